/* points.c: the active contacts as a host sees them. See contact.h. */
#include "contact/parts.h"

#include "base/vec3.h"

#include <string.h>

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

static drape_contact_point point_of(const drape_contact *c, const drape_active_contact *contact)
{
    const drape_contact_law law = drape_contact_law_of(c, contact);
    drape_contact_point out = place_of(c, contact);
    double local[12], v[4][3];
    drape_contact_velocities(c, contact, v);
    const drape_normal normal = drape_normal_at(&contact->gap, &law, v);
    drape_contact_gradient(&contact->gap, &law, local);
    add_force(c, contact, local, out.force);
    if (law.damping > 0) {
        drape_restitution_force(&contact->gap, &normal, local);
        add_force(c, contact, local, out.force);
    }
    if (law.friction > 0 && !c->model->contact.lagged) {
        drape_friction_force(&contact->gap, &law, drape_normal_force(&normal), v, local, NULL);
        add_force(c, contact, local, out.force);
    }
    out.normal_force = drape_normal_force(&normal);
    return out;
}

static drape_contact_point lagged_point(const drape_contact *c, const drape_lagged *lagged)
{
    const drape_contact_law law = drape_contact_law_of(c, &lagged->contact);
    drape_contact_point out = place_of(c, &lagged->contact);
    double local[12], v[4][3];
    drape_contact_velocities(c, &lagged->contact, v);
    drape_friction_force(&lagged->contact.gap, &law, lagged->force, v, local, NULL);
    add_force(c, &lagged->contact, local, out.force);
    return out;
}

int32_t drape_contact_points(const drape_contact *c, int32_t capacity, drape_contact_point *points)
{
    for (int32_t i = 0; i < c->active.count && i < capacity; i++)
        points[i] = point_of(c, &c->active.contacts[i]);
    for (int32_t i = 0; i < c->lagged_count && c->active.count + i < capacity; i++)
        points[c->active.count + i] = lagged_point(c, &c->lagged[i]);
    return c->active.count + c->lagged_count;
}
