/* candidates.c: see candidates.h. */
#include "contact/candidates.h"

#include "base/vec3.h"
#include "contact/bound.h"
#include "contact/list.h"

#include <string.h>

#define ROUNDING  1e-12 /* of the model's length: larger than the rounding of a bound of a gap */
#define MAX_PATCH 0.3   /* of the nodes: if more have left their path, all pairs are searched */

static void take_set(drape_arena *arena, const drape_broad_phase *broad, drape_candidate_set *set)
{
    for (int end = 0; end < 2; end++) {
        set->x[end] = drape_arena_take(arena, 3 * (size_t)broad->points, sizeof *set->x[end]);
        set->pose[end] =
            drape_arena_take(arena, (size_t)broad->model->collider_count, sizeof *set->pose[end]);
    }
}

drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, double margin,
                                     drape_candidates *out)
{
    *out = (drape_candidates){.arena = arena, .broad = broad, .margin = margin};
    take_set(arena, broad, &out->all);
    take_set(arena, broad, &out->patch);
    out->patched =
        drape_arena_take(arena, (size_t)(broad->points + broad->model->collider_count), sizeof *out->patched);
    out->stale = drape_arena_take(arena, (size_t)broad->model->collider_count, sizeof *out->stale);
    return drape_arena_status(arena);
}

/* ---- Searching ---- */

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
                           const bool *marked, drape_broad_phase_visit *visit, void *user)
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
            if (!marked || marked[broad->points + k] || marked[pair.node[0]])
                consider(&s, &pair);
        }
    }
    const drape_broad_query want = {
        .x = path->end[0].x, .y = s.moves ? path->end[1].x : NULL, .reach = s.reach, .marked = marked};
    drape_broad_phase_pairs(broad, &want, consider, &s);
}

typedef struct collector {
    drape_arena *arena;
    drape_candidate_set *set;
} collector;

static void add(void *user, const drape_pair *pair)
{
    const collector *to = user;
    drape_candidate_set *set = to->set;
    drape_pair *pairs = drape_list_grow(to->arena, set->pairs, set->count, &set->room, sizeof *pairs);
    set->known = set->known && pairs;
    if (!pairs)
        return;
    set->pairs = pairs;
    set->pairs[set->count++] = *pair;
}

static drape_status collect(drape_candidates *c, drape_candidate_set *set, const bool *marked,
                            const drape_straight_path *path, const double *ahead)
{
    const double *ends[2] = {path->end[0].x, ahead};
    drape_straight_path own;
    for (int end = 0; end < 2; end++) {
        memcpy(set->x[end], ends[end], 3 * (size_t)c->broad->points * sizeof *set->x[end]);
        memcpy(set->pose[end], path->end[end].pose,
               (size_t)c->broad->model->collider_count * sizeof *set->pose[end]);
        own.end[end] =
            (drape_configuration){.model = c->broad->model, .x = set->x[end], .pose = set->pose[end]};
    }
    set->count = 0;
    set->known = true;
    drape_candidates_find(c->broad, &own, c->margin, marked, add, &(collector){c->arena, set});
    return set->known ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* ---- Distance from the paths ---- */

/* The step fraction of the path at which it is nearest to a configuration, in the mean over all points. */
static double nearest_fraction(const drape_candidates *c, const drape_candidate_set *set, const double *x)
{
    double along = 0, square = 0;
    for (size_t i = 0; i < 3 * (size_t)c->broad->points; i++) {
        const double path = set->x[1][i] - set->x[0][i];
        along += path * (x[i] - set->x[0][i]);
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

/* The largest distance of a point or a collider other than those left out. Marks those of which it exceeds
 * the margin, unless beyond is NULL. */
static double distance_from(const drape_candidates *c, const drape_candidate_set *set,
                            const drape_configuration *at, const bool *without, bool *beyond)
{
    double largest = 0;
    if (!set->known)
        return INFINITY;
    const double t = nearest_fraction(c, set, at->x), limit = c->margin * c->margin;
    for (size_t i = 0; i < (size_t)c->broad->points; i++) {
        const double square = square_away(at->x + 3 * i, set->x[0] + 3 * i, set->x[1] + 3 * i, t);
        if (isnan(square))
            return INFINITY;
        if (beyond)
            beyond[i] = beyond[i] || square > limit;
        largest = square > largest && !(without && without[i]) ? square : largest;
    }
    for (int32_t i = 0; i < c->broad->model->collider_count; i++) {
        const size_t place = (size_t)(c->broad->points + i);
        const double square = square_away(at->pose[i].displacement, set->pose[0][i].displacement,
                                          set->pose[1][i].displacement, t);
        if (beyond)
            beyond[place] = beyond[place] || square > limit;
        largest = square > largest && !(without && without[place]) ? square : largest;
    }
    return sqrt(largest);
}

static double measure(const drape_candidates *c, const drape_candidate_set *set,
                      const drape_straight_path *path, const bool *without)
{
    double largest = 0;
    for (int end = 0; end < 2; end++) {
        if (end > 0 && path->end[1].x == path->end[0].x && path->end[1].pose == path->end[0].pose)
            break;
        largest = fmax(largest, distance_from(c, set, &path->end[end], without, NULL));
        if (!(largest <= c->margin))
            break;
    }
    return largest;
}

/* Whether the first search has pairs with an activation distance that is not theirs any more. */
static bool has_stale(const drape_candidates *c)
{
    bool found = false;
    for (int32_t i = 0; i < c->broad->model->collider_count; i++)
        found = found || (c->stale[i] && !(c->patch.known && c->patched[c->broad->points + i]));
    return found;
}

drape_distances drape_candidates_distances(const drape_candidates *c, const drape_straight_path *path)
{
    const bool patched = c->patch.known;
    return (drape_distances){.all = has_stale(c) ? INFINITY
                                                 : measure(c, &c->all, path, patched ? c->patched : NULL),
                             .patch = patched ? measure(c, &c->patch, path, NULL) : 0};
}

bool drape_candidates_are_valid(const drape_candidates *c, const drape_distances *away)
{
    return away->all <= c->margin && away->patch <= c->margin;
}

/* Marks the colliders and nodes for which the first search is not valid. */
bool drape_candidates_patch_serves(drape_candidates *c, const drape_straight_path *path)
{
    const drape_broad_phase *broad = c->broad;
    const int32_t nodes = broad->model->node_count;
    int32_t count = 0;
    c->patch.known = false;
    memset(c->patched, 0, (size_t)broad->points * sizeof *c->patched);
    memcpy(c->patched + broad->points, c->stale, (size_t)broad->model->collider_count * sizeof *c->stale);
    for (int end = 0; end < 2; end++)
        if (isinf(distance_from(c, &c->all, &path->end[end], NULL, c->patched)))
            return false;
    for (int32_t i = nodes; i < broad->points; i++) /* a collider with all of its points */
        c->patched[broad->points + broad->point_collider[i - nodes]] |= c->patched[i];
    for (int32_t i = nodes; i < broad->points; i++)
        c->patched[i] = c->patched[broad->points + broad->point_collider[i - nodes]];
    for (int32_t i = 0; i < nodes; i++)
        count += c->patched[i];
    return count <= MAX_PATCH * nodes;
}

drape_status drape_candidates_search(drape_candidates *c, const drape_straight_path *path,
                                     const double *ahead)
{
    if (drape_candidates_patch_serves(c, path))
        return collect(c, &c->patch, c->patched, path, ahead);
    memset(c->stale, 0, (size_t)c->broad->model->collider_count * sizeof *c->stale);
    return collect(c, &c->all, NULL, path, ahead);
}

void drape_candidates_forget_collider(drape_candidates *c, int32_t collider)
{
    c->stale[collider] = true;
    c->patch.known = false;
}

/* ---- The list ---- */

/* Each piece of the pair is at most `away` from where it was found. */
static bool may_become_active(const drape_candidates *c, const drape_pair *pair, double away, double beyond)
{
    const double reach = pair->distance + beyond + ROUNDING * c->broad->model->length;
    return pair->gap_at_search - 2 * away < reach;
}

static bool is_patched(const drape_candidates *c, const drape_pair *pair)
{
    const int points = drape_pair_points(pair);
    bool found = pair->collider >= 0 && c->patched[c->broad->points + pair->collider];
    for (int a = 0; a < points && !found; a++)
        found = c->patched[pair->node[a]];
    return found;
}

static bool is_before(const drape_pair *a, const drape_pair *b)
{
    for (int i = 0; i < 3; i++)
        if (a->rank[i] != b->rank[i])
            return a->rank[i] < b->rank[i];
    return false;
}

const drape_pair *drape_candidates_next(const drape_candidates *c, const drape_distances *away,
                                        drape_candidate_cursor *at)
{
    const drape_pair *all = c->all.pairs, *patch = c->patch.pairs;
    const int32_t patches = c->patch.known ? c->patch.count : 0;
    while (at->all < c->all.count && (!may_become_active(c, &all[at->all], away->all, away->beyond) ||
                                      (c->patch.known && is_patched(c, &all[at->all]))))
        at->all++;
    while (at->patch < patches && !may_become_active(c, &patch[at->patch], away->patch, away->beyond))
        at->patch++;
    if (at->patch < patches && (at->all >= c->all.count || is_before(&patch[at->patch], &all[at->all])))
        return &patch[at->patch++];
    return at->all < c->all.count ? &all[at->all++] : NULL;
}
