/* candidates.c: see candidates.h. */
#include "contact/candidates.h"

#include "base/vec3.h"
#include "contact/bound.h"
#include "contact/list.h"

#include <string.h>

#define ROUNDING 1e-12 /* of the model's length: larger than the rounding of a bound of a gap */

drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, drape_candidates *out)
{
    *out = (drape_candidates){.arena = arena, .broad = broad};
    for (int end = 0; end < 2; end++) {
        out->x[end] = drape_arena_take(arena, 3 * (size_t)broad->points, sizeof *out->x[end]);
        out->pose[end] =
            drape_arena_take(arena, (size_t)broad->model->collider_count, sizeof *out->pose[end]);
    }
    return drape_arena_status(arena);
}

/* A search in progress. */
typedef struct search {
    const drape_straight_path *path;
    drape_configuration rest;
    bool moves; /* the ends differ */
    double reach;
    drape_broad_phase_visit *visit;
    void *user;
} search;

/* Layers of one sheet that are close together at rest must not be in contact there: their activation
 * distance is at most half of the rest distance. */
static double activation_distance(const search *s, const drape_pair *pair)
{
    if (pair->collider >= 0 || drape_pair_is_apart(pair, &s->rest, 2 * pair->distance))
        return pair->distance;
    return fmin(pair->distance, 0.5 * drape_pair_gap_value(pair, &s->rest));
}

/* How far a node moves relative to a surface. */
static double move_to_surface(const drape_straight_path *path, const drape_pair *pair)
{
    const size_t node = 3 * (size_t)pair->node[0];
    double move[3], pose[3];
    vec3_sub(path->end[1].x + node, path->end[0].x + node, move);
    vec3_sub(path->end[1].pose[pair->collider].displacement, path->end[0].pose[pair->collider].displacement,
             pose);
    vec3_sub(move, pose, move);
    return vec3_norm(move);
}

/* A lower bound of the gap on the path. The gap is exact if the ends are the same, unless it is at least
 * enough. */
static double least_gap(const search *s, const drape_pair *pair, double enough)
{
    const drape_configuration *end = s->path->end;
    const bool surface = drape_pair_points(pair) == 1;
    double bound = -INFINITY;
    if (!surface)
        bound = drape_bound_by_axes(pair, end[0].x, s->moves ? end[1].x : NULL) - pair->radius;
    if (bound >= enough)
        return bound;
    const double first = drape_pair_gap_value(pair, &end[0]);
    if (!s->moves)
        return first;
    const double change =
        surface ? move_to_surface(s->path, pair) : drape_bound_change(pair, end[0].x, end[1].x);
    return fmax(bound, 0.5 * (first + drape_pair_gap_value(pair, &end[1]) - change));
}

static void consider(void *user, const drape_pair *found)
{
    search *s = user;
    drape_pair pair = *found;
    pair.gap_at_search = least_gap(s, &pair, pair.distance + s->reach);
    if (pair.gap_at_search >= pair.distance + s->reach)
        return;
    pair.distance = activation_distance(s, &pair);
    if (pair.gap_at_search < pair.distance + s->reach)
        s->visit(s->user, &pair);
}

static bool differ(const drape_broad_phase *broad, const drape_configuration end[2])
{
    for (int32_t i = 0; i < broad->model->collider_count; i++)
        if (memcmp(end[0].pose[i].displacement, end[1].pose[i].displacement, 3 * sizeof(double)) != 0)
            return true;
    return memcmp(end[0].x, end[1].x, 3 * (size_t)broad->points * sizeof(double)) != 0;
}

void drape_candidates_find(drape_broad_phase *broad, const drape_straight_path *path, double margin,
                           drape_broad_phase_visit *visit, void *user)
{
    const drape_model *m = broad->model;
    search s = {.path = path,
                .rest = {.model = m, .x = broad->rest, .pose = path->end[0].pose},
                .moves = differ(broad, path->end),
                .reach = 2 * margin + ROUNDING * m->length,
                .visit = visit,
                .user = user};
    for (int32_t k = 0; k < m->collider_count; k++) {
        if (!m->colliders[k].ops->smooth)
            continue;
        for (int32_t i = 0; i < m->free_count; i++) {
            const drape_pair pair = drape_broad_phase_surface(broad, m->node_of_free[i], k);
            consider(&s, &pair);
        }
    }
    drape_broad_phase_pairs(broad, path->end[0].x, s.moves ? path->end[1].x : NULL, s.reach, consider, &s);
}

static void add(void *user, const drape_pair *pair)
{
    drape_candidates *c = user;
    drape_pair *pairs = drape_list_grow(c->arena, c->pairs, c->count, &c->room, sizeof *pairs);
    c->known = c->known && pairs;
    if (!pairs)
        return;
    c->pairs = pairs;
    c->pairs[c->count++] = *pair;
}

drape_status drape_candidates_search(drape_candidates *c, const drape_straight_path *path, double margin)
{
    drape_straight_path own;
    for (int end = 0; end < 2; end++) {
        memcpy(c->x[end], path->end[end].x, 3 * (size_t)c->broad->points * sizeof *c->x[end]);
        memcpy(c->pose[end], path->end[end].pose,
               (size_t)c->broad->model->collider_count * sizeof *c->pose[end]);
        own.end[end] = (drape_configuration){.model = c->broad->model, .x = c->x[end], .pose = c->pose[end]};
    }
    c->margin = margin;
    c->count = 0;
    c->known = true;
    drape_candidates_find(c->broad, &own, margin, add, c);
    return c->known ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* The step fraction of the path at which it is nearest to a configuration, in the mean over all points. */
static double nearest_fraction(const drape_candidates *c, const double *x)
{
    double along = 0, square = 0;
    for (size_t i = 0; i < 3 * (size_t)c->broad->points; i++) {
        const double path = c->x[1][i] - c->x[0][i];
        along += path * (x[i] - c->x[0][i]);
        square += path * path;
    }
    return along > 0 ? fmin(along / square, 1) : 0;
}

/* The square of the distance from a point to its place on the path from a to b. */
static double square_away(const double *x, const double *a, const double *b, double t)
{
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = x[k] - a[k] - t * (b[k] - a[k]);
    return vec3_dot(d, d);
}

double drape_candidates_distance(const drape_candidates *c, const drape_configuration *at)
{
    double largest = 0;
    if (!c->known)
        return INFINITY;
    const double t = nearest_fraction(c, at->x);
    for (size_t i = 0; i < 3 * (size_t)c->broad->points; i += 3) {
        const double square = square_away(at->x + i, c->x[0] + i, c->x[1] + i, t);
        if (isnan(square))
            return INFINITY;
        largest = square > largest ? square : largest;
    }
    for (int32_t i = 0; i < c->broad->model->collider_count; i++)
        largest = fmax(largest, square_away(at->pose[i].displacement, c->pose[0][i].displacement,
                                            c->pose[1][i].displacement, t));
    return sqrt(largest);
}
