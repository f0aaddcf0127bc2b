/* rebound.c: restitution of impacts that begin and end within a step. See contact.h. */
#include "contact/contact_parts.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* An impulse at one pair changes the speeds of others that have its nodes: sweeps over all of them. */
#define SWEEPS 4

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

bool drape_contact_impacts(const drape_contact *c, const double *before)
{
    double mean, own;
    bool any = false;
    for (int32_t i = 0; i < c->active.count && !any; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        any = !(contact->exempt > 0) &&
              rate_before(c, contact, before, &mean, &own) < -c->model->contact.restitution_velocity;
    }
    return any;
}

bool drape_contact_rebounds(const drape_contact *c)
{
    bool any = c->model->contact.self && c->model->contact.self_restitution > 0;
    for (int32_t i = 0; i < c->model->collider_count; i++)
        any = any || c->model->colliders[i].restitution > 0;
    return any;
}

void drape_contact_rebound(const drape_contact *c, double h, const double *before, const double *acceleration,
                           double *v)
{
    const drape_contact_def *def = &c->model->contact;
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int32_t i = 0; i < c->active.count; i++) {
            const drape_active_contact *contact = &c->active.contacts[i];
            const double e = contact->pair.collider >= 0
                                 ? c->model->colliders[contact->pair.collider].restitution
                                 : def->self_restitution;
            if (!(e > 0) || contact->exempt > 0)
                continue;
            double mean, own;
            const double approach = rate_before(c, contact, before, &mean, &own),
                         gap = fmax(contact->gap.value - h * mean, 0),
                         speed = sqrt(fmax(
                             approach * approach - 2 * gap * rate_of_nodes(c, contact, acceleration), 0)),
                         more = e * speed - own - rate_of_nodes(c, contact, v);
            if (approach < 0 && speed > def->restitution_velocity && more > 0)
                push(c, contact, more, v);
        }
}

void drape_contact_clear(const drape_contact *c, double *u)
{
    for (int32_t i = 0; i < c->active.count; i++)
        for (int a = 0; a < c->active.contacts[i].gap.closest.points; a++)
            if (c->active.contacts[i].pair.node[a] < c->model->node_count)
                memset(u + 3 * (size_t)c->active.contacts[i].pair.node[a], 0, 3 * sizeof *u);
}
