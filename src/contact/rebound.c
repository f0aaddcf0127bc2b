/* rebound.c: restitution of impacts that begin and end within a step. See contact.h. */
#include "contact/contact_parts.h"

#include "base/vec3.h"

#include <math.h>

/* An impulse at one pair changes the speeds of others that have its nodes: sweeps over all of them. */
#define SWEEPS    4
#define FEW_STEPS 0.1 /* of the activation distance, in a step: in ten steps an impact is resolved */

/* sum c_i n . u_i over the cloth's nodes of a contact, u (node_count x 3). */
static double rate_of_nodes(const drape_contact *c, const drape_active_contact *contact, const double *u)
{
    const drape_closest *closest = &contact->gap.closest;
    double rate = 0;
    for (int a = 0; a < closest->points; a++)
        if (contact->pair.node[a] < c->model->node_count)
            rate += closest->c[a] * vec3_dot(closest->normal, u + 3 * (size_t)contact->pair.node[a]);
    return rate;
}

/* The rate of the gap by the mean velocities of the step, where the contact was evaluated. */
static double mean_rate(const drape_contact *c, const drape_active_contact *contact)
{
    double v[4][3], rate = 0;
    drape_contact_velocities(c, contact, v);
    for (int a = 0; a < contact->gap.closest.points; a++)
        rate += contact->gap.closest.c[a] * vec3_dot(contact->gap.closest.normal, v[a]);
    return rate;
}

/* The rate of the gap at the beginning of the step. own: what does not come from the nodes. */
static double rate_before(const drape_contact *c, const drape_active_contact *contact, const double *before,
                          double *mean, double *own)
{
    *mean = mean_rate(c, contact);
    *own = *mean - rate_of_nodes(c, contact, c->v);
    return *own + rate_of_nodes(c, contact, before);
}

/* Gives the free nodes of a contact an impulse by which its gap opens faster by `more`. */
static void push(const drape_contact *c, const drape_active_contact *contact, double more, double *v)
{
    const drape_closest *closest = &contact->gap.closest;
    const drape_model *m = c->model;
    double mobility = 0;
    for (int a = 0; a < closest->points; a++) {
        const int32_t i = contact->pair.node[a];
        if (i < m->node_count && m->free_of_node[i] >= 0)
            mobility += closest->c[a] * closest->c[a] / m->mass[i];
    }
    for (int a = 0; a < closest->points && mobility > 0; a++) {
        const int32_t i = contact->pair.node[a];
        if (i < m->node_count && m->free_of_node[i] >= 0)
            vec3_add_scaled(more * closest->c[a] / (m->mass[i] * mobility), closest->normal,
                            v + 3 * (size_t)i);
    }
}

/* Faster than what rests, and so fast that it crosses the distance of contact in fewer than ten steps. */
static bool hits(const drape_contact *c, const drape_active_contact *contact, double h, double rate)
{
    return !(contact->exempt > 0) && -rate > c->model->contact.restitution_velocity &&
           -rate * h > FEW_STEPS * contact->pair.distance;
}

bool drape_contact_impacts(const drape_contact *c, double h, const double *before)
{
    double mean, own;
    bool any = false;
    for (int32_t i = 0; i < c->active.count && !any; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        any = hits(c, contact, h, rate_before(c, contact, before, &mean, &own));
    }
    return any;
}

/* The share of gravity in the acceleration of a gap: free nodes fall. */
static double fall(const drape_contact *c, const drape_active_contact *contact)
{
    const drape_closest *closest = &contact->gap.closest;
    double sum = 0;
    for (int a = 0; a < closest->points; a++)
        if (contact->pair.node[a] < c->model->node_count &&
            c->model->free_of_node[contact->pair.node[a]] >= 0)
            sum += closest->c[a];
    return sum * vec3_dot(closest->normal, c->model->gravity);
}

void drape_contact_rebound(const drape_contact *c, double h, const double *before, double *v)
{
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int32_t i = 0; i < c->active.count; i++) {
            const drape_active_contact *contact = &c->active.contacts[i];
            const double e = contact->pair.collider >= 0
                                 ? c->model->colliders[contact->pair.collider].restitution
                                 : c->model->contact.self_restitution;
            if (!(e > 0))
                continue;
            double mean, own;
            const double approach = rate_before(c, contact, before, &mean, &own),
                         gap = fmax(contact->gap.value - h * mean, 0),
                         speed = sqrt(fmax(approach * approach - 2 * gap * fall(c, contact), 0)),
                         more = e * speed - own - rate_of_nodes(c, contact, v);
            if (more > 0 && -approach * h > contact->pair.distance && hits(c, contact, h, approach))
                push(c, contact, more, v);
        }
}
