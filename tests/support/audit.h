/*
 * audit.h: checks of a run with contact, at states that the run itself did not check: how deep nodes, and
 * points of faces and edges between them, lie in colliders, and how many edges pass through triangles, at
 * the ends of accepted steps and at frames, which may lie between steps.
 */
#ifndef DRAPE_TESTS_AUDIT_H
#define DRAPE_TESTS_AUDIT_H

#include <math.h>

#include "colliders/deformed.h"
#include "geometry/intersect.h"
#include "sim/sim.h"

#define AUDIT_COLLIDERS 16
#define AUDIT_CUTS      6 /* intervals along a side: a face is sampled at 28 points, with its corners */

/* The largest values over all states of one kind. */
typedef struct audit_worst {
    double node, face;     /* [m] deepest node, deepest of all samples; negative: the smallest gap */
    int64_t intersections; /* the largest number in one state */
    double node_at, face_at, intersections_at; /* [s] their times */
    int64_t states;
} audit_worst;

typedef struct audit {
    drape_context *ctx;
    const drape_model *model;
    bool self;                                   /* find edges that pass through triangles */
    bool faces;                                  /* also sample faces between the nodes */
    const drape_collider *body[AUDIT_COLLIDERS]; /* as they are at the time of a state */
    audit_worst steps, frames;
} audit;

static inline audit audit_of(drape_context *ctx, const drape_model *model, bool self, bool faces)
{
    const audit_worst none = {.node = -INFINITY, .face = -INFINITY};
    return (audit){.ctx = ctx, .model = model, .self = self, .faces = faces, .steps = none, .frames = none};
}

static inline double audit_depth(const audit *a, const double *p, double t)
{
    double deepest = -INFINITY;
    for (int32_t k = 0; k < a->model->collider_count; k++) {
        const drape_collider_pose pose = drape_collider_pose_at(&a->model->colliders[k], t);
        deepest = fmax(deepest, -drape_collider_distance(a->body[k], &pose, p, NULL, NULL));
    }
    return deepest;
}

static inline void audit_faces(const audit *a, const double *x, double t, audit_worst *worst)
{
    for (int32_t f = 0; f < a->model->triangle_count; f++) {
        const int32_t *node = a->model->triangle + 3 * (size_t)f;
        for (int i = 0; i <= AUDIT_CUTS; i++)
            for (int j = 0; i + j <= AUDIT_CUTS; j++) {
                double p[3], u = (double)i / AUDIT_CUTS, v = (double)j / AUDIT_CUTS;
                for (int k = 0; k < 3; k++)
                    p[k] = (1 - u - v) * x[3 * node[0] + k] + u * x[3 * node[1] + k] + v * x[3 * node[2] + k];
                double depth = audit_depth(a, p, t);
                if (depth > worst->face) {
                    worst->face = depth;
                    worst->face_at = t;
                }
            }
    }
}

/* x: positions at time t. */
static inline drape_status audit_state(audit *a, const double *x, double t, audit_worst *worst)
{
    drape_arena arena = drape_arena_of(a->ctx);
    drape_status made = a->model->collider_count <= AUDIT_COLLIDERS ? DRAPE_OK : DRAPE_E_ARGUMENT;
    for (int32_t k = 0; !made && k < a->model->collider_count; k++)
        made = drape_deformed_at(&arena, a->model, NULL, k, t, &a->body[k]);
    if (made) {
        drape_arena_free(&arena);
        return made;
    }
    worst->states++;
    for (int32_t i = 0; i < a->model->node_count; i++) {
        double depth = audit_depth(a, x + 3 * (size_t)i, t);
        if (depth > worst->node) {
            worst->node = depth;
            worst->node_at = t;
        }
    }
    if (a->faces && a->model->collider_count > 0)
        audit_faces(a, x, t, worst);
    drape_intersections found = {0};
    drape_arena_free(&arena);
    drape_status status = a->self ? drape_find_intersections(a->ctx, a->model, x, &found) : DRAPE_OK;
    if (found.count > worst->intersections) {
        worst->intersections = found.count;
        worst->intersections_at = t;
    }
    return status;
}

/* An observer of drape_sim_observe; user: an audit. */
static inline drape_status audit_observe(void *user, const drape_event *event)
{
    audit *a = user;
    if (event->kind == DRAPE_EVENT_FRAME)
        return audit_state(a, event->positions, event->time, &a->frames);
    if (!event->attempt->accepted)
        return DRAPE_OK;
    return audit_state(a, drape_sim_positions(event->sim), drape_sim_time(event->sim), &a->steps);
}

#endif
