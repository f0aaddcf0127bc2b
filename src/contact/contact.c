/*
 * contact.c: see contact.h. The path of a pair of pieces to the Jacobian:
 *
 *     broad_phase.c  pairs that no axis separates on a path, searched in trees of boxes (geometry/path_bvh.h)
 *     candidates.c   those that can become active near the path; where some points have left it, a patch
 *     pair.c         cheap lower bounds of a gap, which reject most neighbours, and the narrow phase: closest
 *                    points, gap, normal and weights of a candidate, evaluated once
 *     active.c       the active set: candidates whose gap is below the activation distance, equal ones merged
 *     force.c        energy, gradient and Hessian of an active contact, by the barrier (barrier.h)
 *     restitution.c  the dissipative part of its normal force
 *     friction.c     its friction, with the normal force of now or, lagged, of the beginning of the step
 *     exempt.h       the pairs that are not held, said from outside
 *     jacobian.c     dg/dx + w dg/dv of the active set, block by block into the pattern
 *
 * This file has the two configurations that these work on: the beginning of a step, and the one at which
 * contact is evaluated.
 */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/elementary.h"
#include "base/list.h"
#include "base/vec3.h"
#include "geometry/mesh_distance.h"

#include <float.h>
#include <string.h>

#define MARGIN 0.06 /* by which points may leave the path of a search before a new one, in mean edges */
/* The stiffness is raised when the smallest gap is small and has shrunk since the last raise, and in every
 * attempt that begins where it can hardly shrink any more. It falls when the gap is large again. Gaps in
 * activation distances. */
#define PRESSED    0.05
#define RELAXED    0.3
#define RAISE      2.0 /* and by how much a gap shrinks before the next */
#define HALVED     0.2 /* [s] */
#define MAX_FACTOR 1e4
#define GROWTH     0.5 /* activation distance of a moving collider, in its path in a nominal step */

/* Colliders that deform have bodies of their own. */
static drape_status take_bodies(drape_arena *arena, drape_contact *c)
{
    const size_t colliders = (size_t)c->model->collider_count;
    c->deformed = drape_arena_take(arena, colliders, sizeof *c->deformed);
    c->body = drape_arena_take(arena, colliders, sizeof *c->body);
    c->body_t = drape_arena_take(arena, colliders, sizeof *c->body_t);
    drape_status status = drape_arena_status(arena);
    for (size_t i = 0; !status && i < colliders; i++) {
        if (c->model->colliders[i].frames.frame_count == 0)
            continue;
        status = drape_deformed_create(arena, &c->model->colliders[i], &c->deformed[i]);
        c->body[i] = status ? NULL : &c->deformed[i]->collider;
    }
    if (!status)
        drape_contact_forget_bodies(c);
    return status;
}

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
                         .mean_edge = drape_model_mean_edge(model)};
    c->active.arena = c->inside.arena = arena;
    c->press = (drape_press){.factor = 1, .widest = 1};
    drape_status status = drape_broad_phase_create(arena, model, &c->broad);
    if (!status)
        status = drape_candidates_create(arena, &c->broad, MARGIN * c->mean_edge, &c->step_candidates);
    if (!status)
        status = drape_candidates_create(arena, &c->broad, MARGIN * c->mean_edge, &c->query_candidates);
    if (!status) {
        const size_t points = (size_t)c->broad.points, colliders = (size_t)c->model->collider_count;
        double **const positions[] = {&c->x, &c->v, &c->from, &c->to, &c->start, &c->start_v};
        drape_collider_pose **const poses[] = {&c->pose, &c->start_pose, &c->path_pose, &c->kink_pose};
        for (size_t i = 0; i < sizeof positions / sizeof *positions; i++)
            *positions[i] = drape_arena_take(arena, points, 3 * sizeof(double));
        for (size_t i = 0; i < sizeof poses / sizeof *poses; i++)
            *poses[i] = drape_arena_take(arena, colliders, sizeof **poses[i]);
        c->start_least = drape_arena_take(arena, colliders, sizeof *c->start_least);
        c->distance_before = drape_arena_take(arena, colliders, sizeof *c->distance_before);
        c->on_collider = drape_arena_take(arena, colliders, sizeof *c->on_collider);
        size_t largest = 0;
        for (size_t i = 0; i < colliders; i++)
            if (c->model->colliders[i].frames.frame_count > 0 &&
                (size_t)c->model->colliders[i].shape.point_count > largest)
                largest = (size_t)c->model->colliders[i].shape.point_count;
        c->own = drape_arena_take(arena, largest, 3 * sizeof *c->own);
        c->own_end = drape_arena_take(arena, largest, 3 * sizeof *c->own_end);
        c->on_point = drape_arena_take(arena, largest > 0 ? points - (size_t)c->model->node_count : 0,
                                       3 * sizeof *c->on_point);
        c->swing = drape_arena_take(arena, colliders, sizeof *c->swing);
        c->before = drape_arena_take(arena, (size_t)c->model->node_count, sizeof *c->before);
        c->moved = drape_arena_take(arena, points + colliders, sizeof *c->moved);
        c->carried = drape_arena_take(arena, (size_t)c->model->node_count, sizeof *c->carried);
        status = drape_arena_status(arena);
    }
    if (!status)
        status = take_bodies(arena, c);
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

/* ---- The configuration ---- */

/* A collider that only shifts along a track has the same velocity on a whole piece of it. */
static void pose_at(const drape_contact *c, int32_t collider, const drape_contact_at *at,
                    drape_collider_pose *pose)
{
    const bool instant = at->instant && drape_motion_turns_collider(c->motion, collider);
    if (instant)
        drape_motion_pose(c->motion, collider, at->t, (at->span[0] + at->span[1]) / 2, pose);
    else
        drape_motion_mean_pose(c->motion, collider, at->t, at->span, pose);
}

void drape_contact_poses(const drape_contact *c, double t, drape_collider_pose *pose)
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        pose_at(c, i, &(drape_contact_at){.t = t, .span = {t, t}}, &pose[i]);
}

void drape_contact_fill(const drape_contact *c, const double *nodes, const drape_collider_pose *pose,
                        double *x)
{
    const drape_model *m = c->model;
    memmove(x, nodes, 3 * (size_t)m->node_count * sizeof *x);
    x += 3 * (size_t)m->node_count;
    for (int32_t i = 0; i < m->collider_count; i++) {
        const double *own = m->colliders[i].shape.point;
        if (m->colliders[i].frames.frame_count > 0) {
            drape_motion_points(c->motion, i, pose[i].t, c->own);
            own = c->own;
        }
        for (int32_t p = 0; p < m->colliders[i].shape.point_count; p++, x += 3)
            drape_pose_point(&pose[i], own + 3 * (size_t)p, x);
    }
}

/* The velocities of the points of a collider that deforms: mean ones in space over the span, or those of the
 * time of its pose. */
static void fill_deforming(const drape_contact *c, int32_t collider, const drape_contact_at *at, double *v)
{
    const size_t points = (size_t)c->model->colliders[collider].shape.point_count;
    const drape_collider_pose *pose = &c->pose[collider];
    if (at->instant) {
        drape_motion_points(c->motion, collider, at->t, c->own);
        drape_motion_point_velocities(c->motion, collider, at->t, (at->span[0] + at->span[1]) / 2,
                                      c->own_end);
        for (size_t p = 0; p < points; p++)
            drape_pose_point_velocity(pose, c->own + 3 * p, c->own_end + 3 * p, v + 3 * p);
        return;
    }
    const double h = at->span[1] - at->span[0];
    drape_collider_pose from, to;
    memset(v, 0, 3 * points * sizeof *v);
    if (!(h > 0))
        return;
    drape_motion_pose(c->motion, collider, at->span[0], at->span[0], &from);
    drape_motion_pose(c->motion, collider, at->span[1], at->span[1], &to);
    drape_motion_points(c->motion, collider, at->span[0], c->own);
    drape_motion_points(c->motion, collider, at->span[1], c->own_end);
    for (size_t p = 0; p < points; p++) {
        double a[3], b[3];
        drape_pose_point(&from, c->own + 3 * p, a);
        drape_pose_point(&to, c->own_end + 3 * p, b);
        for (size_t k = 0; k < 3; k++)
            v[3 * p + k] = (b[k] - a[k]) / h;
    }
}

static void fill_velocities(const drape_contact *c, const drape_contact_at *at, double *v)
{
    const drape_model *m = c->model;
    if (at->v)
        memcpy(v, at->v, 3 * (size_t)m->node_count * sizeof *v);
    else
        memset(v, 0, 3 * (size_t)m->node_count * sizeof *v);
    v += 3 * (size_t)m->node_count;
    for (int32_t i = 0; i < m->collider_count; i++) {
        const int32_t points = m->colliders[i].shape.point_count;
        const bool deforms = drape_motion_deforms(c->motion, i);
        if (deforms)
            fill_deforming(c, i, at, v);
        for (int32_t p = 0; !deforms && p < points; p++)
            drape_collider_point_velocity(&m->colliders[i], &c->pose[i], p, v + 3 * (size_t)p);
        v += 3 * (size_t)points;
    }
}

const drape_collider *const *drape_contact_fit_bodies(const drape_contact *c, const drape_collider_pose *pose)
{
    for (int32_t i = 0; i < c->model->collider_count; i++) {
        if (!c->deformed[i] || c->body_t[i] == pose[i].t)
            continue;
        drape_motion_points(c->motion, i, pose[i].t, c->own);
        drape_deformed_move(c->deformed[i], c->own);
        c->body_t[i] = pose[i].t;
    }
    return c->body;
}

void drape_contact_forget_bodies(drape_contact *c)
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        c->body_t[i] = NAN;
}

void drape_contact_nearest_triangle(const drape_contact *c, int32_t collider, const drape_collider_pose *pose,
                                    const double x[3], int32_t node[3], double weight[3])
{
    const drape_deformed *deformed = c->deformed[collider];
    double own[3];
    int32_t triangle;
    drape_pose_own(pose, x, own);
    drape_mesh_distance_nearest(deformed->distance, &deformed->collider.shape, own, &triangle, weight);
    for (int k = 0; k < 3; k++)
        node[k] = c->broad.first_point[collider] +
                  deformed->collider.shape.triangle[3 * (size_t)triangle + (size_t)k];
}

/* ---- Candidates and active set ---- */

static bool are_valid(const drape_candidates *candidates, const drape_straight_path *path,
                      drape_distances *away)
{
    *away = drape_candidates_distances(candidates, path);
    return drape_candidates_farthest(candidates, away) <= candidates->margin;
}

const drape_candidates *drape_contact_valid_candidates(const drape_contact *c,
                                                       const drape_straight_path *path, drape_distances *away)
{
    if (are_valid(&c->step_candidates, path, away))
        return &c->step_candidates;
    return c->between_steps && are_valid(&c->query_candidates, path, away) ? &c->query_candidates : NULL;
}

const drape_candidates *drape_contact_search(drape_contact *c, const drape_straight_path *path,
                                             drape_distances *away)
{
    const double start = drape_clock_seconds();
    drape_candidates *candidates = c->between_steps ? &c->query_candidates : &c->step_candidates;
    const drape_status status = drape_candidates_search(candidates, path);
    if (!are_valid(candidates, path, away)) /* positions that are not finite */
        for (int i = 0; i < DRAPE_CANDIDATE_SETS; i++)
            away->set[i] = INFINITY;
    c->search_seconds += drape_clock_seconds() - start;
    c->out_of_memory = c->out_of_memory || status != DRAPE_OK;
    return status ? NULL : candidates;
}

drape_status drape_contact_take_failure(drape_contact *c)
{
    const bool failed = c->out_of_memory;
    c->out_of_memory = false;
    return failed ? DRAPE_E_MEMORY : DRAPE_OK;
}

/* Whether all points are so near to where the step began that candidates can be searched from there. */
static bool is_near_start(const drape_contact *c, const double *x)
{
    const double longest = DRAPE_LONGEST_SEARCH * c->mean_edge;
    double move[3];
    for (size_t i = 0; i < (size_t)c->broad.points; i++) {
        vec3_sub(x + 3 * i, c->start + 3 * i, move);
        if (!(vec3_dot(move, move) <= longest * longest))
            return false;
    }
    return true;
}

drape_status drape_contact_list(drape_contact *c, const drape_configuration *at)
{
    const drape_straight_path here = {{*at, *at}};
    const bool in_step = c->begun && !c->between_steps;
    drape_distances away;
    const drape_candidates *candidates = drape_contact_valid_candidates(c, &here, &away);
    if (!candidates) {
        /* In a step all pairs are searched from its beginning on, or that of the step before, since that will
         * be looked at, too. */
        drape_straight_path path = here;
        if (in_step && !drape_candidates_patch_serves(&c->step_candidates, &here) && is_near_start(c, at->x))
            path.end[0] = (drape_configuration){.model = c->model, .x = c->start, .pose = c->start_pose};
        candidates = drape_contact_search(c, &path, &away);
    }
    if (!candidates)
        return drape_contact_take_failure(c);
    drape_status status =
        drape_active_set_list(&c->active, candidates, &away, at, &c->inside, !in_step, c->exempt);
    if (!status && c->exempt)
        status = c->exempt->add(c, at);
    if (!status)
        status = drape_predictions_reserve(&c->predicted, c->active.capacity);
    return status ? status : drape_predictions_reserve(&c->predicting, c->active.capacity);
}

drape_status drape_contact_update(drape_contact *c, const drape_contact_at *at)
{
    bool moved = false;
    for (int32_t i = 0; i < c->model->collider_count; i++) {
        const drape_collider_pose before = c->pose[i];
        pose_at(c, i, at, &c->pose[i]);
        moved = moved || drape_pose_differs(&c->pose[i], &before) ||
                (before.t != c->pose[i].t && drape_motion_deforms(c->motion, i));
    }
    fill_velocities(c, at, c->v);
    if (drape_contact_take_failure(c)) {
        c->listed = false;
        return DRAPE_E_MEMORY;
    }
    if (c->listed && !moved && memcmp(at->x, c->x, 3 * (size_t)c->model->node_count * sizeof *c->x) == 0)
        return DRAPE_OK; /* forces, energy and derivatives are often evaluated at the same point */
    drape_contact_fill(c, at->x, c->pose, c->x);
    const drape_configuration now = drape_contact_configuration(c);
    const drape_status status = drape_contact_list(c, &now);
    c->listed = status == DRAPE_OK;
    return status;
}

drape_status drape_contact_evaluate_at(drape_contact *c, const drape_contact_at *at)
{
    const double start = drape_clock_seconds();
    const drape_status status = drape_contact_update(c, at);
    c->seconds += drape_clock_seconds() - start;
    return status;
}

int32_t drape_contact_active(const drape_contact *c, double *least_gap)
{
    *least_gap = INFINITY;
    for (int32_t i = 0; i < c->active.count; i++)
        *least_gap = fmin(*least_gap, c->active.contacts[i].gap.value);
    return c->active.count;
}

/* ---- The beginning and the end of a step ---- */

drape_status drape_contact_lag(drape_contact *c)
{
    double v[4][3];
    c->lagged_count = 0;
    if (!c->model->contact.lagged)
        return DRAPE_OK;
    for (int32_t i = 0; i < c->active.count; i++) {
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

void drape_contact_set_rounding(drape_contact *c, const double *x)
{
    double largest = 0;
    int exponent; /* by powers of two, so that the least gaps of moving scenes do not change in every step */
    for (size_t i = 0; i < 3 * (size_t)c->broad.points; i++)
        largest = fmax(largest, fabs(x[i]));
    largest = drape_ranks_largest(c->ranks, largest);
    frexp(largest, &exponent);
    c->broad.rounding = DRAPE_CLOSEST_ROUNDING * (largest > 0 ? ldexp(1, exponent) : 0);
}

/* Which pairs are inside. A pair that was added has another law, and so are its contacts. */
static drape_status update_inside(drape_contact *c)
{
    drape_status status = DRAPE_OK;
    const bool added =
        drape_inside_update(&c->inside, c->active.near, c->active.near_count, c->broad.rounding, &status);
    const drape_configuration now = drape_contact_configuration(c);
    return added ? drape_contact_list(c, &now) : status;
}

/* Makes contact stiffer where gaps shrink, and softer again. */
static void adapt_stiffness(drape_contact *c, double t, bool retry)
{
    drape_press *press = &c->press;
    double least = 1;
    bool last = false; /* some gap would be at its least before the next raise */
    for (int32_t i = 0; i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        if (contact->gentle || contact->exempt > 0)
            continue;
        least = fmin(least, contact->gap.value / contact->pair.distance);
        last = last || contact->gap.value < RAISE * drape_pair_least_gap(&contact->pair, c->broad.rounding);
    }
    last = drape_ranks_any(c->ranks, last);
    const double gap = drape_ranks_least(c->ranks, least), before = press->factor;
    if (retry && !last)
        return;
    press->widest = fmax(press->widest, gap);
    if (last || (gap < PRESSED && RAISE * gap < press->widest)) {
        press->factor = fmin(RAISE * before, MAX_FACTOR);
        press->widest = gap;
    } else if (gap > RELAXED) {
        press->factor = fmax(before * drape_pow(0.5, (t - press->t) / HALVED), 1);
    }
    press->t = t;
}

double drape_contact_take_work(drape_contact *c)
{
    const double work = c->press.work;
    c->press.work = 0;
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

/* How far something moves: by itself or relative to a displacement `mean`, whichever is less. What rests is
 * not fast where cloth falls, nor what moves along with the cloth. */
static double lesser_path(const double from[3], const double to[3], const double mean[3])
{
    double own[3], relative[3];
    vec3_sub(to, from, own);
    vec3_sub(own, mean, relative);
    return fmin(vec3_norm(own), vec3_norm(relative));
}

/* How far a collider moves in a nominal step from time t on, or relative to the mean motion of the cloth. */
static double path_of(const drape_contact *c, int32_t collider, double t)
{
    const size_t nodes = (size_t)c->model->node_count;
    double from[3], to[3], mean[3] = {0};
    const bool deforms = drape_motion_deforms(c->motion, collider);
    if (!deforms && !drape_motion_shifts_collider(c->motion, collider))
        return turning_path_of(c, collider, t);
    drape_motion_collider(c->motion, collider, t, from);
    drape_motion_collider(c->motion, collider, t + c->dt, to);
    for (size_t i = 0; i < 3 * nodes; i++)
        mean[i % 3] += drape_model_owns(c->model, (int32_t)(i / 3)) ? c->v[i] : 0;
    if (c->ranks)
        c->ranks->sum(c->ranks, mean, 3);
    for (size_t k = 0; k < 3; k++)
        mean[k] *= c->dt / (double)drape_model_node_count(c->model);
    if (deforms) {
        /* How far the points of a collider that deforms move at most, as lesser_path. */
        drape_collider_pose before, after;
        double largest = 0;
        drape_motion_pose(c->motion, collider, t, t, &before);
        drape_motion_pose(c->motion, collider, t + c->dt, t + c->dt, &after);
        drape_motion_points(c->motion, collider, t, c->own);
        drape_motion_points(c->motion, collider, t + c->dt, c->own_end);
        for (size_t p = 0; p < (size_t)c->model->colliders[collider].shape.point_count; p++) {
            double a[3], b[3];
            drape_pose_point(&before, c->own + 3 * p, a);
            drape_pose_point(&after, c->own_end + 3 * p, b);
            largest = fmax(largest, lesser_path(a, b, mean));
        }
        return largest;
    }
    return lesser_path(from, to, mean) + turning_path_of(c, collider, t);
}

/* Sets the activation distance of a collider. */
static void set_distance(drape_contact *c, int32_t collider, double distance)
{
    c->broad.distance[collider] = distance;
    drape_candidates_forget_collider(&c->step_candidates, collider);
    drape_candidates_forget_collider(&c->query_candidates, collider);
}

static bool is_active(const drape_contact *c, int32_t collider)
{
    bool found = false;
    for (int32_t i = 0; i < c->active.count && !found; i++)
        found = c->active.contacts[i].pair.collider == collider;
    return drape_ranks_any(c->ranks, found);
}

/* The distances that were widened beyond twice what they were go back to that where cloth is near already.
 * Returns whether there are any. */
static bool narrow_distances(drape_contact *c)
{
    bool any = false;
    for (int32_t i = 0; i < c->model->collider_count; i++) {
        if (!(c->broad.distance[i] > 2 * c->distance_before[i]) || !is_active(c, i))
            continue;
        set_distance(c, i, 2 * c->distance_before[i]);
        any = true;
    }
    return any;
}

/* Contact with a fast collider over a distance that it crosses in a small part of a step is hard to solve: in
 * a step it accelerates the cloth all at once. So the activation distance grows to a share of the path of a
 * step, and falls again to that of the scene when the collider rests. It changes by powers of two, because
 * each change needs a search, and where cloth is near by one a step, because it changes the contact energy. A
 * body that has just begun to move, or that comes out of nothing at the start of a run, has the whole
 * distance before it reaches the cloth. */
static drape_status adapt_distances(drape_contact *c, double t, bool retry)
{
    const drape_configuration now = drape_contact_configuration(c);
    bool changed = false;
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
    if (!changed)
        return DRAPE_OK;
    drape_status status = drape_contact_list(c, &now);
    if (!status && narrow_distances(c))
        status = drape_contact_list(c, &now);
    return status;
}

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

/* Colliders have their velocities of time t here, because the size of the step is not known yet. */
static drape_status lag_at(drape_contact *c, const double *v, double t)
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        drape_motion_pose(c->motion, i, t, t, &c->pose[i]);
    fill_velocities(c, &(drape_contact_at){.v = v, .t = t, .span = {t, t}, .instant = true}, c->v);
    return drape_contact_lag(c);
}

bool drape_contact_exempts(const drape_contact *c)
{
    return c->exempt && c->exempt->count > 0;
}

/* A rank that alone is out of memory must not leave the others waiting. */
static drape_status agree(const drape_contact *c, drape_status status)
{
    return drape_ranks_agree(c->ranks, c->model->ctx, status);
}

/* What changes between steps are the laws of contacts: which cloth is exempt and how hard it is pushed,
 * activation distances, which pairs are inside, the stiffness. What that adds to the energy of the present
 * contacts, or takes from it, is the work of whoever presses. That energy is the one between steps, in which
 * cloth that was placed into a body is not a barrier that has been passed. */
drape_status drape_contact_begin(drape_contact *c, const double *x, const double *v, double t)
{
    const double start = drape_clock_seconds();
    const drape_contact_at at = {.x = x, .v = v, .t = t, .span = {t, t}};
    c->between_steps = c->begun && !drape_contact_has_begun(c, x, t);
    drape_status status = agree(c, drape_contact_update(c, &at));
    const double before = status ? 0 : drape_contact_potential(c);
    c->between_steps = false;
    if (!status)
        status = c->exempt ? c->exempt->begin(c, &at) : DRAPE_OK;
    c->refused = false;
    drape_contact_set_rounding(c, c->x);
    drape_distant_update(&c->broad.distant, c->x, c->pose, c->broad.rounding);
    /* A step that is tried again begins where it did. */
    const bool same = c->begun && memcmp(c->start, c->x, 3 * (size_t)c->broad.points * sizeof *c->x) == 0;
    const bool retry = drape_ranks_all(c->ranks, same);
    if (!status)
        status = agree(c, adapt_distances(c, t, retry));
    if (!status)
        status = agree(c, update_inside(c));
    if (!status) {
        adapt_stiffness(c, t, retry);
        c->press.work += drape_contact_potential(c) - before;
        status = agree(c, lag_at(c, v, t));
    }
    drape_predictions_clear(&c->predicted);
    if (!status) {
        drape_contact_measure_start(c);
        c->begun = true;
        c->start_t = t;
        memcpy(c->start, c->x, 3 * (size_t)c->broad.points * sizeof *c->x);
        memcpy(c->start_v, c->v, 3 * (size_t)c->broad.points * sizeof *c->v);
        memcpy(c->start_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    }
    c->seconds += drape_clock_seconds() - start;
    return status;
}

void drape_contact_end(drape_contact *c)
{
    c->between_steps = true;
}
