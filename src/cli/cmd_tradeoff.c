/* cmd_tradeoff.c: `drape tradeoff`: work against accuracy. */
#include "cli/lab.h"

#define BUDGET 5 /* [min] */

static const cli_option options[] = {
    CLI_LAB_OPTIONS,
    CLI_LAB_OPTION("repeats", CLI_NUMBER, "N",
                   "runs of a short case, of which the fastest counts (default 3)", repeats, 100),
    CLI_LAB_OPTION("budget", CLI_TEXT, "MINUTES",
                   "limit of wall-clock time, or none; the dearest cases are left out and named (default 5)",
                   budget, 0),
};

static int run(const void *request)
{
    return cli_lab_run(request, 1, BUDGET);
}

const drape_verb drape_verb_tradeoff = {
    .entry = {.name = "tradeoff",
              .summary = "find the cheapest method and step for an accuracy, against a precise reference"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Runs a scene by newton_k, bdf2 and rosenbrock over dt and rtol, or by --integrators at --dt "
        "1/60,1/240\n"
        "and --set /integrator/rtol=1e-3,1e-4, and compares with a reference whose own error is estimated. "
        "After\n"
        "Ctrl-C, or where cases were left out, the same command continues; with other integrators and "
        "values, "
        "too.\n"
        "Cases run one at a time, so that their CPU times can be compared; --jobs runs several.",
    CLI_OPTIONS(options, cli_lab_request),
    .run = run,
};
