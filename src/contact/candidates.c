/* candidates.c: see candidates.h. */
#include "contact/candidates.h"

#include "base/lanes.h"
#include "base/list.h"
#include "base/vec3.h"

#include <string.h>

drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, double margin,
                                     drape_candidates *out)
{
    const size_t points = (size_t)broad->points, colliders = (size_t)broad->model->collider_count;
    *out = (drape_candidates){.arena = arena, .broad = broad, .margin = margin, .sorter.arena = arena};
    out->away = drape_arena_take(arena, points + colliders, sizeof *out->away);
    for (int end = 0; end < 2; end++) {
        out->x[end] = drape_arena_take(arena, 3 * points, sizeof *out->x[end]);
        out->pose[end] = drape_arena_take(arena, colliders, sizeof *out->pose[end]);
    }
    return drape_arena_status(arena);
}

/* ---- Searching ---- */

/* A search in progress. */
typedef struct search {
    drape_broad_phase *broad;
    const drape_straight_path *path;
    drape_configuration rest;
    bool moves;   /* the ends differ */
    bool passing; /* as in drape_broad_query */
    double reach;
    drape_broad_phase_visit *visit;
    void *user;
} search;

/* The gap at which a pair counts as found. */
static double wanted_gap(const search *s, const drape_pair *pair)
{
    return drape_broad_phase_wanted(s->broad, s->passing, pair->distance) + s->reach;
}

/* How far a node moves relative to a surface, straight in the coordinates of that. */
static double move_to_surface(const drape_straight_path *path, const drape_pair *pair)
{
    const size_t node = 3 * (size_t)pair->node[0];
    double move[3], pose[3];
    if (path->end[0].pose[pair->collider].turned || path->end[1].pose[pair->collider].turned) {
        drape_pose_own(&path->end[0].pose[pair->collider], path->end[0].x + node, pose);
        drape_pose_own(&path->end[1].pose[pair->collider], path->end[1].x + node, move);
        vec3_sub(move, pose, move);
        return vec3_norm(move);
    }
    vec3_sub(path->end[1].x + node, path->end[0].x + node, move);
    vec3_sub(path->end[1].pose[pair->collider].displacement, path->end[0].pose[pair->collider].displacement,
             pose);
    vec3_sub(move, pose, move);
    return vec3_norm(move);
}

/* A lower bound of the gap on the path: the gap itself if both ends are the same and it is less than
 * enough. */
static double least_gap(const search *s, const drape_pair *pair, double enough)
{
    const drape_configuration *end = s->path->end;
    const bool surface = drape_pair_points(pair) == 1;
    if (!surface && drape_bound_is_apart(pair, end[0].x, s->moves ? end[1].x : NULL, enough + pair->radius))
        return enough;
    const double first = drape_pair_gap_value(pair, &end[0]);
    if (!s->moves)
        return first;
    const double change =
        surface ? move_to_surface(s->path, pair) : drape_bound_change(pair, end[0].x, end[1].x);
    const double bound = surface ? -INFINITY : drape_bound_by_axes(pair, end[0].x, end[1].x) - pair->radius;
    return fmax(bound, 0.5 * (first + drape_pair_gap_value(pair, &end[1]) - change));
}

static void consider(void *user, const drape_pair *found)
{
    search *s = user;
    drape_pair pair = *found;
    pair.gap_at_search = least_gap(s, &pair, wanted_gap(s, &pair));
    if (pair.gap_at_search >= wanted_gap(s, &pair))
        return;
    pair.distance = drape_pair_activation_distance(&pair, &s->rest);
    if (pair.gap_at_search < wanted_gap(s, &pair))
        s->visit(s->user, &pair);
}

/* Pairs of nodes and smooth colliders. */
static void find_surfaces(search *s)
{
    drape_broad_phase *broad = s->broad;
    const drape_model *m = broad->model;
    const drape_configuration *end = s->path->end;
    bool fitted = false;
    for (int32_t k = 0; k < m->collider_count; k++) {
        if (!m->colliders[k].ops->smooth)
            continue;
        const drape_collider_pose *const pose[2] = {&end[0].pose[k], &end[s->moves].pose[k]};
        const double gap = drape_broad_phase_wanted(broad, s->passing, broad->distance[k]) + s->reach;
        if (!fitted)
            drape_distant_fit(&broad->distant, end[0].x, s->moves ? end[1].x : NULL);
        fitted = true;
        drape_distant_mark(&broad->distant, k, pose, gap, broad->near);
        for (int32_t i = 0; i < m->free_count; i++) {
            const int32_t node = m->node_of_free[i];
            if (!broad->near[node] || drape_model_ignores(m, k, node))
                continue;
            const drape_pair pair = drape_broad_phase_surface(broad, node, k);
            bool beyond = true; /* the node stays beyond the reach of the surface on the whole path */
            for (int e = 0; beyond && e < (s->moves ? 2 : 1); e++) {
                double own[3];
                drape_pose_own(&end[e].pose[k], end[e].x + 3 * (size_t)node, own);
                beyond = drape_distant_keeps(&broad->distant, k, node, own, wanted_gap(s, &pair));
            }
            if (!beyond)
                consider(s, &pair);
        }
    }
}

static bool differ(const drape_broad_phase *broad, const drape_configuration end[2])
{
    for (int32_t i = 0; i < broad->model->collider_count; i++)
        if (drape_pose_differs(&end[0].pose[i], &end[1].pose[i]))
            return true;
    return memcmp(end[0].x, end[1].x, 3 * (size_t)broad->points * sizeof(double)) != 0;
}

void drape_candidates_find(drape_broad_phase *broad, const drape_straight_path *path, double margin,
                           bool passing, drape_broad_phase_visit *visit, void *user)
{
    const drape_model *m = broad->model;
    search s = {.broad = broad,
                .path = path,
                .rest = {.model = m, .x = broad->rest, .pose = path->end[0].pose},
                .moves = differ(broad, path->end),
                .passing = passing,
                .reach = 2 * margin + broad->rounding,
                .visit = visit,
                .user = user};
    if (!passing)
        find_surfaces(&s);
    const drape_broad_query want = {.x = path->end[0].x,
                                    .y = s.moves ? path->end[1].x : NULL,
                                    .pose = {path->end[0].pose, path->end[1].pose},
                                    .reach = s.reach,
                                    .passing = passing};
    drape_broad_phase_pairs(broad, &want, consider, &s);
}

static void add(void *user, const drape_pair *pair)
{
    drape_candidates *c = user;
    if (!drape_list_append(c->arena, &c->pairs, &c->count, &c->capacity, pair, sizeof *pair))
        c->complete = false;
}

drape_status drape_candidates_search(drape_candidates *c, const drape_straight_path *path)
{
    drape_straight_path own;
    for (int end = 0; end < 2; end++) {
        memcpy(c->x[end], path->end[end].x, 3 * (size_t)c->broad->points * sizeof *c->x[end]);
        memcpy(c->pose[end], path->end[end].pose,
               (size_t)c->broad->model->collider_count * sizeof *c->pose[end]);
        own.end[end] = (drape_configuration){.model = c->broad->model, .x = c->x[end], .pose = c->pose[end]};
    }
    c->count = 0;
    c->complete = true;
    drape_candidates_find(c->broad, &own, c->margin, false, add, c);
    const drape_status status =
        c->complete ? drape_sort_pairs(&c->sorter, c->pairs, c->count) : DRAPE_E_MEMORY;
    c->known = !status;
    return status;
}

void drape_candidates_forget(drape_candidates *c)
{
    c->known = false;
}

/* ---- Distance from the path ---- */

/* Sums of path . (x - x0) and of path . path over all coordinates. */
LANES_DISPATCH static void sum_along(const double *x, const double *x0, const double *x1, size_t count,
                                     double *along, double *square)
{
    lanes a = {0}, b = {0};
    size_t i = 0;
    for (; i + LANES <= count; i += LANES) {
        const lanes from = lanes_load(x0 + i), path = lanes_load(x1 + i) - from;
        a += path * (lanes_load(x + i) - from);
        b += path * path;
    }
    *along = *square = 0;
    for (; i < count; i++) {
        *along += (x1[i] - x0[i]) * (x[i] - x0[i]);
        *square += (x1[i] - x0[i]) * (x1[i] - x0[i]);
    }
    for (int l = 0; l < LANES; l++) {
        *along += a[l];
        *square += b[l];
    }
}

/* The square of the distance from a point to its place on the path from a to b. */
static double square_away(const double *x, const double *a, const double *b, double t)
{
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = x[k] - a[k] - t * (b[k] - a[k]);
    return vec3_dot(d, d);
}

static double square_of_point(const drape_candidates *c, const double *x, int32_t point, double t)
{
    const size_t i = 3 * (size_t)point;
    return square_away(x + i, c->x[0] + i, c->x[1] + i, t);
}

/* How far a collider is from its path. If it is turned, how much farther nodes are from their paths in its
 * coordinates, in which the search took these paths to be straight, than in space. */
static double square_of_collider(const drape_candidates *c, const drape_configuration *at, int32_t k,
                                 double t)
{
    const drape_model *m = c->broad->model;
    const drape_collider_pose *const pose[2] = {&c->pose[0][k], &c->pose[1][k]};
    double largest = 0;
    if (!pose[0]->turned && !pose[1]->turned && !at->pose[k].turned)
        return square_away(at->pose[k].displacement, pose[0]->displacement, pose[1]->displacement, t);
    for (int32_t f = 0; m->colliders[k].ops->smooth && f < m->free_count; f++) {
        const int32_t node = m->node_of_free[f];
        const size_t i = 3 * (size_t)node;
        double first[3], last[3], now[3];
        drape_pose_own(pose[0], c->x[0] + i, first);
        drape_pose_own(pose[1], c->x[1] + i, last);
        drape_pose_own(&at->pose[k], at->x + i, now);
        const double away = sqrt(square_away(now, first, last, t)) - sqrt(square_of_point(c, at->x, node, t));
        if (isnan(away))
            return NAN;
        largest = fmax(largest, away);
    }
    return largest * largest;
}

/* The largest distance from the path, at the step fraction at which the path is nearest to the configuration
 * in the mean over all points; INFINITY if it is above the margin. Notes the distance of each point and
 * collider; if `last`, the larger one of both ends. */
static double distance_from(const drape_candidates *c, const drape_configuration *at, bool last)
{
    const int32_t points = c->broad->points;
    double largest = 0, along, square_of_path;
    sum_along(at->x, c->x[0], c->x[1], 3 * (size_t)points, &along, &square_of_path);
    const double t = along > 0 ? fmin(along / square_of_path, 1) : 0, limit = c->margin * c->margin;
    for (int32_t i = 0; i < points + c->broad->model->collider_count; i++) {
        const double square =
            i < points ? square_of_point(c, at->x, i, t) : square_of_collider(c, at, i - points, t);
        if (!(square <= limit))
            return INFINITY;
        const double away = sqrt(square);
        largest = away > largest ? away : largest;
        c->away[i] = last && c->away[i] > away ? c->away[i] : away;
    }
    return largest;
}

drape_distances drape_candidates_distances(const drape_candidates *c, const drape_straight_path *path)
{
    const bool moves = path->end[1].x != path->end[0].x || path->end[1].pose != path->end[0].pose;
    drape_distances away = {.largest = c->known ? distance_from(c, &path->end[0], false) : INFINITY};
    if (!isinf(away.largest) && moves)
        away.largest = fmax(away.largest, distance_from(c, &path->end[1], true));
    return away;
}

/* ---- The list ---- */

/* Whether the gap can be below the activation distance, since the search found it: each piece has moved off
 * its path by at most the largest distance of its points. */
static bool may_become_active(const drape_candidates *c, const drape_pair *pair, const drape_distances *away)
{
    const double slack = pair->gap_at_search - pair->distance - away->beyond - c->broad->rounding;
    if (!(slack >= 0) || !(away->largest <= c->margin))
        return true;
    const double *of = c->away;
    const int32_t *n = pair->node;
    double first = of[n[0]], second;
    if (pair->kind == DRAPE_PAIR_SURFACE)
        second = of[c->broad->points + pair->collider];
    else {
        const bool edge = pair->kind == DRAPE_PAIR_SEGMENTS;
        second = of[n[2]] > of[n[3]] ? of[n[2]] : of[n[3]];
        double *piece = edge ? &first : &second;
        *piece = of[n[1]] > *piece ? of[n[1]] : *piece;
    }
    return slack < first + second + 2 * away->stray;
}

const drape_pair *drape_candidates_next(const drape_candidates *c, const drape_distances *away, int32_t *at)
{
    while (*at < c->count && !may_become_active(c, &c->pairs[*at], away))
        (*at)++;
    return *at < c->count ? &c->pairs[(*at)++] : NULL;
}
