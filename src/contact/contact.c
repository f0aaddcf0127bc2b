/*
 * contact.c: see contact.h. The files of this folder, each of which calls only those before it:
 *
 *     law.c              energy, gradient and Hessian of an active contact, by the barrier (barrier.h)
 *     restitution.c      the dissipative part of its normal force
 *     friction.c         its friction, with the normal force of now or, lagged, of the beginning of the step
 *
 *     pair.c             two pieces: cheap lower bounds of their gap, which reject most neighbours, and the
 *                        narrow phase: closest points, gap, normal and weights
 *     clusters.c, flat.c, self_search.c, distant.c, broad_phase.c
 *                        pairs of pieces that no axis separates on a path, found in trees of boxes
 *     sort_pairs.c, candidates.c
 *                        those that can become active near the path; where some points have left it, a patch
 *     active.c           the active set: candidates whose gap is below the activation distance, equal ones
 *                        merged; exempt.h: pairs that are not held, said from outside
 *     predict.c          normal forces at the end of an iteration of Newton's method
 *
 *     evaluation.c       all points where contact is evaluated, and the candidates and the active set there
 *     forces.c           forces and energy of the active set
 *     jacobian.c         dg/dx + w dg/dv of the active set, block by block into the pattern
 *     ccd.c              continuous collision detection
 *     step_check.c       whether a step may end where it does
 *     sweep.c            a guess of the end of a step that moving colliders do not pass through
 *     contact.c          creation, and the beginning of a step
 *     contact_archive.c  checkpoints
 *
 * So a pair gets to the Jacobian: evaluation.c asks candidates.c for the pairs near the path, of which those
 * of features come from broad_phase.c; active.c keeps the pairs whose gap, by pair.c, is below the activation
 * distance; jacobian.c adds the blocks of law.c, restitution.c and friction.c.
 */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/elementary.h"
#include "base/list.h"
#include "base/vec3.h"

#include <string.h>

#define MARGIN 0.06 /* by which points may leave the path of a search before a new one, in mean edges */
/* The stiffness is raised at the first attempt of a step, if the smallest gap is below SMALL_GAP and less
 * than 1/RAISE of what it was at the last raise, and at every attempt, if a gap is below RAISE least gaps. It
 * falls while the smallest gap is above LARGE_GAP. Gaps are in activation distances. */
#define SMALL_GAP  0.05
#define LARGE_GAP  0.3
#define RAISE      2.0 /* factor of the stiffness, and how many times smaller the gap must be for the next */
#define HALF_LIFE  0.2 /* [s] in which the stiffness falls by half */
#define MAX_FACTOR 1e4
#define GROWTH     0.5 /* activation distance of a moving collider, in its path in a nominal step */

drape_status drape_contact_create(drape_arena *arena, const drape_motion *motion, drape_contact **out)
{
    const drape_model *model = motion->model;
    *out = NULL;
    if (model->collider_count == 0 && !model->contact.self)
        return DRAPE_OK;
    const drape_ranks *ranks = drape_model_ranks(model);
    drape_contact *c = drape_arena_take(arena, 1, sizeof *c);
    if (drape_ranks_agree_memory(ranks, arena->ctx, c))
        return DRAPE_E_MEMORY;
    *c = (drape_contact){.arena = arena,
                         .model = model,
                         .ranks = ranks,
                         .motion = motion,
                         .mean_edge = drape_model_mean_edge(model),
                         .active.arena = arena,
                         .inside.arena = arena,
                         .stiffening = {.factor = 1, .largest_gap = 1}};
    drape_status status = drape_broad_phase_create(arena, model, &c->broad);
    const size_t nodes = (size_t)model->node_count, colliders = (size_t)model->collider_count;
    size_t deforming = 0; /* the most points of a collider that deforms */
    for (size_t i = 0; i < colliders; i++)
        if (model->colliders[i].frames.frame_count > 0 &&
            (size_t)model->colliders[i].shape.point_count > deforming)
            deforming = (size_t)model->colliders[i].shape.point_count;
    if (!status)
        status = drape_candidates_create(arena, &c->broad, MARGIN * c->mean_edge, &c->step_candidates);
    if (!status)
        status = drape_candidates_create(arena, &c->broad, MARGIN * c->mean_edge, &c->query_candidates);
    if (!status) {
        const size_t points = (size_t)c->broad.points;
        double **const positions[] = {&c->x, &c->v, &c->from, &c->to, &c->start, &c->start_v};
        drape_collider_pose **const poses[] = {&c->pose, &c->start_pose, &c->path_pose, &c->kink_pose};
        for (size_t i = 0; i < sizeof positions / sizeof *positions; i++)
            *positions[i] = drape_arena_take(arena, points, 3 * sizeof(double));
        for (size_t i = 0; i < sizeof poses / sizeof *poses; i++)
            *poses[i] = drape_arena_take(arena, colliders, sizeof **poses[i]);
        c->start_least = drape_arena_take(arena, colliders, sizeof *c->start_least);
        c->distance_before = drape_arena_take(arena, colliders, sizeof *c->distance_before);
        c->on_collider = drape_arena_take(arena, colliders, sizeof *c->on_collider);
        c->own = drape_arena_take(arena, deforming, 3 * sizeof *c->own);
        c->own_end = drape_arena_take(arena, deforming, 3 * sizeof *c->own_end);
        c->on_point = drape_arena_take(arena, deforming > 0 ? points - nodes : 0, 3 * sizeof *c->on_point);
        c->swing = drape_arena_take(arena, colliders, sizeof *c->swing);
        c->before = drape_arena_take(arena, nodes, sizeof *c->before);
        c->moved = drape_arena_take(arena, points + colliders, sizeof *c->moved);
        c->carried = drape_arena_take(arena, nodes, sizeof *c->carried);
        c->deformed = drape_arena_take(arena, colliders, sizeof *c->deformed);
        c->body = drape_arena_take(arena, colliders, sizeof *c->body);
        c->body_t = drape_arena_take(arena, colliders, sizeof *c->body_t);
        status = drape_arena_status(arena);
    }
    for (size_t i = 0; !status && i < colliders; i++) {
        if (model->colliders[i].frames.frame_count == 0)
            continue;
        status = drape_deformed_create(arena, &model->colliders[i], &c->deformed[i]);
        c->body[i] = status ? NULL : &c->deformed[i]->collider;
    }
    if (!status)
        drape_contact_forget_bodies(c);
    if (!status)
        status = drape_predictions_init(arena, c->broad.points, &c->predicted);
    if (!status)
        status = drape_predictions_init(arena, c->broad.points, &c->predicting);
    status = drape_ranks_agree(ranks, arena->ctx, status);
    if (!status)
        drape_contact_set_rounding(c, c->broad.rest);
    *out = status ? NULL : c;
    return status;
}

void drape_contact_watch(drape_contact *c, const atomic_bool *const *cancel)
{
    c->cancel = cancel;
}

double drape_contact_seconds(const drape_contact *c)
{
    return c ? c->seconds : 0;
}

double drape_contact_search_seconds(const drape_contact *c)
{
    return c ? c->search_seconds : 0;
}

double drape_contact_take_work(drape_contact *c)
{
    const double work = c->stiffening.work;
    c->stiffening.work = 0;
    return work;
}

void drape_contact_set_step(drape_contact *c, double dt)
{
    c->dt = dt;
}

double drape_contact_longest_path(const drape_contact *c)
{
    return c ? c->longest_path : 0;
}

bool drape_contact_exempts(const drape_contact *c)
{
    return c->exempt && c->exempt->count > 0;
}

/* ---- What changes between steps ---- */

drape_status drape_contact_lag(drape_contact *c)
{
    double v[4][3];
    c->lagged_count = 0;
    for (int32_t i = 0; c->model->contact.lagged && i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        const drape_contact_law law = drape_contact_law_of(c, contact);
        if (!(law.friction > 0))
            continue;
        drape_contact_velocities(c, contact, v);
        const drape_normal normal = drape_normal_at(&contact->gap, &law, v);
        const drape_lagged lagged = {.contact = *contact, .force = drape_normal_force(&normal)};
        if (!drape_list_append(c->arena, &c->lagged, &c->lagged_count, &c->lagged_capacity, &lagged,
                               sizeof lagged))
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

void drape_contact_measure_start(drape_contact *c)
{
    memset(c->start_least, 0, (size_t)c->model->collider_count * sizeof *c->start_least);
    for (int32_t i = 0; i < c->active.near_count; i++) {
        const drape_near_pair *near = &c->active.near[i];
        if (near->pair.collider >= 0)
            c->start_least[near->pair.collider] = fmin(c->start_least[near->pair.collider], near->gap);
    }
    for (int32_t i = 0; c->ranks && i < c->model->collider_count; i++)
        c->start_least[i] = drape_ranks_least(c->ranks, c->start_least[i]);
}

/* Makes contact stiffer where gaps shrink, and softer again. */
static void adapt_stiffness(drape_contact *c, double t, bool retry)
{
    drape_stiffening *s = &c->stiffening;
    double least = 1;
    bool last = false; /* some gap would be at its least before the next raise */
    for (int32_t i = 0; i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        if (contact->inside || contact->exempt > 0)
            continue;
        least = fmin(least, contact->gap.value / contact->pair.distance);
        last = last || contact->gap.value < RAISE * drape_pair_least_gap(&contact->pair, c->broad.rounding);
    }
    last = drape_ranks_any(c->ranks, last);
    const double gap = drape_ranks_least(c->ranks, least), before = s->factor;
    if (retry && !last)
        return;
    s->largest_gap = fmax(s->largest_gap, gap);
    if (last || (gap < SMALL_GAP && RAISE * gap < s->largest_gap)) {
        s->factor = fmin(RAISE * before, MAX_FACTOR);
        s->largest_gap = gap;
    } else if (gap > LARGE_GAP) {
        s->factor = fmax(before * drape_pow(0.5, (t - s->t) / HALF_LIFE), 1);
    }
    s->t = t;
}

/* ---- Activation distances ---- */

/* How far the turning of a collider brings its surface towards a node in a nominal step from time t on: a
 * ball that turns about its center brings nothing nearer. */
static double turning_path_of(const drape_contact *c, int32_t collider, double t)
{
    const drape_collider *k = &c->model->colliders[collider];
    const double end = t + c->dt;
    double largest = 0, before[3], after[3];
    drape_collider_pose from, to;
    if (!drape_motion_turns_collider(c->motion, collider))
        return 0;
    drape_motion_pose(c->motion, collider, t, t, &from);
    drape_motion_pose(c->motion, collider, end, end, &to);
    drape_pose_point(&from, k->pivot, before);
    drape_pose_point(&to, k->pivot, after);
    for (int i = 0; i < 3; i++)
        to.displacement[i] -= after[i] - before[i];
    for (int32_t i = 0; i < c->model->free_count; i++) {
        const double *x = c->x + 3 * (size_t)c->model->node_of_free[i];
        largest = fmax(largest, drape_collider_distance(k, &from, x, NULL, NULL) -
                                    drape_collider_distance(k, &to, x, NULL, NULL));
    }
    return drape_ranks_largest(c->ranks, largest);
}

/* The length of a path, or of the path relative to a displacement `mean` if that is shorter: a body at rest
 * is not fast where cloth falls, nor is a body that moves along with the cloth. */
static double lesser_path(const double from[3], const double to[3], const double mean[3])
{
    double own[3], relative[3];
    vec3_sub(to, from, own);
    vec3_sub(own, mean, relative);
    return fmin(vec3_norm(own), vec3_norm(relative));
}

/* How far the points of a collider move in a nominal step from time t on, or relative to the mean motion of
 * the cloth. */
static double path_of(const drape_contact *c, int32_t collider, double t)
{
    double from[3], to[3], mean[3] = {0}, largest = 0;
    const bool deforms = drape_motion_deforms(c->motion, collider);
    if (!deforms && !drape_motion_shifts_collider(c->motion, collider))
        return turning_path_of(c, collider, t);
    for (size_t i = 0; i < 3 * (size_t)c->model->node_count; i++)
        mean[i % 3] += drape_model_owns(c->model, (int32_t)(i / 3)) ? c->v[i] : 0;
    if (c->ranks)
        c->ranks->sum(c->ranks, mean, 3);
    for (size_t k = 0; k < 3; k++)
        mean[k] *= c->dt / (double)drape_model_node_count(c->model);
    if (!deforms) {
        drape_motion_collider(c->motion, collider, t, from);
        drape_motion_collider(c->motion, collider, t + c->dt, to);
        return lesser_path(from, to, mean) + turning_path_of(c, collider, t);
    }
    drape_collider_pose before, after;
    drape_motion_pose(c->motion, collider, t, t, &before);
    drape_motion_pose(c->motion, collider, t + c->dt, t + c->dt, &after);
    drape_motion_points(c->motion, collider, t, c->own);
    drape_motion_points(c->motion, collider, t + c->dt, c->own_end);
    for (size_t p = 0; p < (size_t)c->model->colliders[collider].shape.point_count; p++) {
        drape_pose_point(&before, c->own + 3 * p, from);
        drape_pose_point(&after, c->own_end + 3 * p, to);
        largest = fmax(largest, lesser_path(from, to, mean));
    }
    return largest;
}

static void set_distance(drape_contact *c, int32_t collider, double distance)
{
    c->broad.distance[collider] = distance;
    drape_candidates_forget_collider(&c->step_candidates, collider);
    drape_candidates_forget_collider(&c->query_candidates, collider);
}

/* Contact with a fast collider over a distance that it crosses in a small part of a step is hard to solve: in
 * a step it accelerates the cloth all at once. So the activation distance grows to a share of the path of a
 * step, and falls again to that of the scene when the collider rests. It changes by powers of two, because
 * each change needs a search, and by one power a step where cloth is in contact already, because it changes
 * the contact energy. A body that has just begun to move, or that appears at the start of a run, has the
 * whole distance before it reaches the cloth. */
static drape_status adapt_distances(drape_contact *c, double t, bool retry)
{
    const drape_configuration now = drape_contact_configuration(c);
    bool changed = false, narrowed = false;
    for (int32_t i = 0; c->dt > 0 && !retry && i < c->model->collider_count; i++) {
        const double path = path_of(c, i, t), before = c->broad.distance[i],
                     least = drape_collider_activation(c->model, i);
        double distance = before;
        c->distance_before[i] = before;
        c->longest_path = fmax(c->longest_path, path);
        if (c->model->contact.distance_given || c->model->colliders[i].shape.distance > 0)
            continue;
        while (GROWTH * path > distance)
            distance *= 2;
        if (GROWTH * path < 0.25 * before && before > least)
            distance = 0.5 * before;
        if (distance == before)
            continue;
        changed = true;
        set_distance(c, i, distance);
    }
    drape_status status = changed ? drape_contact_list(c, &now) : DRAPE_OK;
    for (int32_t i = 0; changed && !status && i < c->model->collider_count; i++) {
        bool active = false;
        if (!(c->broad.distance[i] > 2 * c->distance_before[i]))
            continue;
        for (int32_t k = 0; k < c->active.count && !active; k++)
            active = c->active.contacts[k].pair.collider == i;
        if (!drape_ranks_any(c->ranks, active))
            continue;
        set_distance(c, i, 2 * c->distance_before[i]);
        narrowed = true;
    }
    return narrowed ? drape_contact_list(c, &now) : status;
}

/* ---- The beginning and the end of a step ---- */

bool drape_contact_has_begun(const drape_contact *c, const double *x, double t)
{
    bool same =
        c->begun && c->start_t == t && memcmp(c->start, x, 3 * (size_t)c->model->node_count * sizeof *x) == 0;
    for (int32_t i = 0; same && i < c->model->collider_count; i++) {
        drape_collider_pose pose;
        drape_motion_pose(c->motion, i, t, t, &pose);
        same = !drape_pose_differs(&c->start_pose[i], &pose);
    }
    return drape_ranks_all(c->ranks, same);
}

/* A rank that alone is out of memory must not leave the others waiting. */
static drape_status agree(const drape_contact *c, drape_status status)
{
    return drape_ranks_agree(c->ranks, c->model->ctx, status);
}

/* Between steps the laws of contacts change: which cloth is exempt and how hard it is pushed, activation
 * distances, which pairs are inside, the stiffness. What these changes add to the energy of the present
 * contacts, or take from it, is work done from outside (drape_contact_take_work). The energy before the
 * change follows the rule between steps: cloth that was placed into a body counts as inside. */
drape_status drape_contact_begin(drape_contact *c, const double *x, const double *v, double t)
{
    const double start = drape_clock_seconds();
    const drape_contact_at at = {.x = x, .v = v, .t = t, .span = {t, t}};
    const size_t size = 3 * (size_t)c->broad.points * sizeof *c->x;
    c->between_steps = c->begun && !drape_contact_has_begun(c, x, t);
    drape_status status = agree(c, drape_contact_update(c, &at));
    const double before = status ? 0 : drape_contact_potential(c);
    c->between_steps = false;
    if (!status)
        status = c->exempt ? c->exempt->begin(c, &at) : DRAPE_OK;
    c->refused = false;
    drape_contact_set_rounding(c, c->x);
    drape_distant_update(&c->broad.distant, c->x, c->pose, c->broad.rounding);
    /* A step that is tried again begins where the failed one did. */
    const bool retry = drape_ranks_all(c->ranks, c->begun && memcmp(c->start, c->x, size) == 0);
    if (!status)
        status = agree(c, adapt_distances(c, t, retry));
    if (!status) { /* a pair that has come to be inside has another law, and so have its contacts */
        const drape_configuration now = drape_contact_configuration(c);
        const bool added =
            drape_inside_update(&c->inside, c->active.near, c->active.near_count, c->broad.rounding, &status);
        status = agree(c, added ? drape_contact_list(c, &now) : status);
    }
    if (!status) {
        adapt_stiffness(c, t, retry);
        c->stiffening.work += drape_contact_potential(c) - before;
        drape_contact_set_instant(c, v, t);
        status = agree(c, drape_contact_lag(c));
    }
    drape_predictions_clear(&c->predicted);
    if (!status) {
        drape_contact_measure_start(c);
        c->begun = true;
        c->start_t = t;
        memcpy(c->start, c->x, size);
        memcpy(c->start_v, c->v, size);
        memcpy(c->start_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    }
    c->seconds += drape_clock_seconds() - start;
    return status;
}

void drape_contact_end(drape_contact *c)
{
    c->between_steps = true;
}
