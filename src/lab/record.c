/* record.c: see record.h. */
#include "lab/record.h"

#include "base/hash.h"
#include "io/export.h"
#include "lab/lab.h"
#include "lab/text.h"

#include <string.h>

#define NAME "cases.jsonl"

lab_record *lab_records_make(drape_context *ctx, const drape_reference *only, size_t *count)
{
    size_t room = 0;
    for (int i = 0; drape_references[i]; i++)
        room += (size_t)drape_references[i]->case_count;
    lab_record *records = drape_alloc(ctx, room, sizeof *records);
    *count = 0;
    for (int i = 0; records && drape_references[i]; i++)
        for (int k = 0; k < drape_references[i]->case_count; k++)
            if (!only || only == drape_references[i])
                records[(*count)++] = (lab_record){.reference = drape_references[i], .index = k};
    return records;
}

/* The hash of the scene at load 1: the line has everything else about the case. */
static void hash_of(const lab_record *record, char digits[17])
{
    char text[DRAPE_LAB_TEXT];
    const drape_reference *r = record->reference;
    drape_reference_text(&(drape_reference_case){r, r->parameters[record->index], 1}, text);
    lab_digits(drape_hash_bytes(DRAPE_HASH_START, text, strlen(text)), digits);
}

json_t *lab_record_json(const lab_record *record)
{
    static const char *const verdicts[] = {"pass", "fail", "model_error", "stopped"};
    const drape_reference *r = record->reference;
    const drape_validation *v = &record->v;
    return json_pack("{s:s, s:s, s:s, s:s*, s:s, s:s, s:f, s:o, s:o, s:o, s:o, s:f, s:s, s:s, s:f}", "name",
                     r->entry.name, "quantity", r->entry.summary, "unit", r->unit, "parameter", r->parameter,
                     "model", r->model, "source", r->entry.reference, "value", v->parameter, "expected",
                     drape_json_number(v->expected), "documented", drape_json_number(v->documented),
                     "obtained", drape_json_number(v->obtained), "error",
                     drape_json_number(v->obtained / v->expected - 1), "tolerance", r->tolerance, "verdict",
                     verdicts[v->verdict], "message", v->message, "cpu_s", v->seconds);
}

static void put_line(drape_file *file, const lab_record *record)
{
    char digits[17];
    json_t *line = lab_record_json(record);
    hash_of(record, digits);
    line = drape_json_with(line, "scene_hash", json_string(digits));
    line = drape_json_with(line, "drape", json_string(drape_version()));
    lab_put_line(file, line);
    json_decref(line);
}

static bool belongs_to(const json_t *line, const lab_record *record)
{
    char digits[17];
    const drape_reference *r = record->reference;
    if (strcmp(lab_text(line, "name"), r->entry.name) != 0 ||
        lab_number(line, "value") != r->parameters[record->index] ||
        strcmp(lab_text(line, "drape"), drape_version()) != 0)
        return false;
    hash_of(record, digits);
    return strcmp(lab_text(line, "scene_hash"), digits) == 0;
}

static bool is_cases(const void *user, const char *name)
{
    (void)user;
    return strcmp(name, NAME) == 0;
}

drape_status lab_records_open(drape_context *ctx, const char *path, lab_record *records, size_t count,
                              drape_folder **folder, drape_file *file)
{
    drape_arena arena = drape_arena_of(ctx);
    char *text;
    size_t size;
    drape_status status = drape_folder_open(ctx, path, false, folder);
    if (!status)
        status = drape_folder_check(*folder, is_cases, NULL, NULL);
    if (!status && !lab_read_text(&arena, path, NAME, &text, &size)) {
        char *rest = NULL;
        for (char *word = strtok_r(text, "\n", &rest); word; word = strtok_r(NULL, "\n", &rest)) {
            json_t *line = json_loads(word, JSON_REJECT_DUPLICATES, NULL);
            for (size_t i = 0; line && i < count; i++) {
                lab_record *record = &records[i];
                drape_validation *v = &record->v;
                if (record->done || !belongs_to(line, record))
                    continue;
                *v = (drape_validation){.parameter = record->reference->parameters[record->index],
                                        .obtained = lab_number(line, "obtained"),
                                        .seconds = lab_number(line, "cpu_s")};
                snprintf(v->message, sizeof v->message, "%s", lab_text(line, "message"));
                drape_make_printable(v->message);
                drape_validate_judge(record->reference, v);
                record->done = true;
            }
            json_decref(line);
        }
    }
    drape_arena_free(&arena);
    if (!status)
        status = drape_folder_begin(*folder, NULL, NULL);
    if (!status)
        status = drape_export_begin(ctx, *folder, NAME, file);
    for (size_t i = 0; !status && i < count; i++)
        if (records[i].done)
            put_line(file, &records[i]);
    return status ? status : drape_file_publish(file);
}

drape_status lab_record_keep(drape_file *file, const lab_record *record)
{
    put_line(file, record);
    return drape_file_keep(file);
}
