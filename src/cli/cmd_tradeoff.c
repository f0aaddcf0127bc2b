/* cmd_tradeoff.c: `drape tradeoff`: work against accuracy. */
#include "cli/lab.h"

static const cli_option options[] = {
    CLI_LAB_OPTIONS,
    {"repeats", CLI_NUMBER, "N", "runs of a short case, of which the fastest counts (default 3)",
     offsetof(cli_lab_request, repeats), 100, NULL},
};

static int run(const void *request)
{
    return cli_lab_run(request, 1);
}

const drape_verb drape_verb_tradeoff = {
    .entry = {.name = "tradeoff",
              .summary = "work against accuracy of every integrator, against a tight reference"},
    .operand = "SCENE",
    .takes_scene = true,
    .details = "Runs a scene with every integrator over its dt or rtol, and compares with a reference whose "
               "own error\n"
               "is estimated. Stopped by Ctrl-C, the same command goes on where it was. Cases run one at a "
               "time, so\n"
               "that their CPU times can be compared; --jobs runs several.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .request_size = sizeof(cli_lab_request),
    .run = run,
};
