/*
 * contours.c: the curves in which sheets intersect. A curve is a chain of pairs of triangles, linked
 * by the points where an edge of one passes through the other. It has two traces, one on each sheet. If a
 * trace cuts its sheet in two, the smaller part is on the wrong side, of the smaller of both sheets' parts:
 * its nodes next to the curve are to pass through. If no trace does, its length is reduced.
 */
#include "untangle/workspace.h"

#include "base/list.h"
#include "geometry/intersect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RINGS  4    /* rings of nodes around a curve that may be on the wrong side of their own sheet */
#define STRIDE 0.3  /* by which an edge is moved along the gradient, in its length */
#define STEEP  0.05 /* least sine of an edge and a triangle by which the gradient is divided */

/* ---- Crossings ---- */

typedef struct finding {
    drape_untangler *u;
    int32_t first_edge, first_triangle; /* of the surfaces among those of all sheets */
} finding;

static void note_crossing(void *user, int32_t edge, int32_t triangle)
{
    const finding *f = user;
    drape_untangler *u = f->u;
    const drape_sheets *s = &u->sheets;
    const int32_t e = f->first_edge + edge, t = f->first_triangle + triangle;
    const int32_t *ends = s->edge + 2 * (size_t)e, *corner = s->triangle + 3 * (size_t)t;
    const int32_t nodes = u->model->node_count, a = ends[0], b = corner[0];
    if (a < nodes && b < nodes && drape_model_ignores_cloth(u->model, a, b))
        return;
    if ((a < nodes) != (b < nodes) &&
        drape_model_ignores(u->model, s->of_point[a < nodes ? b : a] - u->model->cloth_count,
                            a < nodes ? a : b))
        return;
    const double *p = u->x + 3 * (size_t)a, *q = u->x + 3 * (size_t)ends[1], *o = u->x + 3 * (size_t)b;
    double n[3], op[3], oq[3];
    vec3_triangle_area(corner, u->x, n);
    vec3_sub(p, o, op);
    vec3_sub(q, o, oq);
    const double above = fabs(vec3_dot(n, op)), below = fabs(vec3_dot(n, oq));
    drape_crossing found = {.edge = e, .triangle = t, .contour = -1};
    found.t = above + below > 0 ? above / (above + below) : 0.5;
    for (int k = 0; k < 3; k++)
        found.x[k] = (1 - found.t) * p[k] + found.t * q[k];
    if (!drape_list_append(u->arena, &u->crossing, &u->crossing_count, &u->crossing_capacity, &found,
                           sizeof found))
        u->out_of_memory = true;
}

static drape_status find_crossings(drape_untangler *u)
{
    const drape_model *m = u->model;
    const drape_sheets *s = &u->sheets;
    const drape_surface cloth = drape_surface_of(m, u->x);
    const drape_surface open = {.x =
                                    u->start, /* the same positions, of points that are nobody's neighbours */
                                .edge = s->edge + 2 * (size_t)m->edge_count,
                                .triangle = s->triangle + 3 * (size_t)m->triangle_count,
                                .edge_count = s->edge_count - m->edge_count,
                                .triangle_count = s->triangle_count - m->triangle_count};
    finding own = {.u = u}, in = {u, 0, m->triangle_count}, by = {u, m->edge_count, 0};
    u->crossing_count = 0;
    drape_status status =
        m->contact.self ? drape_intersect(u->ctx, &cloth, &cloth, note_crossing, &own) : DRAPE_OK;
    if (!status)
        status = drape_intersect(u->ctx, &cloth, &open, note_crossing, &in);
    if (!status)
        status = drape_intersect(u->ctx, &open, &cloth, note_crossing, &by);
    return status ? status : u->out_of_memory ? DRAPE_E_MEMORY : DRAPE_OK;
}

/* ---- Curves ---- */

static int compare_records(const void *a, const void *b)
{
    const drape_crossing_record *p = a, *q = b;
    for (int k = 0; k < 2; k++)
        if (p->triangle[k] != q->triangle[k])
            return p->triangle[k] < q->triangle[k] ? -1 : 1;
    return (p->crossing > q->crossing) - (p->crossing < q->crossing);
}

static bool same_pair(const drape_crossing_record *a, const drape_crossing_record *b)
{
    return a->triangle[0] == b->triangle[0] && a->triangle[1] == b->triangle[1];
}

static drape_status list_records(drape_untangler *u)
{
    u->record_count = 0;
    for (int32_t c = 0; c < u->crossing_count; c++)
        for (int k = 0; k < 2; k++) {
            const int32_t face = u->crossing[c].triangle,
                          at = u->sheets.edge_triangle[2 * (size_t)u->crossing[c].edge + (size_t)k];
            if (at < 0)
                continue;
            const drape_crossing_record new = {
                {at < face ? at : face, at < face ? face : at}, .crossing = c, .edge_in_first = at < face};
            if (!drape_list_append(u->arena, &u->record, &u->record_count, &u->record_capacity, &new,
                                   sizeof new))
                return DRAPE_E_MEMORY;
        }
    if (u->record_count > 0)
        qsort(u->record, (size_t)u->record_count, sizeof *u->record, compare_records);
    return DRAPE_OK;
}

/* The first of the records of a pair, by bisection. */
static int32_t find_pair(const drape_untangler *u, int32_t a, int32_t b)
{
    const drape_crossing_record key = {{a < b ? a : b, a < b ? b : a}, .crossing = -1};
    int32_t low = 0, high = u->record_count;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (compare_records(&u->record[middle], &key) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* The side of the curve that the lower triangle of a pair belongs to. */
static int8_t side_of_first(const drape_untangler *u, const drape_crossing_record *r)
{
    const int8_t trace = u->crossing[r->crossing].trace;
    return r->edge_in_first ? trace : (int8_t)(1 - trace);
}

/* Follows a curve from one crossing: through both pairs of each. order: (crossing_count) its crossings. */
static int32_t follow(drape_untangler *u, int32_t from, int32_t contour, int32_t *order)
{
    int32_t count = 0;
    u->crossing[from].contour = contour;
    order[count++] = from;
    for (int32_t i = 0; i < count; i++) {
        const drape_crossing *c = &u->crossing[order[i]];
        for (int k = 0; k < 2; k++) {
            const int32_t at = u->sheets.edge_triangle[2 * (size_t)c->edge + (size_t)k];
            if (at < 0)
                continue;
            const int32_t first = find_pair(u, at, c->triangle);
            const int8_t side =
                at < c->triangle ? c->trace : (int8_t)(1 - c->trace); /* of the lower triangle */
            for (int32_t r = first; r < u->record_count && same_pair(&u->record[r], &u->record[first]); r++) {
                drape_crossing *other = &u->crossing[u->record[r].crossing];
                if (other->contour >= 0)
                    continue;
                other->contour = contour;
                other->trace = u->record[r].edge_in_first ? side : (int8_t)(1 - side);
                order[count++] = u->record[r].crossing;
            }
        }
    }
    return count;
}

/* ---- Parts of a sheet ---- */

typedef struct curve {
    const int32_t *crossing; /* (count) */
    int32_t count;
} curve;

/* Counts how often the curve passes through each edge of a trace; an edge is blocked if the number is odd.
 * Returns whether the trace has any edges of cloth. */
static bool mark(drape_untangler *u, const curve *k, int trace)
{
    bool any = false;
    memset(u->colour, -1, (size_t)u->broad.points * sizeof *u->colour);
    for (int32_t i = 0; i < k->count; i++) {
        const drape_crossing *c = &u->crossing[k->crossing[i]];
        if (c->trace != trace || c->edge >= u->model->edge_count)
            continue;
        u->block[c->edge]++;
        any = true;
    }
    return any;
}

static void unmark(drape_untangler *u, const curve *k)
{
    for (int32_t i = 0; i < k->count; i++)
        u->block[u->crossing[k->crossing[i]].edge] = 0;
}

/* Spreads colours from the first `count` nodes of the queue to all others that edges lead to; through a
 * blocked edge the other colour. Returns whether they agree everywhere. */
static bool spread(drape_untangler *u, int32_t count, bool through, double price[2])
{
    const drape_sheets *s = &u->sheets;
    bool agree = true;
    price[0] = price[1] = 0;
    for (int32_t i = 0; agree && i < count; i++) {
        const int32_t node = u->queue[i];
        const int8_t own = u->colour[node];
        /* The price of moving a node is its area. A pin costs more than all of the cloth, so that a part with
         * pins is not moved if another part can be. */
        price[own] += u->broad.node_area[node] + (u->mobility[node] > 0 ? 0 : 2 * u->area);
        for (int32_t a = s->edges.first[node]; agree && a < s->edges.first[node + 1]; a++) {
            const int32_t e = s->edges.element[a], *ends = s->edge + 2 * (size_t)e,
                          other = ends[0] == node ? ends[1] : ends[0];
            const bool blocked = u->block[e] & 1;
            if (u->colour[other] < 0 && (through || !blocked)) {
                u->colour[other] = (int8_t)(own ^ blocked);
                u->queue[count++] = other;
            }
            agree = !through || u->colour[other] == (own ^ blocked);
        }
    }
    return agree && price[0] > 0 && price[1] > 0;
}

/* Colours the nodes of the sheet of a trace that cuts it in two: two nodes of an edge have different colours
 * if the edge is blocked. Returns whether that is possible. */
static bool colour_cut(drape_untangler *u, const curve *k, int trace, double price[2])
{
    bool cuts = mark(u, k, trace);
    for (int32_t i = 0; cuts && i < k->count; i++) {
        const drape_crossing *c = &u->crossing[k->crossing[i]];
        if (c->trace != trace)
            continue;
        u->queue[0] = u->sheets.edge[2 * (size_t)c->edge];
        u->colour[u->queue[0]] = 0;
        cuts = spread(u, 1, true, price);
        break;
    }
    unmark(u, k);
    return cuts;
}

/* Colours the nodes of the sheet of a trace that ends inside of it: as that end of a blocked edge which is
 * nearest along edges, 1 on that side of the other sheet to which its normals point. The border between both
 * colours so goes on from the end of the curve to the boundary. */
static bool colour_near(drape_untangler *u, const curve *k, int trace, double price[2])
{
    const drape_sheets *s = &u->sheets;
    int32_t count = 0;
    bool any = mark(u, k, trace);
    for (int32_t i = 0; any && i < k->count; i++) {
        const drape_crossing *c = &u->crossing[k->crossing[i]];
        const int32_t *corner = s->triangle + 3 * (size_t)c->triangle;
        for (int a = 0; c->trace == trace && (u->block[c->edge] & 1) && a < 2; a++) {
            const int32_t node = s->edge[2 * (size_t)c->edge + (size_t)a];
            if (u->colour[node] >= 0)
                continue;
            u->colour[node] = drape_orient(u->x + 3 * (size_t)corner[0], u->x + 3 * (size_t)corner[1],
                                           u->x + 3 * (size_t)corner[2], u->x + 3 * (size_t)node) > 0;
            u->queue[count++] = node;
        }
    }
    any = any && spread(u, count, false, price);
    unmark(u, k);
    return any;
}

/* ---- A part on the wrong side ---- */

static double area_of(const double *a, const double *b, const double *c, const double n[3])
{
    double v[3], w[3], cross[3];
    vec3_sub(b, a, v);
    vec3_sub(c, a, w);
    vec3_cross(v, w, cross);
    return vec3_dot(cross, n);
}

/* Barycentric coordinates of a point in the plane of a triangle. */
static void weights_of(const drape_untangler *u, int32_t triangle, const double n[3], const double at[3],
                       double weight[3])
{
    const int32_t *t = u->sheets.triangle + 3 * (size_t)triangle;
    const double *a = u->x + 3 * (size_t)t[0], *b = u->x + 3 * (size_t)t[1], *c = u->x + 3 * (size_t)t[2];
    const double whole = area_of(a, b, c, n);
    weight[0] = whole > 0 ? fmin(fmax(area_of(at, b, c, n) / whole, 0), 1) : 1;
    weight[1] = whole > 0 ? fmin(fmax(area_of(a, at, c, n) / whole, 0), 1 - weight[0]) : 0;
    weight[2] = 1 - weight[0] - weight[1];
}

/* The gap that is wanted between two sheets. */
static double wanted_between(const drape_untangler *u, int32_t sheet, int32_t other)
{
    const int32_t most = sheet > other ? sheet : other, cloths = u->model->cloth_count;
    if (most < cloths)
        return drape_untangle_wanted(u, 2 * u->model->contact.self_thickness);
    return u->model->colliders[most - cloths].shape.radius +
           drape_untangle_wanted(u, u->broad.distance[most - cloths]);
}

/* Adds the bounds by which the nodes of a triangle that are on the wrong side pass the other triangle, at a
 * point of the curve. Returns the right side of the other triangle: 1 if its normal points there, -1 if not,
 * 0 if the pair does not show it. */
static int pass(drape_untangler *u, int32_t triangle, int32_t other, int8_t wrong, const double at[3])
{
    const int32_t *node = u->sheets.triangle + 3 * (size_t)triangle,
                  *corner = u->sheets.triangle + 3 * (size_t)other;
    double n[3], weight[3], height[3], sum[2] = {0};
    int number[2] = {0};
    vec3_triangle_normal(u->sheets.triangle + 3 * (size_t)other, u->x, n);
    weights_of(u, other, n, at, weight);
    for (int a = 0; a < 3; a++) {
        double from[3];
        vec3_sub(u->x + 3 * (size_t)node[a], at, from);
        height[a] = vec3_dot(n, from);
        sum[u->colour[node[a]] == wrong] += height[a];
        number[u->colour[node[a]] == wrong]++;
    }
    if (number[0] == 0 || number[1] == 0)
        return 0;
    const double side = sum[0] / number[0] >= sum[1] / number[1] ? 1 : -1;
    const double wanted = wanted_between(u, u->sheets.of_point[node[0]], u->sheets.of_point[corner[0]]);
    for (int a = 0; a < 3; a++) {
        if (u->colour[node[a]] != wrong)
            continue;
        const drape_half_space bound = {.node = {node[a], corner[0], corner[1], corner[2]},
                                        .c = {1, -weight[0], -weight[1], -weight[2]},
                                        .normal = {side * n[0], side * n[1], side * n[2]},
                                        .bound = wanted};
        drape_untangle_bound(u, &bound);
    }
    return side > 0 ? 1 : -1;
}

static bool is_boundary(const drape_sheets *s, int32_t a, int32_t b)
{
    const int32_t edge = drape_elements_of_edge(&s->edges, s->edge, a, b);
    return edge >= 0 && s->edge_triangle[2 * (size_t)edge + 1] < 0;
}

/* Moves a node of a part on the wrong side, away from the curve, towards the nearest place of the other
 * sheet, as far as a sweep goes, so that the part turns as a whole and is not pulled along by its edge. */
static void follow_part(drape_untangler *u, int32_t node, int32_t sheet, int side)
{
    const drape_bvh *tree = &u->tree[sheet];
    const double *x = u->x + 3 * (size_t)node;
    const drape_on_triangle place = drape_nearest_on(tree, u->x, x, INFINITY);
    double n[3], d[3];
    if (place.triangle < 0)
        return;
    const int32_t *corner = tree->node + 3 * (size_t)place.triangle;
    /* A place on the boundary of the other sheet does not show on which side the node is. */
    for (int a = 0; a < 3; a++)
        if (place.weights[a] <= 0 && is_boundary(&u->sheets, corner[(a + 1) % 3], corner[(a + 2) % 3]))
            return;
    vec3_triangle_normal(corner, u->x, n);
    memcpy(d, x, sizeof d);
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(-place.weights[a], u->x + 3 * (size_t)corner[a], d);
    const double height = side * vec3_dot(n, d);
    if (height >= 0)
        return;
    const drape_half_space bound = {
        .node = {node, corner[0], corner[1], corner[2]},
        .c = {1, -place.weights[0], -place.weights[1], -place.weights[2]},
        .normal = {side * n[0], side * n[1], side * n[2]},
        .bound = fmin(wanted_between(u, u->sheets.of_point[node], sheet), height + drape_untangle_stride(u))};
    drape_untangle_bound(u, &bound);
}

/* Adds the passages of the wrong part: all of its nodes may be near the other sheet on the wrong side. In a
 * sheet that passes through itself only nodes next to the curve may be, since the others are near right parts
 * of the sheet. */
static void let_pass(drape_untangler *u, const curve *k, int trace, int8_t wrong, int32_t sheet, int side)
{
    const drape_sheets *s = &u->sheets;
    int32_t count = 0, ring = 0, end;
    for (int32_t i = 0; i < k->count; i++) {
        const drape_crossing *c = &u->crossing[k->crossing[i]];
        for (int a = 0; c->trace == trace && a < 2; a++) {
            const int32_t node = s->edge[2 * (size_t)c->edge + (size_t)a];
            if (u->colour[node] != wrong)
                continue;
            u->colour[node] = (int8_t)(wrong + 2);
            u->queue[count++] = node;
        }
    }
    const bool itself = count > 0 && s->of_point[u->queue[0]] == sheet;
    end = count;
    for (int32_t i = 0; i < count; i++) {
        const int32_t node = u->queue[i];
        ring += i == end;
        end = i == end ? count : end;
        drape_untangle_add_passage(u, node, sheet);
        if (!itself && side != 0)
            follow_part(u, node, sheet, side);
        for (int32_t a = s->edges.first[node]; !(itself && ring + 1 >= RINGS) && a < s->edges.first[node + 1];
             a++) {
            const int32_t *ends = s->edge + 2 * (size_t)s->edges.element[a],
                          other = ends[0] == node ? ends[1] : ends[0];
            if (u->colour[other] != wrong)
                continue;
            u->colour[other] = (int8_t)(wrong + 2);
            u->queue[count++] = other;
        }
    }
    for (int32_t i = 0; i < count; i++)
        u->colour[u->queue[i]] = wrong;
}

/* Lets the wrong part of a trace pass, at each pair of triangles of the curve once. */
static void pass_all(drape_untangler *u, const curve *k, int trace, int8_t wrong)
{
    const int32_t contour = u->crossing[k->crossing[0]].contour;
    int32_t sheet = -1, sum = 0, number = 0;
    for (int32_t first = 0, end; first < u->record_count; first = end) {
        const drape_crossing_record *r = &u->record[first];
        double at[3] = {0};
        for (end = first; end < u->record_count && same_pair(&u->record[end], r); end++)
            vec3_add_scaled(1, u->crossing[u->record[end].crossing].x, at);
        if (u->crossing[r->crossing].contour != contour)
            continue;
        for (int a = 0; a < 3; a++)
            at[a] /= end - first;
        const int mover = side_of_first(u, r) == trace ? 0 : 1;
        sheet = u->sheets.of_point[u->sheets.triangle[3 * (size_t)r->triangle[1 - mover]]];
        const int side = pass(u, r->triangle[mover], r->triangle[1 - mover], wrong, at);
        sum += side;
        number += side != 0;
    }
    const bool same = 4 * (sum < 0 ? -sum : sum) >= 3 * number;
    let_pass(u, k, trace, wrong, sheet, !same ? 0 : sum > 0 ? 1 : sum < 0 ? -1 : 0);
}

/* ---- A curve that cuts nothing off ---- */

/* The direction in which a move of an edge, relative to a triangle that it goes through, shortens the curve:
 * the sum over its faces of R - 2 (E . R) / (E . N) N, R along the curve into the face (Volino &
 * Magnenat-Thalmann 2006). */
static void gradient_of(const drape_untangler *u, const drape_crossing *c, double g[3])
{
    const drape_sheets *s = &u->sheets;
    const int32_t *ends = s->edge + 2 * (size_t)c->edge;
    double n[3], e[3];
    vec3_triangle_normal(u->sheets.triangle + 3 * (size_t)c->triangle, u->x, n);
    vec3_sub(u->x + 3 * (size_t)ends[1], u->x + 3 * (size_t)ends[0], e);
    const double length = vec3_norm(e);
    double sine = vec3_dot(e, n) / length;
    if (fabs(sine) < STEEP)
        sine = sine < 0 ? -STEEP : STEEP;
    memset(g, 0, 3 * sizeof *g);
    for (int k = 0; k < 2; k++) {
        const int32_t face = s->edge_triangle[2 * (size_t)c->edge + (size_t)k];
        double own[3], r[3], in[3] = {0};
        if (face < 0)
            continue;
        const int32_t *t = s->triangle + 3 * (size_t)face;
        vec3_triangle_normal(u->sheets.triangle + 3 * (size_t)face, u->x, own);
        vec3_cross(own, n, r);
        const double size = vec3_norm(r);
        for (int a = 0; a < 3; a++)
            vec3_add_scaled(1.0 / 3, u->x + 3 * (size_t)t[a], in);
        vec3_add_scaled(-1, c->x, in);
        const double sign = vec3_dot(in, r) < 0 ? -1 : 1;
        for (int a = 0; a < 3; a++)
            r[a] = size > 0 ? sign * r[a] / size : 0;
        vec3_add_scaled(1, r, g);
        vec3_add_scaled(-2 * vec3_dot(e, r) / length / sine, n, g);
    }
}

static void shorten(drape_untangler *u, const curve *k)
{
    const drape_sheets *s = &u->sheets;
    for (int32_t i = 0; i < k->count; i++) {
        const drape_crossing *c = &u->crossing[k->crossing[i]];
        const int32_t *ends = s->edge + 2 * (size_t)c->edge, *corner = s->triangle + 3 * (size_t)c->triangle;
        double g[3], n[3], weight[3], e[3];
        for (int a = 0; a < 2; a++)
            drape_untangle_add_passage(u, ends[a], s->of_point[corner[0]]);
        for (int a = 0; a < 3; a++)
            drape_untangle_add_passage(u, corner[a], s->of_point[ends[0]]);
        gradient_of(u, c, g);
        const double size = vec3_norm(g);
        if (!(size > 0))
            continue;
        vec3_triangle_normal(u->sheets.triangle + 3 * (size_t)c->triangle, u->x, n);
        weights_of(u, c->triangle, n, c->x, weight);
        vec3_sub(u->x + 3 * (size_t)ends[1], u->x + 3 * (size_t)ends[0], e);
        const double stride = STRIDE * vec3_norm(e) * size / sqrt(1 + size * size);
        for (int a = 0; a < 3; a++)
            g[a] /= size;
        /* the crossing is a point of edge and triangle: their distance along g is 0 now. Each of them gets
         * half of the stride */
        const drape_half_space bound = {.node = {ends[0], ends[1], -1, -1},
                                        .c = {1 - c->t, c->t},
                                        .normal = {g[0], g[1], g[2]},
                                        .bound = vec3_dot(g, c->x) + 0.5 * stride};
        drape_untangle_bound(u, &bound);
        for (int a = 0; a < 3; a++) {
            const drape_half_space back = {.node = {corner[a], -1, -1, -1},
                                           .c = {1},
                                           .normal = {-g[0], -g[1], -g[2]},
                                           .bound = -vec3_dot(g, u->x + 3 * (size_t)corner[a]) +
                                                    0.5 * stride * weight[a]};
            drape_untangle_bound(u, &back);
        }
    }
}

/* ---- All curves ---- */

/* How a trace can be coloured, the safest first. */
static bool (*const colourings[])(drape_untangler *, const curve *, int, double[2]) = {colour_cut,
                                                                                       colour_near};

static void treat(drape_untangler *u, const curve *k)
{
    double price[2], best = INFINITY;
    int trace = -1;
    int8_t wrong = 0;
    for (size_t c = 0; trace < 0 && c < sizeof colourings / sizeof *colourings; c++) {
        for (int i = 0; i < 2; i++)
            if (colourings[c](u, k, i, price))
                for (int8_t part = 0; part < 2; part++)
                    if (price[part] < best) {
                        best = price[part];
                        trace = i;
                        wrong = part;
                    }
        if (trace < 0)
            continue;
        colourings[c](u, k, trace, price);
        pass_all(u, k, trace, wrong);
    }
    if (trace < 0)
        shorten(u, k);
}

drape_status drape_untangle_contours(drape_untangler *u)
{
    drape_status status = find_crossings(u);
    if (!status)
        status = list_records(u);
    int32_t *order = drape_arena_take(u->arena, (size_t)u->crossing_count + 1, sizeof *order);
    if (status || !order)
        return status ? status : DRAPE_E_MEMORY;
    for (int32_t c = 0, contours = 0; c < u->crossing_count; c++) {
        if (u->crossing[c].contour >= 0)
            continue;
        const curve k = {order, follow(u, c, contours++, order)};
        treat(u, &k);
    }
    drape_arena_release(u->arena, order);
    return u->out_of_memory ? DRAPE_E_MEMORY : DRAPE_OK;
}
