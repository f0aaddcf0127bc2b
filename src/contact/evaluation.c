/* evaluation.c: the points at which contact is evaluated, and the candidates and active set there. See
 * contact.h. */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/vec3.h"

#include <string.h>

/* ---- Points and poses ---- */

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

void drape_contact_set_instant(drape_contact *c, const double *v, double t)
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        drape_motion_pose(c->motion, i, t, t, &c->pose[i]);
    fill_velocities(c, &(drape_contact_at){.v = v, .t = t, .span = {t, t}, .instant = true}, c->v);
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
    if (!are_valid(candidates, path, away)) /* if positions are not finite */
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

/* Whether no point is so far from the beginning of the step that a path from there has too many
 * candidates. */
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
        /* In a step the search covers the path from c->start, where this step begins, because the check at
         * its end needs the pairs on that path. */
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
