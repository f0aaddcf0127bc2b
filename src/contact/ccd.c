/* ccd.c: continuous collision detection: the step fraction of a straight displacement without collisions. See
 * contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/vec3.h"

#include <string.h>

#define KEEP_ITERATE 0.5 /* of what a gap has above the least, kept when a Newton iterate is cut short */
#define MARCH_SHARE  0.9
#define MAX_MARCHES  10000 /* maximum number of steps of a node along its path */

/* A displacement of all points, and the first pair that limits it. */
typedef struct path {
    const double *x, *y; /* (points x 3) */
    const drape_broad_phase *broad;
    const drape_keep *keep;
    double fraction;
    drape_pair limiting;
} path;

/* Does not search beyond the step fraction that another pair leaves: if forces throw nodes very far, a pair
 * approaches so slowly relative to its speed that searching each to its own end would take for ever. */
static void follow(void *user, const drape_pair *pair)
{
    path *p = user;
    const double fraction = drape_pair_step_fraction(pair, p->x, p->y, p->keep, p->fraction);
    if (fraction < p->fraction) {
        p->fraction = fraction;
        p->limiting = *pair;
    }
}

/* The same for a pair that the broad phase found. */
static void follow_found(void *user, const drape_pair *found)
{
    path *p = user;
    drape_pair pair = *found;
    pair.distance = drape_candidates_distance(p->broad, found);
    follow(p, &pair);
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

/* Paths are straight: if both ends are near the last search, all points between them are. Two points
 * approach each other by no more than the sum of their displacements. */
double drape_contact_free_fraction(drape_contact *c, const double *x, const double *y,
                                   const drape_collider_pose *pose, const drape_keep *keep,
                                   drape_pair *limiting)
{
    const drape_configuration from = {.model = c->model, .x = x, .pose = pose},
                              to = {.model = c->model, .x = y, .pose = pose};
    path p = {.x = x, .y = y, .broad = &c->broad, .keep = keep, .fraction = 1};
    double moved;
    const drape_candidates *candidates = drape_contact_valid_candidates(c, &from, &moved);
    if (candidates && drape_candidates_moved(candidates, &to) <= candidates->margin) {
        const double reach =
            2 * longest_move(c, &p) + fmax(DRAPE_LEAST_GAP * c->broad.max_distance, keep->rounding);
        for (int32_t i = 0; i < candidates->count; i++)
            if (drape_pair_points(&candidates->pairs[i]) > 1 &&
                drape_candidate_may_fall_below(&candidates->pairs[i], moved, reach))
                follow(&p, &candidates->pairs[i]);
    } else {
        const double start = drape_clock_seconds();
        drape_broad_phase_pairs(&c->broad, x, y, -c->broad.max_distance, follow_found, &p);
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
    const double least = drape_contact_least_gap(c), end = drape_keep_gap(keep, least, gap);
    vec3_sub(y, x, p);
    const double length = vec3_norm(p), slack = (1 - MARCH_SHARE) * fmin(end, gap - end);
    if (!(gap > keep->rounding) || !(length > gap - end))
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

double drape_contact_step_fraction(drape_contact *c, const double *x, const double *y, double t)
{
    const double start = drape_clock_seconds(), span[2] = {t, t};
    const drape_keep keep = {
        .rounding = c->broad.rounding, .least = 1, .above = KEEP_ITERATE, .below = KEEP_ITERATE};
    drape_pair limiting;
    drape_contact_poses(c, t, span, c->path_pose);
    drape_contact_fill(c, x, c->path_pose, c->from);
    drape_contact_fill(c, y, c->path_pose, c->to);
    double fraction = drape_contact_free_fraction(c, c->from, c->to, c->path_pose, &keep, &limiting);
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        const drape_collider *collider = &c->model->colliders[k];
        if (!collider->ops->smooth)
            continue;
        for (int32_t i = 0; i < c->model->free_count; i++) {
            const size_t at = 3 * (size_t)c->model->node_of_free[i];
            double a[3], b[3];
            vec3_sub(x + at, c->path_pose[k].displacement, a);
            vec3_sub(y + at, c->path_pose[k].displacement, b);
            fraction = fmin(fraction, drape_contact_march(c, collider, a, b, &keep));
        }
    }
    c->seconds += drape_clock_seconds() - start;
    return fraction;
}
