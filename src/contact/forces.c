/* forces.c: forces and energy of the active set, summed. See contact.h. */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/barrier.h"
#include "geometry/mesh_distance.h"

#include <string.h>

#define OUT_SPEED 0.2 /* sizes of the scene in a second: exempt cloth is pushed out no faster */

/* The energy of a gap that closes is proportional to K d (law.h). K is proportional to 1/d, so that pairs
 * of equal area absorb the same energy, whatever their activation distance. */
drape_contact_law drape_contact_law_of(const drape_contact *c, const drape_active_contact *contact)
{
    const drape_contact_def *def = &c->model->contact;
    const drape_pair *pair = &contact->pair;
    const drape_collider *collider = pair->collider >= 0 ? &c->model->colliders[pair->collider] : NULL;
    const double friction = collider ? collider->friction : def->self_friction;
    if (contact->exempt > 0) {
        /* Exempt pairs have a bounded pressure, and no rebound. The factor of the pressure does not multiply
         * friction, which would hold the cloth fast that it is to push out. */
        return (drape_contact_law){.distance = pair->distance,
                                   .low = DRAPE_BARRIER_BOUNDED,
                                   .stiffness = contact->exempt * def->relaxed_pressure * pair->area,
                                   .friction = friction / contact->exempt,
                                   .velocity = def->friction_velocity,
                                   .damping = 1,
                                   .restitution_velocity =
                                       fmax(def->restitution_velocity, OUT_SPEED * c->model->length)};
    }
    const double e = collider ? collider->restitution : def->self_restitution,
                 least = drape_pair_least_gap(pair, c->broad.rounding) / pair->distance;
    return (drape_contact_law){
        .distance = pair->distance,
        .low = contact->inside ? DRAPE_BARRIER_PARABOLA : fmin(least, DRAPE_BARRIER_PARABOLA),
        .stiffness = c->stiffening.factor * def->stiffness * pair->area * (def->distance / pair->distance),
        .friction = friction,
        .velocity = def->friction_velocity,
        .damping = (1 - e * e) / (1 + e * e),
        .restitution_velocity = def->restitution_velocity};
}

/* Whether what a contact adds to sums over all contacts counts on this rank. Each rank with one of the nodes
 * that have a weight in it knows the contact; the one that owns the first of these nodes counts it. */
static bool is_counted(const drape_contact *c, const drape_active_contact *contact)
{
    int32_t first = c->model->node_count;
    for (int a = 0; c->ranks && a < contact->gap.closest.points; a++)
        if (contact->gap.closest.c[a] != 0 && contact->pair.node[a] < first)
            first = contact->pair.node[a];
    return !c->ranks || (first < c->model->node_count && drape_model_owns(c->model, first));
}

bool drape_contact_rolls(const drape_contact *c, const drape_active_contact *contact)
{
    const drape_pair *pair = &contact->pair;
    return pair->kind != DRAPE_PAIR_SURFACE && pair->collider >= 0 && pair->radius > 0 &&
           c->pose[pair->collider].spins && !c->deformed[pair->collider]; /* those move point by point */
}

double drape_contact_arm(const drape_contact *c, const drape_active_contact *contact)
{
    const bool cloth_first = contact->pair.node[0] < c->model->node_count;
    return cloth_first ? contact->pair.radius : -contact->pair.radius;
}

/* Whether the contact is with the distance of a collider that deforms: contacts of exempt cloth are. */
static bool is_on_body(const drape_contact *c, const drape_active_contact *contact)
{
    return contact->pair.kind == DRAPE_PAIR_SURFACE && c->deformed[contact->pair.collider];
}

/* The corners of the triangle of the collider that is nearest to such a contact, and the weights of its
 * nearest point. */
static void find_body_points(const drape_contact *c, const drape_active_contact *contact, int32_t node[3],
                             double weight[3])
{
    const int32_t collider = contact->pair.collider;
    const drape_deformed *body = c->deformed[collider];
    double x[3] = {0};
    int32_t triangle;
    for (int a = 0; a < contact->gap.closest.points; a++)
        vec3_add_scaled(contact->gap.closest.c[a], c->x + 3 * (size_t)contact->pair.node[a], x);
    drape_contact_fit_bodies(c, c->pose);
    drape_pose_own(&c->pose[collider], x, x);
    drape_mesh_distance_nearest(body->distance, &body->collider.shape, x, &triangle, weight);
    for (int k = 0; k < 3; k++)
        node[k] =
            c->broad.first_point[collider] + body->collider.shape.triangle[3 * (size_t)triangle + (size_t)k];
}

/* The forces on the points of a collider that deforms. */
static void add_on_points(const drape_contact *c, const drape_active_contact *contact, const double *from)
{
    const int32_t nodes = c->model->node_count;
    int32_t node[3];
    double weight[3];
    if (!is_on_body(c, contact)) {
        for (int a = 0; a < contact->gap.closest.points; a++)
            if (contact->pair.node[a] >= nodes)
                vec3_add_scaled(1, from + 3 * a, c->on_point + 3 * (size_t)(contact->pair.node[a] - nodes));
        return;
    }
    find_body_points(c, contact, node, weight);
    for (int a = 0; a < contact->gap.closest.points; a++)
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(-weight[k], from + 3 * a, c->on_point + 3 * (size_t)(node[k] - nodes));
}

void drape_contact_velocities(const drape_contact *c, const drape_active_contact *contact, double v[4][3])
{
    for (int a = 0; a < contact->gap.closest.points; a++)
        memcpy(v[a], c->v + 3 * (size_t)contact->pair.node[a], sizeof v[a]);
    if (is_on_body(c, contact)) {
        int32_t node[3];
        double weight[3];
        find_body_points(c, contact, node, weight);
        for (int a = 0; a < contact->gap.closest.points; a++)
            for (int k = 0; k < 3; k++)
                vec3_add_scaled(-weight[k], c->v + 3 * (size_t)node[k], v[a]);
        return;
    }
    if (drape_contact_rolls(c, contact)) {
        /* The surface of a round feature that turns has another velocity than its core. */
        const drape_collider_pose *pose = &c->pose[contact->pair.collider];
        const double arm = drape_contact_arm(c, contact);
        for (int a = 0; a < contact->gap.closest.points; a++)
            for (int k = 0; k < 3 && contact->pair.node[a] >= c->model->node_count; k++)
                v[a][k] += arm * vec3_dot(pose->gradient + 3 * k, contact->gap.closest.normal);
    }
    for (int a = 0; contact->pair.kind == DRAPE_PAIR_SURFACE && a < contact->gap.closest.points; a++) {
        double surface[3];
        drape_pose_velocity(&c->pose[contact->pair.collider], c->x + 3 * (size_t)contact->pair.node[a],
                            surface);
        vec3_sub(v[a], surface, v[a]);
    }
}

static void scatter(drape_contact *c, const drape_active_contact *contact, const double *from, double *g)
{
    const int32_t *node = contact->pair.node, collider = is_counted(c, contact) ? contact->pair.collider : -1;
    for (int a = 0; a < contact->gap.closest.points; a++)
        for (int k = 0; k < 3 && node[a] < c->model->node_count; k++) {
            g[3 * (size_t)node[a] + (size_t)k] += from[3 * a + k];
            if (collider >= 0)
                c->on_collider[collider].force[k] -= from[3 * a + k];
        }
    if (collider >= 0) {
        /* The forces on a collider act on the surface around its points or, if it is smooth, where the
         * nodes are: there its velocity was taken, so that their work is what the cloth is given. */
        double *moment = c->on_collider[collider].moment;
        const bool surface = contact->pair.kind == DRAPE_PAIR_SURFACE;
        for (int a = 0; a < contact->gap.closest.points; a++) {
            double own[3], x[3];
            if (!surface && node[a] < c->model->node_count)
                continue;
            memcpy(x, c->x + 3 * (size_t)node[a], sizeof x);
            if (!surface)
                vec3_add_scaled(drape_contact_arm(c, contact), contact->gap.closest.normal, x);
            drape_pose_own(&c->pose[contact->pair.collider], x, own);
            for (int i = 0; i < 9; i++)
                moment[i] += (surface ? -1 : 1) * from[3 * a + i / 3] * own[i % 3];
        }
    }
    if (collider >= 0 && c->deformed[collider])
        add_on_points(c, contact, from);
}

/* The forces of one active contact (3 points each): of the energy, and of restitution and of friction that is
 * not lagged. Returns their number. */
static int evaluate(const drape_contact *c, const drape_active_contact *contact, bool conservative,
                    bool dissipative, double force[3][12])
{
    const drape_contact_law law = drape_contact_law_of(c, contact);
    const bool friction = law.friction > 0 && !c->model->contact.lagged;
    int count = 0;
    double v[4][3];
    if (conservative)
        drape_law_gradient(&contact->gap, &law, force[count++]);
    if (!dissipative || (!friction && !(law.damping > 0)))
        return count;
    drape_contact_velocities(c, contact, v);
    const drape_normal normal = drape_normal_at(&contact->gap, &law, v);
    if (law.damping > 0)
        drape_restitution_force(&contact->gap, &normal, force[count++]);
    if (friction)
        drape_friction_force(&contact->gap, &law, drape_normal_force(&normal), v, force[count++], NULL);
    return count;
}

/* The force of lagged friction (3 points). */
static void evaluate_lagged(const drape_contact *c, const drape_lagged *lagged, double *force)
{
    const drape_contact_law law = drape_contact_law_of(c, &lagged->contact);
    double v[4][3];
    drape_contact_velocities(c, &lagged->contact, v);
    drape_friction_force(&lagged->contact.gap, &law, lagged->force, v, force, NULL);
}

void drape_contact_add_forces(drape_contact *c, bool conservative, bool dissipative, double *g)
{
    const double start = drape_clock_seconds();
    double force[3][12];
    memset(c->on_collider, 0, (size_t)c->model->collider_count * sizeof *c->on_collider);
    for (int32_t i = 0; i < c->model->collider_count; i++) {
        if (!c->deformed[i])
            continue;
        double *on = c->on_point + 3 * (size_t)(c->broad.first_point[i] - c->model->node_count);
        memset(on, 0, 3 * (size_t)c->model->colliders[i].shape.point_count * sizeof *on);
        c->on_collider[i].on_points = on;
    }
    for (int32_t i = 0; i < c->active.count; i++) {
        const int count = evaluate(c, &c->active.contacts[i], conservative, dissipative, force);
        for (int k = 0; k < count; k++)
            scatter(c, &c->active.contacts[i], force[k], g);
    }
    for (int32_t i = 0; dissipative && i < c->lagged_count; i++) {
        evaluate_lagged(c, &c->lagged[i], force[0]);
        scatter(c, &c->lagged[i].contact, force[0], g);
    }
    c->seconds += drape_clock_seconds() - start;
}

const drape_load *drape_contact_on_colliders(const drape_contact *c)
{
    return c->on_collider;
}

double drape_contact_potential(const drape_contact *c)
{
    double sum = 0;
    for (int32_t i = 0; i < c->active.count; i++) {
        const drape_contact_law law = drape_contact_law_of(c, &c->active.contacts[i]);
        if (is_counted(c, &c->active.contacts[i]))
            sum += drape_law_energy(&c->active.contacts[i].gap, &law);
    }
    return drape_ranks_sum(c->ranks, sum);
}

int32_t drape_contact_active(const drape_contact *c, double *least_gap)
{
    *least_gap = INFINITY;
    for (int32_t i = 0; i < c->active.count; i++)
        *least_gap = fmin(*least_gap, c->active.contacts[i].gap.value);
    return c->active.count;
}

/* ---- As a host sees them ---- */

/* Sums a force (points x 3, with the sign of a gradient) on the first piece: the cloth at a collider,
 * otherwise the points with positive weights. */
static void add_force(const drape_contact *c, const drape_active_contact *contact, const double *g,
                      double force[3])
{
    for (int a = 0; a < contact->gap.closest.points; a++) {
        const bool first = contact->pair.collider >= 0 ? contact->pair.node[a] < c->model->node_count
                                                       : contact->gap.closest.c[a] > 0;
        for (int k = 0; first && k < 3; k++)
            force[k] -= g[3 * a + k];
    }
}

/* The geometry, without forces. At a collider the cloth may be the second piece of the pair. */
static drape_contact_point place_of(const drape_contact *c, const drape_active_contact *contact)
{
    const drape_closest *closest = &contact->gap.closest;
    drape_contact_point out = {
        .collider = contact->pair.collider, .nodes = {-1, -1, -1, -1}, .gap = contact->gap.value};
    double sign = 1;
    int count = 0;
    for (int a = 0; a < closest->points && contact->pair.collider >= 0; a++)
        if (contact->pair.node[a] < c->model->node_count && closest->c[a] != 0)
            sign = closest->c[a] > 0 ? 1 : -1;
    for (int a = 0; a < closest->points; a++) {
        if (contact->pair.node[a] >= c->model->node_count)
            continue;
        const double weight = sign * closest->c[a];
        out.nodes[count] = contact->pair.node[a];
        out.weights[count++] = weight;
        if (weight > 0)
            vec3_add_scaled(weight, c->x + 3 * (size_t)contact->pair.node[a], out.point);
    }
    vec3_add_scaled(sign, closest->normal, out.normal);
    return out;
}

int32_t drape_contact_points(const drape_contact *c, int32_t capacity, drape_contact_point *points)
{
    double force[3][12], v[4][3];
    for (int32_t i = 0; i < c->active.count && i < capacity; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        const drape_contact_law law = drape_contact_law_of(c, contact);
        drape_contact_velocities(c, contact, v);
        const drape_normal normal = drape_normal_at(&contact->gap, &law, v);
        points[i] = place_of(c, contact);
        points[i].normal_force = drape_normal_force(&normal);
        for (int count = evaluate(c, contact, true, true, force), k = 0; k < count; k++)
            add_force(c, contact, force[k], points[i].force);
    }
    for (int32_t i = 0, at = c->active.count; i < c->lagged_count && at < capacity; i++, at++) {
        points[at] = place_of(c, &c->lagged[i].contact);
        evaluate_lagged(c, &c->lagged[i], force[0]);
        add_force(c, &c->lagged[i].contact, force[0], points[at].force);
    }
    return c->active.count + c->lagged_count;
}
