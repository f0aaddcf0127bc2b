/* cmd_validate.c: `drape validate`: measured against expected values, as a table, as Markdown, as JSON. */
#include "cli/cli.h"
#include "lab/reference.h"

#include "base/clock.h"
#include "io/export.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define SCENE_NAME "%s_%d.json"

typedef struct validate_request {
    cli_command command;
    bool json, markdown;
    const char *scenes, *out;
} validate_request;

/* How results are printed. */
typedef struct validate_style {
    const char *begin;
    void (*record)(const lab_record *record, bool first);
    const char *end;
    bool counts; /* are printed after it */
} validate_style;

static void text_record(const lab_record *record, bool first)
{
    const drape_reference *reference = record->reference;
    const drape_validation *v = &record->v;
    char parameter[24] = "";
    (void)first;
    if (reference->parameter)
        snprintf(parameter, sizeof parameter, "%.6g", v->parameter);
    printf("%-18s %12s %14.8g %14.8g %9.4f%% %8.3g%%  %s", reference->entry.name, parameter, v->expected,
           v->obtained, 100 * (v->obtained / v->expected - 1), 100 * reference->tolerance,
           drape_outcome_name(v->verdict));
    if (reference->documented)
        printf("; the documented %.6g within %.2f %%", v->documented, 100 * fabs(v->error));
    if (v->verdict == DRAPE_OUTCOME_STOPPED)
        printf(": %s", v->message);
    putchar('\n');
}

static void markdown_record(const lab_record *record, bool first)
{
    const drape_reference *reference = record->reference;
    const drape_validation *v = &record->v;
    char parameter[200] = "";
    (void)first;
    if (reference->parameter)
        snprintf(parameter, sizeof parameter, "%s = %.6g", reference->parameter, v->parameter);
    printf("| %s | %s [%s] | %s | %s | %.8g | %.8g | %.4f %% | %.3g %% | %s | %s |\n", reference->entry.name,
           reference->entry.summary, reference->unit, parameter, reference->model, v->expected, v->obtained,
           100 * (v->obtained / v->expected - 1), 100 * reference->tolerance, drape_outcome_name(v->verdict),
           reference->entry.reference);
}

static void json_record(const lab_record *record, bool first)
{
    json_t *object = lab_record_json(record);
    char *text = object ? json_dumps(object, JSON_REAL_PRECISION(17)) : NULL;
    printf("%s\n%s", first ? "" : ",", text ? text : "");
    free(text);
    json_decref(object);
}

static const validate_style
    text_style =
        {"reference                  case       expected       obtained      error     limit  verdict\n",
         text_record, "", true},
    markdown_style =
        {"| reference | quantity | case | model | expected | obtained | error | limit | verdict | source |\n"
         "|---|---|---|---|---|---|---|---|---|---|\n",
         markdown_record, "\n", true},
    json_style = {"[", json_record, "\n]\n", false};

/* ---- Running ---- */

/* Whether a file has the name of a scene of the references to be written: `user`, or all of them if NULL. */
static bool is_scene(const void *user, const char *name)
{
    for (int r = 0; drape_references[r]; r++)
        for (int i = 0; (!user || user == drape_references[r]) && i < drape_references[r]->case_count; i++) {
            char known[128];
            snprintf(known, sizeof known, SCENE_NAME, drape_references[r]->entry.name, i);
            if (strcmp(name, known) == 0)
                return true;
        }
    return false;
}

static int write_scenes(const validate_request *request, const drape_reference *only)
{
    drape_context *ctx = request->command.ctx;
    drape_folder *folder = NULL;
    drape_status status = drape_folder_open(ctx, request->scenes, false, &folder);
    if (!status)
        status = drape_folder_check(folder, is_scene, NULL, only);
    if (!status)
        status = drape_folder_begin(folder, NULL, NULL);
    for (int r = 0; drape_references[r]; r++)
        for (int i = 0;
             !status && (!only || only == drape_references[r]) && i < drape_references[r]->case_count; i++) {
            const drape_reference *reference = drape_references[r];
            const double load = reference->high > 0 ? drape_reference_expected(reference, i) : 0;
            char name[128], text[DRAPE_LAB_TEXT];
            drape_file file = {0};
            drape_reference_text(reference, i, load, text);
            snprintf(name, sizeof name, SCENE_NAME, reference->entry.name, i);
            status = drape_export_begin(ctx, folder, name, &file);
            if (!status) {
                drape_file_put_text(&file, text);
                drape_file_put_text(&file, "\n");
                status = drape_file_finish(&file);
            }
            drape_file_destroy(&file);
        }
    drape_folder_close(&folder);
    return !status ? CLI_DONE
                   : cli_report(&request->command, status == DRAPE_E_ARGUMENT ? CLI_BAD_INPUT : CLI_FAILED);
}

/* The cases of a run, and how far it is. */
typedef struct run {
    drape_context *ctx;
    lab_record *records;
    size_t count;
    drape_folder *folder; /* NULL without --out */
    drape_file file;      /* of their lines; closed without --out */
    cli_progress progress;
    double start; /* [s] of the clock */
} run;

static drape_status run_cases(run *r, const validate_style *style, int counts[4])
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < r->count; i++) {
        lab_record *record = &r->records[i];
        double done = 0, left = 0; /* simulations, as the search of a threshold takes several */
        for (size_t k = 0; k < r->count; k++) {
            const int runs = drape_validate_runs(r->records[k].reference);
            left += r->records[k].done ? 0 : runs;
            done += r->records[k].done && k < i ? runs : 0;
        }
        const double wall = drape_clock_seconds() - r->start;
        cli_progress_count(&r->progress, (int64_t)i, (int64_t)r->count, done > 0 ? wall / done * left : NAN);
        if (!record->done) {
            status = drape_validate(r->ctx, record->reference, record->index, cli_interrupted_by, NULL,
                                    &record->v);
            record->done = !status;
            if (!status && r->file.open)
                status = lab_record_keep(&r->file, record);
        }
        if (status)
            break;
        counts[record->v.verdict]++;
        cli_progress_hide(&r->progress);
        errno = 0;
        style->record(record, i == 0);
        if (drape_memory_ran_out())
            status = drape_fail_memory(r->ctx, 1);
        if (fflush(stdout)) /* nobody reads it */
            break;
    }
    cli_progress_clear(&r->progress);
    return status;
}

static int run_references(drape_context *ctx, const validate_request *request, const drape_reference *only)
{
    const validate_style *style = request->json       ? &json_style
                                  : request->markdown ? &markdown_style
                                                      : &text_style;
    run r = {.ctx = ctx, .start = drape_clock_seconds()};
    int counts[4] = {0};
    r.records = lab_records_make(ctx, only, &r.count);
    drape_status status = r.records ? DRAPE_OK : DRAPE_E_MEMORY;
    if (!status && request->out)
        status = lab_records_open(ctx, request->out, r.records, r.count, &r.folder, &r.file);
    if (!status) {
        fputs(style->begin, stdout);
        cli_progress_begin(&r.progress, NULL, 0);
        status = run_cases(&r, style, counts);
        fputs(style->end, stdout);
        if (style->counts)
            printf("%d passed, %d documented model errors, %d failed\n", counts[DRAPE_OUTCOME_PASS],
                   counts[DRAPE_OUTCOME_DOCUMENTED],
                   counts[DRAPE_OUTCOME_FAIL] + counts[DRAPE_OUTCOME_STOPPED]);
        fflush(stdout);
    }
    const drape_status closed = drape_file_close(&r.file);
    const int failed = counts[DRAPE_OUTCOME_FAIL] + counts[DRAPE_OUTCOME_STOPPED];
    const int done = failed + counts[DRAPE_OUTCOME_PASS] + counts[DRAPE_OUTCOME_DOCUMENTED];
    status = status ? status : closed;
    int code = status || failed ? CLI_FAILED : CLI_DONE;
    if (status == DRAPE_E_ARGUMENT) {
        code = cli_report(&request->command, CLI_BAD_INPUT);
    } else if (status == DRAPE_E_STOPPED) {
        fprintf(stderr, "interrupted: %d of %zu cases are done%s\n", done, r.count,
                request->out ? "; the same command resumes"
                             : "; with --out DIR the same command would resume");
        code = CLI_INTERRUPTED;
    } else if (status) {
        cli_print_message(&request->command, drape_context_message(ctx));
    }
    drape_file_destroy(&r.file);
    drape_folder_close(&r.folder);
    drape_free(ctx, r.records);
    return code;
}

#define AT(member) offsetof(validate_request, member)
static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "print one array, an object for each case", AT(json)},
    {"markdown", CLI_FLAG, NULL, "print a Markdown table", AT(markdown)},
    {"out", CLI_TEXT, "DIR", "save a line of JSON for each case; the same command resumes where it stopped",
     AT(out)},
    {"scenes", CLI_TEXT, "DIR", "only write the scene of every case into DIR", AT(scenes)},
};

static int main_validate(const void *command)
{
    const validate_request *request = command;
    const drape_reference *only = NULL;
    if (request->json && request->markdown)
        return cli_misuse("validate", "--json and --markdown exclude each other");
    if (request->command.operand) {
        int i;
        if (drape_registry_choose(request->command.ctx, &drape_reference_registry, "",
                                  request->command.operand, &i))
            return cli_misuse("validate", "%s", request->command.ctx->text);
        only = drape_references[i];
    }
    return request->scenes ? write_scenes(request, only)
                           : run_references(request->command.ctx, request, only);
}

const drape_verb drape_verb_validate = {
    .entry = {.name = "validate",
              .summary = "run the physical references, and compare obtained with expected values"},
    .operand = "REFERENCE",
    .operand_optional = true,
    .details = "Runs the scene of every reference, or of one, and compares a measured quantity with a closed "
               "form, a\nseries or a differential equation. Terms that are known to converge to another "
               "value are reported as a\ndocumented model error. Exit code 0: none failed. All references "
               "take four minutes of CPU time.",
    CLI_OPTIONS(options, validate_request),
    .run = main_validate,
};
