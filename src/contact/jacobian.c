/* jacobian.c: derivatives of the forces of the active set, and the blocks of a pattern that they need. See
 * contact.h. */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/list.h"
#include "base/vec3.h"
#include "contact/barrier.h"

#include <string.h>

#define D DRAPE_GAP_DOFS

static int32_t free_of(const drape_model *m, int32_t point)
{
    return point >= 0 && point < m->node_count ? m->free_of_node[point] : -1;
}

/* Adds share h to the blocks of the free nodes of a contact. */
static void add_blocks(const drape_contact *c, const drape_active_contact *contact, double share,
                       const double *h, const drape_pattern *pattern, double *values)
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
                    to[k * stride + i] += share * h[D * (3 * r + i) + 3 * s + k];
        }
}

/* -dN/dgap if only the gap changes, and with it its rate; bound: with the upper bound of restitution. */
static double tangent_stiffness(const drape_gap *gap, const drape_contact_law *law, double weight,
                                double v[4][3], bool bound)
{
    const drape_normal normal = drape_normal_at(gap, law, v);
    const double barrier =
        gap->m * law->stiffness / law->distance * drape_barrier_at(gap->value / law->distance, law->low).ddb;
    return bound ? barrier + weight * normal.lambda * normal.secant
                 : barrier * (1 - normal.share) + weight * normal.lambda * normal.slope;
}

/* By how much the normal stiffness of a contact in the Jacobian, the secant to its predicted force, is above
 * the tangent stiffness; 0 without a prediction. */
static double excess_stiffness(const drape_contact *c, const drape_active_contact *contact,
                               const drape_contact_law *law, double weight, bool bound)
{
    const drape_gap *gap = &contact->gap;
    double v[4][3];
    if (c->predicted.count == 0)
        return 0;
    drape_contact_velocities(c, contact, v);
    const double secant = drape_predictions_stiffness(&c->predicted, contact, law, weight, v);
    return isnan(secant) ? 0 : secant - tangent_stiffness(gap, law, weight, v, bound);
}

typedef struct request {
    double weight;
    drape_contact_derivatives which;
} request;

/* Adds weight dg/dv of friction with the normal force `force`. */
static void add_friction(const request *want, const drape_active_contact *contact,
                         const drape_contact_law *law, double force, double v[4][3], double *h)
{
    const int d = 3 * contact->gap.closest.points;
    double g[D], dgdv[D * D];
    if (want->which == DRAPE_CONTACT_GAUSS_NEWTON)
        drape_friction_bound(&contact->gap, law, force, v, dgdv);
    else
        drape_friction_force(&contact->gap, law, force, v, g, dgdv);
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[D * i + j] += want->weight * dgdv[D * i + j];
}

/* Adds the derivatives of friction that is not lagged by its normal force and, unless derivatives and by_x
 * are NULL, by the place of contact. */
static void add_changes_of_friction(const drape_gap *gap, const drape_contact_law *law, double weight,
                                    const drape_normal *normal, const drape_gap_derivatives *derivatives,
                                    const drape_normal_derivatives *by_x, double excess, double v[4][3],
                                    double *h)
{
    double change[D];
    drape_normal_by_v(gap, normal, weight, change);
    if (derivatives) {
        drape_normal_add_by_x(gap, normal, by_x, change);
        for (int j = 0; j < 3 * gap->closest.points; j++)
            change[j] -= excess * gap->closest.c[j / 3] * gap->closest.normal[j % 3];
        drape_friction_add_dgdx(gap, derivatives, law, drape_normal_force(normal), v, h);
    }
    drape_friction_add_normal(gap, law, change, v, h);
}

/* Adds the derivatives of the dissipative part of the normal force and of friction that is not lagged;
 * derivatives: NULL unless those by x are requested. */
static void add_dissipative(const drape_contact *c, const request *want, const drape_active_contact *contact,
                            const drape_contact_law *law, const drape_gap_derivatives *derivatives,
                            double excess, double *h)
{
    const drape_gap *gap = &contact->gap;
    const bool friction = law->friction > 0 && !c->model->contact.lagged;
    drape_normal_derivatives by_x;
    double v[4][3];
    if (!friction && !(law->damping > 0))
        return;
    drape_contact_velocities(c, contact, v);
    const drape_normal normal = drape_normal_at(gap, law, v);
    if (derivatives)
        drape_normal_derive(gap, derivatives, law, v, &by_x);
    if (law->damping > 0)
        drape_restitution_add_dgdv(
            gap, &normal,
            want->weight * (want->which == DRAPE_CONTACT_GAUSS_NEWTON ? normal.secant : normal.slope), h);
    if (law->damping > 0 && derivatives)
        drape_restitution_add_dgdx(gap, derivatives, &normal, &by_x, h);
    if (!friction)
        return;
    add_friction(want, contact, law, drape_normal_force(&normal), v, h);
    if (want->which != DRAPE_CONTACT_GAUSS_NEWTON)
        add_changes_of_friction(gap, law, want->weight, &normal, derivatives, derivatives ? &by_x : NULL,
                                excess, v, h);
}

/* Adds what follows from the velocity of the surface around a round feature that turns: it changes with the
 * normal, by dv = arm G dn at the points of the feature. */
static void add_roll(const drape_contact *c, const drape_active_contact *contact,
                     const drape_gap_derivatives *derivatives, const double *hv, double *h)
{
    const double *gradient = c->pose[contact->pair.collider].gradient, arm = drape_contact_arm(c, contact);
    const int d = 3 * contact->gap.closest.points;
    for (int i = 0; i < d; i++)
        for (int b = 0; b < d; b++)
            for (int k = 0; k < 3 && contact->pair.node[b / 3] >= c->model->node_count; k++)
                for (int j = 0; j < d; j++)
                    h[D * i + j] +=
                        hv[D * i + b] * arm * gradient[3 * (b % 3) + k] * derivatives->closest.normal[k][j];
}

/* Adds what follows from the velocity V(x) of a surface that turns: forces with dg/dv = hv depend on x
 * through the relative velocity v - V(x). derivatives: NULL if the place of contact is fixed. */
static void add_spin(const drape_contact *c, const drape_active_contact *contact,
                     const drape_gap_derivatives *derivatives, const double *hv, double *h)
{
    const drape_collider_pose *pose = &c->pose[contact->pair.collider];
    const int d = 3 * contact->gap.closest.points;
    if (drape_contact_rolls(c, contact)) {
        if (derivatives)
            add_roll(c, contact, derivatives, hv, h);
        return;
    }
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            for (int k = 0; k < 3; k++)
                h[D * i + j] -= hv[D * i + j - j % 3 + k] * pose->gradient[3 * k + j % 3];
}

static bool spins(const drape_contact *c, const drape_active_contact *contact)
{
    return (contact->pair.kind == DRAPE_PAIR_SURFACE && c->pose[contact->pair.collider].spins) ||
           drape_contact_rolls(c, contact);
}

/* h = (h + h')/2 of so many points */
static void symmetrize(int points, double *h)
{
    for (int i = 0; i < 3 * points; i++)
        for (int j = 0; j < i; j++)
            h[D * i + j] = h[D * j + i] = (h[D * i + j] + h[D * j + i]) / 2;
}

/* dg/dv of one active contact, h (12 x 12). */
static void differentiate_by_v(const drape_contact *c, const drape_active_contact *contact, double *h)
{
    const drape_contact_law law = drape_contact_law_of(c, contact);
    memset(h, 0, D * D * sizeof *h);
    add_dissipative(c, &(request){1, DRAPE_CONTACT_VELOCITY}, contact, &law, NULL, 0, h);
}

bool drape_contact_has_friction(const drape_contact *c)
{
    bool friction = c->model->contact.self && c->model->contact.self_friction > 0;
    for (int32_t i = 0; i < c->model->collider_count; i++)
        friction = friction || c->model->colliders[i].friction > 0;
    return friction;
}

bool drape_contact_is_symmetric(const drape_contact *c)
{
    return !drape_contact_has_friction(c) || c->model->contact.lagged;
}

/* Adds a share of the derivatives of all contacts. */
static void add_derivatives(const drape_contact *c, const request *want, double share,
                            const drape_pattern *pattern, double *values)
{
    double h[D * D];
    for (int32_t i = 0; i < c->active.count; i++) {
        /* The derivatives of one active contact, h (12 x 12). */
        const drape_active_contact *contact = &c->active.contacts[i];
        const drape_contact_law law = drape_contact_law_of(c, contact);
        const drape_configuration now = drape_contact_configuration(c);
        const bool by_x = want->which == DRAPE_CONTACT_EXACT || want->which == DRAPE_CONTACT_SYMMETRIC;
        drape_gap_derivatives derivatives;
        if (by_x) {
            drape_pair_derivatives(&contact->pair, &contact->gap, &now, c->broad.rest, &derivatives);
            drape_law_hessian(&contact->gap, &derivatives, &law, h);
        } else if (want->which == DRAPE_CONTACT_VELOCITY) {
            memset(h, 0, D * 3 * (size_t)contact->gap.closest.points * sizeof *h);
        } else {
            drape_law_gauss_newton(&contact->gap, &law, h);
        }
        const double excess = want->which == DRAPE_CONTACT_VELOCITY
                                  ? 0
                                  : excess_stiffness(c, contact, &law, want->weight, !by_x);
        add_dissipative(c, want, contact, &law, by_x ? &derivatives : NULL, excess, h);
        const double *ce = contact->gap.closest.c, *n = contact->gap.closest.normal;
        for (int k = 0; excess != 0 && k < 3 * contact->gap.closest.points; k++)
            for (int j = 0; j < 3 * contact->gap.closest.points; j++)
                h[D * k + j] += excess * ce[k / 3] * n[k % 3] * ce[j / 3] * n[j % 3];
        if (by_x && spins(c, contact)) {
            double hv[D * D];
            differentiate_by_v(c, contact, hv);
            add_spin(c, contact, &derivatives, hv, h);
        }
        if (want->which == DRAPE_CONTACT_SYMMETRIC)
            symmetrize(contact->gap.closest.points, h);
        add_blocks(c, contact, share, h, pattern, values);
    }
    for (int32_t i = 0; i < c->lagged_count; i++) {
        const drape_lagged *lagged = &c->lagged[i];
        const drape_contact_law law = drape_contact_law_of(c, &lagged->contact);
        double v[4][3];
        memset(h, 0, sizeof h);
        drape_contact_velocities(c, &lagged->contact, v);
        add_friction(want, &lagged->contact, &law, lagged->force, v, h);
        if (spins(c, &lagged->contact) && want->which != DRAPE_CONTACT_VELOCITY &&
            want->which != DRAPE_CONTACT_GAUSS_NEWTON) {
            double hv[D * D] = {0};
            add_friction(&(request){1, DRAPE_CONTACT_EXACT}, &lagged->contact, &law, lagged->force, v, hv);
            add_spin(c, &lagged->contact, NULL, hv, h);
            if (want->which == DRAPE_CONTACT_SYMMETRIC)
                symmetrize(lagged->contact.gap.closest.points, h);
        }
        add_blocks(c, &lagged->contact, share, h, pattern, values);
    }
}

void drape_contact_add_jacobian(drape_contact *c, double weight, drape_contact_derivatives which,
                                double positive_share, const drape_pattern *pattern, double *values)
{
    const double start = drape_clock_seconds();
    const bool exact = which == DRAPE_CONTACT_SYMMETRIC && !drape_contact_is_symmetric(c);
    const request want = {which == DRAPE_CONTACT_VELOCITY ? 1 : weight, exact ? DRAPE_CONTACT_EXACT : which};
    if (which == DRAPE_CONTACT_GAUSS_NEWTON || positive_share < 1)
        add_derivatives(c, &want, which == DRAPE_CONTACT_GAUSS_NEWTON ? 1 : 1 - positive_share, pattern,
                        values);
    if (which != DRAPE_CONTACT_GAUSS_NEWTON && positive_share > 0)
        add_derivatives(c, &(request){weight, DRAPE_CONTACT_GAUSS_NEWTON}, positive_share, pattern, values);
    c->seconds += drape_clock_seconds() - start;
}

void drape_contact_add_remainder(drape_contact *c, double weight, const drape_pattern *pattern,
                                 double *values)
{
    const double start = drape_clock_seconds();
    add_derivatives(c, &(request){weight, DRAPE_CONTACT_EXACT}, 1, pattern, values);
    add_derivatives(c, &(request){weight, DRAPE_CONTACT_GAUSS_NEWTON}, -1, pattern, values);
    c->seconds += drape_clock_seconds() - start;
}

void drape_contact_fix_friction(drape_contact *c, double weight, double share, const drape_pattern *pattern,
                                double *values)
{
    const double start = drape_clock_seconds();
    const drape_configuration now = drape_contact_configuration(c);
    for (int32_t i = 0; i < c->active.count && !c->model->contact.lagged; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        const drape_contact_law law = drape_contact_law_of(c, contact);
        drape_gap_derivatives derivatives;
        drape_normal_derivatives by_x;
        double v[4][3], h[D * D] = {0};
        if (!(law.friction > 0))
            continue;
        drape_pair_derivatives(&contact->pair, &contact->gap, &now, c->broad.rest, &derivatives);
        drape_contact_velocities(c, contact, v);
        const drape_normal normal = drape_normal_at(&contact->gap, &law, v);
        drape_normal_derive(&contact->gap, &derivatives, &law, v, &by_x);
        const double excess = excess_stiffness(c, contact, &law, weight, false);
        add_changes_of_friction(&contact->gap, &law, weight, &normal, &derivatives, &by_x, excess, v, h);
        if (spins(c, contact)) {
            double hv[D * D];
            differentiate_by_v(c, contact, hv);
            add_spin(c, contact, &derivatives, hv, h);
        }
        add_blocks(c, contact, -share, h, pattern, values);
    }
    c->seconds += drape_clock_seconds() - start;
}

/* ---- Prediction ---- */

static double predict(const drape_contact *c, const drape_active_contact *contact, const double *p,
                      double weight, double mass_weight)
{
    const drape_contact_law law = drape_contact_law_of(c, contact);
    const drape_gap *gap = &contact->gap;
    double v[4][3], change = 0, compliance = 0; /* a force accelerates the gap by sum(c_i^2/m_i) */
    drape_contact_velocities(c, contact, v);
    const drape_normal normal = drape_normal_at(gap, &law, v);
    for (int a = 0; a < gap->closest.points; a++) {
        const int32_t node = contact->pair.node[a];
        if (free_of(c->model, node) < 0)
            continue;
        change += gap->closest.c[a] * vec3_dot(gap->closest.normal, p + 3 * (size_t)node);
        compliance += gap->closest.c[a] * gap->closest.c[a] / c->model->mass[node];
    }
    const double stiffness = tangent_stiffness(gap, &law, weight, v, false) +
                             excess_stiffness(c, contact, &law, weight, false),
                 through = fmax(-change - gap->value, 0);
    return fmax(drape_normal_force(&normal) - stiffness * change, 0) +
           mass_weight * (compliance > 0 ? 1 / compliance : 0) * through;
}

void drape_contact_predict(drape_contact *c, const double *p, double weight, double mass_weight)
{
    const double start = drape_clock_seconds();
    drape_predictions *now = &c->predicted, *next = &c->predicting;
    drape_predictions_clear(next);
    for (int32_t i = 0; p && i < c->active.count; i++)
        if (!drape_predictions_add(next, &c->active.contacts[i],
                                   predict(c, &c->active.contacts[i], p, weight, mass_weight)))
            break; /* without memory for it, a contact has its tangent */
    const drape_predictions swap = *now;
    *now = *next;
    *next = swap;
    c->seconds += drape_clock_seconds() - start;
}

/* ---- The pattern ---- */

/* A contact with a collider needs only blocks on the diagonal and of edges of the cloth, which every pattern
 * has: see drape_model_couplings. */
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
    int32_t nodes[4];
    for (int a = 0; a < 4; a++)
        nodes[a] = pair->node[a < points ? a : 0];
    return drape_list_append(c->arena, &c->coupling, &c->coupling_count, &c->coupling_capacity, nodes,
                             sizeof nodes);
}

/* The pairs of cloth that are listed, and whether there was memory for all. */
typedef struct listing {
    drape_contact *contact;
    double margin; /* [m] */
    bool complete;
} listing;

static void list_near(void *user, const drape_pair *pair)
{
    listing *list = user;
    drape_contact *c = list->contact;
    const drape_configuration now = drape_contact_configuration(c);
    const double reach = pair->distance + list->margin;
    if (pair->collider < 0 && !drape_pair_is_apart(pair, &now, reach) &&
        drape_pair_gap_value(pair, &now) < reach)
        list->complete = list->complete && add_coupling(c, pair, 4);
}

int32_t drape_contact_list_couplings(drape_contact *c, const int32_t **nodes)
{
    const double start = drape_clock_seconds();
    listing list = {.contact = c, .margin = c->step_candidates.margin / 2, .complete = true};
    const drape_configuration now = drape_contact_configuration(c);
    const drape_straight_path here = {{now, now}};
    drape_distances away;
    c->coupling_count = 0;
    /* A pattern has the blocks of all pairs whose gap is below their activation distance and half of the
     * margin. Blocks of more pairs would stay 0, and cost more in each factorisation of a pile than the
     * patterns that they save. The pairs are taken from the candidates only if these contain all of them: a
     * pattern depends on the positions alone. */
    const drape_candidates *candidates = drape_contact_valid_candidates(c, &here, &away);
    if (candidates &&
        drape_candidates_farthest(candidates, &away) + 0.5 * list.margin <= candidates->margin) {
        drape_candidate_cursor cursor = {0};
        const drape_pair *pair;
        away.beyond = list.margin;
        while ((pair = drape_candidates_next(candidates, &away, &cursor)))
            list_near(&list, pair);
    } else {
        drape_candidates_find(&c->broad, &here, 0.5 * list.margin, false, NULL, list_near, &list);
        c->search_seconds += drape_clock_seconds() - start;
    }
    c->seconds += drape_clock_seconds() - start;
    for (int32_t i = 0; i < c->lagged_count; i++) {
        const drape_active_contact *contact = &c->lagged[i].contact;
        if (contact->pair.collider < 0 && !add_coupling(c, &contact->pair, contact->gap.closest.points))
            return -1;
    }
    return list.complete ? drape_contact_last_couplings(c, nodes) : -1;
}

int32_t drape_contact_last_couplings(const drape_contact *c, const int32_t **nodes)
{
    *nodes = c->coupling;
    return c->coupling_count;
}
