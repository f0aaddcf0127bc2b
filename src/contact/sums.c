/* sums.c: what acts where contact was last placed, added up: forces, potential, derivatives and the places that
 * these need in a pattern. See contact.h. */
#include "contact/inside.h"

#include "base/clock.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define D 12
#define PATTERN_AHEAD                                                                                        \
    0.25 /* of a mean edge: so near to acting, a pair has its place when a pattern is made */

/* ---- Forces ---- */

/* Pairs with a shorter activation distance take up the same energy. */
drape_contact_law drape_contact_law_of(const drape_contact *c, const drape_pair *pair)
{
    drape_contact_law law = c->law;
    law.distance = pair->distance;
    law.stiffness = c->model->contact.stiffness * pair->area * (c->model->contact.distance / pair->distance);
    law.friction =
        pair->collider >= 0 ? c->model->colliders[pair->collider].friction : c->model->contact.self_friction;
    return law;
}

static void gather_velocities(const drape_contact *c, const drape_pair *pair, int points, double v[4][3])
{
    for (int a = 0; a < points; a++)
        memcpy(v[a], c->v + 3 * (size_t)pair->node[a], sizeof v[a]);
    if (points == 1)
        vec3_sub(v[0], c->pose[pair->collider].velocity, v[0]);
}

static void scatter(drape_contact *c, const drape_pair *pair, int points, const double *from, double *g)
{
    const int32_t *node = pair->node;
    for (int a = 0; a < points; a++)
        for (int k = 0; k < 3 && node[a] < c->model->node_count; k++) {
            g[3 * (size_t)node[a] + (size_t)k] += from[3 * a + k];
            if (pair->collider >= 0)
                c->on_collider[3 * (size_t)pair->collider + (size_t)k] -= from[3 * a + k];
        }
}

void drape_contact_gap(const drape_contact *c, const drape_touch *touch, bool derivatives, drape_gap *gap)
{
    const drape_placed now = drape_contact_placed(c, c->x);
    drape_touch_gap(touch, &now, c->search.rest, derivatives, gap);
}

static void add_touch(drape_contact *c, const drape_touch *touch, bool normal, bool friction, double *g)
{
    drape_gap gap;
    double local[D], v[4][3];
    drape_contact_law law = drape_contact_law_of(c, &touch->pair);
    drape_contact_gap(c, touch, false, &gap);
    if (normal) {
        drape_contact_normal(&gap, &law, local, NULL);
        scatter(c, &touch->pair, gap.points, local, g);
    }
    if (!friction || c->model->contact.lagged || !(law.friction > 0))
        return;
    gather_velocities(c, &touch->pair, gap.points, v);
    drape_contact_friction(&gap, &law, drape_contact_normal_force(&gap, &law), v, local, NULL);
    scatter(c, &touch->pair, gap.points, local, g);
}

static void add_lagged(drape_contact *c, const drape_lagged *l, double *g)
{
    double v[4][3], local[D];
    drape_contact_law law = drape_contact_law_of(c, &l->pair);
    gather_velocities(c, &l->pair, l->gap.points, v);
    drape_contact_friction(&l->gap, &law, l->lambda, v, local, NULL);
    scatter(c, &l->pair, l->gap.points, local, g);
}

void drape_contact_add_forces(drape_contact *c, bool normal, bool friction, double *g)
{
    double start = drape_clock_seconds();
    memset(c->on_collider, 0, 3 * (size_t)c->model->collider_count * sizeof *c->on_collider);
    for (int32_t i = 0; i < c->touch_count; i++)
        add_touch(c, &c->touches[i], normal, friction, g);
    for (int32_t i = 0; friction && i < c->lagged_count; i++)
        add_lagged(c, &c->lagged[i], g);
    c->seconds += drape_clock_seconds() - start;
}

const double *drape_contact_on_colliders(const drape_contact *c)
{
    return c->on_collider;
}

double drape_contact_potential(drape_contact *c)
{
    double sum = 0;
    for (int32_t i = 0; i < c->touch_count; i++) {
        drape_gap gap;
        drape_contact_law law = drape_contact_law_of(c, &c->touches[i].pair);
        drape_contact_gap(c, &c->touches[i], false, &gap);
        sum += drape_contact_energy(&gap, &law);
    }
    return sum;
}

int32_t drape_contact_active(drape_contact *c, double *least_gap)
{
    *least_gap = INFINITY;
    for (int32_t i = 0; i < c->touch_count; i++)
        *least_gap = fmin(*least_gap, c->touches[i].gap);
    return c->touch_count;
}

/* ---- Jacobian ---- */

static int32_t free_of(const drape_model *m, int32_t point)
{
    return point >= 0 && point < m->node_count ? m->free_of_node[point] : -1;
}

static void add_blocks(const drape_contact *c, const int32_t *node, int points, const double *h,
                       const drape_pattern *pattern, double *values)
{
    for (int s = 0; s < points; s++)
        for (int r = 0; r < points; r++) {
            int32_t column = free_of(c->model, node[s]), row = free_of(c->model, node[r]);
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

static void add_weighted(int d, double weight, const double *from, double *h)
{
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[D * i + j] += weight * from[D * i + j];
}

/* What of the derivatives is wanted: dg/dx + weight dg/dv, or weight dg/dv alone. */
typedef struct request {
    double weight;
    bool velocity_only, positive;
} request;

/* Adds weight dg/dv of friction with the normal force lambda. */
static void friction_jacobian(drape_contact *c, const request *want, const drape_pair *pair,
                              const drape_gap *gap, double lambda, double *h)
{
    double v[4][3], g[D], dgdv[D * D];
    drape_contact_law law = drape_contact_law_of(c, pair);
    gather_velocities(c, pair, gap->points, v);
    if (want->positive)
        drape_contact_friction_bound(gap, &law, lambda, v, dgdv);
    else
        drape_contact_friction(gap, &law, lambda, v, g, dgdv);
    add_weighted(3 * gap->points, want->weight, dgdv, h);
    if (!want->velocity_only && !want->positive && !c->model->contact.lagged)
        drape_contact_friction_slope(gap, &law, v, h);
}

static void touch_jacobian(drape_contact *c, const request *want, const drape_pair *pair,
                           const drape_gap *gap, double *h)
{
    drape_contact_law law = drape_contact_law_of(c, pair);
    double g[D];
    if (want->velocity_only)
        memset(h, 0, D * 3 * (size_t)gap->points * sizeof *h);
    else if (want->positive)
        drape_contact_positive(gap, &law, h);
    else
        drape_contact_normal(gap, &law, g, h);
    if (law.friction > 0 && !c->model->contact.lagged)
        friction_jacobian(c, want, pair, gap, drape_contact_normal_force(gap, &law), h);
}

void drape_contact_add_jacobian(drape_contact *c, double weight, bool velocity_only, bool positive,
                                const drape_pattern *pattern, double *values)
{
    double start = drape_clock_seconds(), h[D * D];
    const request want = {velocity_only ? 1 : weight, velocity_only, positive};
    for (int32_t i = 0; i < c->touch_count; i++) {
        const drape_pair *pair = &c->touches[i].pair;
        drape_gap gap;
        drape_contact_gap(c, &c->touches[i], true, &gap);
        touch_jacobian(c, &want, pair, &gap, h);
        add_blocks(c, pair->node, gap.points, h, pattern, values);
    }
    for (int32_t i = 0; i < c->lagged_count; i++) {
        const drape_lagged *l = &c->lagged[i];
        memset(h, 0, sizeof h);
        friction_jacobian(c, &want, &l->pair, &l->gap, l->lambda, h);
        add_blocks(c, l->pair.node, l->gap.points, h, pattern, values);
    }
    c->seconds += drape_clock_seconds() - start;
}

static bool has_places(const drape_contact *c, const int32_t *node, int points, const drape_pattern *pattern)
{
    for (int s = 0; s < points; s++)
        for (int r = 0; r < points; r++) {
            int32_t column = free_of(c->model, node[s]), row = free_of(c->model, node[r]);
            if (column >= 0 && row >= 0 && !drape_pattern_has(pattern, row, column))
                return false;
        }
    return true;
}

bool drape_contact_fits(drape_contact *c, const drape_pattern *pattern)
{
    for (int32_t i = 0; i < c->touch_count; i++)
        if (c->touches[i].pair.collider < 0 &&
            !has_places(c, c->touches[i].pair.node, c->touches[i].closest.points, pattern))
            return false;
    for (int32_t i = 0; i < c->lagged_count; i++)
        if (c->lagged[i].pair.collider < 0 &&
            !has_places(c, c->lagged[i].pair.node, c->lagged[i].gap.points, pattern))
            return false;
    return true;
}

/* Four nodes each: the first again for those that are not there. */
static bool list_coupling(drape_contact *c, int32_t count, const drape_pair *pair, int points)
{
    int32_t *coupling =
        drape_contact_grow(c->ctx, c->coupling, count, &c->coupling_room, 4 * sizeof *coupling);
    if (!coupling)
        return false;
    c->coupling = coupling;
    for (int a = 0; a < 4; a++)
        c->coupling[4 * (size_t)count + (size_t)a] = pair->node[a < points ? a : 0];
    return true;
}

static bool is_near(const drape_contact *c, const drape_pair *pair)
{
    const drape_placed now = drape_contact_placed(c, c->x);
    double near = pair->distance + PATTERN_AHEAD * c->mean_edge;
    return drape_contact_may(pair, c->moved, near) && drape_pair_gap_value(pair, &now) < near;
}

int32_t drape_contact_couplings(drape_contact *c, const int32_t **nodes)
{
    int32_t count = c->coupling_count = 0;
    for (int32_t i = 0; i < c->count; i++)
        if (c->pairs[i].collider < 0 && is_near(c, &c->pairs[i]) &&
            !list_coupling(c, count++, &c->pairs[i], 4))
            return -1;
    for (int32_t i = 0; i < c->lagged_count; i++)
        if (c->lagged[i].pair.collider < 0 &&
            !list_coupling(c, count++, &c->lagged[i].pair, c->lagged[i].gap.points))
            return -1;
    *nodes = c->coupling;
    return c->coupling_count = count;
}

int32_t drape_contact_coupled(const drape_contact *c, const int32_t **nodes)
{
    *nodes = c->coupling;
    return c->coupling_count;
}
