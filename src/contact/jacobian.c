/* jacobian.c: derivatives of the forces of the active set, and the blocks of a pattern that they need. See
 * contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "contact/list.h"

#include <string.h>

#define D 12
/* of a mean edge: pairs this near to becoming active have their blocks when a pattern is made */
#define PATTERN_MARGIN 0.25

static int32_t free_of(const drape_model *m, int32_t point)
{
    return point >= 0 && point < m->node_count ? m->free_of_node[point] : -1;
}

static void add_blocks(const drape_contact *c, const drape_active_contact *contact, const double *h,
                       const drape_pattern *pattern, double *values)
{
    const int points = contact->gap.closest.points;
    for (int s = 0; s < points; s++)
        for (int r = 0; r < points; r++) {
            int32_t column = free_of(c->model, contact->pair.node[s]),
                    row = free_of(c->model, contact->pair.node[r]);
            int64_t stride;
            if (column < 0 || row < 0)
                continue;
            double *to =
                drape_pattern_at(pattern, values, column, drape_pattern_find(pattern, row, column), &stride);
            for (int k = 0; k < 3; k++)
                for (int i = 0; i < 3; i++)
                    to[k * stride + i] += h[D * (3 * r + i) + 3 * s + k];
        }
}

/* The requested derivatives: dg/dx + weight dg/dv, or weight dg/dv alone. */
typedef struct request {
    double weight;
    bool velocity_only, gauss_newton;
} request;

/* Adds weight dg/dv of friction with the normal force lambda. */
static void add_friction(const drape_contact *c, const request *want, const drape_active_contact *contact,
                         const drape_contact_law *law, double lambda, double *h)
{
    const int d = 3 * contact->gap.closest.points;
    double v[4][3], g[D], dgdv[D * D];
    drape_contact_velocities(c, contact, v);
    if (want->gauss_newton)
        drape_friction_bound(&contact->gap, law, lambda, v, dgdv);
    else
        drape_friction_force(&contact->gap, law, lambda, v, g, dgdv);
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[D * i + j] += want->weight * dgdv[D * i + j];
}

/* The derivatives of one active contact, h (12 x 12). */
static void differentiate(const drape_contact *c, const request *want, const drape_active_contact *contact,
                          double *h)
{
    const drape_contact_law law = drape_contact_law_of(c, contact);
    const drape_configuration now = drape_contact_configuration(c);
    const bool friction = law.friction > 0 && !c->model->contact.lagged;
    const bool exact = !want->velocity_only && !want->gauss_newton;
    drape_gap_derivatives derivatives;
    double v[4][3];
    if (exact) {
        drape_pair_derivatives(&contact->pair, &contact->gap, &now, c->broad.rest, &derivatives);
        drape_contact_hessian(&contact->gap, &derivatives, &law, h);
    } else if (want->velocity_only) {
        memset(h, 0, D * 3 * (size_t)contact->gap.closest.points * sizeof *h);
    } else {
        drape_contact_gauss_newton(&contact->gap, &law, h);
    }
    if (!friction)
        return;
    add_friction(c, want, contact, &law, drape_contact_normal_force(&contact->gap, &law), h);
    if (exact) {
        drape_contact_velocities(c, contact, v);
        drape_friction_add_dgdx(&contact->gap, &derivatives, &law, v, h);
    }
}

void drape_contact_add_jacobian(drape_contact *c, double weight, bool velocity_only, bool gauss_newton,
                                const drape_pattern *pattern, double *values)
{
    const double start = drape_clock_seconds();
    const request want = {velocity_only ? 1 : weight, velocity_only, gauss_newton};
    double h[D * D];
    for (int32_t i = 0; i < c->active.count; i++) {
        differentiate(c, &want, &c->active.contacts[i], h);
        add_blocks(c, &c->active.contacts[i], h, pattern, values);
    }
    for (int32_t i = 0; i < c->lagged_count; i++) {
        const drape_lagged *lagged = &c->lagged[i];
        const drape_contact_law law = drape_contact_law_of(c, &lagged->contact);
        memset(h, 0, sizeof h);
        add_friction(c, &want, &lagged->contact, &law, lagged->lambda, h);
        add_blocks(c, &lagged->contact, h, pattern, values);
    }
    c->seconds += drape_clock_seconds() - start;
}

/* ---- The pattern ---- */

/* The blocks of contacts with colliders, the diagonal and the edges of triangles of the cloth, are in every
 * pattern: see drape_model_couplings. */
static bool has_blocks(const drape_contact *c, const drape_active_contact *contact,
                       const drape_pattern *pattern)
{
    const int points = contact->pair.collider < 0 ? contact->gap.closest.points : 0;
    for (int s = 0; s < points; s++)
        for (int r = 0; r < points; r++) {
            int32_t column = free_of(c->model, contact->pair.node[s]),
                    row = free_of(c->model, contact->pair.node[r]);
            if (column >= 0 && row >= 0 && !drape_pattern_has(pattern, row, column))
                return false;
        }
    return true;
}

bool drape_contact_is_in_pattern(const drape_contact *c, const drape_pattern *pattern)
{
    for (int32_t i = 0; i < c->active.count; i++)
        if (!has_blocks(c, &c->active.contacts[i], pattern))
            return false;
    for (int32_t i = 0; i < c->lagged_count; i++)
        if (!has_blocks(c, &c->lagged[i].contact, pattern))
            return false;
    return true;
}

/* Lists the nodes of a pair; if it has fewer than four, the first one is repeated. */
static bool add_coupling(drape_contact *c, const drape_pair *pair, int points)
{
    int32_t *coupling =
        drape_list_grow(c->arena, c->coupling, c->coupling_count, &c->coupling_room, 4 * sizeof *coupling);
    if (!coupling)
        return false;
    c->coupling = coupling;
    for (int a = 0; a < 4; a++)
        c->coupling[4 * (size_t)c->coupling_count + (size_t)a] = pair->node[a < points ? a : 0];
    c->coupling_count++;
    return true;
}

static bool is_near(const drape_contact *c, const drape_pair *pair)
{
    const drape_configuration now = drape_contact_configuration(c);
    const double near = pair->distance + PATTERN_MARGIN * c->mean_edge;
    return drape_candidate_may_fall_below(pair, c->moved, near) && drape_pair_gap_value(pair, &now) < near;
}

int32_t drape_contact_list_couplings(drape_contact *c, const int32_t **nodes)
{
    c->coupling_count = 0;
    for (int32_t i = 0; i < c->listed->count; i++) {
        const drape_pair *pair = &c->listed->pairs[i];
        if (pair->collider < 0 && is_near(c, pair) && !add_coupling(c, pair, 4))
            return -1;
    }
    for (int32_t i = 0; i < c->lagged_count; i++) {
        const drape_active_contact *contact = &c->lagged[i].contact;
        if (contact->pair.collider < 0 && !add_coupling(c, &contact->pair, contact->gap.closest.points))
            return -1;
    }
    return drape_contact_last_couplings(c, nodes);
}

int32_t drape_contact_last_couplings(const drape_contact *c, const int32_t **nodes)
{
    *nodes = c->coupling;
    return c->coupling_count;
}
