/* candidates.c: see candidates.h. */
#include "contact/candidates.h"

#include "base/lanes.h"
#include "base/list.h"
#include "base/vec3.h"

#include <string.h>

#define MAX_PATCH 0.3 /* share of the nodes: if more have left their path, all pairs are searched */

drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, double margin,
                                     drape_candidates *out)
{
    *out = (drape_candidates){.arena = arena, .broad = broad, .margin = margin, .sorter.arena = arena};
    const size_t marks = (size_t)(broad->points + broad->model->collider_count);
    for (int i = 0; i < DRAPE_CANDIDATE_SETS; i++) {
        drape_candidate_set *set = &out->set[i];
        set->away = drape_arena_take(arena, marks, sizeof *set->away);
        for (int end = 0; end < 2; end++) {
            set->x[end] = drape_arena_take(arena, 3 * (size_t)broad->points, sizeof *set->x[end]);
            set->pose[end] =
                drape_arena_take(arena, (size_t)broad->model->collider_count, sizeof *set->pose[end]);
        }
    }
    out->level = drape_arena_take(arena, marks, sizeof *out->level);
    out->marked = drape_arena_take(arena, marks, sizeof *out->marked);
    out->beyond = drape_arena_take(arena, marks, sizeof *out->beyond);
    out->stale = drape_arena_take(arena, (size_t)broad->model->collider_count, sizeof *out->stale);
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
static void find_surfaces(search *s, const bool *marked)
{
    drape_broad_phase *broad = s->broad;
    const drape_model *m = broad->model;
    const drape_configuration *end = s->path->end;
    bool fitted = false;
    for (int32_t k = 0; k < m->collider_count; k++) {
        if (!m->colliders[k].ops->smooth)
            continue;
        const drape_collider_pose *const pose[2] = {&end[0].pose[k], &end[s->moves].pose[k]};
        const bool *wanted = marked && !marked[broad->points + k] ? marked : broad->near;
        const double gap = drape_broad_phase_wanted(broad, s->passing, broad->distance[k]) + s->reach;
        if (wanted == broad->near) {
            if (!fitted)
                drape_distant_fit(&broad->distant, end[0].x, s->moves ? end[1].x : NULL);
            fitted = true;
            drape_distant_mark(&broad->distant, k, pose, gap, broad->near);
        }
        for (int32_t i = 0; i < m->free_count; i++) {
            const int32_t node = m->node_of_free[i];
            if (!wanted[node] || drape_model_ignores(m, k, node))
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
                           bool passing, const bool *marked, drape_broad_phase_visit *visit, void *user)
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
        find_surfaces(&s, marked);
    const drape_broad_query want = {.x = path->end[0].x,
                                    .y = s.moves ? path->end[1].x : NULL,
                                    .pose = {path->end[0].pose, path->end[1].pose},
                                    .reach = s.reach,
                                    .passing = passing,
                                    .marked = marked};
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
    if (!drape_list_append(to->arena, &set->pairs, &set->count, &set->capacity, pair, sizeof *pair))
        set->known = false;
}

/* ---- Distance from the paths ---- */

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

/* The step fraction of the path at which it is nearest to a configuration, in the mean over all points. */
static double nearest_fraction(const drape_candidates *c, const drape_candidate_set *set, const double *x)
{
    double along, square;
    sum_along(x, set->x[0], set->x[1], 3 * (size_t)c->broad->points, &along, &square);
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

/* How much farther nodes are from their paths in the coordinates of a turned collider, in which the search
 * took these paths to be straight, than in space. Nodes that were marked for a later set do not count. */
static double distance_of_turned(const drape_candidates *c, int set, const drape_configuration *at,
                                 int32_t collider, double t)
{
    const drape_candidate_set *from = &c->set[set];
    const drape_model *m = c->broad->model;
    double largest = 0;
    for (int32_t f = 0; f < m->free_count; f++) {
        const int32_t node = m->node_of_free[f];
        const size_t i = 3 * (size_t)node;
        double first[3], last[3], now[3];
        if (c->level[node] > set)
            continue;
        drape_pose_own(&from->pose[0][collider], from->x[0] + i, first);
        drape_pose_own(&from->pose[1][collider], from->x[1] + i, last);
        drape_pose_own(&at->pose[collider], at->x + i, now);
        const double away = sqrt(square_away(now, first, last, t)) -
                            sqrt(square_away(at->x + i, from->x[0] + i, from->x[1] + i, t));
        if (isnan(away))
            return NAN;
        largest = fmax(largest, away);
    }
    return largest;
}

static double square_of_collider(const drape_candidates *c, int set, const drape_configuration *at, int32_t k,
                                 double t)
{
    const drape_candidate_set *from = &c->set[set];
    if (!from->pose[0][k].turned && !from->pose[1][k].turned && !at->pose[k].turned)
        return square_away(at->pose[k].displacement, from->pose[0][k].displacement,
                           from->pose[1][k].displacement, t);
    const double away = c->broad->model->colliders[k].ops->smooth ? distance_of_turned(c, set, at, k, t) : 0;
    return away * away;
}

static double square_of_point(const drape_candidate_set *from, const double *x, int32_t point, double t)
{
    const size_t i = 3 * (size_t)point;
    return square_away(x + i, from->x[0] + i, from->x[1] + i, t);
}

/* The largest distance from the path of a set, among the points and colliders that were not marked for a
 * later set; INFINITY if it is above the margin. Notes the distance of each; if `last`, the larger one of
 * both ends. */
static double distance_from(const drape_candidates *c, int set, const drape_configuration *at, bool last)
{
    const drape_candidate_set *from = &c->set[set];
    const int32_t points = c->broad->points;
    const double t = nearest_fraction(c, from, at->x), limit = c->margin * c->margin;
    double largest = 0;
    for (int32_t i = 0; i < points + c->broad->model->collider_count; i++) {
        if (c->level[i] > set)
            continue;
        const double square =
            i < points ? square_of_point(from, at->x, i, t) : square_of_collider(c, set, at, i - points, t);
        if (!(square <= limit))
            return INFINITY;
        const double away = sqrt(square);
        largest = away > largest ? away : largest;
        from->away[i] = last && from->away[i] > away ? from->away[i] : away;
    }
    return largest;
}

drape_distances drape_candidates_distances(const drape_candidates *c, const drape_straight_path *path)
{
    const bool moves = path->end[1].x != path->end[0].x || path->end[1].pose != path->end[0].pose;
    drape_distances away = {.set = {INFINITY}};
    bool stale = false;
    for (int32_t i = 0; i < c->broad->model->collider_count; i++)
        stale = stale || c->stale[i];
    for (int i = 0; i < c->sets && !stale; i++) {
        away.set[i] = distance_from(c, i, &path->end[0], false);
        if (!isinf(away.set[i]) && moves)
            away.set[i] = fmax(away.set[i], distance_from(c, i, &path->end[1], true));
        if (!(away.set[i] <= c->margin))
            break;
    }
    return away;
}

double drape_candidates_farthest(const drape_candidates *c, const drape_distances *away)
{
    double largest = away->set[0];
    for (int i = 1; i < c->sets; i++)
        largest = fmax(largest, away->set[i]);
    largest += away->stray;
    return largest <= c->margin ? largest : INFINITY;
}

/* Notes, for each point and collider, from the paths of which sets it is farther than the margin. Returns
 * false if a position is not finite. */
static bool note_beyond(drape_candidates *c, const drape_straight_path *path)
{
    const int32_t points = c->broad->points, count = points + c->broad->model->collider_count;
    const double limit = c->margin * c->margin;
    memset(c->beyond, 0, (size_t)count * sizeof *c->beyond);
    for (int set = 0; set < c->sets; set++)
        for (int end = 0; end < 2; end++) {
            const drape_configuration *at = &path->end[end];
            const double t = nearest_fraction(c, &c->set[set], at->x);
            for (int32_t i = 0; i < count; i++) {
                if (c->level[i] > set)
                    continue;
                const double square = i < points ? square_of_point(&c->set[set], at->x, i, t)
                                                 : square_of_collider(c, set, at, i - points, t);
                if (isnan(square))
                    return false;
                c->beyond[i] |= (uint8_t)((square > limit) << set);
            }
        }
    return true;
}

/* Marks the points and colliders that must be in a patch which follows the first `sets` sets: those that have
 * left the paths of these sets, and those of the patches that it replaces. Returns the number of marked
 * nodes. */
static int32_t mark(drape_candidates *c, int sets)
{
    const drape_broad_phase *broad = c->broad;
    const int32_t nodes = broad->model->node_count, points = broad->points;
    const unsigned int kept = (1u << sets) - 1;
    int32_t count = 0;
    for (int32_t i = 0; i < points + broad->model->collider_count; i++)
        c->marked[i] = c->level[i] >= sets || (c->beyond[i] & kept) || (i >= points && c->stale[i - points]);
    for (int32_t i = nodes; i < points; i++) /* a collider with all of its points */
        c->marked[points + broad->point_collider[i - nodes]] |= c->marked[i];
    for (int32_t i = nodes; i < points; i++)
        c->marked[i] = c->marked[points + broad->point_collider[i - nodes]];
    for (int32_t i = 0; i < nodes; i++)
        count += c->marked[i];
    return count;
}

/* After how many sets the next patch is searched, whose points and colliders are marked: after all sets, or
 * after the first one, in place of all patches, if that marks fewer nodes or all sets are in use. 0: all
 * pairs are searched. */
static int choose_set(drape_candidates *c, const drape_straight_path *path)
{
    const int32_t nodes = c->broad->model->node_count;
    if (c->sets == 0 || !note_beyond(c, path))
        return 0;
    const int32_t after_all = c->sets > 1 && c->sets < DRAPE_CANDIDATE_SETS ? mark(c, c->sets) : nodes + 1,
                  after_first = mark(c, 1);
    if (after_all < after_first)
        return mark(c, c->sets) <= MAX_PATCH * nodes ? c->sets : 0;
    return after_first <= MAX_PATCH * nodes ? 1 : 0;
}

bool drape_candidates_patch_serves(drape_candidates *c, const drape_straight_path *path)
{
    return choose_set(c, path) > 0;
}

drape_status drape_candidates_search(drape_candidates *c, const drape_straight_path *path)
{
    const int sets = choose_set(c, path);
    const size_t count = (size_t)(c->broad->points + c->broad->model->collider_count);
    for (size_t i = 0; i < count; i++)
        c->level[i] = sets > 0 && c->marked[i] ? (uint8_t)sets : sets > 0 ? c->level[i] : 0;
    memset(c->stale, 0, (size_t)c->broad->model->collider_count * sizeof *c->stale);
    drape_candidate_set *set = &c->set[sets];
    const bool *marked = sets > 0 ? c->marked : NULL;
    drape_straight_path own;
    for (int end = 0; end < 2; end++) {
        memcpy(set->x[end], path->end[end].x, 3 * (size_t)c->broad->points * sizeof *set->x[end]);
        memcpy(set->pose[end], path->end[end].pose,
               (size_t)c->broad->model->collider_count * sizeof *set->pose[end]);
        own.end[end] =
            (drape_configuration){.model = c->broad->model, .x = set->x[end], .pose = set->pose[end]};
    }
    set->count = 0;
    set->known = true;
    drape_candidates_find(c->broad, &own, c->margin, false, marked, add, &(collector){c->arena, set});
    const drape_status status =
        set->known ? drape_sort_pairs(&c->sorter, set->pairs, set->count) : DRAPE_E_MEMORY;
    c->sets = status ? 0 : sets + 1;
    return status;
}

void drape_candidates_forget(drape_candidates *c)
{
    c->sets = 0;
}

void drape_candidates_forget_collider(drape_candidates *c, int32_t collider)
{
    c->stale[collider] = true;
}

/* ---- The list ---- */

/* Whether the gap can be below the activation distance, since the search found it: each piece has moved off
 * its path by at most the largest distance of its points. */
static bool may_become_active(const drape_candidates *c, int set, const drape_pair *pair,
                              const drape_distances *away)
{
    const double slack = pair->gap_at_search - pair->distance - away->beyond - c->broad->rounding;
    if (!(slack >= 0) || !(away->set[set] <= c->margin))
        return true;
    const double *of = c->set[set].away;
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

/* Whether the set is the last one for which a piece of the pair was marked: other sets have outdated copies
 * of the pair. */
static bool is_of(const drape_candidates *c, const drape_pair *pair, int set)
{
    const int points = drape_pair_points(pair);
    int level = pair->collider >= 0 ? c->level[c->broad->points + pair->collider] : 0;
    for (int a = 0; a < points; a++)
        level = c->level[pair->node[a]] > level ? c->level[pair->node[a]] : level;
    return level == set;
}

const drape_pair *drape_candidates_next(const drape_candidates *c, const drape_distances *away,
                                        drape_candidate_cursor *cursor)
{
    const drape_pair *next = NULL;
    int from = 0;
    for (int i = 0; i < c->sets; i++) {
        const drape_candidate_set *set = &c->set[i];
        int32_t at = cursor->at[i];
        while (at < set->count && ((c->sets > 1 && !is_of(c, &set->pairs[at], i)) ||
                                   !may_become_active(c, i, &set->pairs[at], away)))
            at++;
        cursor->at[i] = at;
        if (at < set->count && (!next || drape_pair_is_before(&set->pairs[at], next))) {
            next = &set->pairs[at];
            from = i;
        }
    }
    cursor->at[from] += next != NULL;
    return next;
}
