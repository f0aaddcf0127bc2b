/* lab.h: what the verbs of experiments share. */
#ifndef DRAPE_CLI_LAB_H
#define DRAPE_CLI_LAB_H

#include "cli/cli.h"

/* The command line of an experiment; each verb has options for what it uses of it. */
typedef struct cli_lab_request {
    cli_command command;
    const char *out, *shard, *integrators, *levels;
    cli_texts axes;
    int jobs, repeats; /* 0: not said */
    bool space;
    double case_seconds, strain_limit; /* 0: not said */
} cli_lab_request;

/* The options that all of them have. */
#define CLI_LAB_OPTIONS                                                                                       \
    {"out",                                                                                                   \
     CLI_TEXT,                                                                                                \
     "DIR",                                                                                                   \
     "folder for cases.jsonl, results.csv, pictures, report.html (default SCENE.VERB)",                       \
     offsetof(cli_lab_request, out),                                                                          \
     0,                                                                                                       \
     NULL},                                                                                                   \
        {"integrators", CLI_TEXT, "A,B", "only these rows", offsetof(cli_lab_request, integrators), 0, NULL}, \
        {"jobs", CLI_NUMBER, "N", "cases at a time, each in a thread", offsetof(cli_lab_request, jobs),       \
         256,    NULL},                                                                                       \
        {"case-seconds",                                                                                      \
         CLI_REAL,                                                                                            \
         "S",                                                                                                 \
         "CPU time after which a case is stopped (default 30)",                                               \
         offsetof(cli_lab_request, case_seconds),                                                             \
         0,                                                                                                   \
         NULL},                                                                                               \
    {                                                                                                         \
        "shard", CLI_TEXT, "I/N", "only the cases of part I of N; `drape merge` brings them together",        \
            offsetof(cli_lab_request, shard), 0, NULL                                                         \
    }

/* Runs the experiment of the request's verb. Returns the exit code. */
int cli_lab_run(const cli_lab_request *request, int default_jobs);

struct drape_lab_outcome;
int cli_lab_conclude(drape_context *ctx, drape_status status, struct drape_lab_outcome *outcome);

#endif
