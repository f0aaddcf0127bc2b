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
 */
#include "base/vec3.h"
#include "integrators/verlet.h"

#include <string.h>

#define FARTHEST 1e9 /* boxes are counted in 32 bits: what is beyond has blown up and shares one */

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
    if (s->start && s->bucket && s->place && s->node && s->cell && s->x)
        return DRAPE_OK;
    drape_verlet_self_destroy(out);
    return DRAPE_E_MEMORY;
}

size_t drape_verlet_self_bytes(const drape_verlet_self *s)
{
    size_t n = (size_t)s->model->node_count;
    return sizeof *s + ((size_t)s->buckets + 1) * sizeof *s->start +
           n * (6 * sizeof(int32_t) + 3 * sizeof(double));
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

/* ---- Pushing ---- */

/* The sum over the near points of one. */
typedef struct push {
    int32_t node;
    const double *x;
    double reach_squared, reach;
    int32_t low[3], high[3]; /* boxes that are searched */
    double sum[3];
    int count;
} push;

static bool is_searched(const push *p, const int32_t *cell, int32_t y, int32_t z)
{
    return cell[1] == y && cell[2] == z && cell[0] >= p->low[0] && cell[0] <= p->high[0];
}

static void add_near(push *p, const double d[3], double square)
{
    double distance = sqrt(square);
    if (distance == 0) /* no direction to push in */
        return;
    vec3_add_scaled((p->reach - distance) / distance, d, p->sum);
    p->count++;
}

/* Points from first to last: those of row y, z, and of others whose hash is the same. */
static void search_range(const drape_verlet_self *s, push *p, int32_t y, int32_t z, int32_t first,
                         int32_t last)
{
    for (int32_t at = first; at < last; at++) {
        double d[3];
        vec3_sub(p->x, s->x + 3 * (size_t)at, d);
        double square = vec3_dot(d, d);
        if (square < p->reach_squared && s->node[at] != p->node &&
            is_searched(p, s->cell + 3 * (size_t)at, y, z))
            add_near(p, d, square);
    }
}

static void search_row(const drape_verlet_self *s, push *p, int32_t y, int32_t z)
{
    int32_t first = bucket_of(s, p->low[0], y, z), last = first + (p->high[0] - p->low[0]) + 1;
    if (last <= s->buckets) {
        search_range(s, p, y, z, s->start[first], s->start[last]);
        return;
    }
    search_range(s, p, y, z, s->start[first], s->start[s->buckets]);
    search_range(s, p, y, z, 0, s->start[last - s->buckets]);
}

static void push_node(drape_verlet_self *s, int32_t i, double share, double *x)
{
    double *own = x + 3 * (size_t)i, ball = s->same_box ? 0 : s->reach * (1 + share);
    push p = {.node = i, .x = own, .reach = s->reach, .reach_squared = s->reach * s->reach};
    for (int k = 0; k < 3; k++) {
        p.low[k] = box_number(own[k] - ball, s->per_box[k]);
        p.high[k] = box_number(own[k] + ball, s->per_box[k]);
    }
    for (int32_t y = p.low[1]; y <= p.high[1]; y++)
        for (int32_t z = p.low[2]; z <= p.high[2]; z++)
            search_row(s, &p, y, z);
    if (p.count == 0)
        return;
    vec3_add_scaled(share / p.count, p.sum, own);
    memcpy(s->x + 3 * (size_t)s->place[i], own, 3 * sizeof *own);
}

void drape_verlet_self_push(drape_verlet_self *s, double share, double *x)
{
    sort_nodes(s, x);
    for (int32_t i = 0; i < s->model->node_count; i++)
        if (!s->model->pinned[i])
            push_node(s, i, share, x);
}
