/* ccd.c: continuous collision detection: the step fraction of a straight displacement without collisions. See
 * contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/vec3.h"

#include <string.h>

#define KEEP_ITERATE 0.5 /* of a gap, kept when a Newton iterate is cut short */
#define MARCH_SHARE  0.9
#define MAX_MARCHES  10000 /* maximum number of steps of a node along its path */

/* A displacement of all points, and the first pair that limits it. */
typedef struct path {
    const double *x, *y; /* (points x 3) */
    double keep, fraction;
    bool core;
    drape_pair limiting;
    double *of_node; /* (nodes) the smallest fraction of a pair at each node; NULL: not wanted */
    int32_t nodes;
} path;

/* The fraction of a pair that limits the displacement, for each of its nodes. */
static void share(path *p, const drape_pair *pair, double fraction)
{
    for (int k = 0; k < 4; k++)
        if (pair->node[k] < p->nodes)
            p->of_node[pair->node[k]] = fmin(p->of_node[pair->node[k]], fraction);
}

/* Does not search beyond the step fraction that another pair leaves: if forces throw nodes very far, a pair
 * approaches so slowly relative to its speed that searching each to its own end would take for ever. */
static void follow(void *user, const drape_pair *pair)
{
    path *p = user;
    const double limit = p->of_node ? 1 : p->fraction;
    const double fraction = drape_pair_step_fraction(pair, p->x, p->y, p->keep, p->core, limit);
    if (p->of_node && fraction < 1)
        share(p, pair, fraction);
    if (fraction < p->fraction) {
        p->fraction = fraction;
        p->limiting = *pair;
    }
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
                                   const drape_collider_pose *pose, double keep, bool core,
                                   drape_pair *limiting)
{
    const drape_configuration from = {.model = c->model, .x = x, .pose = pose},
                              to = {.model = c->model, .x = y, .pose = pose};
    path p = {.x = x,
              .y = y,
              .keep = keep,
              .fraction = 1,
              .core = core,
              .of_node = c->of_node,
              .nodes = c->model->node_count};
    double moved;
    const drape_candidates *candidates = drape_contact_valid_candidates(c, &from, &moved);
    if (candidates && drape_candidates_moved(candidates, &to) <= candidates->margin) {
        const double reach = 2 * longest_move(c, &p);
        for (int32_t i = 0; i < candidates->count; i++)
            if (drape_pair_points(&candidates->pairs[i]) > 1 &&
                drape_candidate_may_fall_below(&candidates->pairs[i], moved, reach))
                follow(&p, &candidates->pairs[i]);
    } else {
        const double start = drape_clock_seconds();
        drape_broad_phase_pairs(&c->broad, x, y, -c->broad.max_distance, follow, &p);
        c->search_seconds += drape_clock_seconds() - start;
    }
    *limiting = p.limiting;
    return p.fraction;
}

/* The same for a node and a surface, by steps of the length of the distance, with which no path can cross
 * the surface, until keep of the gap is left. Returns 1 if the node starts inside. */
static double march(const drape_collider *collider, const drape_collider_pose *pose, const double *x,
                    const double *y, double keep)
{
    double gap = drape_collider_distance(collider, pose, x, NULL, NULL), min_gap = keep * gap, t = 0, p[3],
           at[3];
    vec3_sub(y, x, p);
    const double length = vec3_norm(p);
    for (int i = 0; gap > min_gap && length > gap - min_gap && i < MAX_MARCHES; i++) {
        t += MARCH_SHARE * (gap - min_gap) / length;
        if (t >= 1)
            return 1;
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        gap = drape_collider_distance(collider, pose, at, NULL, NULL);
        if (gap < min_gap + (1 - MARCH_SHARE) * min_gap)
            return t;
    }
    return 1;
}

double drape_contact_step_fraction(drape_contact *c, const double *x, const double *y, double t)
{
    const double start = drape_clock_seconds(), span[2] = {t, t};
    drape_pair limiting;
    drape_contact_poses(c, t, span, c->path_pose);
    drape_contact_fill(c, x, c->path_pose, c->from);
    drape_contact_fill(c, y, c->path_pose, c->to);
    double fraction =
        drape_contact_free_fraction(c, c->from, c->to, c->path_pose, KEEP_ITERATE, false, &limiting);
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        const drape_collider *collider = &c->model->colliders[k];
        if (!collider->ops->smooth)
            continue;
        for (int32_t i = 0; i < c->model->free_count; i++) {
            const size_t at = 3 * (size_t)c->model->node_of_free[i];
            const double own = march(collider, &c->path_pose[k], x + at, y + at, KEEP_ITERATE);
            fraction = fmin(fraction, own);
            if (c->of_node)
                c->of_node[at / 3] = fmin(c->of_node[at / 3], own);
        }
    }
    c->seconds += drape_clock_seconds() - start;
    return fraction;
}

double drape_contact_node_fractions(drape_contact *c, const double *x, const double *y, double t,
                                    double *fraction)
{
    c->of_node = fraction;
    const double least = drape_contact_step_fraction(c, x, y, t);
    c->of_node = NULL;
    return least;
}

bool drape_contact_crosses(drape_contact *c, const double *y, double t)
{
    const double start = drape_clock_seconds(), span[2] = {t, t};
    drape_pair limiting;
    drape_contact_poses(c, t, span, c->path_pose);
    drape_contact_fill(c, y, c->path_pose, c->to);
    const double fraction =
        drape_contact_free_fraction(c, c->start, c->to, c->path_pose, DRAPE_KEEP_STEP, true, &limiting);
    c->seconds += drape_clock_seconds() - start;
    return fraction < 1;
}
