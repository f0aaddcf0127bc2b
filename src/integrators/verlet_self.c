/*
 * verlet_self.c: cloth against cloth as CS184 has it: points that are nearer to each other than twice the
 * thickness r = 2 t are pushed apart. One node after the other, x_i moves by
 *     share * mean over its near points j of (r - |x_i - x_j|) (x_i - x_j)/|x_i - x_j|
 * with the points as they are by then; share is one over the substeps of a step.
 *
 * Near points are found by boxes: all that a ball of the radius r around the point reaches are searched. CS184 looks
 * into a point's own box alone, of 3 width/columns x 3 height/rows x the larger of both, as points stand before the
 * first turn, and misses pairs across its faces; with same_box so do we. Points are sorted by bucket, then by number, where
 *     bucket = hash of a box's y and z + its number along x,
 * so that the boxes of a row along x lie one after another and are searched as one range.
 *
 * While its turn has not come, a point stands where it was sorted in; one that had its turn moved by share r
 * at most, so a ball that much larger finds it in its old box.
 *
 * Boxes are searched once for many substeps: for the points that are nearer than r, what two turns move, and a
 * skin, kept as a list that is good until a node has moved by half of the skin (Verlet 1967), not counting what
 * all nodes move alike. Where lists become too long, in a heap of cloth, boxes are searched each time. The
 * points that push are the same, and are added in the order of their numbers, whichever way they were found: the
 * result depends on the positions alone, not on when a list was made. With same_box the points of a list that push are
 * those of the same box of CS184, which is found for each point in every substep.
 */
#include "base/lanes.h"
#include "base/vec3.h"
#include "integrators/verlet.h"

#include <string.h>

#define MOST_NEAR 64  /* points in the list of one */
#define A_NODE    24  /* of them on the average */
#define SKIN      0.5 /* of r */
#define FARTHEST  1e9 /* boxes are counted in 32 bits: what is beyond has blown up and shares one */

struct drape_verlet_self {
    drape_context *ctx;
    const drape_model *model;
    bool same_box;
    double reach;            /* r [m] */
    double per_box[3];       /* boxes a metre, as nodes are sorted */
    double per_own[3];       /* same_box: those of CS184 */
    uint64_t *own;           /* same_box: (node_count) own_box of a node */
    int32_t buckets;         /* a power of 2 */
    int32_t *start;          /* (buckets + 1) */
    int32_t *bucket, *place; /* (node_count) of a node, and where it is in what follows */
    int32_t *node;           /* sorted: (node_count) */
    uint64_t *row;           /* sorted: (node_count) row_of its box */
    double *x;               /* sorted: (node_count x 3) */
    /* Lists; built: they are good near x_built, for shares up to built_share. */
    bool built;
    double built_share;
    int32_t *first, *cursor; /* (node_count + 1), (node_count): of a node in near */
    int32_t *near;           /* (node_count x A_NODE) */
    int32_t *pair;           /* (node_count x A_NODE / 2 x 2) */
    double *x_built;         /* (node_count x 3) */
};

/* ---- Making ---- */

/* Sizes of CS184's boxes, of the first cloth; of a mesh that is no grid, three mean edges. */
static void box_of_cs184(const drape_model *m, double size[3])
{
    const drape_mesh *mesh = &m->cloths[0].mesh;
    double mean = 0, d[3];
    for (int32_t e = 0; e < m->edge_count; e++)
        mean += m->edge_length[e] / m->edge_count;
    size[0] = size[1] = size[2] = 3 * mean;
    if (mesh->rows == 0)
        return;
    vec3_sub(m->rest + 3 * (size_t)(mesh->columns - 1), m->rest, d);
    size[0] = 3 * vec3_norm(d) / mesh->columns;
    vec3_sub(m->rest + 3 * (size_t)(mesh->rows - 1) * (size_t)mesh->columns, m->rest, d);
    size[1] = 3 * vec3_norm(d) / mesh->rows;
    size[2] = fmax(size[0], size[1]);
}

/* Along x boxes are small, which costs no look-up; across they are as large as a ball, which reaches 2 x 2
 * rows then. */
static void set_boxes(drape_verlet_self *s)
{
    const double size[3] = {0.5 * s->reach, 2 * s->reach, 2 * s->reach};
    for (int k = 0; k < 3; k++)
        s->per_box[k] = s->same_box ? s->per_own[k] : 1 / size[k];
}

void drape_verlet_self_destroy(drape_verlet_self **self)
{
    drape_verlet_self *s = *self;
    if (!s)
        return;
    drape_free(s->ctx, s->own);
    drape_free(s->ctx, s->start);
    drape_free(s->ctx, s->bucket);
    drape_free(s->ctx, s->place);
    drape_free(s->ctx, s->node);
    drape_free(s->ctx, s->row);
    drape_free(s->ctx, s->x);
    drape_free(s->ctx, s->first);
    drape_free(s->ctx, s->cursor);
    drape_free(s->ctx, s->near);
    drape_free(s->ctx, s->pair);
    drape_free(s->ctx, s->x_built);
    drape_free(s->ctx, s);
    *self = NULL;
}

static bool create_own(drape_verlet_self *s)
{
    double size[3];
    if (!s->same_box)
        return true;
    box_of_cs184(s->model, size);
    for (int k = 0; k < 3; k++)
        s->per_own[k] = 1 / size[k];
    s->own = drape_alloc(s->ctx, (size_t)s->model->node_count, sizeof *s->own);
    return s->own;
}

drape_status drape_verlet_self_create(drape_context *ctx, const drape_model *m, bool same_box,
                                      drape_verlet_self **out)
{
    size_t n = (size_t)m->node_count;
    drape_verlet_self *s = drape_alloc(ctx, 1, sizeof *s);
    *out = s;
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (drape_verlet_self){.ctx = ctx, .model = m, .same_box = same_box, .buckets = 64};
    s->reach = 2 * m->contact.self_thickness;
    while (s->buckets < 2 * m->node_count && s->buckets < 1 << 28)
        s->buckets *= 2;
    s->start = drape_alloc(ctx, (size_t)s->buckets + 1, sizeof *s->start);
    s->bucket = drape_alloc(ctx, n, sizeof *s->bucket);
    s->place = drape_alloc(ctx, n, sizeof *s->place);
    s->node = drape_alloc(ctx, n, sizeof *s->node);
    s->row = drape_alloc(ctx, n, sizeof *s->row);
    s->x = drape_alloc(ctx, 3 * n, sizeof *s->x);
    s->first = drape_alloc(ctx, n + 1, sizeof *s->first);
    s->cursor = drape_alloc(ctx, n, sizeof *s->cursor);
    s->near = drape_alloc(ctx, n * A_NODE, sizeof *s->near);
    s->pair = drape_alloc(ctx, n * A_NODE, sizeof *s->pair);
    s->x_built = drape_alloc(ctx, 3 * n, sizeof *s->x_built);
    if (s->start && s->bucket && s->place && s->node && s->row && s->x && s->first && s->cursor && s->near &&
        s->pair && s->x_built && create_own(s))
        return DRAPE_OK;
    drape_verlet_self_destroy(out);
    return DRAPE_E_MEMORY;
}

size_t drape_verlet_self_bytes(const drape_verlet_self *s)
{
    size_t n = (size_t)s->model->node_count;
    return sizeof *s + ((size_t)s->buckets + 1) * sizeof *s->start +
           n * ((5 + 2 * A_NODE) * sizeof(int32_t) + 7 * sizeof(double) + (s->own ? sizeof *s->own : 0));
}

/* ---- Boxes ---- */

/* floor(x per_box): the conversion cuts towards zero, and floor itself is a call on plain x86-64. */
static int32_t box_number(double x, double per_box)
{
    double number = x * per_box;
    if (!(fabs(number) < FARTHEST))
        return 0;
    int32_t cut = (int32_t)number;
    return cut - (number < cut);
}

static void boxes_of(const drape_verlet_self *s, const double *x, int32_t box[3])
{
    for (int k = 0; k < 3; k++)
        box[k] = box_number(x[k], s->per_box[k]);
}

static int32_t bucket_of(const drape_verlet_self *s, int32_t x, int32_t y, int32_t z)
{
    uint32_t row = (uint32_t)y * 0x9E3779B1u ^ (uint32_t)z * 0x85EBCA77u; /* odd: all rows differ */
    return (int32_t)(((row ^ row >> 15) + (uint32_t)x) & (uint32_t)(s->buckets - 1));
}

/* The row along x that a box is in. */
static uint64_t row_of(int32_t y, int32_t z)
{
    return (uint64_t)(uint32_t)y << 32 | (uint32_t)z;
}

static void sort_nodes(drape_verlet_self *s, const double *x)
{
    int32_t n = s->model->node_count;
    memset(s->start, 0, ((size_t)s->buckets + 1) * sizeof *s->start);
    for (int32_t i = 0; i < n; i++) {
        int32_t box[3];
        boxes_of(s, x + 3 * (size_t)i, box);
        s->bucket[i] = bucket_of(s, box[0], box[1], box[2]);
        s->start[s->bucket[i] + 1]++;
    }
    for (int32_t b = 0; b < s->buckets; b++)
        s->start[b + 1] += s->start[b];
    for (int32_t i = n - 1; i >= 0; i--) { /* backwards: the ends of the buckets move to their starts */
        int32_t box[3], at = --s->start[s->bucket[i] + 1];
        boxes_of(s, x + 3 * (size_t)i, box);
        s->place[i] = at;
        s->node[at] = i;
        s->row[at] = row_of(box[1], box[2]);
        memcpy(s->x + 3 * (size_t)at, x + 3 * (size_t)i, 3 * sizeof *x);
    }
    /* start[b + 1] is now where bucket b begins */
    memmove(s->start, s->start + 1, (size_t)s->buckets * sizeof *s->start);
    s->start[s->buckets] = n;
}

/* ---- Searching ---- */

/* The points nearer than `reach` to one: their numbers, as many as there is room for. */
typedef struct search {
    int32_t node;
    const double *x;
    double reach_squared;
    int32_t low[3], high[3]; /* boxes that are searched */
    int32_t found[MOST_NEAR + 1];
    int count; /* more than MOST_NEAR: there are more */
} search;

/* Points from first to last: those of a row, not others whose hash is the same. What is written is only counted if
 * it belongs: the branches that this saves would be guessed wrong half of the time. */
static inline void search_range(const drape_verlet_self *s, search *q, uint64_t row, int32_t first,
                                int32_t last)
{
    int count = q->count;
    for (int32_t at = first; at < last; at++) {
        double d[3];
        int32_t node = s->node[at];
        vec3_sub(q->x, s->x + 3 * (size_t)at, d);
        q->found[count < MOST_NEAR ? count : MOST_NEAR] = node;
        count += (vec3_dot(d, d) < q->reach_squared) & (node != q->node) & (s->row[at] == row);
    }
    q->count = count;
}

static inline void search_row(const drape_verlet_self *s, search *q, int32_t y, int32_t z)
{
    uint64_t row = row_of(y, z);
    int32_t first = bucket_of(s, q->low[0], y, z), last = first + (q->high[0] - q->low[0]) + 1;
    if (last <= s->buckets) {
        search_range(s, q, row, s->start[first], s->start[last]);
        return;
    }
    search_range(s, q, row, s->start[first], s->start[s->buckets]);
    search_range(s, q, row, 0, s->start[last - s->buckets]);
}

static void sort_found(search *q)
{
    int count = q->count < MOST_NEAR ? q->count : MOST_NEAR;
    for (int i = 1; i < count; i++) {
        int32_t number = q->found[i];
        int k = i;
        for (; k > 0 && q->found[k - 1] > number; k--)
            q->found[k] = q->found[k - 1];
        q->found[k] = number;
    }
}

/* ball: how far boxes are searched, at least as far as any point of interest was when it was sorted. */
static void search_near(const drape_verlet_self *s, search *q, double reach, double ball)
{
    q->reach_squared = reach * reach;
    q->count = 0;
    for (int k = 0; k < 3; k++) {
        q->low[k] = box_number(q->x[k] - ball, s->per_box[k]);
        q->high[k] = box_number(q->x[k] + ball, s->per_box[k]);
    }
    for (int32_t y = q->low[1]; y <= q->high[1]; y++)
        for (int32_t z = q->low[2]; z <= q->high[2]; z++)
            search_row(s, q, y, z);
    sort_found(q);
}

/* ---- Lists ---- */

/* The rows of boxes around one in which the other point of a pair is looked for; those behind look for it. */
#define ROWS 4
static const int32_t rows_ahead[ROWS][2] = {{0, 1}, {1, -1}, {1, 0}, {1, 1}};

/* Where points that are sorted lie which may be near to those of one box: in the next one of its row, and in three
 * boxes of each of the rows. A range that wraps around the table is two. */
typedef struct surroundings {
    int32_t bucket;
    uint64_t row;
    int count;
    struct {
        uint64_t row;
        int32_t first, last;
    } range[1 + 2 * ROWS];
} surroundings;

static void surround(const drape_verlet_self *s, uint64_t row, int32_t bucket, int32_t buckets,
                     surroundings *a)
{
    int32_t end = bucket + buckets, cut = end < s->buckets ? end : s->buckets;
    a->range[a->count].row = row;
    a->range[a->count].first = s->start[bucket];
    a->range[a->count++].last = s->start[cut];
    if (end <= s->buckets)
        return;
    a->range[a->count].row = row;
    a->range[a->count].first = 0;
    a->range[a->count++].last = s->start[end - s->buckets];
}

static void look_around(const drape_verlet_self *s, int32_t at, surroundings *a)
{
    int32_t box[3];
    boxes_of(s, s->x + 3 * (size_t)at, box);
    a->bucket = bucket_of(s, box[0], box[1], box[2]);
    a->row = s->row[at];
    a->count = 0;
    surround(s, a->row, bucket_of(s, box[0] + 1, box[1], box[2]), 1, a);
    for (int k = 0; k < ROWS; k++) {
        int32_t y = box[1] + rows_ahead[k][0], z = box[2] + rows_ahead[k][1];
        surround(s, row_of(y, z), bucket_of(s, box[0] - 1, y, z), 3, a);
    }
}

/* Adds the pairs of a point with those from first to last; returns how many there are then. */
static inline int32_t pair_with(const drape_verlet_self *s, int32_t at, uint64_t row, int32_t first,
                                int32_t last, double square_of_reach, int32_t count)
{
    const double *x = s->x + 3 * (size_t)at;
    for (int32_t other = first; other < last; other++) {
        double d[3];
        vec3_sub(x, s->x + 3 * (size_t)other, d);
        s->pair[2 * (size_t)count] = s->node[at];
        s->pair[2 * (size_t)count + 1] = s->node[other];
        count += (vec3_dot(d, d) < square_of_reach) & (s->row[other] == row);
    }
    return count;
}

/* All pairs of points nearer than reach, which is the size of the boxes. -1: there is no room for all. */
static int32_t collect_pairs(drape_verlet_self *s, double reach)
{
    int32_t n = s->model->node_count, count = 0, most = n * (A_NODE / 2);
    surroundings a = {.bucket = -1};
    for (int32_t at = 0; at < n; at++) {
        int32_t bucket = s->bucket[s->node[at]];
        if (bucket != a.bucket || s->row[at] != a.row)
            look_around(s, at, &a);
        int32_t last = s->start[bucket + 1], candidates = last - at;
        for (int k = 0; k < a.count; k++)
            candidates += a.range[k].last - a.range[k].first;
        if (candidates > most - count) /* each is written, and counted only if it is near */
            return -1;
        count = pair_with(s, at, a.row, at + 1, last, reach * reach, count);
        for (int k = 0; k < a.count; k++)
            count = pair_with(s, at, a.range[k].row, a.range[k].first, a.range[k].last, reach * reach, count);
    }
    return count;
}

/* From pairs to the list of every node, in the order of numbers: lists of any order first, in near; then each node,
 * one after the other, is put into the lists of those that are in its own. */
static bool spread_pairs(drape_verlet_self *s, int32_t count)
{
    int32_t n = s->model->node_count, total = 0, *sorted = s->pair;
    memset(s->cursor, 0, (size_t)n * sizeof *s->cursor);
    for (int32_t p = 0; p < 2 * count; p++)
        s->cursor[s->pair[p]]++;
    for (int32_t i = 0; i < n; i++) {
        int32_t own = s->cursor[i];
        if (own > MOST_NEAR)
            return false;
        s->first[i] = s->cursor[i] = total;
        total += own;
    }
    s->first[n] = total;
    for (int32_t p = 0; p < count; p++) {
        int32_t i = s->pair[2 * p], j = s->pair[2 * p + 1];
        s->near[s->cursor[i]++] = j;
        s->near[s->cursor[j]++] = i;
    }
    memcpy(s->cursor, s->first, (size_t)n * sizeof *s->cursor);
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = s->first[i]; k < s->first[i + 1]; k++)
            sorted[s->cursor[s->near[k]]++] = i;
    s->pair = s->near;
    s->near = sorted;
    return true;
}

/* Where there are none, nodes are sorted for a search. */
static void build_lists(drape_verlet_self *s, double share, const double *x)
{
    double reach = s->reach * (1 + 2 * share + SKIN);
    s->built = false;
    for (int k = 0; k < 3; k++)
        s->per_box[k] = 1 / reach;
    sort_nodes(s, x);
    int32_t count = collect_pairs(s, reach);
    s->built = count >= 0 && spread_pairs(s, count);
    if (s->built) {
        memcpy(s->x_built, x, 3 * (size_t)s->model->node_count * sizeof *x);
        s->built_share = share;
        return;
    }
    set_boxes(s);
    sort_nodes(s, x);
}

/* LANES nodes at once, each with sums and a maximum of its own. */

/* sum of x - x0 over all nodes. */
static inline void sum_moves(size_t n, const double *restrict x, const double *restrict x0, double sum[3])
{
    double lane[3 * LANES] = {0};
    size_t whole = n - n % LANES;
    for (size_t i = 0; i < 3 * whole; i += 3 * LANES)
        for (size_t k = 0; k < 3 * LANES; k++)
            lane[k] += x[i + k] - x0[i + k];
    for (size_t i = 3 * whole; i < 3 * n; i++)
        lane[i % 3] += x[i] - x0[i];
    for (size_t k = 0; k < 3; k++)
        sum[k] = lane[k] + lane[3 + k] + lane[6 + k] + lane[9 + k];
}

static inline double square_of_move(const double *x, const double *x0, const double mean[3])
{
    double a = x[0] - x0[0] - mean[0], b = x[1] - x0[1] - mean[1], c = x[2] - x0[2] - mean[2];
    return a * a + b * b + c * c;
}

/* How far a node has moved from x0 to x at most, against the mean of all; infinite where a number is none. */
LANES_DISPATCH static double farthest_moved(size_t n, const double *restrict x, const double *restrict x0)
{
    double mean[3], lane[LANES] = {0}, square;
    size_t whole = n - n % LANES;
    sum_moves(n, x, x0, mean);
    for (int k = 0; k < 3; k++)
        mean[k] /= (double)n;
    if (!isfinite(mean[0] + mean[1] + mean[2]))
        return INFINITY;
    for (size_t i = 0; i < whole; i += LANES)
        for (size_t k = 0; k < LANES; k++) {
            square = square_of_move(x + 3 * (i + k), x0 + 3 * (i + k), mean);
            lane[k] = square > lane[k] ? square : lane[k];
        }
    for (size_t i = whole; i < n; i++) {
        square = square_of_move(x + 3 * i, x0 + 3 * i, mean);
        lane[0] = square > lane[0] ? square : lane[0];
    }
    return sqrt(fmax(fmax(lane[0], lane[1]), fmax(lane[2], lane[3])));
}

/* No node has moved by half of the skin against the mean of all. */
static bool lists_are_good(const drape_verlet_self *s, double share, const double *x)
{
    return s->built && share <= s->built_share &&
           farthest_moved((size_t)s->model->node_count, x, s->x_built) <= 0.5 * SKIN * s->reach;
}

/* ---- Pushing ---- */

/* near NULL: all points, which are count. */
static void push_node(drape_verlet_self *s, int32_t i, const int32_t *near, int count, double share,
                      double *x)
{
    double *own = x + 3 * (size_t)i, sum[3] = {0}, square_of_reach = s->reach * s->reach;
    int pushing = 0;
    for (int k = 0; k < count; k++) {
        double d[3];
        vec3_sub(own, x + 3 * (size_t)(near ? near[k] : k), d);
        double square = vec3_dot(d, d);
        if (!(square < square_of_reach) || square == 0) /* itself, or no direction to push in */
            continue;
        double distance = sqrt(square);
        vec3_add_scaled(s->reach / distance - 1, d, sum);
        pushing++;
    }
    if (pushing > 0)
        vec3_add_scaled(share / pushing, sum, own);
}

static void push_listed(drape_verlet_self *s, double share, double *x)
{
    for (int32_t i = 0; i < s->model->node_count; i++)
        if (!s->model->pinned[i])
            push_node(s, i, s->near + s->first[i], s->first[i + 1] - s->first[i], share, x);
}

/* A box as 21 bits of each of its numbers: points that are near to each other are not 2^20 boxes apart. */
static uint64_t own_box(const drape_verlet_self *s, const double *x)
{
    uint64_t box = 0;
    for (int k = 0; k < 3; k++)
        box = box << 21 | ((uint32_t)box_number(x[k], s->per_own[k]) & 0x1FFFFFu);
    return box;
}

static void push_listed_own(drape_verlet_self *s, double share, double *x)
{
    const int32_t n = s->model->node_count;
    for (int32_t i = 0; i < n; i++)
        s->own[i] = own_box(s, x + 3 * (size_t)i);
    for (int32_t i = 0; i < n; i++) {
        int32_t near[MOST_NEAR + 1];
        int count = 0;
        if (s->model->pinned[i])
            continue;
        for (int32_t k = s->first[i]; k < s->first[i + 1]; k++) {
            near[count] = s->near[k];
            count += s->own[near[count]] == s->own[i];
        }
        push_node(s, i, near, count, share, x);
    }
}

/* A point in a heap of more than MOST_NEAR others, of cloth much thicker than its mesh is fine, asks all; in its
 * own box it keeps to the first of them. */
static void push_searched(drape_verlet_self *s, double share, double *x)
{
    for (int32_t i = 0; i < s->model->node_count; i++) {
        search q = {.node = i, .x = x + 3 * (size_t)i};
        if (s->model->pinned[i])
            continue;
        search_near(s, &q, s->reach, s->same_box ? 0 : s->reach * (1 + share));
        if (q.count <= MOST_NEAR)
            push_node(s, i, q.found, q.count, share, x);
        else if (s->same_box)
            push_node(s, i, q.found, MOST_NEAR, share, x);
        else
            push_node(s, i, NULL, s->model->node_count, share, x);
        memcpy(s->x + 3 * (size_t)s->place[i], q.x, 3 * sizeof *q.x);
    }
}

void drape_verlet_self_push(drape_verlet_self *s, double share, double *x)
{
    if (!lists_are_good(s, share, x))
        build_lists(s, share, x);
    if (!s->built)
        push_searched(s, share, x);
    else if (s->same_box)
        push_listed_own(s, share, x);
    else
        push_listed(s, share, x);
}
