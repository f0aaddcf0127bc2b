/* check.c: checks whether the end of a step is allowed: penetration and collisions. See contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "contact/depth.h"

#include <string.h>

#define TOUCH       1e-9  /* [m] a piece may be this deep in a collider */
#define MAX_MARCHES 10000 /* maximum number of steps of a node along its path */

static drape_diagnostic diagnostic_of(const drape_contact *c, const drape_pair *pair, const char *what,
                                      double value, double limit)
{
    const bool collider = pair->collider >= 0;
    drape_diagnostic found = {.what = what,
                              .term = collider ? c->model->colliders[pair->collider].name : "self_contact",
                              .element = collider ? pair->collider : 0,
                              .node = {-1, -1, -1, -1},
                              .value = value,
                              .limit = limit};
    int count = 0;
    for (int a = 0; a < 4; a++)
        if (pair->node[a] >= 0 && pair->node[a] < c->model->node_count)
            found.node[count++] = pair->node[a];
    found.cloth = drape_model_cloth_of(c->model, found.node[0]);
    return found;
}

/* Finds the active contact whose penetration exceeds its limit most; the penetration before the step is
 * allowed. */
static drape_status check_depth(drape_contact *c, const char **reason, drape_diagnostic *diagnostic)
{
    double excess = 0;
    for (int32_t i = 0; i < c->active.count; i++) {
        const drape_pair *pair = &c->active.contacts[i].pair;
        const drape_gap *gap = &c->active.contacts[i].gap;
        if (pair->collider < 0)
            continue;
        const double before = gap->closest.points == 1 ? c->start_gaps[pair->node[0]] : c->start_least;
        const double min_gap = fmin(before, -TOUCH);
        if (gap->value >= min_gap || min_gap - gap->value < excess)
            continue;
        excess = min_gap - gap->value;
        *diagnostic = diagnostic_of(c, pair, "gap [m]", gap->value, min_gap);
    }
    *reason = excess > 0 ? drape_reason_name(DRAPE_REASON_PENETRATION) : *reason;
    return excess > 0 ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

/* Whether a node passes through the surface on its straight path although both ends are outside, by steps
 * of the length of the distance, with which no path can cross the surface. x, y: in the collider's own
 * coordinates. */
static bool dips(const drape_collider *collider, const double *x, const double *y)
{
    double p[3], at[3], t = 0,
                        before = collider->ops->distance(collider->values, &collider->shape, x, NULL, NULL),
                        after = collider->ops->distance(collider->values, &collider->shape, y, NULL, NULL);
    vec3_sub(y, x, p);
    const double length = vec3_norm(p);
    if (before <= 0 || after <= 0 || length < before + after)
        return false;
    for (int i = 0; i < MAX_MARCHES && t < 1; i++) {
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        double gap = collider->ops->distance(collider->values, &collider->shape, at, NULL, NULL);
        if (gap < -TOUCH)
            return true;
        t += fmax(gap, TOUCH) / length;
    }
    return false;
}

static drape_status check_surfaces(drape_contact *c, const char **reason, drape_diagnostic *diagnostic)
{
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        if (!c->model->colliders[k].ops->smooth)
            continue;
        for (int32_t i = 0; i < c->model->free_count; i++) {
            const int32_t node = c->model->node_of_free[i];
            double x[3], y[3];
            vec3_sub(c->start + 3 * (size_t)node, c->start_pose[k].displacement, x);
            vec3_sub(c->x + 3 * (size_t)node, c->pose[k].displacement, y);
            if (!dips(&c->model->colliders[k], x, y))
                continue;
            const drape_pair pair = drape_broad_phase_surface(&c->broad, node, k);
            *reason = drape_reason_name(DRAPE_REASON_COLLISION);
            *diagnostic = diagnostic_of(c, &pair, "node through collider", 1, 0);
            return DRAPE_RETRY_REJECTED;
        }
    }
    return DRAPE_OK;
}

/* The smallest distance of an edge (two nodes) or a face (three) of cloth; `enough` as in depth.h. */
static double depth_of(const drape_collider *collider, const drape_collider_pose *pose, const double *x,
                       const int32_t *node, int nodes, double enough)
{
    const double *corner[3];
    for (int a = 0; a < nodes; a++)
        corner[a] = x + 3 * (size_t)node[a];
    return nodes == 2 ? drape_depth_edge(collider, pose, corner[0], corner[1], enough)
                      : drape_depth_face(collider, pose, corner, enough);
}

/* Checks edges or faces of cloth against the curved surfaces of shapes whose features lie inside these
 * surfaces (inscribed). A piece may be as deep as it was before. */
static drape_status check_inscribed(drape_contact *c, const int32_t *node, int nodes, int32_t count,
                                    const char **reason, drape_diagnostic *diagnostic)
{
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        const drape_collider *collider = &c->model->colliders[k];
        for (int32_t i = 0; collider->shape.inscribed && i < count; i++) {
            const int32_t *n = node + (size_t)i * (size_t)nodes;
            const double depth = depth_of(collider, &c->pose[k], c->x, n, nodes, -TOUCH);
            if (depth >= -TOUCH)
                continue;
            const double before = depth_of(collider, &c->start_pose[k], c->start, n, nodes, INFINITY);
            const double min_gap = fmin(before, -TOUCH);
            if (depth >= min_gap)
                continue;
            const drape_pair pair = {.collider = k, .node = {n[0], n[1], nodes > 2 ? n[2] : -1, -1}};
            *reason = drape_reason_name(DRAPE_REASON_PENETRATION);
            *diagnostic = diagnostic_of(c, &pair, "gap [m]", depth, min_gap);
            return DRAPE_RETRY_REJECTED;
        }
    }
    return DRAPE_OK;
}

static drape_status check_path(drape_contact *c, const char **reason, drape_diagnostic *diagnostic)
{
    drape_pair limiting;
    const double fraction =
        drape_contact_free_fraction(c, c->start, c->x, c->pose, DRAPE_KEEP_STEP, true, &limiting);
    if (fraction >= 1)
        return DRAPE_OK;
    *reason = drape_reason_name(DRAPE_REASON_COLLISION);
    *diagnostic = diagnostic_of(c, &limiting, "fraction of the step before passing through", fraction, 1);
    return DRAPE_RETRY_REJECTED;
}

drape_status drape_contact_check(drape_contact *c, const double *x, double t, const char **reason,
                                 drape_diagnostic *diagnostic)
{
    const double start = drape_clock_seconds();
    drape_status status = drape_contact_update(c, &(drape_contact_at){.x = x, .t = t, .span = {t, t}});
    if (!status)
        status = check_depth(c, reason, diagnostic);
    if (!status)
        status = check_surfaces(c, reason, diagnostic);
    if (!status)
        status = check_inscribed(c, c->model->edge, 2, c->model->edge_count, reason, diagnostic);
    if (!status)
        status = check_inscribed(c, c->model->triangle, 3, c->model->triangle_count, reason, diagnostic);
    if (!status)
        status = check_path(c, reason, diagnostic);
    if (!status)
        status = drape_contact_take_failure(c);
    c->seconds += drape_clock_seconds() - start;
    return status;
}
