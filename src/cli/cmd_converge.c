/* cmd_converge.c: `drape converge`: orders in time and space. */
#include "cli/lab.h"

static const cli_option options[] = {
    CLI_LAB_OPTIONS,
    CLI_LAB_OPTION("levels", CLI_TEXT, "N", "refinements, 3 to 12 (default 6)", levels, 0),
    CLI_LAB_OPTION("space", CLI_FLAG, NULL, "also subdivide the meshes of all cloths", space, 0),
};

static int run(const void *request)
{
    return cli_lab_run(request, 1, 0);
}

const drape_verb drape_verb_converge = {
    .entry = {.name = "converge", .summary = "measure orders of convergence in time, and in space"},
    .operand = "SCENE",
    .takes_scene = true,
    .details = "Halves the step of every integrator repeatedly (ida: divides rtol by 10), and with --space "
               "the edges of\nall meshes. The distances between successive final states give the order and "
               "its confidence interval.",
    CLI_OPTIONS(options, cli_lab_request),
    .run = run,
};
