/* lab.c: see lab.h. */
#include "cli/lab.h"

#include "cli/progress.h"
#include "cli/signals.h"
#include "drape/lab.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void show(void *user, int64_t done, int64_t total, double seconds_left)
{
    cli_progress_count(user, done, total, seconds_left);
}

static bool interrupted(void *user)
{
    (void)user;
    return cli_interrupted();
}

/* "1/4" */
static int read_shard(const cli_lab_request *request, drape_lab_def *def)
{
    int used = 0;
    const char *text = request->shard;
    if (!text)
        return CLI_GO_ON;
    if (sscanf(text, "%d/%d%n", &def->shard, &def->shards, &used) != 2 || text[used] || def->shard < 1 ||
        def->shard > def->shards)
        return cli_misuse(request->command.verb, "--shard \"%.60s\": it is I/N, with I from 1 to N, as 1/4",
                          text);
    return CLI_GO_ON;
}

/* Its range is the experiment's, with the same words. */
static int read_levels(const cli_lab_request *request, drape_lab_def *def)
{
    const char *text = request->levels;
    char *end;
    if (!text)
        return CLI_GO_ON;
    long number = strtol(text, &end, 10);
    if (end == text || *end || number < INT_MIN || number > INT_MAX)
        return cli_misuse(request->command.verb, "--levels \"%.60s\": it is an integer, 3 to 12", text);
    def->levels = (int)number;
    return CLI_GO_ON;
}

/* What a command line becomes; freed by free_words. */
typedef struct words {
    drape_lab_setting *settings;
    char *text;         /* of the integrators, cut at the commas */
    const char **items; /* into it */
    char *folder;
} words;

static void free_words(words *w)
{
    free(w->settings);
    free(w->text);
    free(w->items);
    free(w->folder);
}

/* "be,ida" */
static size_t split(words *w)
{
    size_t count = 0;
    for (char *word = strtok(w->text, ","); word; word = strtok(NULL, ","))
        w->items[count++] = word;
    return count;
}

/* scenes/flag.json, tradeoff -> flag.tradeoff */
static void name_folder(const char *scene, const char *verb, char *folder, size_t size)
{
    const char *slash = strrchr(scene, '/'), *name = slash ? slash + 1 : scene, *dot = strrchr(name, '.');
    snprintf(folder, size, "%.*s.%s", dot ? (int)(dot - name) : (int)strlen(name), name, verb);
}

static bool make_words(const cli_lab_request *request, words *w)
{
    const cli_command *command = &request->command;
    const char *rows = request->integrators ? request->integrators : "";
    size_t room = strlen(command->operand) + strlen(command->verb) + 2;
    w->settings = calloc(command->setting_count + 1, sizeof *w->settings);
    w->text = strdup(rows);
    w->items = calloc(strlen(rows) + 1, sizeof *w->items);
    w->folder = calloc(room, 1);
    if (!w->settings || !w->text || !w->items || !w->folder)
        return false;
    name_folder(command->operand, command->verb, w->folder, room);
    for (size_t i = 0; i < command->setting_count; i++)
        w->settings[i] = (drape_lab_setting){command->settings[i].pointer, command->settings[i].value};
    return true;
}

static int make_def(const cli_lab_request *request, int default_jobs, words *w, cli_progress *progress,
                    drape_lab_def *def)
{
    const cli_command *command = &request->command;
    drape_lab_def_init(def, sizeof *def);
    def->scene = command->operand;
    def->folder = request->out ? request->out : w->folder;
    def->settings = w->settings;
    def->setting_count = command->setting_count;
    def->integrators = w->items;
    def->integrator_count = split(w);
    def->axes = request->axes.items;
    def->axis_count = request->axes.count;
    def->space = request->space;
    def->jobs = request->jobs ? request->jobs : default_jobs;
    def->repeats = request->repeats ? request->repeats : def->repeats;
    def->case_seconds = request->case_seconds > 0 ? request->case_seconds : def->case_seconds;
    def->strain_limit = request->strain_limit > 0 ? request->strain_limit : def->strain_limit;
    def->progress = show;
    def->cancel = interrupted;
    def->user = progress;
    int code = read_levels(request, def);
    return code == CLI_GO_ON ? read_shard(request, def) : code;
}

static int exit_code(drape_status status, bool input)
{
    if (!status)
        return CLI_DONE;
    if (status == DRAPE_E_STOPPED)
        return CLI_INTERRUPTED;
    return input && status != DRAPE_E_MEMORY ? CLI_BAD_INPUT : CLI_FAILED;
}

int cli_lab_conclude(drape_context *ctx, drape_status status, drape_lab_outcome *outcome)
{
    if (status)
        fprintf(stderr, "%s\n", status == DRAPE_E_STOPPED ? "interrupted" : drape_context_message(ctx));
    else
        fputs(outcome->text ? outcome->text : "", stdout);
    const int code = exit_code(status, outcome->input);
    drape_lab_outcome_free(outcome);
    return code;
}

int cli_lab_run(const cli_lab_request *request, int default_jobs)
{
    const char *verb = request->command.verb;
    drape_lab_def def;
    drape_lab_outcome outcome;
    drape_context *ctx = NULL;
    cli_progress progress;
    words w = {.settings = NULL};
    if (!make_words(request, &w) || cli_context_create(&ctx)) {
        free_words(&w);
        return cli_misuse(verb, "out of memory");
    }
    int code = make_def(request, default_jobs, &w, &progress, &def);
    if (code == CLI_GO_ON && request->command.threads)
        code = cli_misuse(verb, "--threads has no effect: a case takes one; --jobs runs cases at a time");
    if (code == CLI_GO_ON) {
        cli_progress_begin(&progress, 0, 0);
        drape_status status = drape_lab_run(ctx, verb, &def, &outcome);
        cli_progress_clear(&progress);
        code = cli_lab_conclude(ctx, status, &outcome);
    }
    drape_context_destroy(&ctx);
    free_words(&w);
    return code;
}
