/* lab.h: what the verbs of experiments share. */
#ifndef DRAPE_CLI_LAB_H
#define DRAPE_CLI_LAB_H

#include "cli/cli.h"

/* The command line of an experiment; each verb has options for the members that it uses. */
typedef struct cli_lab_request {
    cli_command command;
    const char *out, *shard, *integrators, *levels, *budget, *results;
    cli_texts axes;
    int jobs, repeats, plan; /* 0: not given */
    bool space;
    double case_seconds, strain_limit; /* 0: not given */
} cli_lab_request;

/* An option of a member; max: of a number. */
#define CLI_LAB_OPTION(name, kind, argument, help, member, max)                                              \
    {                                                                                                        \
        name, kind, argument, help, offsetof(cli_lab_request, member), max, NULL                             \
    }

/* The options that all experiments have. */
#define CLI_LAB_OPTIONS                                                                                      \
    CLI_LAB_OPTION("out", CLI_TEXT, "DIR",                                                                   \
                   "folder for cases.jsonl, results.csv, figures, report.html (default SCENE.VERB)", out,    \
                   0),                                                                                       \
        CLI_LAB_OPTION("integrators", CLI_TEXT, "A,B", "only these integrators", integrators, 0),            \
        CLI_LAB_OPTION("jobs", CLI_NUMBER, "N", "number of cases at a time, each in a thread", jobs, 256),   \
        CLI_LAB_OPTION("case-seconds", CLI_REAL, "S", "CPU time after which a case is stopped (default 30)", \
                       case_seconds, 0),                                                                     \
        CLI_LAB_OPTION("plan", CLI_NUMBER, "N",                                                              \
                       "run only N cases, spread over all, and say what all take: time, memory, disk", plan, \
                       1000000),                                                                             \
        CLI_LAB_OPTION("shard", CLI_TEXT, "I/N",                                                             \
                       "run only part I of N of the cases; `drape merge` merges the parts", shard, 0)

/* Runs the experiment of the request's verb. default_minutes: its budget; 0: none. Returns the exit code. */
int cli_lab_run(const cli_lab_request *request, int default_jobs, double default_minutes);

/* Prints the summary, or the message of a failure, and frees the outcome. Returns the exit code. */
struct drape_lab_outcome;
int cli_lab_conclude(const cli_command *command, drape_status status, struct drape_lab_outcome *outcome);

#endif
