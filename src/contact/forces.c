/* forces.c: forces and energy of the active set, summed. See contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/barrier.h"

#include <string.h>

#define OUT_SPEED 0.2 /* of the size of the scene in a second: at most so fast is cloth pushed out */

/* The energy of a gap that closes is proportional to K d (force.h). K is proportional to 1/d, so that pairs
 * of equal area absorb the same energy, whatever their activation distance. */
drape_contact_law drape_contact_law_of(const drape_contact *c, const drape_active_contact *contact)
{
    const drape_contact_def *def = &c->model->contact;
    const drape_pair *pair = &contact->pair;
    const drape_collider *collider = pair->collider >= 0 ? &c->model->colliders[pair->collider] : NULL;
    const double friction = collider ? collider->friction : def->self_friction;
    if (contact->exempt > 0) {
        /* Exempt pairs: a bounded pressure, and no rebound. What pushes cloth out in addition to that does
         * not rub: with friction in proportion it would hold fast what it pushes. */
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
        .low = contact->gentle ? DRAPE_BARRIER_GENTLE : fmin(least, DRAPE_BARRIER_GENTLE),
        .stiffness = c->press.factor * def->stiffness * pair->area * (def->distance / pair->distance),
        .friction = friction,
        .velocity = def->friction_velocity,
        .damping = (1 - e * e) / (1 + e * e),
        .restitution_velocity = def->restitution_velocity};
}

bool drape_contact_counts(const drape_contact *c, const drape_active_contact *contact)
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
           c->pose[pair->collider].spins && !c->deformed[pair->collider]; /* of these, points alone move */
}

double drape_contact_arm(const drape_contact *c, const drape_active_contact *contact)
{
    const bool cloth_first = contact->pair.node[0] < c->model->node_count;
    return cloth_first ? contact->pair.radius : -contact->pair.radius;
}

/* Whether the contact is with the distance of a collider that deforms, as that of exempt cloth. */
static bool is_on_body(const drape_contact *c, const drape_active_contact *contact)
{
    return contact->pair.kind == DRAPE_PAIR_SURFACE && c->deformed[contact->pair.collider];
}

/* The points of the collider that are nearest to such a contact. */
static void find_body_points(const drape_contact *c, const drape_active_contact *contact, int32_t node[3],
                             double weight[3])
{
    double x[3] = {0};
    for (int a = 0; a < contact->gap.closest.points; a++)
        vec3_add_scaled(contact->gap.closest.c[a], c->x + 3 * (size_t)contact->pair.node[a], x);
    drape_contact_fit_bodies(c, c->pose);
    drape_contact_nearest_triangle(c, contact->pair.collider, &c->pose[contact->pair.collider], x, node,
                                   weight);
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
        /* The surface of a round feature moves otherwise than its core. */
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
    const int32_t *node = contact->pair.node,
                  collider = drape_contact_counts(c, contact) ? contact->pair.collider : -1;
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

static void add_friction(drape_contact *c, const drape_active_contact *contact, const drape_contact_law *law,
                         double force, double v[4][3], double *g)
{
    double local[12];
    drape_friction_force(&contact->gap, law, force, v, local, NULL);
    scatter(c, contact, local, g);
}

void drape_contact_add_forces(drape_contact *c, bool conservative, bool dissipative, double *g)
{
    const double start = drape_clock_seconds();
    memset(c->on_collider, 0, (size_t)c->model->collider_count * sizeof *c->on_collider);
    for (int32_t i = 0; i < c->model->collider_count; i++) {
        if (!c->deformed[i])
            continue;
        double *on = c->on_point + 3 * (size_t)(c->broad.first_point[i] - c->model->node_count);
        memset(on, 0, 3 * (size_t)c->model->colliders[i].shape.point_count * sizeof *on);
        c->on_collider[i].on_points = on;
    }
    for (int32_t i = 0; i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        const drape_contact_law law = drape_contact_law_of(c, contact);
        double local[12];
        if (conservative) {
            drape_contact_gradient(&contact->gap, &law, local);
            scatter(c, contact, local, g);
        }
        const bool friction = law.friction > 0 && !c->model->contact.lagged;
        if (!dissipative || (!friction && !(law.damping > 0)))
            continue;
        double v[4][3];
        drape_contact_velocities(c, contact, v);
        const drape_normal normal = drape_normal_at(&contact->gap, &law, v);
        if (law.damping > 0) {
            drape_restitution_force(&contact->gap, &normal, local);
            scatter(c, contact, local, g);
        }
        if (friction) /* that is not lagged */
            add_friction(c, contact, &law, drape_normal_force(&normal), v, g);
    }
    const int32_t lagged_count = dissipative ? c->lagged_count : 0;
    for (int32_t i = 0; i < lagged_count; i++) {
        const drape_lagged *lagged = &c->lagged[i];
        const drape_contact_law law = drape_contact_law_of(c, &lagged->contact);
        double v[4][3];
        drape_contact_velocities(c, &lagged->contact, v);
        add_friction(c, &lagged->contact, &law, lagged->force, v, g);
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
        if (drape_contact_counts(c, &c->active.contacts[i]))
            sum += drape_contact_energy(&c->active.contacts[i].gap, &law);
    }
    return drape_ranks_sum(c->ranks, sum);
}
