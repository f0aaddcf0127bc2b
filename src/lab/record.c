/* record.c: see record.h. */
#include "lab/record.h"

#include "base/hash.h"
#include "lab/text.h"

#include <math.h>
#include <stdlib.h>
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

/* Of the scene at load 1, which is all that a line does not say of a case. */
static void hash_of(const lab_record *record, char digits[17])
{
    char text[DRAPE_LAB_TEXT];
    const double parameter = record->reference->parameters[record->index];
    record->reference->scene(&(drape_reference_case){record->reference, parameter, 1}, text);
    snprintf(digits, 17, "%016llx",
             (unsigned long long)drape_hash_bytes(DRAPE_HASH_START, text, strlen(text)));
}

static json_t *number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

json_t *lab_record_json(const lab_record *record)
{
    static const char *const verdicts[] = {"pass", "fail", "model_error", "stopped"};
    const drape_reference *r = record->reference;
    const drape_validation *v = &record->v;
    return json_pack("{s:s, s:s, s:s, s:s*, s:s, s:s, s:f, s:o, s:o, s:o, s:o, s:f, s:s, s:s, s:f}", "name",
                     r->name, "quantity", r->quantity, "unit", r->unit, "parameter", r->parameter, "model",
                     r->model, "source", r->source, "value", v->parameter, "expected", number(v->expected),
                     "documented", number(v->documented), "obtained", number(v->obtained), "error",
                     number(v->obtained / v->expected - 1), "tolerance", r->tolerance, "verdict",
                     verdicts[v->verdict], "message", v->message, "cpu_s", v->seconds);
}

static void put_line(drape_file *file, const lab_record *record)
{
    char digits[17];
    json_t *line = lab_record_json(record);
    hash_of(record, digits);
    json_object_set_new(line, "scene_hash", json_string(digits));
    json_object_set_new(line, "drape", json_string(drape_version()));
    char *text = json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(17));
    drape_file_put_text(file, text ? text : "");
    drape_file_put_text(file, "\n");
    free(text);
    json_decref(line);
}

static bool says(const json_t *line, const char *key, const char *word)
{
    const char *text = json_string_value(json_object_get(line, key));
    return text && strcmp(text, word) == 0;
}

static double value_of(const json_t *line, const char *key)
{
    const json_t *value = json_object_get(line, key);
    return json_is_number(value) ? json_number_value(value) : NAN;
}

static bool is_of(const json_t *line, const lab_record *record)
{
    char digits[17];
    const drape_reference *r = record->reference;
    if (!says(line, "name", r->name) || value_of(line, "value") != r->parameters[record->index] ||
        !says(line, "drape", drape_version()))
        return false;
    hash_of(record, digits);
    return says(line, "scene_hash", digits);
}

static void take(const json_t *line, lab_record *record)
{
    const char *message = json_string_value(json_object_get(line, "message"));
    drape_validation *v = &record->v;
    *v = (drape_validation){.parameter = record->reference->parameters[record->index],
                            .obtained = value_of(line, "obtained"),
                            .seconds = value_of(line, "cpu_s")};
    snprintf(v->message, sizeof v->message, "%s", message ? message : "");
    drape_validate_judge(record->reference, v);
    record->done = true;
}

/* A line that is none, as a kill may leave the last, counts for nothing. */
static void take_lines(char *text, lab_record *records, size_t count)
{
    char *rest = NULL;
    for (char *word = strtok_r(text, "\n", &rest); word; word = strtok_r(NULL, "\n", &rest)) {
        json_t *line = json_loads(word, JSON_REJECT_DUPLICATES, NULL);
        for (size_t i = 0; line && i < count; i++)
            if (!records[i].done && is_of(line, &records[i]))
                take(line, &records[i]);
        json_decref(line);
    }
}

static drape_status begin(drape_context *ctx, const char *folder, const lab_record *records, size_t count,
                          drape_file *file)
{
    drape_status status = drape_file_create(ctx, strlen(folder) + sizeof "/" NAME, file);
    if (status)
        return status;
    drape_file_name(file, "%s/" NAME, folder);
    status = drape_file_begin(file);
    for (size_t i = 0; !status && i < count; i++)
        if (records[i].done)
            put_line(file, &records[i]);
    return status ? status : drape_file_publish(file);
}

drape_status lab_records_open(drape_context *ctx, const char *folder, lab_record *records, size_t count,
                              drape_file *file, size_t *found)
{
    char *text = NULL, *path = drape_copy_text(ctx, folder);
    size_t size;
    drape_status status = path ? drape_folder_make(ctx, path) : DRAPE_E_MEMORY;
    drape_free(ctx, path);
    if (!status && !lab_read_text(ctx, folder, NAME, &text, &size))
        take_lines(text, records, count);
    free(text);
    *found = 0;
    for (size_t i = 0; i < count; i++)
        *found += records[i].done;
    return status ? status : begin(ctx, folder, records, count, file);
}

drape_status lab_record_keep(drape_file *file, const lab_record *record)
{
    put_line(file, record);
    return drape_file_keep(file);
}
