/*
 * verlet_rules.c: the rules of contact and friction of CS184 and of Boson (verlet.h), for any surface with a
 * signed distance phi and a normal n. y0 is where the node was, carried along with the collider: it stands
 * for the previous position in their rules. A surface without curvature at a node is flat and follows the
 * rule of their planes, any other that of their spheres.
 *
 * CS184, where phi <= 0: x = y0 + (1 - friction)(t - y0) with the surface point
 *     t = x - phi n                                                              on a sphere
 *     t = where the line from y0 to x meets the surface, `offset` outside of it  on a plane
 *     (t = x - phi n and the offset if y0 is inside too: the line does not meet the surface)
 *
 * Boson, where phi <= 0: x = x - phi n on a sphere, x = y0 on a floor. And nearer than friction_range to a
 * surface, with F the sum of all forces on the node and F_n = -F.n > 0 the part that presses it on:
 *     F <- max(|F_t| - friction F_n, 0) F_t/|F_t| - friction_drag v
 * Its code reads the height of a node before it is set, so that in its first frame all nodes have friction
 * with the floor, and divides by |F_t| = 0; neither is reproduced. The range of friction of its spheres is a
 * little larger, by sqrt(r^2 + (d/2)^2) - r with the spacing d: 5 mm for its radius of 100 m.
 *
 * CS184, cloth against cloth: points nearer to each other than r = 2 thickness are pushed apart. One node
 * after the other, x_i moves by
 *     share * mean over its near points j of (r - |x_i - x_j|) (x_i - x_j)/|x_i - x_j|
 * with the points where they are by then; share is one over the substeps of a step. CS184 searches only the
 * box of the point, of 3 width/columns x 3 height/rows x the larger of both, as points are before the first
 * is moved, and misses pairs across its faces; so does same_box. Near points are added in ascending order:
 * the result depends on the positions alone, not on how they were found.
 */
#include "base/vec3.h"
#include "colliders/colliders.h"
#include "integrators/verlet.h"

#include <string.h>

/* A collider over one substep. */
typedef struct pose {
    const drape_collider *collider;
    drape_collider_pose before, at; /* at the start and at the end */
} pose;

/* Where a point that is carried along gets to. */
static void carry(const pose *p, const double *from, double *to)
{
    double moved[3];
    if (p->before.turned || p->at.turned) {
        drape_pose_own(&p->before, from, to);
        drape_pose_point(&p->at, to, to);
        return;
    }
    vec3_sub(p->at.displacement, p->before.displacement, moved);
    for (int k = 0; k < 3; k++)
        to[k] = from[k] + moved[k];
}

static bool is_flat(const pose *p, const double *x)
{
    double curvature[9], sum = 0;
    drape_collider_distance(p->collider, &p->at, x, NULL, curvature);
    for (int i = 0; i < 9; i++)
        sum += fabs(curvature[i]);
    return sum == 0;
}

static void project_cs184(const drape_verlet_contact *contact, const pose *p, const double *y0, double phi,
                          const double *n, double *x)
{
    const bool flat = is_flat(p, x);
    const double share = 1 - fmin(p->collider->friction, 1);
    double t[3], before = flat ? drape_collider_distance(p->collider, &p->at, y0, NULL, NULL) : 0;
    for (int k = 0; k < 3; k++)
        t[k] = before > 0 ? y0[k] + before / (before - phi) * (x[k] - y0[k]) : x[k] - phi * n[k];
    if (flat)
        vec3_add_scaled(contact->offset, n, t);
    for (int k = 0; k < 3; k++)
        x[k] = y0[k] + share * (t[k] - y0[k]);
}

/* Returns the work of the collider. */
static double project_on(const drape_verlet_contact *contact, const pose *p, double h, const double *x0,
                         double *x)
{
    const drape_model *m = contact->model;
    double work = 0;
    for (int32_t f = 0; f < m->free_count; f++) {
        size_t i = 3 * (size_t)m->node_of_free[f];
        double n[3], y0[3], phi = drape_collider_distance(p->collider, &p->at, x + i, n, NULL);
        if (!(phi <= 0) || drape_model_ignores(m, p->collider->index, m->node_of_free[f]))
            continue;
        carry(p, x0 + i, y0);
        const double before[3] = {x[i], x[i + 1], x[i + 2]};
        if (contact->rule == DRAPE_VERLET_CS184)
            project_cs184(contact, p, y0, phi, n, x + i);
        else if (is_flat(p, x + i))
            memcpy(x + i, y0, 3 * sizeof *x);
        else
            vec3_add_scaled(-phi, n, x + i);
        /* A node that is moved from `before` to x in a substep of h gets the impulse m (x - before)/h. The
         * work of the collider is that impulse times its mean velocity where the node is: friction and
         * impacts, which only take energy as seen from a collider that moves, are not a part of it. */
        double moved[3], carried[3];
        vec3_sub(x + i, before, moved);
        vec3_sub(y0, x0 + i, carried);
        work += m->mass[i / 3] / (h * h) * vec3_dot(moved, carried);
    }
    return work;
}

double drape_verlet_project(const drape_verlet_contact *contact, double t0, double t, double h,
                            const double *x0, double *x)
{
    double work = 0;
    for (int32_t c = 0;
         c < contact->model->collider_count && !(contact->cancel && atomic_load(contact->cancel)); c++) {
        pose p = {.collider = &contact->model->colliders[c]};
        drape_motion_pose(contact->motion, c, t0, t0, &p.before);
        drape_motion_pose(contact->motion, c, t, t, &p.at);
        work += project_on(contact, &p, h, x0, x);
    }
    return work;
}

/* Boson's friction on one node, whose negative force is g. Returns the power of the collider: the force that
 * friction adds, times the velocity of the collider there. */
static double apply_friction(const drape_verlet_contact *contact, const drape_collider *c,
                             const double velocity[3], const double *n, const double *v, double *g)
{
    double normal = vec3_dot(g, n), tangential[3], slip[3], power = 0;
    if (!(normal > 0))
        return 0;
    for (int k = 0; k < 3; k++)
        tangential[k] = -g[k] + normal * n[k];
    double force = vec3_norm(tangential), left = fmax(force - c->friction * normal, 0);
    vec3_sub(v, velocity, slip);
    for (int k = 0; k < 3; k++) {
        const double before = g[k];
        g[k] = contact->friction_drag * slip[k] - (force > 0 ? left / force * tangential[k] : 0);
        power += (before - g[k]) * velocity[k];
    }
    return power;
}

double drape_verlet_friction(const drape_verlet_contact *contact, double t, const double *x, const double *v,
                             double *g)
{
    const drape_model *m = contact->model;
    double power = 0;
    if (contact->rule != DRAPE_VERLET_BOSON)
        return 0;
    for (int32_t k = 0; k < m->collider_count && !(contact->cancel && atomic_load(contact->cancel)); k++) {
        drape_collider_pose at;
        drape_motion_pose(contact->motion, k, t, t, &at);
        for (int32_t f = 0; f < m->free_count; f++) {
            const size_t i = 3 * (size_t)m->node_of_free[f];
            double n[3], velocity[3];
            if (!(drape_collider_distance(&m->colliders[k], &at, x + i, n, NULL) < contact->friction_range) ||
                drape_model_ignores(m, k, m->node_of_free[f]))
                continue;
            drape_pose_velocity(&at, x + i, velocity);
            power += apply_friction(contact, &m->colliders[k], velocity, n, v + i, g + i);
        }
    }
    return power;
}

/* ---- Cloth against cloth ---- */

drape_status drape_verlet_self_create(drape_arena *arena, const drape_model *m, bool same_box,
                                      drape_verlet_self *out)
{
    double size[3];
    *out = (drape_verlet_self){.model = m, .reach = 2 * m->contact.self_thickness};
    /* The sizes of CS184's boxes, by the first cloth; three mean edges if its mesh is not a grid. */
    const drape_mesh *mesh = &m->cloths[0].mesh;
    double mean = 0, d[3];
    for (int32_t e = 0; e < m->edge_count; e++)
        mean += m->edge_length[e] / m->edge_count;
    size[0] = size[1] = size[2] = 3 * mean;
    if (mesh->rows != 0) {
        vec3_sub(m->rest + 3 * (size_t)(mesh->columns - 1), m->rest, d);
        size[0] = 3 * vec3_norm(d) / mesh->columns;
        vec3_sub(m->rest + 3 * (size_t)(mesh->rows - 1) * (size_t)mesh->columns, m->rest, d);
        size[1] = 3 * vec3_norm(d) / mesh->rows;
        size[2] = fmax(size[0], size[1]);
    }
    for (int k = 0; k < 3; k++)
        out->per_box[k] = 1 / size[k];
    if (same_box)
        out->box = drape_arena_take(arena, (size_t)m->node_count, sizeof *out->box);
    if (same_box && !out->box)
        return DRAPE_E_MEMORY;
    return drape_neighbours_create(arena, m->node_count, out->reach, &out->neighbours);
}

/* Moves node i by the rule. others (count): the points that push it; NULL: all `count` points of the
 * model. */
static void push_node(const drape_verlet_self *s, int32_t i, const int32_t *others, int count, double share,
                      double *x)
{
    double *own = x + 3 * (size_t)i, sum[3] = {0}, square_of_reach = s->reach * s->reach;
    int pushing = 0;
    for (int k = 0; k < count; k++) {
        const int32_t j = others ? others[k] : k;
        double d[3];
        if (s->model->sewn && s->model->sewn[i] == s->model->sewn[j])
            continue;
        vec3_sub(own, x + 3 * (size_t)j, d);
        double square = vec3_dot(d, d);
        if (!(square < square_of_reach) || square == 0) /* too far, or no direction to push in */
            continue;
        if (drape_model_ignores_cloth(s->model, i, j))
            continue;
        double distance = sqrt(square);
        vec3_add_scaled(s->reach / distance - 1, d, sum);
        pushing++;
    }
    if (pushing > 0)
        vec3_add_scaled(share / pushing, sum, own);
}

/* Finds the near points that push a point. NULL: all points do, as in a pile of cloth much thicker than its
 * mesh is fine, where a point has more near points than a list can hold. */
static int find_others(const drape_verlet_self *s, int32_t i, const double *x,
                       int32_t list[DRAPE_MAX_NEIGHBOURS + 1], const int32_t **others)
{
    int count = drape_neighbours_of(&s->neighbours, i, x + 3 * (size_t)i, list, others);
    if (count < 0) {
        *others = NULL;
        count = s->model->node_count;
    }
    if (!s->box)
        return count;
    /* Only the near points in the box of the point push, in `list`, which may be *others; of all points, the
     * first that fit. */
    int number = 0;
    for (int k = 0; k < count && number < DRAPE_MAX_NEIGHBOURS; k++) {
        const int32_t j = *others ? (*others)[k] : k;
        double d[3];
        vec3_sub(x + 3 * (size_t)i, x + 3 * (size_t)j, d);
        list[number] = j;
        number += (s->box[j] == s->box[i]) & (j != i) & (*others || vec3_dot(d, d) < s->reach * s->reach);
    }
    count = number;
    *others = list;
    return count;
}

void drape_verlet_self_push(drape_verlet_self *s, double share, double *x)
{
    drape_neighbours_update(&s->neighbours, share, x);
    for (int32_t i = 0; s->box && i < s->model->node_count; i++) {
        /* A box as 21 bits of each of its numbers: points that are near to each other are not 2^20 boxes
         * apart. */
        uint64_t box = 0;
        for (int k = 0; k < 3; k++) {
            double number = x[3 * (size_t)i + (size_t)k] * s->per_box[k];
            int32_t cut = fabs(number) < INT32_MAX ? (int32_t)number : 0;
            cut -= fabs(number) < INT32_MAX && number < cut; /* floor */
            box = box << 21 | ((uint32_t)cut & 0x1FFFFFu);
        }
        s->box[i] = box;
    }
    for (int32_t i = 0; i < s->model->node_count && !(s->cancel && atomic_load(s->cancel)); i++) {
        int32_t list[DRAPE_MAX_NEIGHBOURS + 1];
        const int32_t *others;
        if (s->model->pinned[i])
            continue;
        const int count = find_others(s, i, x, list, &others);
        push_node(s, i, others, count, share, x);
        drape_neighbours_moved(&s->neighbours, i, x + 3 * (size_t)i);
    }
}
