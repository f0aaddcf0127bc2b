/* cmd_check.c: `drape check`: compares every analytic derivative of a scene with differences. */
#include "cli/cli.h"
#include "cli/signals.h"

#include "assemble/check.h"
#include "geometry/intersect.h"

#include <stdio.h>

#define DEFAULT_SEED 1
#define MAX_SEED     1000000000

typedef struct check_request {
    cli_command command;
    int seed; /* 0: not given */
} check_request;

static int print_comparisons(const drape_check_result *rows, int count)
{
    int failed = 0;
    printf("%-20s %-28s %12s %10s\n", "term", "what", "error", "limit");
    for (int i = 0; i < count; i++) {
        printf("%-20s %-28s %12.3e %10.1e  %s\n", rows[i].term, rows[i].what, rows[i].error, rows[i].limit,
               rows[i].pass ? "ok" : "FAILED");
        failed += !rows[i].pass;
    }
    printf("%d passed, %d failed\n", count - failed, failed);
    fflush(stdout);
    if (failed)
        fprintf(stderr, "drape check: %d of %d comparisons are beyond their limit\n", failed, count);
    return failed ? CLI_FAILED : CLI_DONE;
}

/* Prints where cloth passes through cloth at the start. It is not a failure, as a scene without self-contact
 * may have it. */
static drape_status print_intersections(const cli_scene *in)
{
    drape_intersections found;
    drape_status status = drape_find_intersections(in->ctx, in->model, drape_sim_positions(in->sim), &found);
    if (status)
        return status;
    printf("%lld edge-face intersections at the start", (long long)found.count);
    if (found.count > 0)
        printf("; the first: edge %d %d, triangle %d %d %d", (int)found.edge[0], (int)found.edge[1],
               (int)found.triangle[0], (int)found.triangle[1], (int)found.triangle[2]);
    putchar('\n');
    return DRAPE_OK;
}

static int check(const check_request *request, const cli_scene *in)
{
    int count = 0, code = CLI_FAILED;
    unsigned seed = request->seed ? (unsigned)request->seed : DEFAULT_SEED;
    drape_check_result *rows =
        drape_arena_take(request->command.arena, DRAPE_MAX_CHECK_RESULTS, sizeof *rows);
    bool done = rows && !drape_check_derivatives(in->ctx, in->sim->system, seed, rows, &count);
    if (done)
        code = print_comparisons(rows, count);
    if (cli_interrupted())
        return cli_report_interrupted(request->command.verb);
    return done && !print_intersections(in) ? code : cli_report(&request->command, CLI_FAILED);
}

static int run(const void *command)
{
    const check_request *request = command;
    cli_scene in;
    int code = cli_scene_load(&request->command, request->command.operand, &in);
    if (code == CLI_GO_ON)
        code = check(request, &in);
    cli_scene_free(&in);
    return code;
}

static const cli_option options[] = {
    {"seed", CLI_NUMBER, "N", "seed of the deformation, rotation and motion (default 1)",
     offsetof(check_request, seed), MAX_SEED, NULL},
};

const drape_verb drape_verb_check = {
    .entry =
        {.name = "check",
         .summary =
             "compare a scene's analytic derivatives with finite differences; count edges through faces"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Compares every analytic derivative of a scene with central differences at a deformed, rotated,\n"
        "moving state, and counts the edges that pass through triangles at the start. Exit code 0: all\n"
        "derivatives are within their limits.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .request_size = sizeof(check_request),
    .run = run,
};
