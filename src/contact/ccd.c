/* ccd.c: continuous collision detection: the step fraction of a straight displacement without collisions. See
 * contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/bound.h"

#include <string.h>

#define KEEP_ITERATE 0.5 /* of what a gap has above the least, kept when a Newton iterate is cut short */
/* of the activation distance: where a pair that comes from beyond it is stopped. Halved from afar, its gap
 * would reach the barrier only after many iterations, in which it holds up all other pairs. */
#define ARRIVAL     0.5
#define NEAR        0.9 /* of the activation distance: a gap below that is surely found to be below it */
#define MARCH_SHARE 0.9
#define MAX_MARCHES 10000 /* maximum number of steps of a node along its path */

#define MAX_PATH 8.0 /* in mean edges: the candidates of a longer path may be too many to keep */

/* A displacement of all points, and the first pair that limits it. */
typedef struct path {
    const double *x, *y; /* (points x 3) */
    const drape_keep *keep;
    double fraction;
    drape_pair limiting;
    double *of_node; /* (nodes) the smallest fraction of a pair at each node; NULL: not wanted */
    int32_t nodes;
    const drape_relaxed_set *relaxed; /* their pairs limit nothing */
} path;

/* The fraction of a pair that limits the displacement, for each of its nodes. */
static void share(path *p, const drape_pair *pair, double fraction)
{
    for (int k = 0; k < 4; k++)
        if (pair->node[k] < p->nodes)
            p->of_node[pair->node[k]] = fmin(p->of_node[pair->node[k]], fraction);
}

/* Whether the gap falls below the activation distance on the path; close to that it may be missed. */
static bool comes_near(const path *p, const drape_pair *pair, double gap)
{
    const double rounding = p->keep->rounding, least = drape_pair_least_gap(pair, rounding);
    const drape_keep near = {
        .rounding = rounding, .least = 1, .above = (NEAR * pair->distance - least) / (gap - least)};
    return gap < pair->distance || drape_pair_step_fraction(pair, p->x, p->y, &near, 1) < 1;
}

/* A pair that does not come near limits nothing, so it makes no difference whether it is a candidate. Does
 * not search beyond the step fraction that another pair leaves: if forces throw nodes very far, a pair
 * approaches so slowly relative to its speed that searching each to its own end would take for ever. */
static void follow(void *user, const drape_pair *pair)
{
    path *p = user;
    const drape_configuration from = {.x = p->x};
    if (drape_pair_points(pair) == 1 ||
        drape_bound_by_axes(pair, p->x, p->y) >= pair->distance + pair->radius ||
        drape_relaxed_factor(p->relaxed, pair) > 0)
        return;
    const double limit = p->of_node ? 1 : p->fraction;
    const double fraction = drape_pair_step_fraction(pair, p->x, p->y, p->keep, limit);
    if (fraction >= limit || !comes_near(p, pair, drape_pair_gap_value(pair, &from)))
        return;
    if (p->of_node)
        share(p, pair, fraction);
    if (fraction >= p->fraction)
        return;
    p->fraction = fraction;
    p->limiting = *pair;
}

static double longest_move(const drape_contact *c, const path *p)
{
    double largest = 0, move[3];
    for (size_t i = 0; i < (size_t)c->broad.points; i++) {
        vec3_sub(p->y + 3 * i, p->x + 3 * i, move);
        largest = fmax(largest, vec3_dot(move, move));
    }
    return sqrt(largest);
}

/* The candidates that are valid on the whole path, and how far it is from theirs: as far as its ends are, at
 * most. Searched if there are none; NULL for a path that is too long, or if there is no memory. */
static const drape_candidates *candidates_of(drape_contact *c, const drape_straight_path *straight,
                                             double length, drape_distances *away)
{
    const drape_candidates *candidates = drape_contact_valid_candidates(c, straight, away);
    if (candidates || length > MAX_PATH * c->mean_edge)
        return candidates;
    return drape_contact_search(c, straight, away);
}

double drape_contact_free_fraction(drape_contact *c, const double *x, const double *y,
                                   const drape_collider_pose *pose, const drape_keep *keep, double *of_node,
                                   drape_pair *limiting)
{
    const drape_straight_path straight = {
        {{.model = c->model, .x = x, .pose = pose}, {.model = c->model, .x = y, .pose = pose}}};
    path p = {.x = x,
              .y = y,
              .keep = keep,
              .fraction = 1,
              .of_node = of_node,
              .nodes = c->model->node_count,
              .relaxed = &c->relaxed};
    drape_distances away;
    drape_candidate_cursor cursor = {0};
    const drape_candidates *candidates = candidates_of(c, &straight, longest_move(c, &p), &away);
    const drape_pair *pair;
    while (candidates && (pair = drape_candidates_next(candidates, &away, &cursor)))
        follow(&p, pair);
    if (!candidates) {
        const double start = drape_clock_seconds();
        drape_candidates_find(&c->broad, &straight, 0, NULL, follow, &p);
        c->search_seconds += drape_clock_seconds() - start;
    }
    *limiting = p.limiting;
    return p.fraction;
}

double drape_contact_least_gap(const drape_contact *c)
{
    const drape_pair pair = {.distance = c->model->contact.distance};
    return drape_pair_least_gap(&pair, c->broad.rounding);
}

/* By steps of the length of the distance, with which no path can cross the surface. */
double drape_contact_march(const drape_contact *c, const drape_collider *collider, const double *x,
                           const double *y, const drape_keep *keep)
{
    double p[3], at[3], t = 0;
    double gap = collider->ops->distance(collider->values, &collider->shape, x, NULL, NULL);
    const double least = drape_contact_least_gap(c),
                 end = drape_keep_gap(keep, least, gap, c->model->contact.distance);
    vec3_sub(y, x, p);
    const double length = vec3_norm(p), slack = (1 - MARCH_SHARE) * fmin(end, gap - end);
    if (!drape_gap_has_side(gap, keep->rounding) || !(length > gap - end))
        return 1;
    for (int i = 0; i < MAX_MARCHES; i++) {
        t += MARCH_SHARE * (gap - end) / length;
        if (t >= 1)
            return 1;
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        gap = collider->ops->distance(collider->values, &collider->shape, at, NULL, NULL);
        if (gap <= end + slack)
            return t;
    }
    return t;
}

/* Lowers the fractions of nodes that go farther than a path whose candidates can be kept. A correction
 * throws nodes so far only if it is of no use there; to search each pair on its own path would take seconds.
 * Returns the least fraction. */
static double shorten_long(const drape_contact *c, const double *x, const double *y, double *fraction)
{
    const double longest = MAX_PATH * c->mean_edge;
    double least = 1, move[3];
    for (int32_t i = 0; i < c->model->node_count; i++) {
        vec3_sub(y + 3 * (size_t)i, x + 3 * (size_t)i, move);
        const double length = vec3_norm(move);
        if (!(length > longest))
            continue;
        fraction[i] = longest / length;
        least = fmin(least, fraction[i]);
    }
    return least;
}

double drape_contact_step_fraction(drape_contact *c, const double *x, const double *y, double t,
                                   double *of_node)
{
    const double start = drape_clock_seconds(), span[2] = {t, t};
    const drape_keep keep = {.rounding = c->broad.rounding,
                             .least = 1,
                             .above = KEEP_ITERATE,
                             .below = KEEP_ITERATE,
                             .arrival = ARRIVAL};
    drape_pair limiting;
    const double shortened = of_node ? shorten_long(c, x, y, of_node) : 1;
    if (shortened < 1)
        return shortened;
    drape_contact_poses(c, t, span, c->path_pose);
    drape_contact_fill(c, x, c->path_pose, c->from);
    drape_contact_fill(c, y, c->path_pose, c->to);
    double fraction = drape_contact_free_fraction(c, c->from, c->to, c->path_pose, &keep, of_node, &limiting);
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        const drape_collider *collider = &c->model->colliders[k];
        if (!collider->ops->smooth)
            continue;
        for (int32_t i = 0; i < c->model->free_count; i++) {
            const int32_t node = c->model->node_of_free[i];
            const size_t at = 3 * (size_t)node;
            double a[3], b[3];
            if (drape_relaxed_has(&c->relaxed, k, &node, 1))
                continue;
            vec3_sub(x + at, c->path_pose[k].displacement, a);
            vec3_sub(y + at, c->path_pose[k].displacement, b);
            const double own = drape_contact_march(c, collider, a, b, &keep);
            fraction = fmin(fraction, own);
            if (of_node)
                of_node[node] = fmin(of_node[node], own);
        }
    }
    c->seconds += drape_clock_seconds() - start;
    return fraction;
}
