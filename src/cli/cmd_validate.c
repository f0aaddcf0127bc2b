/* cmd_validate.c: `drape validate`: what scenes give against what is known, as a table, as Markdown, as
 * JSON. */
#include "cli/cli.h"
#include "lab/validate.h"

#include "base/param.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MOST_NAMES 64

typedef struct validate_request {
    cli_command command;
    bool json, markdown;
    const char *scenes;
} validate_request;

/* How results are printed. */
typedef struct validate_style {
    void (*begin)(void);
    void (*row)(const drape_reference *reference, const drape_validation *v);
    void (*end)(const int counts[4]);
} validate_style;

/* ---- As text, as Markdown ---- */

static void text_begin(void)
{
    printf("%-18s %12s %14s %14s %10s %9s  %s\n", "reference", "case", "expected", "obtained", "error",
           "limit", "verdict");
}

static void text_row(const drape_reference *reference, const drape_validation *v)
{
    char parameter[24] = "";
    if (reference->parameter)
        snprintf(parameter, sizeof parameter, "%.6g", v->parameter);
    printf("%-18s %12s %14.8g %14.8g %9.4f%% %8.3g%%  %s", reference->name, parameter, v->expected,
           v->obtained, 100 * (v->obtained / v->expected - 1), 100 * reference->tolerance,
           drape_outcome_name(v->verdict));
    if (reference->documented)
        printf("; the documented %.6g within %.2f %%", v->documented, 100 * fabs(v->error));
    if (v->verdict == DRAPE_OUTCOME_STOPPED)
        printf(": %s", v->message);
    putchar('\n');
}

static void text_end(const int counts[4])
{
    printf("%d passed, %d documented model errors, %d failed\n", counts[DRAPE_OUTCOME_PASS],
           counts[DRAPE_OUTCOME_DOCUMENTED], counts[DRAPE_OUTCOME_FAIL] + counts[DRAPE_OUTCOME_STOPPED]);
}

static void markdown_begin(void)
{
    printf(
        "| reference | quantity | case | model | expected | obtained | error | limit | verdict | source |\n"
        "|---|---|---|---|---|---|---|---|---|---|\n");
}

static void markdown_row(const drape_reference *reference, const drape_validation *v)
{
    char parameter[200] = "";
    if (reference->parameter)
        snprintf(parameter, sizeof parameter, "%s = %.6g", reference->parameter, v->parameter);
    printf("| %s | %s [%s] | %s | %s | %.8g | %.8g | %.4f %% | %.3g %% | %s | %s |\n", reference->name,
           reference->quantity, reference->unit, parameter, reference->model, v->expected, v->obtained,
           100 * (v->obtained / v->expected - 1), 100 * reference->tolerance, drape_outcome_name(v->verdict),
           reference->source);
}

static void markdown_end(const int counts[4])
{
    putchar('\n');
    text_end(counts);
}

/* ---- As JSON: one array, an object a case ---- */

static int json_rows;

static json_t *number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

static void json_begin(void)
{
    json_rows = 0;
    printf("[");
}

static void json_row(const drape_reference *reference, const drape_validation *v)
{
    static const char *const verdicts[] = {"pass", "fail", "model_error", "stopped"};
    json_t *row = json_pack("{s:s, s:s, s:s, s:s*, s:s, s:s, s:f, s:o, s:o, s:o, s:o, s:f, s:s, s:s, s:f}",
                            "name", reference->name, "quantity", reference->quantity, "unit", reference->unit,
                            "parameter", reference->parameter, "model", reference->model, "source",
                            reference->source, "value", v->parameter, "expected", number(v->expected),
                            "documented", number(v->documented), "obtained", number(v->obtained), "error",
                            number(v->obtained / v->expected - 1), "tolerance", reference->tolerance,
                            "verdict", verdicts[v->verdict], "message", v->message, "cpu_s", v->seconds);
    char *text = row ? json_dumps(row, JSON_REAL_PRECISION(17)) : NULL;
    printf("%s\n%s", json_rows++ ? "," : "", text ? text : "{}");
    free(text);
    json_decref(row);
}

static void json_end(const int counts[4])
{
    (void)counts;
    printf("\n]\n");
}

/* ---- Running ---- */

static int write_scenes(const drape_reference *reference, const char *folder)
{
    for (int i = 0; i < reference->case_count; i++) {
        char path[1024], text[DRAPE_LAB_TEXT];
        const double p = reference->parameters[i];
        reference->scene(p, reference->high > 0 ? reference->expected(p) : 0, text, sizeof text);
        for (char *c = text; *c; c++)
            *c = *c == '\'' ? '"' : *c;
        snprintf(path, sizeof path, "%s/%s_%d.json", folder, reference->name, i);
        FILE *file = fopen(path, "w");
        if (!file || fprintf(file, "%s\n", text) < 0 || fclose(file)) {
            fprintf(stderr, "drape validate: %s: %s\n", path, strerror(errno));
            return CLI_FAILED;
        }
    }
    return CLI_DONE;
}

static int find(const char *name, const drape_reference **only)
{
    const char *names[MOST_NAMES];
    size_t count = 0;
    for (int i = 0; drape_references[i] && count < MOST_NAMES; i++) {
        names[count++] = drape_references[i]->name;
        if (strcmp(drape_references[i]->name, name) == 0) {
            *only = drape_references[i];
            return CLI_GO_ON;
        }
    }
    const char *meant = drape_did_you_mean(name, names, count);
    return cli_misuse("validate", "there is no reference \"%.60s\"%s%s%s", name,
                      meant ? "; did you mean \"" : "", meant ? meant : "", meant ? "\"?" : "");
}

static int run_references(drape_context *ctx, const validate_request *request, const drape_reference *only)
{
    static const validate_style text = {text_begin, text_row, text_end},
                                markdown = {markdown_begin, markdown_row, markdown_end},
                                json = {json_begin, json_row, json_end};
    const validate_style *style = request->json ? &json : request->markdown ? &markdown : &text;
    int counts[4] = {0};
    style->begin();
    for (int i = 0; drape_references[i]; i++)
        for (int k = 0; k < drape_references[i]->case_count && (!only || only == drape_references[i]); k++) {
            drape_validation v;
            if (isatty(STDERR_FILENO))
                fprintf(stderr, "%s %d/%d ...\r", drape_references[i]->name, k + 1,
                        drape_references[i]->case_count);
            if (drape_validate(ctx, drape_references[i], k, &v)) {
                fprintf(stderr, "%s\n", drape_context_message(ctx));
                return CLI_FAILED;
            }
            counts[v.verdict]++;
            style->row(drape_references[i], &v);
            fflush(stdout);
        }
    style->end(counts);
    return counts[DRAPE_OUTCOME_FAIL] + counts[DRAPE_OUTCOME_STOPPED] ? CLI_FAILED : CLI_DONE;
}

static int validate(const validate_request *request, drape_context *ctx)
{
    const drape_reference *only = NULL;
    int code = CLI_GO_ON;
    if (request->json && request->markdown)
        return cli_misuse("validate", "--json and --markdown exclude each other");
    if (request->command.operand)
        code = find(request->command.operand, &only);
    if (code != CLI_GO_ON)
        return code;
    if (!request->scenes)
        return run_references(ctx, request, only);
    if (mkdir(request->scenes, 0777) && errno != EEXIST) {
        fprintf(stderr, "drape validate: %s: %s\n", request->scenes, strerror(errno));
        return CLI_FAILED;
    }
    code = CLI_DONE;
    for (int i = 0; drape_references[i] && code == CLI_DONE; i++)
        if (!only || only == drape_references[i])
            code = write_scenes(drape_references[i], request->scenes);
    return code;
}

static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "one array of objects, one a case", offsetof(validate_request, json), 0, NULL},
    {"markdown", CLI_FLAG, NULL, "a table for a page", offsetof(validate_request, markdown), 0, NULL},
    {"scenes", CLI_TEXT, "DIR", "run nothing: write the scene of every case into DIR",
     offsetof(validate_request, scenes), 0, NULL},
};

static int main_validate(int argc, char **argv);

const drape_verb drape_verb_validate = {
    .name = "validate",
    .operand = "REFERENCE",
    .operand_optional = true,
    .summary = "the physics references: obtained against expected",
    .details = "Runs the scene of every reference, or of one, and compares what is measured in it with the "
               "closed form,\n"
               "series or differential equation that it is known by. Terms that converge to something else "
               "show that as\n"
               "a documented model error. Exit code 0: none failed. All of them take some minutes.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .run = main_validate,
};

static int main_validate(int argc, char **argv)
{
    validate_request request = {.scenes = NULL};
    drape_context *ctx = NULL;
    int code = cli_parse(&drape_verb_validate, argc, argv, &request.command);
    if (code == CLI_GO_ON && drape_context_create(NULL, &ctx))
        code = cli_misuse("validate", "out of memory");
    if (code == CLI_GO_ON)
        code = validate(&request, ctx);
    drape_context_destroy(&ctx);
    cli_command_free(&request.command);
    return code;
}
