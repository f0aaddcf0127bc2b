/* query.c: what a host asks about the present state: the nearest place to a point, the first one on a ray,
 * and the contacts. */
#include "base/finite.h"
#include "base/vec3.h"
#include "colliders/deformed.h"
#include "geometry/nearest.h"
#include "sim/sim.h"

#include <math.h>
#include <string.h>

#define LEAST 1e-4 /* of the length of a ray: the least step along it outside of a collider */

/* What is asked about: the colliders as they are at the moment, where they deform. */
typedef struct query {
    const drape_sim *sim;
    int what;
    drape_arena arena; /* of what deforms */
    const drape_collider *
        *body; /* (collider_count) if colliders are asked about; NULL: cloth passes through */
} query;

/* ---- Places ---- */

static void set_cloth(const drape_sim *sim, const drape_on_triangle *at, drape_hit *hit)
{
    const int32_t *node = sim->model->triangle + 3 * (size_t)at->triangle;
    const double *x = drape_sim_state(sim)->x;
    *hit = (drape_hit){.found = true, .collider = -1, .triangle = at->triangle, .distance = at->distance};
    memcpy(hit->weights, at->weights, sizeof hit->weights);
    vec3_triangle_normal(node, x, hit->normal);
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(at->weights[a], x + 3 * (size_t)node[a], hit->point);
}

static drape_collider_pose pose_of(const drape_sim *sim, int32_t collider)
{
    const double t = drape_sim_state(sim)->t;
    drape_collider_pose pose;
    drape_motion_pose(drape_system_motion(sim->system), collider, t, t, &pose);
    return pose;
}

/* ---- Points ---- */

static void find_collider_near(const query *q, int32_t collider, const double *point, double within,
                               drape_hit *hit)
{
    const drape_collider_pose pose = pose_of(q->sim, collider);
    double normal[3];
    const double distance = drape_collider_distance(q->body[collider], &pose, point, normal, NULL);
    if (!(fabs(distance) <= within) || (hit->found && !(fabs(distance) < fabs(hit->distance))))
        return;
    *hit = (drape_hit){.found = true, .collider = collider, .triangle = -1, .distance = distance};
    memcpy(hit->normal, normal, sizeof normal);
    memcpy(hit->point, point, sizeof hit->point);
    vec3_add_scaled(-distance, normal, hit->point);
}

static void find_near(const query *q, const double *point, double within, drape_hit *hit)
{
    const drape_sim *sim = q->sim;
    *hit = (drape_hit){.found = false};
    if (q->what & DRAPE_QUERY_CLOTH) {
        const drape_on_triangle at =
            drape_nearest_on(&sim->query_tree, drape_sim_state(sim)->x, point, within);
        if (at.triangle >= 0)
            set_cloth(sim, &at, hit);
    }
    for (int32_t c = 0; q->body && c < sim->model->collider_count; c++)
        if (q->body[c])
            find_collider_near(q, c, point, within, hit);
}

/* ---- Rays ---- */

typedef struct ray {
    const drape_collider *collider;
    const drape_collider_pose *pose;
    const double *origin, *direction;
} ray;

static double distance_at(const ray *r, double t, double *normal)
{
    double x[3];
    memcpy(x, r->origin, sizeof x);
    vec3_add_scaled(t, r->direction, x);
    return drape_collider_distance(r->collider, r->pose, x, normal, NULL);
}

/* Where the piece from outside to inside enters. */
static double enter(const ray *r, double outside, double inside)
{
    for (double middle; (middle = outside + (inside - outside) / 2) > outside && middle < inside;) {
        if (distance_at(r, middle, NULL) > 0)
            outside = middle;
        else
            inside = middle;
    }
    return inside;
}

/* Within its distance from a collider, a step along the ray cannot meet it. Returns whether the ray meets
 * it. */
static bool meets(const ray *r, double length, double *t)
{
    double before = 0;
    *t = 0;
    for (double distance; (distance = distance_at(r, *t, NULL)) > DRAPE_PENETRATION_TOLERANCE;) {
        if (*t >= length)
            return false;
        before = *t;
        *t = fmin(*t + fmax(distance, LEAST * length), length);
    }
    if (distance_at(r, *t, NULL) < -DRAPE_PENETRATION_TOLERANCE && *t > 0)
        *t = enter(r, before, *t);
    return true;
}

static void find_collider_on(const query *q, int32_t collider, const double *origin, const double *direction,
                             double length, drape_hit *hit)
{
    const drape_collider_pose pose = pose_of(q->sim, collider);
    const ray r = {q->body[collider], &pose, origin, direction};
    double t, normal[3];
    if (!meets(&r, length, &t) || (hit->found && !(t < hit->distance)))
        return;
    distance_at(&r, t, normal);
    *hit = (drape_hit){.found = true, .collider = collider, .triangle = -1, .distance = t};
    memcpy(hit->normal, normal, sizeof normal);
    memcpy(hit->point, origin, sizeof hit->point);
    vec3_add_scaled(t, direction, hit->point);
}

/* Of length 1, by the largest component first, so that no square over- or underflows. Returns whether there
 * is such a direction. */
static bool normalise(const double *along, double direction[3])
{
    const double largest = fmax(fmax(fabs(along[0]), fabs(along[1])), fabs(along[2]));
    if (!(largest > 0) || !drape_all_finite(along, 3))
        return false;
    for (int k = 0; k < 3; k++)
        direction[k] = along[k] / largest;
    const double size = vec3_norm(direction);
    for (int k = 0; k < 3; k++)
        direction[k] /= size;
    return true;
}

static void find_on_ray(const query *q, const double *origin, const double *along, double length,
                        drape_hit *hit)
{
    const drape_sim *sim = q->sim;
    double direction[3];
    (void)normalise(along, direction);
    *hit = (drape_hit){.found = false};
    if (q->what & DRAPE_QUERY_CLOTH) {
        const drape_on_triangle at =
            drape_first_on_ray(&sim->query_tree, drape_sim_state(sim)->x, origin, direction, length);
        if (at.triangle >= 0)
            set_cloth(sim, &at, hit);
    }
    for (int32_t c = 0; q->body && c < sim->model->collider_count; c++)
        if (q->body[c])
            find_collider_on(q, c, origin, direction, length, hit);
}

/* ---- For hosts ---- */

static drape_status check(drape_sim *sim, const char *function, int what, int32_t count, const double *points,
                          double reach, const drape_hit *hits)
{
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (count < 0 || (count > 0 && (!points || !hits)))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: %d points, but no array of them or of hits",
                          function, (int)count);
    if (what < DRAPE_QUERY_CLOTH || what > (DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "%s: what = %d; it is 1 for cloth, 2 for colliders, 3 for both", function, what);
    if (!(reach > 0))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: the distance is %g m; it must be above 0",
                          function, reach);
    for (int32_t i = 0; i < count; i++) {
        const double *x = points + 3 * (size_t)i;
        if (!drape_all_finite(x, 3))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: point %d is (%g, %g, %g) m; it must be finite",
                              function, (int)i, x[0], x[1], x[2]);
    }
    return DRAPE_OK;
}

static drape_status fit_tree(drape_sim *sim, int what)
{
    const drape_model *m = sim->model;
    drape_status status = DRAPE_OK;
    if (!(what & DRAPE_QUERY_CLOTH))
        return DRAPE_OK;
    if (!sim->query_tree.branches)
        status = drape_bvh_build(sim->arena, m->triangle_count, 3, m->triangle, m->rest, &sim->query_tree);
    if (status)
        sim->query_tree = (drape_bvh){.count = 0};
    else
        drape_bvh_fit(&sim->query_tree, drape_sim_state(sim)->x);
    return status;
}

/* Fits what is asked about to the present state. */
static drape_status begin_query(drape_sim *sim, int what, query *q)
{
    const drape_model *m = sim->model;
    drape_status status = fit_tree(sim, what);
    *q = (query){.sim = sim, .what = what, .arena = drape_arena_of(sim->ctx)};
    if (status || !(what & DRAPE_QUERY_COLLIDERS) || m->collider_count == 0)
        return status;
    q->body = drape_arena_take(&q->arena, (size_t)m->collider_count, sizeof *q->body);
    status = q->body ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int32_t c = 0; !status && c < m->collider_count; c++) {
        bool met = false;
        for (int32_t i = 0; i < m->cloth_count; i++)
            met = met || !drape_model_ignores(m, c, m->cloths[i].first_node);
        if (met)
            status = drape_deformed_at(&q->arena, m, drape_system_motion(sim->system), c,
                                       drape_sim_state(sim)->t, &q->body[c]);
    }
    return status;
}

drape_status drape_sim_closest(drape_sim *sim, int what, int32_t count, const double *points, double within,
                               drape_hit *hits)
{
    query q = {.arena = drape_arena_of(sim ? sim->ctx : NULL)};
    drape_status status = check(sim, "drape_sim_closest", what, count, points, within, hits);
    if (!status)
        status = begin_query(sim, what, &q);
    for (int32_t i = 0; !status && i < count; i++)
        find_near(&q, points + 3 * (size_t)i, within, &hits[i]);
    drape_arena_free(&q.arena);
    return status;
}

drape_status drape_sim_cast(drape_sim *sim, int what, int32_t count, const double *origins,
                            const double *directions, double length, drape_hit *hits)
{
    query q = {.arena = drape_arena_of(sim ? sim->ctx : NULL)};
    drape_status status = check(sim, "drape_sim_cast", what, count, origins, length, hits);
    if (!status) {
        bool good = isfinite(length) && (count == 0 || directions);
        double direction[3];
        for (int32_t i = 0; good && i < count; i++)
            good = normalise(directions + 3 * (size_t)i, direction);
        status = good
                     ? DRAPE_OK
                     : drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                                  "drape_sim_cast: directions and length must be finite, and no direction 0");
    }
    if (!status)
        status = begin_query(sim, what, &q);
    for (int32_t i = 0; !status && i < count; i++)
        find_on_ray(&q, origins + 3 * (size_t)i, directions + 3 * (size_t)i, length, &hits[i]);
    drape_arena_free(&q.arena);
    return status;
}
