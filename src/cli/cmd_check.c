/* cmd_check.c: `drape check`: compares every analytic derivative of a scene with differences; or counts the
 * intersections of cloth with itself and with colliders in the frames of a run. */
#include "cli/cli.h"

#include "assemble/check.h"
#include "colliders/deformed.h"
#include "geometry/intersect.h"
#include "sim/inside.h"

#include <math.h>
#include <stdio.h>

#define DEFAULT_SEED 1
#define MAX_SEED     1000000000

typedef struct check_request {
    cli_command command;
    int seed; /* 0: not given */
} check_request;

/* Ends the line of a count. */
static void print_first(const drape_intersections *found)
{
    if (found->count > 0)
        printf("; the first: edge %d %d, triangle %d %d %d", (int)found->edge[0], (int)found->edge[1],
               (int)found->triangle[0], (int)found->triangle[1], (int)found->triangle[2]);
    putchar('\n');
}

/* ---- What dissipates ---- */

/* A line of a table, begun by the first of its items. */
static void print_loss(const char *of, const char *what, bool *begun)
{
    if (*begun)
        printf(", %s", what);
    else
        printf("%-20s %s", of, what);
    *begun = true;
}

/* Whether a term of the model takes energy, and not the motion of pins or a host. */
static bool is_lossy(const drape_model *m, const drape_term *t)
{
    const bool relaxes = t->ops->law && t->ops->build && m->cloths[t->cloth].branch_count > 0;
    return t->ops->dissipative || t->damping || t->sliders > 0 || (relaxes && t->seam < 0);
}

static bool is_of_fabric(const drape_model *m, const drape_term *t)
{
    return t->ops->from_fabric && m->cloths[t->cloth].retardation > 0;
}

/* Lists what dissipates of each cloth, of seams, of contact and by the method, and warns of cloths of which
 * only the method takes energy: how soon these come to rest depends on its steps. */
static void check_losses(const cli_scene *in)
{
    const drape_model *m = in->model;
    const drape_chosen *chosen = &in->sim->chosen;
    const char *method = chosen->integrator->entry.name;
    const bool damps =
        !chosen->integrator->conservative || drape_chosen_integrator_value(chosen, "damping", 0) > 0;
    bool begun = false, friction = m->contact.self_friction > 0, impacts = m->contact.self_restitution < 1;
    printf("%-20s %s\n", "dissipates", "by");
    for (int32_t c = 0; c < m->cloth_count; c++, begun = false) {
        const char *name = m->cloths[c].name;
        const drape_term *left = NULL;
        for (int32_t i = 0; i < m->term_count; i++) {
            const drape_term *t = &m->terms[i];
            if (t->cloth != c || t->seam >= 0 || !is_lossy(m, t))
                continue;
            if (is_of_fabric(m, t) && chosen->integrator->leaves_losses)
                left = t;
            else
                print_loss(CLI_SHOWN(name),
                           is_of_fabric(m, t) ? DRAPE_FORMAT("%s of its fabric, beta %.3g s",
                                                             t->ops->entry.name, t->params[0])
                                              : t->ops->entry.name,
                           &begun);
        }
        const bool none = !begun;
        if (none)
            print_loss(CLI_SHOWN(name), "nothing", &begun);
        if (left)
            printf(": %s leaves out %s of its fabric", method, left->ops->entry.name);
        putchar('\n');
        fflush(stdout);
        if (none && !chosen->integrator->steady_state)
            fprintf(stderr,
                    "warning: /cloth/%d: %s damps the waves of %s, so %s; damp.kelvin_voigt, or %s, does\n",
                    (int)c, damps ? DRAPE_FORMAT("only the method, %s,", method) : "nothing", CLI_SHOWN(name),
                    damps ? "how long they last depends on its steps" : "they last",
                    left ? "the loss of its fabric under an implicit method"
                         : "a \"fabric\" without \"damping\": \"none\"");
    }
    for (int32_t i = 0; i < m->term_count; i++)
        if (m->terms[i].seam >= 0 && is_lossy(m, &m->terms[i]))
            printf("%-20s %s\n", CLI_SHOWN(m->seams[m->terms[i].seam].name), m->terms[i].ops->entry.name);
    friction = m->contact.self && friction, impacts = m->contact.self && impacts;
    for (int32_t c = 0; c < m->collider_count; c++) {
        friction = friction || m->colliders[c].friction > 0;
        impacts = impacts || m->colliders[c].restitution < 1;
    }
    if (friction)
        print_loss("contact", "friction", &begun);
    if (impacts)
        print_loss("contact", "impacts", &begun);
    if (begun)
        putchar('\n');
    if (damps && !chosen->integrator->steady_state)
        printf("%-20s what its steps do not resolve\n", method);
}

/* Also counts where cloth passes through cloth at the start. It is not a failure, as a scene without
 * self-contact may have it. */
static int check(const check_request *request, const cli_scene *in)
{
    int count = 0, failed = 0;
    drape_intersections found;
    drape_check_result *rows =
        drape_arena_take(request->command.arena, DRAPE_MAX_CHECK_RESULTS, sizeof *rows);
    const unsigned seed = request->seed ? (unsigned)request->seed : DEFAULT_SEED;
    const bool done = rows && !drape_check_derivatives(in->ctx, in->sim->system, seed, rows, &count);
    if (done)
        printf("%-20s %-28s %12s %10s\n", "term", "what", "error", "limit");
    for (int i = 0; done && i < count; i++) {
        printf("%-20s %-28s %12.3e %10.1e  %s\n", rows[i].term, rows[i].what, rows[i].error, rows[i].limit,
               rows[i].pass ? "ok" : "FAILED");
        failed += !rows[i].pass;
    }
    if (done)
        printf("%d passed, %d failed\n", count - failed, failed);
    fflush(stdout);
    if (failed)
        fprintf(stderr, "drape check: %d of %d comparisons are beyond their limit\n", failed, count);
    if (cli_interrupted())
        return cli_report_interrupted(request->command.verb);
    if (!done || drape_find_intersections(in->ctx, in->model, drape_sim_positions(in->sim), &found))
        return cli_report(&request->command, CLI_FAILED);
    printf("%lld edge-face intersections at the start", (long long)found.count);
    print_first(&found);
    check_losses(in);
    return failed ? CLI_FAILED : CLI_DONE;
}

/* ---- The frames of a run ---- */

/* Adds the intersections of a frame to the sum, and finds the deepest point inside a collider [m]. */
static drape_status check_collider(const cli_scene *in, int32_t collider, int64_t frame, double time,
                                   const double *x, int64_t *sum, double *deepest)
{
    const drape_collider *c = &in->model->colliders[collider];
    const drape_collider_pose pose = drape_collider_pose_at(c, time);
    drape_inside found;
    const drape_collider *body;
    drape_arena arena = drape_arena_of(in->ctx);
    drape_status status = drape_deformed_at(&arena, in->model, NULL, collider, time, &body);
    if (!status)
        status = drape_find_inside(in->ctx, in->model, body, &pose, x, &found);
    drape_arena_free(&arena);
    if (status || found.triangles == 0)
        return status;
    *sum += found.triangles + found.intersections;
    *deepest = fmax(*deepest, found.deepest);
    printf(
        "frame %lld, t=%.9g: %d triangles reach into %s, up to %.3g m deep; %lld edge-face intersections\n",
        (long long)frame, time, (int)found.triangles, CLI_SHOWN(c->name), found.deepest,
        (long long)found.intersections);
    return DRAPE_OK;
}

static int check_frames(const check_request *request, const cli_scene *in, const drape_record *run)
{
    int64_t crossed = 0, worst = 0, count = 0; /* frames; the one with the largest number */
    double deepest = 0;
    double *x = drape_arena_take(request->command.arena, (size_t)run->nodes, 3 * sizeof *x);
    drape_status status = x ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int64_t i = 0; i < run->frames && !status && !cli_interrupted(); i++) {
        drape_intersections found = {.count = 0};
        status = drape_record_read(run, i, x);
        if (!status)
            status = drape_find_intersections(in->ctx, in->model, x, &found);
        int64_t sum = status ? 0 : found.count;
        if (sum > 0) {
            printf("frame %lld, t=%.9g: %lld edge-face intersections of the cloth with itself", (long long)i,
                   run->times[i], (long long)sum);
            print_first(&found);
        }
        for (int32_t c = 0; !status && c < in->model->collider_count; c++)
            status = check_collider(in, c, i, run->times[i], x, &sum, &deepest);
        crossed += sum > 0;
        worst = sum > count ? i : worst;
        count = sum > count ? sum : count;
    }
    if (cli_interrupted())
        return cli_report_interrupted(request->command.verb);
    if (status)
        return cli_report(&request->command, CLI_FAILED);
    printf("%lld frames, %lld with intersections", (long long)run->frames, (long long)crossed);
    if (crossed > 0)
        printf("; the most in frame %lld; the deepest point is %.3g m inside a collider", (long long)worst,
               deepest);
    putchar('\n');
    return crossed > 0 ? CLI_FAILED : CLI_DONE;
}

static int run(const void *command)
{
    const check_request *request = command;
    const cli_command *common = &request->command;
    const bool finished = cli_is_folder(common->operand);
    cli_scene in = {0};
    drape_record record = {.positions = -1};
    if (finished && request->seed)
        return cli_misuse("check", "--seed is for a scene, and %s is a finished run",
                          CLI_SHOWN(common->operand));
    int code = finished ? cli_run_load(common, common->operand, &in, &record)
                        : cli_scene_load(common, common->operand, &in);
    if (code == CLI_GO_ON)
        code = finished ? check_frames(request, &in, &record) : check(request, &in);
    drape_record_close(&record);
    cli_scene_free(&in);
    return code;
}

static const cli_option options[] = {
    {"seed", CLI_NUMBER, "N", "seed of the deformation, rotation and motion (default 1)",
     offsetof(check_request, seed), MAX_SEED},
};

const drape_verb drape_verb_check = {
    .entry =
        {.name = "check",
         .summary =
             "compare a scene's derivatives with finite differences; count intersections in a run's frames"},
    .operand = "SCENE|RUN",
    .takes_scene = true,
    .details =
        "SCENE: compares every analytic derivative with central differences at a deformed, rotated, moving\n"
        "state, counts the edges that pass through triangles at the start, and lists what dissipates. A "
        "warning\n"
        "names cloth whose waves only the method damps. Exit code 0: all derivatives are within their "
        "limits.\n"
        "RUN, the folder of a run with positions.npy: counts, in each frame, edges of the cloth that pass\n"
        "through its triangles, triangles that reach into a collider, and edges of either that pass through\n"
        "triangles of the other, with each collider where its track has it at that time. Prints a line for\n"
        "each frame and obstacle where there are any. Exit code 0: there are none.",
    CLI_OPTIONS(options, check_request),
    .run = run,
};
