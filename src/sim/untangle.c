/*
 * untangle.c: untangling of a sim, and its report. The new state is built in the one that the next attempt
 * would overwrite. What is reported is counted as drape_sim_intersections and drape_sim_inside count, apart
 * from the search that moved the cloth.
 */
#include "sim/untangle.h"

#include "base/clock.h"
#include "base/def.h"
#include "base/vec3.h"
#include "colliders/deformed.h"
#include "geometry/intersect.h"
#include "sim/inside.h"
#include "untangle/untangler.h"

#include <stdio.h>
#include <string.h>

/* The def has had these members since its first version. */
#define MIN_SIZE  sizeof(drape_untangle_def)
#define MAX_SWEEP 1000000

void drape_untangle_def_init(drape_untangle_def *def, size_t struct_size)
{
    const drape_untangle_def defaults = {.struct_size = struct_size,
                                         .sweeps = DRAPE_UNTANGLE_DEFAULT_SWEEPS,
                                         .gap = DRAPE_UNTANGLE_DEFAULT_GAP};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

static drape_status read_def(const drape_sim *sim, const drape_untangle_def *given, drape_untangle_def *def)
{
    const drape_model_untangle *scene = &sim->model->untangle;
    drape_untangle_def_init(def, sizeof *def);
    if (!given) {
        def->keep = scene->goes_on;
        return DRAPE_OK;
    }
    if (!drape_def_fits(given->struct_size, MIN_SIZE, sizeof *def))
        return drape_fail(sim->ctx, DRAPE_E_VERSION,
                          "the untangle def was not initialised by drape_untangle_def_init of this version: "
                          "struct_size %zu",
                          given->struct_size);
    memcpy(def, given, given->struct_size);
    if (def->sweeps < 1 || def->sweeps > MAX_SWEEP)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_untangle: sweeps = %d; it is 1 to %d",
                          def->sweeps, MAX_SWEEP);
    if (!(def->gap >= 0.01 && def->gap <= 1))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_untangle: gap = %g; it is in [0.01, 1]",
                          def->gap);
    return DRAPE_OK;
}

/* ---- What passes through what ---- */

typedef struct finding {
    int64_t pairs;
    int32_t inside;
    drape_intersections own; /* of the cloth with itself */
    int32_t collider;        /* the first one that something is in; -1: none */
} finding;

static drape_status find(const drape_sim *sim, const double *x, finding *found)
{
    const drape_model *m = sim->model;
    const drape_motion *motion = drape_system_motion(sim->system);
    const double t = drape_sim_time(sim);
    drape_status status = DRAPE_OK;
    *found = (finding){.collider = -1};
    if (m->contact.self)
        status = drape_find_intersections(sim->ctx, m, x, &found->own);
    found->pairs = found->own.count;
    for (int32_t c = 0; !status && c < m->collider_count; c++) {
        drape_arena arena = drape_arena_of(sim->ctx);
        const drape_collider *body;
        drape_collider_pose pose;
        drape_inside inside = {.triangles = 0};
        drape_motion_pose(motion, c, t, t, &pose);
        status = drape_deformed_at(&arena, m, motion, c, t, &body);
        if (!status)
            status = drape_find_inside(sim->ctx, m, body, &pose, x, &inside);
        drape_arena_free(&arena);
        found->pairs += inside.intersections;
        found->inside += inside.triangles;
        if (found->collider < 0 && (inside.triangles > 0 || inside.intersections > 0))
            found->collider = c;
    }
    return status;
}

/* ---- The report ---- */

static void report_moves(drape_sim *sim, const double *x, drape_untangling *u)
{
    const drape_model *m = sim->model;
    const double *before = drape_sim_positions(sim);
    u->node = -1;
    memset(sim->untangled_move, 0, (size_t)m->cloth_count * sizeof *sim->untangled_move);
    for (int32_t i = 0; i < m->node_count; i++) {
        double *most = &sim->untangled_move[drape_model_cloth_of(m, i)], d[3];
        vec3_sub(x + 3 * (size_t)i, before + 3 * (size_t)i, d);
        const double length = vec3_norm(d);
        *most = fmax(*most, length);
        if (!(length > u->displacement))
            continue;
        u->displacement = length;
        u->node = i;
    }
    for (int32_t c = 0; c < m->cloth_count; c++)
        u->cloths += sim->untangled_move[c] > 0;
    for (int32_t e = 0; e < m->edge_count; e++) {
        const size_t a = 3 * (size_t)m->edge[2 * (size_t)e], b = 3 * (size_t)m->edge[2 * (size_t)e + 1];
        double now[3], then[3];
        vec3_sub(x + b, x + a, now);
        vec3_sub(before + b, before + a, then);
        if (vec3_norm(then) > 0)
            u->strain = fmax(u->strain, fabs(vec3_norm(now) / vec3_norm(then) - 1));
    }
}

/* "; first, edge 3 4 of a and triangle 5 6 7 of b" */
static void describe_first(const drape_sim *sim, const finding *found, char *text, size_t size)
{
    const drape_model *m = sim->model;
    text[0] = 0;
    if (found->own.count > 0) {
        const drape_cloth *a = &m->cloths[drape_model_cloth_of(m, found->own.edge[0])],
                          *b = &m->cloths[drape_model_cloth_of(m, found->own.triangle[0])];
        snprintf(text, size, "; first, edge %d %d of %s and triangle %d %d %d of %s",
                 (int)(found->own.edge[0] - a->first_node), (int)(found->own.edge[1] - a->first_node),
                 a->name, (int)(found->own.triangle[0] - b->first_node),
                 (int)(found->own.triangle[1] - b->first_node), (int)(found->own.triangle[2] - b->first_node),
                 b->name);
    } else if (found->collider >= 0) {
        snprintf(text, size, "; first, at %s", m->colliders[found->collider].name);
    }
}

static drape_status refuse(const drape_sim *sim, const finding *found, const drape_untangling *u)
{
    char first[240];
    describe_first(sim, found, first, sizeof first);
    return drape_fail(
        sim->ctx, DRAPE_E_SOLVER,
        "t=%.9g: the cloth did not come apart in %d sweeps: %lld of %lld pairs of an edge and a "
        "triangle still pass through each other, %d of %d triangles reach into colliders, and the "
        "smallest gap is %.3g of the least that contact allows%s",
        u->time, u->sweeps, (long long)u->pairs, (long long)u->pairs_before, (int)u->inside,
        (int)u->inside_before, u->least_gap, first);
}

/* ---- Untangling ---- */

/* Whether positions are no worse than the present ones in what a host can count, and steps can begin with
 * them. */
static bool is_worth_keeping(const drape_sim *sim, const double *x, const finding *before,
                             const finding *after)
{
    const drape_energy e = drape_sim_energy_of(sim, drape_sim_time(sim), x, drape_sim_velocities(sim));
    return after->pairs <= before->pairs && after->inside <= before->inside && isfinite(e.elastic) &&
           isfinite(e.contact);
}

/* Positions of the next state become the present ones; velocities stay. */
static void commit(drape_sim *sim)
{
    const drape_model *m = sim->model;
    drape_state *now = &sim->states[sim->now], *next = &sim->states[sim->next];
    const drape_energy before = drape_sim_account(sim);
    next->t = now->t;
    memcpy(next->v, now->v, 3 * (size_t)m->node_count * sizeof *next->v);
    drape_state_commit(m, now, next);
    drape_state_relax(m, now, false, next); /* the energy is shifted below */
    sim->next = sim->now;
    sim->now = (int)(next - sim->states);
    drape_sim_forget_past(sim);
    drape_sim_shift_energy(sim, &before, DRAPE_BY_HOST);
}

static drape_status untangle(drape_sim *sim, const drape_untangle_def *def, drape_untangling *u)
{
    const drape_untangle_limits limits = {.sweeps = def->sweeps, .gap = def->gap};
    const size_t size = 3 * (size_t)sim->model->node_count * sizeof(double);
    double *x = sim->states[sim->next].x;
    const double start = drape_clock_seconds();
    drape_untangle_outcome outcome = {.min_share = INFINITY};
    finding before, after;
    memcpy(x, drape_sim_positions(sim), size);
    drape_status status = find(sim, x, &before);
    if (!status)
        status = drape_untangle(sim->ctx, drape_system_motion(sim->system), drape_sim_time(sim), &limits,
                                &sim->cancel, x, &outcome);
    if (status == DRAPE_E_STOPPED && atomic_load(&sim->cancel))
        return drape_sim_check_cancel(sim);
    if (!status)
        status = find(sim, x, &after);
    if (status)
        return status;
    if (!is_worth_keeping(sim, x, &before, &after)) {
        memcpy(x, drape_sim_positions(sim), size);
        after = before;
        outcome.min_share = outcome.min_share_before;
    }
    *u = (drape_untangling){.clear =
                                after.pairs == 0 && after.inside == 0 && drape_untangle_is_clear(&outcome),
                            .time = drape_sim_time(sim),
                            .sweeps = outcome.sweeps,
                            .pairs_before = before.pairs,
                            .pairs = after.pairs,
                            .inside_before = before.inside,
                            .inside = after.inside,
                            .least_gap_before = outcome.min_share_before,
                            .least_gap = outcome.min_share};
    report_moves(sim, x, u);
    if (u->node >= 0 && (u->clear || def->keep))
        commit(sim);
    u->seconds = drape_clock_seconds() - start;
    sim->untangling = *u;
    sim->untangled = true;
    return u->clear ? DRAPE_OK : refuse(sim, &after, u);
}

drape_status drape_sim_untangle(drape_sim *sim, const drape_untangle_def *given, drape_untangling *report)
{
    drape_untangle_def def;
    drape_untangling u = {.node = -1};
    drape_status status = drape_sim_guard(sim, "drape_sim_untangle");
    if (!status)
        status = read_def(sim, given, &def);
    if (status)
        return status;
    sim->ctx->message[0] = 0;
    status = untangle(sim, &def, &u);
    if (report)
        *report = u;
    return status;
}

bool drape_sim_untangling(const drape_sim *sim, drape_untangling *out, double *moved)
{
    if (!sim || !sim->untangled)
        return false;
    if (out)
        *out = sim->untangling;
    if (moved)
        memcpy(moved, sim->untangled_move, (size_t)sim->model->cloth_count * sizeof *moved);
    return true;
}

drape_status drape_sim_untangle_some(drape_sim *sim, int sweeps)
{
    const drape_untangle_limits limits = {.sweeps = sweeps, .gap = DRAPE_UNTANGLE_DEFAULT_GAP};
    double *x = sim->states[sim->next].x;
    drape_untangle_outcome outcome;
    finding before, after;
    memcpy(x, drape_sim_positions(sim), 3 * (size_t)sim->model->node_count * sizeof *x);
    drape_status status = find(sim, x, &before);
    if (!status)
        status = drape_untangle(sim->ctx, drape_system_motion(sim->system), drape_sim_time(sim), &limits,
                                &sim->cancel, x, &outcome);
    if (!status)
        status = find(sim, x, &after);
    if (!status && after.pairs < before.pairs && is_worth_keeping(sim, x, &before, &after))
        commit(sim);
    return status;
}

drape_status drape_sim_untangle_start(drape_sim *sim)
{
    drape_untangle_def def;
    drape_untangling u = {.node = -1};
    if (!sim->untangle_due)
        return DRAPE_OK;
    drape_status status = read_def(sim, NULL, &def);
    if (!status)
        status = untangle(sim, &def, &u);
    if (!status || status == DRAPE_E_SOLVER)
        drape_log(sim->ctx, u.clear ? DRAPE_LOG_INFO : DRAPE_LOG_WARNING,
                  "t=%.9g: %s in %d sweeps: %lld to %lld pairs of an edge and a triangle, %d to %d triangles "
                  "in colliders; the largest displacement of a node is %.4g m",
                  u.time, u.clear ? "untangled" : "did not come apart", u.sweeps, (long long)u.pairs_before,
                  (long long)u.pairs, (int)u.inside_before, (int)u.inside, u.displacement);
    if (status == DRAPE_E_SOLVER && def.keep) {
        sim->ctx->message[0] = 0; /* the run goes on, with a warning */
        status = DRAPE_OK;
    }
    sim->untangle_due = status != DRAPE_OK;
    return status;
}

void drape_sim_copy_untangling(drape_sim *to, const drape_sim *from)
{
    to->untangle_due = from->untangle_due;
    to->untangled = from->untangled;
    to->untangling = from->untangling;
    memcpy(to->untangled_move, from->untangled_move,
           (size_t)to->model->cloth_count * sizeof *to->untangled_move);
}
