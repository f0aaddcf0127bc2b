/*
 * verlet_self.c: cloth against cloth as CS184 has it: points that are nearer to each other than twice the
 * thickness r = 2 t are pushed apart. One node after the other, x_i moves by
 *     share * mean over its near points j of (r - |x_i - x_j|) (x_i - x_j)/|x_i - x_j|
 * with the points as they are by then; share is one over the substeps of a step.
 *
 * Near points are found by boxes. CS184 looks into a point's own box alone, of 3 width/columns x 3 height/rows
 * x the larger of both, and misses pairs across its faces; with same_box so do we. Else all boxes that a ball
 * of the radius r around the point reaches are searched. Points are sorted by bucket, then by number, where
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
 * result depends on the positions alone, not on when a list was made.
 */
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
    double per_box[3];       /* boxes a metre */
    int32_t buckets;         /* a power of 2 */
    int32_t *start;          /* (buckets + 1) */
    int32_t *bucket, *place; /* (node_count) of a node, and where it is in what follows */
    int32_t *node, *cell;    /* sorted: (node_count), (node_count x 3) */
    double *x;               /* sorted: (node_count x 3) */
    /* Lists; built: they are good near x_built, for shares up to built_share. */
    bool built;
    double built_share;
    int32_t *first, *cursor; /* (node_count + 1), (node_count): of a node in near */
    int32_t *near;           /* (node_count x A_NODE) */
    int32_t *pair;           /* (node_count x A_NODE / 2) of each pair the lower node, by the higher one */
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
    double size[3] = {0.5 * s->reach, 2 * s->reach, 2 * s->reach};
    if (s->same_box)
        box_of_cs184(s->model, size);
    for (int k = 0; k < 3; k++)
        s->per_box[k] = 1 / size[k];
}

void drape_verlet_self_destroy(drape_verlet_self **self)
{
    drape_verlet_self *s = *self;
    if (!s)
        return;
    drape_free(s->ctx, s->start);
    drape_free(s->ctx, s->bucket);
    drape_free(s->ctx, s->place);
    drape_free(s->ctx, s->node);
    drape_free(s->ctx, s->cell);
    drape_free(s->ctx, s->x);
    drape_free(s->ctx, s->first);
    drape_free(s->ctx, s->cursor);
    drape_free(s->ctx, s->near);
    drape_free(s->ctx, s->pair);
    drape_free(s->ctx, s->x_built);
    drape_free(s->ctx, s);
    *self = NULL;
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
    set_boxes(s);
    while (s->buckets < 2 * m->node_count && s->buckets < 1 << 28)
        s->buckets *= 2;
    s->start = drape_alloc(ctx, (size_t)s->buckets + 1, sizeof *s->start);
    s->bucket = drape_alloc(ctx, n, sizeof *s->bucket);
    s->place = drape_alloc(ctx, n, sizeof *s->place);
    s->node = drape_alloc(ctx, n, sizeof *s->node);
    s->cell = drape_alloc(ctx, 3 * n, sizeof *s->cell);
    s->x = drape_alloc(ctx, 3 * n, sizeof *s->x);
    s->first = drape_alloc(ctx, n + 1, sizeof *s->first);
    s->cursor = drape_alloc(ctx, n, sizeof *s->cursor);
    s->near = drape_alloc(ctx, n * A_NODE, sizeof *s->near);
    s->pair = drape_alloc(ctx, n * A_NODE / 2, sizeof *s->pair);
    s->x_built = drape_alloc(ctx, 3 * n, sizeof *s->x_built);
    if (s->start && s->bucket && s->place && s->node && s->cell && s->x && s->first && s->cursor && s->near &&
        s->pair && s->x_built)
        return DRAPE_OK;
    drape_verlet_self_destroy(out);
    return DRAPE_E_MEMORY;
}

size_t drape_verlet_self_bytes(const drape_verlet_self *s)
{
    size_t n = (size_t)s->model->node_count;
    return sizeof *s + ((size_t)s->buckets + 1) * sizeof *s->start +
           n * ((8 + A_NODE + A_NODE / 2) * sizeof(int32_t) + 6 * sizeof(double));
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

static int32_t bucket_of(const drape_verlet_self *s, int32_t x, int32_t y, int32_t z)
{
    uint32_t row = (uint32_t)y * 0x9E3779B1u ^ (uint32_t)z * 0x85EBCA77u; /* odd: all rows differ */
    return (int32_t)(((row ^ row >> 15) + (uint32_t)x) & (uint32_t)(s->buckets - 1));
}

static void sort_nodes(drape_verlet_self *s, const double *x)
{
    int32_t n = s->model->node_count;
    memset(s->start, 0, ((size_t)s->buckets + 1) * sizeof *s->start);
    for (int32_t i = 0; i < n; i++) {
        const double *p = x + 3 * (size_t)i;
        s->bucket[i] = bucket_of(s, box_number(p[0], s->per_box[0]), box_number(p[1], s->per_box[1]),
                                 box_number(p[2], s->per_box[2]));
        s->start[s->bucket[i] + 1]++;
    }
    for (int32_t b = 0; b < s->buckets; b++)
        s->start[b + 1] += s->start[b];
    for (int32_t i = n - 1; i >= 0; i--) { /* backwards: the ends of the buckets move to their starts */
        size_t at = (size_t)--s->start[s->bucket[i] + 1];
        s->place[i] = (int32_t)at;
        s->node[at] = i;
        for (size_t k = 0; k < 3; k++) {
            s->x[3 * at + k] = x[3 * (size_t)i + k];
            s->cell[3 * at + k] = box_number(s->x[3 * at + k], s->per_box[k]);
        }
    }
    /* start[b + 1] is now where bucket b begins */
    memmove(s->start, s->start + 1, (size_t)s->buckets * sizeof *s->start);
    s->start[s->buckets] = n;
}

/* ---- Searching ---- */

/* The points nearer than `reach` to one: their numbers, as many as there is room for, of all or of lower ones. */
typedef struct search {
    int32_t node;
    const double *x;
    double reach_squared;
    int32_t low[3], high[3]; /* boxes that are searched */
    bool lower;
    int32_t found[MOST_NEAR];
    int count; /* more than MOST_NEAR: there are more */
} search;

static bool is_searched(const search *q, const int32_t *cell, int32_t y, int32_t z)
{
    return cell[1] == y && cell[2] == z && cell[0] >= q->low[0] && cell[0] <= q->high[0];
}

/* Points from first to last: those of row y, z, and of others whose hash is the same. */
static void search_range(const drape_verlet_self *s, search *q, int32_t y, int32_t z, int32_t first,
                         int32_t last)
{
    for (int32_t at = first; at < last; at++) {
        double d[3];
        vec3_sub(q->x, s->x + 3 * (size_t)at, d);
        if (!(vec3_dot(d, d) < q->reach_squared) || s->node[at] == q->node ||
            (q->lower && s->node[at] > q->node) || !is_searched(q, s->cell + 3 * (size_t)at, y, z))
            continue;
        if (q->count < MOST_NEAR)
            q->found[q->count] = s->node[at];
        q->count++;
    }
}

static void search_row(const drape_verlet_self *s, search *q, int32_t y, int32_t z)
{
    int32_t first = bucket_of(s, q->low[0], y, z), last = first + (q->high[0] - q->low[0]) + 1;
    if (last <= s->buckets) {
        search_range(s, q, y, z, s->start[first], s->start[last]);
        return;
    }
    search_range(s, q, y, z, s->start[first], s->start[s->buckets]);
    search_range(s, q, y, z, 0, s->start[last - s->buckets]);
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

/* Each pair once, under its higher node. False: there is no room for all. */
static bool collect_pairs(drape_verlet_self *s, const double *x, double reach)
{
    int32_t n = s->model->node_count, count = 0, most = n * (A_NODE / 2);
    for (int32_t i = 0; i < n; i++) {
        search q = {.node = i, .x = x + 3 * (size_t)i, .lower = true};
        s->first[i] = count;
        search_near(s, &q, reach, reach);
        if (q.count > MOST_NEAR || count + q.count > most)
            return false;
        memcpy(s->pair + count, q.found, (size_t)q.count * sizeof *q.found);
        count += q.count;
    }
    s->first[n] = count;
    return true;
}

/* From pairs by their higher node to the list of every node: first the lower ones, as they are; the higher
 * ones come as the loop does. */
static bool spread_pairs(drape_verlet_self *s)
{
    int32_t n = s->model->node_count, total = 0;
    for (int32_t i = 0; i < n; i++)
        s->cursor[i] = s->first[i + 1] - s->first[i];
    for (int32_t p = 0; p < s->first[n]; p++)
        s->cursor[s->pair[p]]++;
    for (int32_t i = 0; i < n; i++) {
        int32_t own = s->cursor[i];
        if (own > MOST_NEAR)
            return false;
        s->cursor[i] = total;
        total += own;
    }
    for (int32_t i = 0; i < n; i++)
        for (int32_t p = s->first[i]; p < s->first[i + 1]; p++) {
            s->near[s->cursor[i]++] = s->pair[p];
            s->near[s->cursor[s->pair[p]]++] = i;
        }
    s->first[0] = 0;
    for (int32_t i = 0; i < n; i++)
        s->first[i + 1] = s->cursor[i];
    return true;
}

static void build_lists(drape_verlet_self *s, double share, const double *x)
{
    sort_nodes(s, x);
    s->built = !s->same_box && collect_pairs(s, x, s->reach * (1 + 2 * share + SKIN)) && spread_pairs(s);
    s->built_share = share;
    if (s->built)
        memcpy(s->x_built, x, 3 * (size_t)s->model->node_count * sizeof *x);
}

/* No node has moved by half of the skin against the mean of all. */
static bool lists_are_good(const drape_verlet_self *s, double share, const double *x)
{
    size_t n = (size_t)s->model->node_count;
    double mean[3] = {0}, most = 0, bound = 0.5 * SKIN * s->reach;
    if (!s->built || share > s->built_share)
        return false;
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++)
            mean[k] += x[3 * i + k] - s->x_built[3 * i + k];
    for (size_t k = 0; k < 3; k++)
        mean[k] /= (double)n;
    for (size_t i = 0; i < n; i++) {
        double a = x[3 * i] - s->x_built[3 * i] - mean[0], b = x[3 * i + 1] - s->x_built[3 * i + 1] - mean[1],
               c = x[3 * i + 2] - s->x_built[3 * i + 2] - mean[2], square = a * a + b * b + c * c;
        most = square > most || square != square ? square : most;
    }
    return most <= bound * bound;
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
    if (s->built)
        push_listed(s, share, x);
    else
        push_searched(s, share, x);
}
