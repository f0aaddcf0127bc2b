/* lab.c: see lab.h. */
#include "cli/lab.h"

#include "base/arena.h"
#include "base/param.h"
#include "drape/lab.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void show(void *user, int64_t done, int64_t total, double seconds_left)
{
    cli_progress_count(user, done, total, seconds_left);
}

/* Reads the options that are texts: "1/4"; an integer, whose range is checked by the experiment; minutes, or
 * "none". A shard is part of a sweep that is to run in full: it has no budget unless it is given one. */
static int read_texts(const cli_lab_request *request, double default_minutes, drape_lab_def *def)
{
    const char *shard = request->shard, *levels = request->levels, *budget = request->budget;
    int used = 0;
    char *end;
    if (levels) {
        const long number = strtol(levels, &end, 10);
        if (end == levels || *end || number < INT_MIN || number > INT_MAX)
            return cli_misuse(request->command.verb, "--levels \"%.60s\": must be an integer, 3 to 12",
                              levels);
        def->levels = (int)number;
    }
    if (shard && (sscanf(shard, "%d/%d%n", &def->shard, &def->shards, &used) != 2 || shard[used] ||
                  def->shard < 1 || def->shard > def->shards))
        return cli_misuse(request->command.verb,
                          "--shard \"%.60s\": must be I/N, with I from 1 to N, such as 1/4", shard);
    double minutes = shard ? 0 : default_minutes;
    if (budget && strcmp(budget, "none") == 0) {
        minutes = 0;
    } else if (budget) {
        const char *rest = drape_number_read(budget, &minutes);
        if (!rest || *rest || !(minutes > 0 && minutes < 1e9))
            return cli_misuse(request->command.verb, "--budget \"%.60s\": must be minutes, above 0, or none",
                              budget);
    }
    def->budget_seconds = 60 * minutes;
    return CLI_GO_ON;
}

/* The names of a list "a,b"; NULL: none. Returns their number. */
static size_t split(drape_arena *arena, const char *list, const char ***names)
{
    char *text = drape_arena_text(arena, list ? list : ""), *rest;
    size_t count = 0;
    *names = drape_arena_take(arena, text ? strlen(text) + 1 : 1, sizeof **names);
    if (drape_arena_status(arena))
        return 0;
    for (char *word = strtok_r(text, ",", &rest); word; word = strtok_r(NULL, ",", &rest))
        (*names)[count++] = word;
    return count;
}

/* Fills the def; its texts and arrays are those of the request or in the arena. */
static int make_def(const cli_lab_request *request, int default_jobs, double default_minutes,
                    drape_arena *arena, drape_lab_def *def)
{
    const cli_command *command = &request->command;
    const char *slash = strrchr(command->operand, '/'), *name = slash ? slash + 1 : command->operand,
               *dot = strrchr(name, '.');
    const size_t size = strlen(name) + strlen(command->verb) + 2;
    const char **integrators = NULL, **results = NULL;
    char *folder = drape_arena_take(arena, size, 1);
    drape_lab_setting *settings = drape_arena_take(arena, command->setting_count, sizeof *settings);
    if (drape_arena_status(arena))
        return cli_report_memory(command);
    drape_lab_def_init(def, sizeof *def);
    def->integrator_count = split(arena, request->integrators, &integrators);
    def->result_count = split(arena, request->results, &results);
    if (drape_arena_status(arena))
        return cli_report_memory(command);
    for (size_t i = 0; i < command->setting_count; i++)
        settings[i] = (drape_lab_setting){command->settings[i].pointer, command->settings[i].value};
    /* scenes/flag.json, tradeoff -> flag.tradeoff */
    snprintf(folder, size, "%.*s.%s", dot ? (int)(dot - name) : (int)strlen(name), name, command->verb);
    def->scene = command->operand;
    def->scenes = (const char *const *)command->operands;
    def->scene_count = (size_t)command->operand_count;
    def->folder = request->out ? request->out : folder;
    def->settings = settings;
    def->setting_count = command->setting_count;
    def->integrators = integrators;
    def->results = results;
    def->plan = request->plan;
    def->axes = request->axes.items;
    def->axis_count = request->axes.count;
    def->space = request->space;
    def->jobs = request->jobs ? request->jobs : default_jobs;
    def->repeats = request->repeats ? request->repeats : def->repeats;
    def->case_seconds = request->case_seconds > 0 ? request->case_seconds : def->case_seconds;
    def->strain_limit = request->strain_limit > 0 ? request->strain_limit : def->strain_limit;
    def->progress = show;
    def->cancel = cli_interrupted_by;
    int code = read_texts(request, default_minutes, def);
    if (code == CLI_GO_ON && command->threads)
        code = cli_misuse(
            command->verb,
            "--threads has no effect: each case takes one thread; --jobs runs several cases at a time");
    return code;
}

int cli_lab_conclude(const cli_command *command, drape_status status, drape_lab_outcome *outcome)
{
    const int code = !status                                      ? CLI_DONE
                     : status == DRAPE_E_STOPPED                  ? CLI_INTERRUPTED
                     : outcome->input && status != DRAPE_E_MEMORY ? CLI_BAD_INPUT
                                                                  : CLI_FAILED;
    if (!status)
        fputs(outcome->text ? outcome->text : "", stdout);
    else if (code == CLI_INTERRUPTED)
        cli_report_interrupted(command->verb);
    else
        cli_print_message(command, drape_context_message(command->ctx));
    drape_lab_outcome_free(outcome);
    return code;
}

int cli_lab_run(const cli_lab_request *request, int default_jobs, double default_minutes)
{
    const cli_command *command = &request->command;
    cli_progress progress;
    drape_lab_def def;
    drape_lab_outcome outcome;
    const int code = make_def(request, default_jobs, default_minutes, command->arena, &def);
    if (code != CLI_GO_ON)
        return code;
    def.user = &progress;
    cli_progress_begin(&progress, NULL, 0);
    progress.logs = !progress.on;
    drape_status status = drape_lab_run(command->ctx, command->verb, &def, &outcome);
    cli_progress_clear(&progress);
    return cli_lab_conclude(command, status, &outcome);
}
