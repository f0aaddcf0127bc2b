/* reference.c: runs the cases of a reference, and keeps them as lines; see reference.h. */
#include "lab/reference.h"

#include "base/clock.h"
#include "base/hash.h"
#include "io/export.h"
#include "lab/engine.h"
#include "lab/engine_output.h"
#include "lab/sheet.h"

#include <gsl/gsl_errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define BISECTIONS 9 /* of a threshold: 1/512 of the interval that it is sought in */

double drape_reference_expected(const drape_reference *r, int index)
{
    return r->expected ? r->expected(r->parameters[index]) : r->known[r->known_count > 1 ? index : 0];
}

int drape_reference_text(const drape_reference *r, int index, double load, char text[DRAPE_LAB_TEXT])
{
    const drape_reference_run run = {
        .reference = r, .index = index, .parameter = r->parameters[index], .load = load};
    const int length =
        r->scene ? r->scene(&run, text) : lab_sheet_text(r->sheet, r->high > 0 ? load : run.parameter, text);
    for (char *at = strchr(text, '\''); at; at = strchr(at, '\''))
        *at = '"';
    return length;
}

static drape_status watch(void *user, const drape_event *event)
{
    const drape_reference_run *run = user;
    (void)event;
    return run->cancel && run->cancel(run->user) ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

/* Runs the scene of a load and measures. */
static drape_status measure_at(drape_reference_run *run, double load, double *value)
{
    const drape_reference *reference = run->reference;
    char json[DRAPE_LAB_TEXT];
    drape_scene *scene = NULL;
    drape_reference_text(reference, run->index, load, json);
    drape_status status = drape_scene_parse(run->ctx, json, "reference", &scene);
    if (!status)
        status = drape_scene_compile(scene, &run->model);
    if (!status)
        status = drape_sim_create(run->ctx, run->model, NULL, &run->sim);
    if (!status)
        status = drape_sim_observe(run->sim, watch, run);
    if (!status)
        status = reference->measure ? reference->measure(run, value) : lab_advance(run);
    if (!status && reference->value)
        *value = reference->value(run);
    drape_scene_destroy(&scene);
    drape_sim_destroy(&run->sim);
    drape_model_destroy(&run->model);
    drape_arena_free(&run->arena);
    return status;
}

int drape_validate_runs(const drape_reference *reference)
{
    return reference->high > 0 ? BISECTIONS : 1;
}

/* Fills all but parameter, obtained, seconds and message, which are given. */
static void judge(const drape_reference *reference, int index, drape_validation *v)
{
    gsl_set_error_handler_off(); /* the default handler ends the process */
    v->expected = drape_reference_expected(reference, index);
    v->documented = reference->documented ? reference->documented[index] : NAN;
    v->error = v->obtained / (reference->documented ? v->documented : v->expected) - 1;
    v->verdict = *v->message                                 ? DRAPE_OUTCOME_STOPPED
                 : !(fabs(v->error) <= reference->tolerance) ? DRAPE_OUTCOME_FAIL
                 : reference->documented                     ? DRAPE_OUTCOME_DOCUMENTED
                                                             : DRAPE_OUTCOME_PASS;
}

drape_status drape_validate(drape_context *ctx, const drape_reference *reference, int index,
                            drape_validate_cancel *cancel, void *user, drape_validation *out)
{
    const double start = drape_clock_cpu_seconds();
    drape_reference_run run = {.reference = reference,
                               .index = index,
                               .ctx = ctx,
                               .arena = drape_arena_of(ctx),
                               .parameter = reference->parameters[index],
                               .cancel = cancel,
                               .user = user};
    drape_status status = DRAPE_OK;
    *out = (drape_validation){.parameter = run.parameter, .obtained = NAN};
    judge(reference, index, out);
    if (reference->high > 0) {
        /* Bisects between a load at which the measure is 0 and one at which it is not. */
        const double about = reference->documented ? out->documented : out->expected;
        double low = reference->low * about, high = reference->high * about, value = 0;
        for (int k = 0; !status && k < BISECTIONS; k++) {
            out->obtained = (low + high) / 2;
            status = measure_at(&run, out->obtained, &value);
            *(value > 0 ? &high : &low) = out->obtained;
        }
        out->obtained = (low + high) / 2;
    } else
        status = measure_at(&run, 0, &out->obtained);
    out->seconds = drape_clock_cpu_seconds() - start;
    if (status && cancel && cancel(user))
        return drape_fail(ctx, DRAPE_E_STOPPED, "interrupted");
    if (status) {
        out->obtained = NAN;
        snprintf(out->message, sizeof out->message, "%s", drape_context_message(ctx));
    }
    judge(reference, index, out);
    return status == DRAPE_E_MEMORY ? status : DRAPE_OK;
}

const char *drape_outcome_name(drape_outcome verdict)
{
    static const char *const names[] = {[DRAPE_OUTCOME_PASS] = "pass",
                                        [DRAPE_OUTCOME_FAIL] = "FAIL",
                                        [DRAPE_OUTCOME_DOCUMENTED] = "model error",
                                        [DRAPE_OUTCOME_STOPPED] = "STOPPED"};
    return names[verdict];
}

/* ---- Lines ---- */

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
    drape_reference_text(record->reference, record->index, 1, text);
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

drape_status lab_records_open(drape_context *ctx, const char *path, lab_record *records, size_t count,
                              drape_folder **folder, drape_file *file)
{
    drape_arena arena = drape_arena_of(ctx);
    char *text = NULL, *rest = NULL, digits[17];
    size_t size;
    drape_status status = drape_folder_open(ctx, path, false, folder);
    if (!status)
        status = drape_folder_check(*folder, drape_folder_is_named, NULL, NAME);
    if (!status)
        lab_read_text(&arena, path, NAME, &text, &size); /* NULL if there is no such file */
    /* A line that is not JSON, as a kill may leave the last, is ignored. */
    for (char *word = text ? strtok_r(text, "\n", &rest) : NULL; word; word = strtok_r(NULL, "\n", &rest)) {
        json_t *line = json_loads(word, JSON_REJECT_DUPLICATES, NULL);
        for (size_t i = 0; line && i < count; i++) {
            lab_record *record = &records[i];
            drape_validation *v = &record->v;
            if (record->done || strcmp(lab_text(line, "name"), record->reference->entry.name) != 0 ||
                lab_number(line, "value") != record->reference->parameters[record->index] ||
                strcmp(lab_text(line, "drape"), drape_version()) != 0)
                continue;
            hash_of(record, digits);
            if (strcmp(lab_text(line, "scene_hash"), digits) != 0)
                continue;
            *v = (drape_validation){.parameter = record->reference->parameters[record->index],
                                    .obtained = lab_number(line, "obtained"),
                                    .seconds = lab_number(line, "cpu_s")};
            snprintf(v->message, sizeof v->message, "%s", lab_text(line, "message"));
            drape_make_printable(v->message);
            judge(record->reference, record->index, v);
            record->done = true;
        }
        json_decref(line);
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
