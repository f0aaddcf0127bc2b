/* distant.c: see distant.h. */
#include "contact/distant.h"

#include "base/vec3.h"
#include "colliders/colliders.h"
#include "contact/clusters.h"

#include <math.h>

#define STALE   0.25 /* share of its gap by which a node may move before it is evaluated again */
#define CLUSTER DRAPE_CLUSTER_FACES /* nodes of one */

drape_status drape_distant_create(drape_arena *arena, const drape_model *model, const drape_path_bvh *faces,
                                  drape_distant *out)
{
    const size_t nodes = (size_t)model->node_count, count = (size_t)model->collider_count * nodes;
    *out = (drape_distant){.model = model,
                           .known = drape_arena_take(arena, count, sizeof *out->known),
                           .order = drape_arena_take(arena, nodes, sizeof *out->order),
                           .balls =
                               drape_arena_take(arena, (size_t)((model->node_count + CLUSTER - 1) / CLUSTER),
                                                sizeof *out->balls)};
    bool *listed = drape_arena_take(arena, nodes, sizeof *listed);
    if (drape_arena_status(arena))
        return drape_arena_status(arena);
    for (size_t i = 0; i < count; i++)
        out->known[i].gap = -INFINITY;
    /* Nodes in the order in which faces have them first, then those that no face has. */
    int32_t ordered = 0;
    for (int32_t f = 0; f < faces->count; f++)
        for (int a = 0; a < faces->nodes; a++) {
            const int32_t node = faces->node[(size_t)faces->order[f] * (size_t)faces->nodes + (size_t)a];
            if (!listed[node])
                out->order[ordered++] = node;
            listed[node] = true;
        }
    for (int32_t i = 0; i < model->node_count; i++)
        if (!listed[i])
            out->order[ordered++] = i;
    drape_arena_release(arena, listed);
    return DRAPE_OK;
}

/* ---- Clusters ---- */

void drape_distant_fit(drape_distant *distant, const double *x, const double *y)
{
    const double *const ends[2] = {x, y ? y : x};
    const int32_t nodes = distant->model->node_count;
    for (int32_t first = 0; first < nodes; first += CLUSTER) {
        drape_node_ball *ball = &distant->balls[first / CLUSTER];
        ball->radius = 0;
        for (int end = 0; end < 2; end++) {
            double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
            double half[3], sum = 0; /* not finite if a position is not: such a ball is not beyond anything */
            for (int32_t i = first; i < first + CLUSTER && i < nodes; i++)
                for (int k = 0; k < 3; k++) {
                    const double at = ends[end][3 * (size_t)distant->order[i] + (size_t)k];
                    low[k] = at < low[k] ? at : low[k];
                    high[k] = at > high[k] ? at : high[k];
                    sum += at;
                }
            for (int k = 0; k < 3; k++) {
                ball->centre[end][k] = 0.5 * (low[k] + high[k]);
                half[k] = 0.5 * (high[k] - low[k]);
            }
            const double radius = vec3_norm(half) + 0 * sum;
            ball->radius = radius > ball->radius || isnan(radius) ? radius : ball->radius;
        }
    }
}

/* Whether a ball that contains the balls of both ends, and so the paths of all nodes of the cluster, is
 * farther than the gap from a collider. */
static bool is_beyond(const drape_distant *d, const drape_node_ball *ball, int32_t collider,
                      const drape_collider_pose *const pose[2], double gap)
{
    const drape_collider *of = &d->model->colliders[collider];
    double own[2][3], middle[3], half[3];
    for (int end = 0; end < 2; end++)
        drape_pose_own(pose[end], ball->centre[end], own[end]);
    for (int k = 0; k < 3; k++) {
        middle[k] = 0.5 * (own[0][k] + own[1][k]);
        half[k] = 0.5 * (own[1][k] - own[0][k]);
    }
    const double reach = gap + ball->radius + vec3_norm(half) + d->rounding;
    return of->ops->distance(of->values, &of->shape, middle, NULL, NULL) > reach;
}

void drape_distant_mark(const drape_distant *distant, int32_t collider,
                        const drape_collider_pose *const pose[2], double gap, bool *marked)
{
    const drape_collider *of = &distant->model->colliders[collider];
    const bool rigid = of->ops->smooth && of->frames.frame_count == 0;
    const int32_t nodes = distant->model->node_count;
    for (int32_t first = 0; first < nodes; first += CLUSTER) {
        const bool beyond =
            rigid && is_beyond(distant, &distant->balls[first / CLUSTER], collider, pose, gap);
        for (int32_t i = first; i < first + CLUSTER && i < nodes; i++)
            marked[distant->order[i]] = !beyond;
    }
}

/* ---- Single nodes ---- */

void drape_distant_update(drape_distant *distant, const double *x, const drape_collider_pose *pose,
                          double rounding)
{
    const drape_model *m = distant->model;
    distant->rounding = rounding;
    for (int32_t k = 0; k < m->collider_count; k++) {
        const drape_collider *collider = &m->colliders[k];
        if (!collider->ops->smooth || collider->frames.frame_count > 0)
            continue;
        for (int32_t i = 0; i < m->free_count; i++) {
            const int32_t node = m->node_of_free[i];
            drape_known_gap *known = &distant->known[(size_t)k * (size_t)m->node_count + (size_t)node];
            double own[3];
            drape_pose_own(&pose[k], x + 3 * (size_t)node, own);
            if (drape_distant_keeps(distant, k, node, own, (1 - STALE) * known->gap))
                continue;
            const double gap = collider->ops->distance(collider->values, &collider->shape, own, NULL, NULL);
            *known = (drape_known_gap){.own = {own[0], own[1], own[2]}, .gap = gap - rounding};
        }
    }
}
