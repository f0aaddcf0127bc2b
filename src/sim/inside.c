/*
 * inside.c: see inside.h. Samples find triangles that lie in a collider, and exact intersections those that
 * only a tip or an edge of it pierces, which may be finer than any samples.
 */
#include "sim/inside.h"

#include "base/vec3.h"
#include "colliders/deformed.h"
#include "geometry/intersect.h"
#include "sim/sim.h"

#include <math.h>
#include <stdlib.h>

#define ACROSS 6 /* parts of a side: 28 points of a face are tested */

/* The cloth, the collider and their intersections. */
typedef struct search {
    const drape_model *model;
    const drape_collider *collider;
    const drape_collider_pose *pose;
    drape_surface cloth, obstacle;
    uint8_t *edge_crosses; /* (edge_count of the cloth) it passes through a triangle of the collider */
    int32_t *pierced;      /* (triangle_count of the cloth) number of edges of the collider through it */
    double *middle;        /* (triangle_count x 3) sum of the points where they pass through */
    drape_inside *found;
} search;

/* ---- Intersections ---- */

static void note_edge(void *user, int32_t edge, int32_t triangle)
{
    search *s = user;
    (void)triangle;
    if (drape_model_ignores(s->model, s->collider->index, s->cloth.edge[2 * (size_t)edge]))
        return;
    s->edge_crosses[edge] = 1;
    s->found->intersections++;
}

static void note_triangle(void *user, int32_t edge, int32_t triangle)
{
    search *s = user;
    const int32_t *ends = s->obstacle.edge + 2 * (size_t)edge,
                  *node = s->cloth.triangle + 3 * (size_t)triangle;
    if (drape_model_ignores(s->model, s->collider->index, node[0]))
        return;
    const double *p = s->obstacle.x + 3 * (size_t)ends[0], *q = s->obstacle.x + 3 * (size_t)ends[1],
                 *a = s->cloth.x + 3 * (size_t)node[0];
    double u[3], v[3], n[3], ap[3], aq[3];
    vec3_sub(s->cloth.x + 3 * (size_t)node[1], a, u);
    vec3_sub(s->cloth.x + 3 * (size_t)node[2], a, v);
    vec3_cross(u, v, n);
    vec3_sub(p, a, ap);
    vec3_sub(q, a, aq);
    const double above = fabs(vec3_dot(n, ap)), below = fabs(vec3_dot(n, aq));
    const double t = above + below > 0 ? above / (above + below) : 0.5;
    vec3_add_scaled(1 - t, p, s->middle + 3 * (size_t)triangle);
    vec3_add_scaled(t, q, s->middle + 3 * (size_t)triangle);
    s->pierced[triangle]++;
    s->found->intersections++;
}

static drape_status intersect(drape_arena *arena, search *s)
{
    const drape_collider_shape *shape = &s->collider->shape;
    const size_t points = (size_t)shape->point_count, triangles = (size_t)s->model->triangle_count;
    double *x = drape_arena_take(arena, points, 3 * sizeof *x);
    s->edge_crosses = drape_arena_take(arena, (size_t)s->model->edge_count, sizeof *s->edge_crosses);
    s->pierced = drape_arena_take(arena, triangles, sizeof *s->pierced);
    s->middle = drape_arena_take(arena, triangles, 3 * sizeof *s->middle);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < points; i++)
        drape_collider_point(s->collider, s->pose, (int32_t)i, x + 3 * i);
    s->obstacle = (drape_surface){.x = x,
                                  .edge = shape->segment,
                                  .triangle = shape->triangle,
                                  .edge_count = shape->segment_count,
                                  .triangle_count = shape->triangle_count};
    drape_status status = drape_intersect(arena->ctx, &s->cloth, &s->obstacle, note_edge, s);
    return status ? status : drape_intersect(arena->ctx, &s->obstacle, &s->cloth, note_triangle, s);
}

/* ---- Triangles ---- */

static bool is_pierced(const search *s, int32_t triangle)
{
    const int32_t *node = s->model->triangle + 3 * (size_t)triangle;
    if (s->found->intersections == 0)
        return false;
    bool crossed = s->pierced[triangle] > 0;
    for (int a = 0; a < 3 && !crossed; a++) {
        const int32_t edge =
            drape_edge_between(s->model->edge, s->model->edge_count, node[a], node[(a + 1) % 3]);
        crossed = edge >= 0 && s->edge_crosses[edge];
    }
    return crossed;
}

static double depth_at(const search *s, const double *point)
{
    return -drape_collider_distance(s->collider, s->pose, point, NULL, NULL);
}

/* Whether no point of a triangle is inside. A distance changes by no more than that from the centroid, and
 * rounding errors are far below DRAPE_PENETRATION_TOLERANCE: most triangles need one evaluation, not that
 * of all samples. */
static bool is_outside(const search *s, const int32_t *node)
{
    double centroid[3] = {0, 0, 0}, radius = 0;
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(1.0 / 3, s->cloth.x + 3 * (size_t)node[a], centroid);
    for (int a = 0; a < 3; a++) {
        double to[3];
        vec3_sub(s->cloth.x + 3 * (size_t)node[a], centroid, to);
        radius = fmax(radius, vec3_norm(to));
    }
    return depth_at(s, centroid) < -(1 + DRAPE_SAME) * radius - DRAPE_PENETRATION_TOLERANCE;
}

static double deepest_sample(const search *s, const int32_t *node)
{
    double deepest = 0;
    if (is_outside(s, node))
        return 0;
    for (int a = 0; a <= ACROSS; a++)
        for (int b = 0; a + b <= ACROSS; b++) {
            const double share[3] = {(double)(ACROSS - a - b) / ACROSS, (double)a / ACROSS,
                                     (double)b / ACROSS};
            double point[3] = {0, 0, 0};
            for (int k = 0; k < 3; k++)
                vec3_add_scaled(share[k], s->cloth.x + 3 * (size_t)node[k], point);
            deepest = fmax(deepest, depth_at(s, point));
        }
    return deepest;
}

/* Between the points where edges of the collider pass through a triangle, the triangle is inside. */
static double deepest_between(const search *s, int32_t triangle)
{
    double point[3] = {0, 0, 0};
    if (s->pierced[triangle] == 0)
        return 0;
    vec3_add_scaled(1.0 / s->pierced[triangle], s->middle + 3 * (size_t)triangle, point);
    return depth_at(s, point);
}

static search search_of(const drape_model *m, const drape_collider *collider, const drape_collider_pose *pose,
                        const double *x, drape_inside *found)
{
    *found = (drape_inside){.triangles = 0};
    return (search){
        .model = m, .collider = collider, .pose = pose, .cloth = drape_surface_of(m, x), .found = found};
}

drape_status drape_find_inside(drape_context *ctx, const drape_model *m, const drape_collider *collider,
                               const drape_collider_pose *pose, const double *x, drape_inside *found)
{
    drape_arena arena = drape_arena_of(ctx);
    search s = search_of(m, collider, pose, x, found);
    drape_status status = intersect(&arena, &s);
    for (int32_t f = 0; !status && f < m->triangle_count; f++) {
        status = drape_check_cancel_after(ctx, 28 * (100 + (size_t)collider->shape.triangle_count));
        if (status || drape_model_ignores(m, collider->index, m->triangle[3 * (size_t)f]))
            continue;
        const double depth = fmax(deepest_sample(&s, m->triangle + 3 * (size_t)f), deepest_between(&s, f));
        found->triangles += depth > DRAPE_PENETRATION_TOLERANCE || is_pierced(&s, f);
        found->deepest = fmax(found->deepest, depth);
    }
    drape_arena_free(&arena);
    return status;
}

drape_status drape_find_pierced(drape_context *ctx, const drape_model *m, const drape_collider *collider,
                                const drape_collider_pose *pose, const double *x, int32_t *pierced)
{
    drape_inside found;
    drape_arena arena = drape_arena_of(ctx);
    search s = search_of(m, collider, pose, x, &found);
    const drape_status status = intersect(&arena, &s);
    *pierced = 0;
    for (int32_t f = 0; !status && f < m->triangle_count; f++) {
        const int32_t *node = m->triangle + 3 * (size_t)f;
        const bool pinned = m->pinned[node[0]] || m->pinned[node[1]] || m->pinned[node[2]];
        *pierced += !pinned && is_pierced(&s, f);
    }
    drape_arena_free(&arena);
    return status;
}

/* ---- The present state ---- */

drape_status drape_sim_find_inside(const drape_sim *sim, int32_t collider, drape_inside *found)
{
    if (!sim || collider < 0 || collider >= sim->model->collider_count)
        return DRAPE_E_ARGUMENT;
    const double t = drape_sim_time(sim);
    const drape_motion *motion = drape_system_motion(sim->system);
    const drape_collider *body;
    drape_collider_pose pose;
    drape_arena arena = drape_arena_of(sim->ctx);
    drape_motion_pose(motion, collider, t, t, &pose);
    drape_status status = drape_deformed_at(&arena, sim->model, motion, collider, t, &body);
    if (!status)
        status = drape_find_inside(sim->ctx, sim->model, body, &pose, drape_sim_positions(sim), found);
    drape_arena_free(&arena);
    return status;
}

int32_t drape_sim_inside(const drape_sim *sim, int32_t collider, double *deepest)
{
    drape_inside found;
    if (drape_sim_find_inside(sim, collider, &found))
        return -1;
    if (deepest)
        *deepest = found.deepest;
    return found.triangles;
}

int64_t drape_sim_intersections(const drape_sim *sim, int32_t collider)
{
    drape_intersections cloth;
    drape_inside found;
    if (collider != -1)
        return drape_sim_find_inside(sim, collider, &found) ? -1 : found.intersections;
    if (!sim)
        return -1;
    return drape_find_intersections(sim->ctx, sim->model, drape_sim_positions(sim), &cloth) ? -1
                                                                                            : cloth.count;
}
