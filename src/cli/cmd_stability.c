/* cmd_stability.c: `drape stability`: maps of what happens over values of a scene. */
#include "cli/lab.h"

#include <unistd.h>

static const cli_option options[] = {
    CLI_LAB_OPTION("axis", CLI_TEXTS, "/POINTER=FROM:TO:N[log]", "an axis of the map; give 1 to 3", axes, 0),
    CLI_LAB_OPTIONS,
    CLI_LAB_OPTION("results", CLI_TEXT, "A,B",
                   "results that the figures show, too, such as energy_drift or strain_max", results, 0),
    CLI_LAB_OPTION("strain-limit", CLI_REAL, "E",
                   "a run with a larger strain of an edge counts as overstretched (default 0.2)",
                   strain_limit, 0),
};

static int run(const void *request)
{
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    return cli_lab_run(request, cores < 1 ? 1 : cores > 256 ? 256 : (int)cores, 0);
}

const drape_verb drape_verb_stability = {
    .entry =
        {.name = "stability",
         .summary =
             "map where runs complete, reject steps, stop or explode, over dt, stiffness, mass, resolution"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Runs a scene at every point of a grid of its values with several integrators (be, bdf2, ida, "
        "verlet,\nunless --integrators names others), for example\n  drape stability scene.json "
        "--axis /integrator/dt=1e-4:1e-1:32log \\\n      --axis "
        "/cloth/0/material/young_modulus=1e4:1e8:32log --out maps\n--results names columns of results.csv: "
        "energy_drift (the default over a single axis), strain_max,\niterations_per_step, rejected_share, "
        "cpu_s ... The same command with others draws them from the same cases.\nUses all cores unless "
        "--jobs says "
        "how many. After Ctrl-C, the same command resumes where it stopped.",
    CLI_OPTIONS(options, cli_lab_request),
    .run = run,
};
