/* cmd_check.c: `drape check`: every analytic derivative of a scene against differences. */
#include "cli/cli.h"
#include "cli/signals.h"

#include "assemble/check.h"
#include "geometry/intersect.h"

#include <stdio.h>

#define DEFAULT_SEED 1
#define LARGEST_SEED 1000000000

typedef struct check_request {
    cli_command command;
    int seed;
} check_request;

static void print_row(const drape_check_row *row)
{
    printf("%-20s %-28s %12.3e %10.1e  %s\n", row->term, row->what, row->error, row->limit,
           row->pass ? "ok" : "FAILED");
}

static int print_rows(const drape_check_row *rows, int count)
{
    int failed = 0;
    printf("%-20s %-28s %12s %10s\n", "term", "what", "error", "limit");
    for (int i = 0; i < count; i++) {
        print_row(&rows[i]);
        failed += !rows[i].pass;
    }
    printf("%d passed, %d failed\n", count - failed, failed);
    fflush(stdout);
    if (failed)
        fprintf(stderr, "drape check: %d of %d comparisons are beyond their limit\n", failed, count);
    return failed ? CLI_FAILED : CLI_DONE;
}

/* Where the cloths pass through themselves or each other at the start. No failure: a scene without
 * self-contact may. */
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
    drape_check_row *rows = drape_alloc(in->ctx, DRAPE_MAX_CHECK_ROWS, sizeof *rows);
    bool done =
        rows && !drape_check_derivatives(in->ctx, in->sim->system, (unsigned)request->seed, rows, &count);
    if (done)
        code = print_rows(rows, count);
    if (cli_interrupted()) {
        code = cli_tell_interrupted(request->command.verb);
    } else if (!done || print_intersections(in)) {
        code = CLI_FAILED;
        fprintf(stderr, "%s\n", drape_context_message(in->ctx));
    }
    drape_free(in->ctx, rows);
    return code;
}

static const cli_option options[] = {
    {"seed", CLI_NUMBER, "N", "another deformation, rotation and motion (default 1)",
     offsetof(check_request, seed), LARGEST_SEED, NULL},
};

static int main_check(int argc, char **argv);

const drape_verb drape_verb_check = {
    .name = "check",
    .operand = "SCENE",
    .takes_scene = true,
    .summary = "differences against every analytic derivative of a scene; edge-face intersections",
    .details =
        "Compares every analytic derivative of a scene with central differences at a deformed, rotated,\n"
        "moving state, and counts the edges that pass through triangles at the start. Exit code 0: all\n"
        "derivatives are within their limits.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .run = main_check,
};

static int main_check(int argc, char **argv)
{
    check_request request = {.seed = DEFAULT_SEED};
    cli_scene in = {.ctx = NULL};
    int code = cli_parse(&drape_verb_check, argc, argv, &request.command);
    if (code == CLI_GO_ON)
        code = cli_scene_load(&request.command, &in);
    if (code == CLI_GO_ON)
        code = check(&request, &in);
    cli_scene_free(&in);
    cli_command_free(&request.command);
    return code;
}
