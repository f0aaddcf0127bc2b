/*
 * verlet_contact.c: how the two explicit systems keep nodes out of obstacles, written for any surface with a
 * signed distance phi and a normal n. y0 is where the node was, carried along with the collider: what the
 * systems say of a previous position is said of that. A surface without curvature under a node is flat and
 * obeys the rule of their planes, any other that of their spheres.
 *
 * CS184, where phi <= 0: x = y0 + (1 - friction)(t - y0) with the surface point
 *     t = x - phi n                                                        on a sphere
 *     t = where the way from y0 to x meets the surface, and `offset` more  on a plane
 *     (t = x - phi n and the offset, where y0 is inside too: the way meets nothing)
 * Boson, where phi <= 0: x = x - phi n on a sphere, x = y0 on a floor. And nearer than friction_range to a
 * surface, F the sum of all forces on the node, F_n = -F.n > 0 what presses it on:
 *     F <- max(|F_t| - friction F_n, 0) F_t/|F_t| - friction_drag v
 * Its code reads the height of a node before it is set, so that in its first frame everything rubs on the
 * floor, and divides by |F_t| = 0; neither is done here. Its spheres rub a little farther out, by
 * sqrt(r^2 + (d/2)^2) - r with the spacing d: 5 mm of its 100 m.
 */
#include "base/vec3.h"
#include "colliders/colliders.h"
#include "integrators/verlet.h"

#include <string.h>

/* Where a collider is, and how fast. */
static drape_collider_pose pose_at(const drape_motion *motion, int32_t collider, double t)
{
    drape_collider_pose pose;
    drape_motion_collider(motion, collider, t, pose.displacement);
    drape_motion_collider_velocity(motion, collider, t, t, pose.velocity);
    return pose;
}

/* A collider over one substep. */
typedef struct pose {
    const drape_collider *collider;
    drape_collider_pose at; /* at the end */
    double way[3];          /* [m] since the start */
} pose;

static bool is_flat(const pose *p, const double *x)
{
    double curvature[9], sum = 0;
    drape_collider_distance(p->collider, &p->at, x, NULL, curvature);
    for (int i = 0; i < 9; i++)
        sum += fabs(curvature[i]);
    return sum == 0;
}

/* ---- CS184 ---- */

static void surface_point(const pose *p, double offset, const double *y0, const double *x, double phi,
                          const double *n, double *t)
{
    bool flat = is_flat(p, x);
    double before = flat ? drape_collider_distance(p->collider, &p->at, y0, NULL, NULL) : 0;
    for (int k = 0; k < 3; k++)
        t[k] = before > 0 ? y0[k] + before / (before - phi) * (x[k] - y0[k]) : x[k] - phi * n[k];
    if (flat)
        vec3_add_scaled(offset, n, t);
}

static void project_cs184(const drape_verlet_contact *contact, const pose *p, const double *y0, double phi,
                          const double *n, double *x)
{
    double t[3], share = 1 - fmin(p->collider->friction, 1);
    surface_point(p, contact->offset, y0, x, phi, n, t);
    for (int k = 0; k < 3; k++)
        x[k] = y0[k] + share * (t[k] - y0[k]);
}

/* ---- Boson ---- */

static void project_boson(const drape_verlet_contact *contact, const pose *p, const double *y0, double phi,
                          const double *n, double *x)
{
    (void)contact;
    if (is_flat(p, x))
        memcpy(x, y0, 3 * sizeof *x);
    else
        vec3_add_scaled(-phi, n, x);
}

static void rub(const drape_verlet_contact *contact, const drape_collider *c, const double velocity[3],
                const double *n, const double *v, double *g)
{
    double press = vec3_dot(g, n), tangential[3], slip[3];
    if (!(press > 0))
        return;
    for (int k = 0; k < 3; k++)
        tangential[k] = -g[k] + press * n[k];
    double pull = vec3_norm(tangential), left = fmax(pull - c->friction * press, 0);
    vec3_sub(v, velocity, slip);
    for (int k = 0; k < 3; k++)
        g[k] = contact->friction_drag * slip[k] - (pull > 0 ? left / pull * tangential[k] : 0);
}

static void rub_on(const drape_verlet_contact *contact, int32_t collider, double t, const double *x,
                   const double *v, double *g)
{
    const drape_model *m = contact->model;
    const drape_collider *c = &m->colliders[collider];
    const drape_collider_pose pose_now = pose_at(contact->motion, collider, t);
    double n[3];
    for (int32_t f = 0; f < m->free_count; f++) {
        size_t i = 3 * (size_t)m->node_of_free[f];
        if (drape_collider_distance(c, &pose_now, x + i, n, NULL) < contact->friction_range)
            rub(contact, c, pose_now.velocity, n, v + i, g + i);
    }
}

void drape_verlet_rub(const drape_verlet_contact *contact, double t, const double *x, const double *v,
                      double *g)
{
    if (contact->rule != DRAPE_VERLET_BOSON)
        return;
    for (int32_t c = 0; c < contact->model->collider_count; c++)
        rub_on(contact, c, t, x, v, g);
}

/* ---- Both ---- */

typedef void project_function(const drape_verlet_contact *contact, const pose *p, const double *y0,
                              double phi, const double *n, double *x);

static void project_on(const drape_verlet_contact *contact, const pose *p, const double *x0, double *x)
{
    static project_function *const rules[] = {
        [DRAPE_VERLET_CS184] = project_cs184, [DRAPE_VERLET_BOSON] = project_boson};
    const drape_model *m = contact->model;
    for (int32_t f = 0; f < m->free_count; f++) {
        size_t i = 3 * (size_t)m->node_of_free[f];
        double n[3], y0[3], phi = drape_collider_distance(p->collider, &p->at, x + i, n, NULL);
        if (!(phi <= 0))
            continue;
        for (size_t k = 0; k < 3; k++)
            y0[k] = x0[i + k] + p->way[k];
        rules[contact->rule](contact, p, y0, phi, n, x + i);
    }
}

void drape_verlet_project(const drape_verlet_contact *contact, double t0, double t, const double *x0,
                          double *x)
{
    for (int32_t c = 0; c < contact->model->collider_count; c++) {
        pose p = {.collider = &contact->model->colliders[c]};
        const drape_collider_pose before = pose_at(contact->motion, c, t0);
        p.at = pose_at(contact->motion, c, t);
        vec3_sub(p.at.displacement, before.displacement, p.way);
        project_on(contact, &p, x0, x);
    }
}
