/*
 * untangle.c: see untangle.h. The topology of all sheets, and the sweeps.
 */
#include "contact/untangle.h"

#include "colliders/deformed.h"
#include "contact/list.h"
#include "contact/untangle_parts.h"
#include "geometry/mesh_distance.h"

#include <float.h>
#include <string.h>

#define ENOUGH   0.5  /* of the wanted gap: with which a sheet is clear */
#define LESS     0.05 /* of the strain: by which a sweep that is worth it lessens it */
#define POLISH   6    /* sweeps without such a gain that end it, once it is clear */
#define PATIENCE 30   /* the same while gaps are too small */
#define STRETCH  2.0  /* of an edge, at most: else the cloth is torn */
#define SQUEEZE  0.25 /* of an edge, at least: else it has collapsed */
#define SHARE    0.25 /* of a strain like these that is allowed if something still crosses */

/* ---- Topology ---- */

static double between(const double *x, const int32_t *pair)
{
    double d[3];
    vec3_sub(x + 3 * (size_t)pair[0], x + 3 * (size_t)pair[1], d);
    return vec3_norm(d);
}

static double area_of(const drape_untangler *u, int32_t face)
{
    double n[3];
    vec3_triangle_area(u->model->triangle + 3 * (size_t)face, u->x, n);
    return vec3_norm(n) / 2;
}

static drape_status list_sheets(drape_untangler *u)
{
    const drape_model *m = u->model;
    drape_sheets *s = &u->sheets;
    memcpy(s->edge, m->edge, 2 * (size_t)m->edge_count * sizeof *s->edge);
    memcpy(s->triangle, m->triangle, 3 * (size_t)m->triangle_count * sizeof *s->triangle);
    s->edge_count = m->edge_count;
    s->triangle_count = m->triangle_count;
    for (int32_t c = 0; c < m->collider_count; c++)
        if (u->open[c]) {
            const drape_collider_shape *shape = &u->model->colliders[c].shape;
            const int32_t first = u->broad.first_point[c];
            for (int32_t i = 0; i < 2 * shape->segment_count; i++)
                s->edge[2 * (size_t)s->edge_count + (size_t)i] = first + shape->segment[i];
            for (int32_t i = 0; i < 3 * shape->triangle_count; i++)
                s->triangle[3 * (size_t)s->triangle_count + (size_t)i] = first + shape->triangle[i];
            s->edge_count += shape->segment_count;
            s->triangle_count += shape->triangle_count;
        }
    for (int32_t i = 0; i < u->broad.points; i++)
        s->of_point[i] = i < m->node_count ? drape_model_cloth_of(m, i)
                                           : m->cloth_count + u->broad.point_collider[i - m->node_count];
    const drape_status status =
        drape_elements_of_create(u->arena, s->edge_count, 2, s->edge, u->broad.points, &s->edges);
    if (status)
        return status;
    /* The triangles at each edge, and the nodes opposite of it: their distance is how the sheet bends
     * there. */
    memset(s->edge_triangle, -1, 2 * (size_t)s->edge_count * sizeof *s->edge_triangle);
    for (int32_t f = 0; f < s->triangle_count; f++)
        for (int a = 0; a < 3; a++) {
            const int32_t *t = s->triangle + 3 * (size_t)f,
                          e = drape_elements_of_edge(&s->edges, s->edge, t[a], t[(a + 1) % 3]);
            if (e >= 0)
                s->edge_triangle[2 * (size_t)e + (s->edge_triangle[2 * (size_t)e] >= 0)] = f;
        }
    for (int32_t e = 0; e < u->model->edge_count; e++) {
        const int32_t *at = s->edge_triangle + 2 * (size_t)e, *ends = s->edge + 2 * (size_t)e;
        if (at[1] < 0)
            continue;
        for (int k = 0; k < 2; k++) {
            const int32_t *t = s->triangle + 3 * (size_t)at[k];
            int a = 0;
            while (t[a] == ends[0] || t[a] == ends[1])
                a++;
            u->hinge[2 * (size_t)u->hinge_count + (size_t)k] = t[a];
        }
        u->hinge_count++;
    }
    for (int32_t e = 0; e < m->edge_count; e++) {
        u->length[e] = between(u->x, m->edge + 2 * (size_t)e);
        u->mean_edge += u->length[e] / m->edge_count;
    }
    for (int32_t h = 0; h < u->hinge_count; h++)
        u->hinge_length[h] = between(u->x, u->hinge + 2 * (size_t)h);
    for (int32_t f = 0; f < m->triangle_count; f++)
        u->face_area[f] = area_of(u, f);
    return DRAPE_OK;
}

/* Numbers the pieces of cloth that hang together. */
static void list_pieces(drape_untangler *u)
{
    const drape_sheets *s = &u->sheets;
    const int32_t nodes = u->model->node_count;
    for (int32_t i = 0; i < nodes; i++)
        u->piece[i] = -1;
    for (int32_t i = 0; i < nodes; i++) {
        int32_t listed = 0;
        if (u->piece[i] >= 0)
            continue;
        u->piece[i] = u->piece_count++;
        u->queue[listed++] = i;
        for (int32_t next = 0; next < listed; next++)
            for (int32_t a = s->edges.first[u->queue[next]]; a < s->edges.first[u->queue[next] + 1]; a++)
                for (int k = 0; k < 2; k++) {
                    const int32_t other = s->edge[2 * (size_t)s->edges.element[a] + (size_t)k];
                    if (u->piece[other] >= 0)
                        continue;
                    u->piece[other] = u->piece[i];
                    u->queue[listed++] = other;
                }
    }
}

/* A tree for each cloth, and for each open collider. */
static drape_status build_trees(drape_untangler *u)
{
    const drape_model *m = u->model;
    const int32_t sheets = m->cloth_count + m->collider_count;
    int32_t first = m->triangle_count;
    u->tree = drape_arena_take(u->arena, (size_t)sheets, sizeof *u->tree);
    drape_status status = drape_arena_status(u->arena);
    for (int32_t i = 0; !status && i < sheets; i++) {
        const bool cloth = i < m->cloth_count;
        const int32_t c = i - m->cloth_count,
                      count = cloth        ? m->cloths[i].mesh.triangle_count
                              : u->open[c] ? m->colliders[c].shape.triangle_count
                                           : 0,
                      from = cloth ? m->cloths[i].first_triangle : first;
        status =
            drape_bvh_build(u->arena, count, 3, u->sheets.triangle + 3 * (size_t)from, u->x, &u->tree[i]);
        first += cloth ? 0 : count;
    }
    return status;
}

/* ---- Bodies ---- */

static drape_status place_bodies(drape_untangler *u, const drape_motion *motion, double t)
{
    const drape_model *m = u->model;
    for (int32_t c = 0; c < m->collider_count; c++) {
        const drape_collider *k = &m->colliders[c];
        drape_motion_pose(motion, c, t, t, &u->pose[c]);
        const drape_status status = drape_deformed_at(u->arena, m, motion, c, t, &u->body[c]);
        if (status)
            return status;
        u->open[c] =
            k->frames.frame_count > 0 && drape_mesh_distance_side(u->body[c]->shape.kept) == DRAPE_SIDE_NONE;
        for (int a = 0; a < 3; a++) {
            u->box[c][0][a] = k->ops->smooth ? -INFINITY : INFINITY;
            u->box[c][1][a] = k->ops->smooth ? INFINITY : -INFINITY;
        }
        for (int32_t i = 0; i < k->shape.point_count; i++) {
            double *x = u->x + 3 * (size_t)(u->broad.first_point[c] + i);
            drape_collider_point(u->body[c], &u->pose[c], i, x);
            for (int a = 0; a < 3; a++) {
                u->box[c][0][a] = fmin(u->box[c][0][a], x[a] - k->shape.radius);
                u->box[c][1][a] = fmax(u->box[c][1][a], x[a] + k->shape.radius);
            }
        }
    }
    return DRAPE_OK;
}

/* ---- Setting up ---- */

static drape_status set_up(drape_untangler *u, const drape_motion *motion, double t, const double *x)
{
    const drape_model *m = u->model;
    drape_status status = drape_broad_phase_create(u->arena, m, &u->broad);
    if (!status) {
        const size_t points = (size_t)u->broad.points, colliders = (size_t)u->model->collider_count,
                     edges = (size_t)u->model->edge_count;
        u->pose = drape_arena_take(u->arena, colliders, sizeof *u->pose);
        u->body = drape_arena_take(u->arena, colliders, sizeof *u->body);
        u->open = drape_arena_take(u->arena, colliders, sizeof *u->open);
        u->box = drape_arena_take(u->arena, colliders, sizeof *u->box);
        u->x = drape_arena_take(u->arena, points, 3 * sizeof *u->x);
        u->start = drape_arena_take(u->arena, points, 3 * sizeof *u->start);
        u->best = drape_arena_take(u->arena, points, 3 * sizeof *u->best);
        u->mobility = drape_arena_take(u->arena, points, sizeof *u->mobility);
        u->moved = drape_arena_take(u->arena, points, sizeof *u->moved);
        u->passes = drape_arena_take(u->arena, points, sizeof *u->passes);
        u->colour = drape_arena_take(u->arena, points, sizeof *u->colour);
        u->queue = drape_arena_take(u->arena, points, sizeof *u->queue);
        u->sunk = drape_arena_take(u->arena, (size_t)u->model->node_count, sizeof *u->sunk);
        u->depth = drape_arena_take(u->arena, (size_t)u->model->node_count, sizeof *u->depth);
        u->outward = drape_arena_take(u->arena, (size_t)u->model->node_count, 3 * sizeof *u->outward);
        u->piece = drape_arena_take(u->arena, (size_t)u->model->node_count, sizeof *u->piece);
        u->face_area = drape_arena_take(u->arena, (size_t)u->model->triangle_count, sizeof *u->face_area);
        u->length = drape_arena_take(u->arena, edges, sizeof *u->length);
        status = drape_arena_status(u->arena);
    }
    if (status)
        return status;
    memcpy(u->x, x, 3 * (size_t)m->node_count * sizeof *x);
    for (int32_t i = 0; i < m->node_count; i++) {
        u->mobility[i] = m->pinned[i] ? 0 : 1;
        u->area += u->broad.node_area[i];
    }
    for (int32_t i = 0; i < m->support_count; i++) /* they would leave their planes */
        u->mobility[m->supports[i].node] = 0;
    for (int32_t i = 0; m->image_set_count > 0 && i < m->image_start[m->image_set_count]; i++)
        u->mobility[m->image[i]] = 0; /* nor would these keep their period */
    status = place_bodies(u, motion, t);
    if (!status) {
        drape_sheets *s = &u->sheets;
        const size_t points = (size_t)u->broad.points;
        size_t edges = (size_t)m->edge_count, triangles = (size_t)m->triangle_count;
        for (int32_t c = 0; c < m->collider_count; c++)
            if (u->open[c]) {
                edges += (size_t)m->colliders[c].shape.segment_count;
                triangles += (size_t)m->colliders[c].shape.triangle_count;
            }
        s->edge = drape_arena_take(u->arena, edges, 2 * sizeof *s->edge);
        s->triangle = drape_arena_take(u->arena, triangles, 3 * sizeof *s->triangle);
        s->edge_triangle = drape_arena_take(u->arena, edges, 2 * sizeof *s->edge_triangle);
        s->of_point = drape_arena_take(u->arena, points, sizeof *s->of_point);
        u->block = drape_arena_take(u->arena, edges, sizeof *u->block);
        u->hinge = drape_arena_take(u->arena, edges, 2 * sizeof *u->hinge);
        u->hinge_length = drape_arena_take(u->arena, edges, sizeof *u->hinge_length);
        status = drape_arena_status(u->arena);
    }
    if (!status)
        status = list_sheets(u);
    if (status)
        return status;
    list_pieces(u);
    u->exit = drape_arena_take(u->arena, (size_t)u->piece_count, sizeof *u->exit);
    double largest = 0;
    for (size_t i = 0; i < 3 * (size_t)u->broad.points; i++)
        largest = fmax(largest, fabs(u->x[i]));
    u->broad.rounding = DRAPE_CLOSEST_ROUNDING * largest;
    return u->exit ? build_trees(u) : DRAPE_E_MEMORY;
}

void drape_untangle_bound(drape_untangler *u, const drape_half_space *bound)
{
    drape_half_space *list =
        drape_list_grow(u->arena, u->bounds.list, u->bounds.count, &u->bounds.room, sizeof *list);
    u->out_of_memory = u->out_of_memory || !list;
    if (!list)
        return;
    u->bounds.list = list;
    list[u->bounds.count++] = *bound;
}

/* ---- Projection ---- */

/* Positions that keep all bounds, and lengths and bends as well as these allow: each is satisfied in turn by
 * the least move of its nodes (Mueller et al. 2007, Position based dynamics), again and again. Bounds come
 * last, so that they are kept best. */

#define ITERATIONS 30
#define BENDING    0.1 /* share of a change of a bend that is taken back at once */

/* Moves two points apart or together along the line between them, by a share of what their distance lacks. */
static void restore(drape_untangler *u, int32_t a, int32_t b, double length, double share)
{
    const double mobility = u->mobility[a] + u->mobility[b];
    double *p = u->x + 3 * (size_t)a, *q = u->x + 3 * (size_t)b, d[3];
    if (!(mobility > 0) || !(u->moved[a] || u->moved[b]))
        return;
    vec3_sub(q, p, d);
    const double now = vec3_norm(d);
    if (!(now > 0) || now == length)
        return;
    const double move = share * (now - length) / (now * mobility);
    vec3_add_scaled(u->mobility[a] * move, d, p);
    vec3_add_scaled(-u->mobility[b] * move, d, q);
    u->moved[a] = u->moved[a] || u->mobility[a] > 0;
    u->moved[b] = u->moved[b] || u->mobility[b] > 0;
}

static void keep_bound(drape_untangler *u, const drape_half_space *bound)
{
    double lacks = bound->bound, sum = 0;
    for (int a = 0; a < 4 && bound->node[a] >= 0; a++) {
        lacks -= bound->c[a] * vec3_dot(bound->normal, u->x + 3 * (size_t)bound->node[a]);
        sum += u->mobility[bound->node[a]] * bound->c[a] * bound->c[a];
    }
    if (!(lacks > 0) || !(sum > 0))
        return;
    for (int a = 0; a < 4 && bound->node[a] >= 0; a++) {
        const int32_t i = bound->node[a];
        const double move = u->mobility[i] * bound->c[a] * lacks / sum;
        vec3_add_scaled(move, bound->normal, u->x + 3 * (size_t)i);
        u->moved[i] = u->moved[i] || move != 0;
    }
}

/* Moves x to where bounds, lengths and bends are kept as well as possible. */
static void project(drape_untangler *u)
{
    const drape_model *m = u->model;
    for (int i = 0; i < ITERATIONS; i++) {
        for (int32_t e = 0; e < m->edge_count; e++)
            restore(u, m->edge[2 * (size_t)e], m->edge[2 * (size_t)e + 1], u->length[e], 1);
        for (int32_t h = 0; h < u->hinge_count; h++)
            restore(u, u->hinge[2 * (size_t)h], u->hinge[2 * (size_t)h + 1], u->hinge_length[h], BENDING);
        for (int32_t b = 0; b < u->bounds.count; b++)
            keep_bound(u, &u->bounds.list[b]);
    }
    /* No point goes farther than what was searched. */
    const double most = drape_untangle_stride(u);
    for (int32_t i = 0; i < u->model->node_count; i++) {
        double *x = u->x + 3 * (size_t)i, move[3];
        const double *from = u->start + 3 * (size_t)i;
        vec3_sub(x, from, move);
        const double length = vec3_norm(move);
        for (int k = 0; length > most && k < 3; k++)
            x[k] = from[k] + move[k] * (most / length);
    }
}

/* ---- Sweeps ---- */

/* Finds what is wrong with the present positions, and the bounds that mend it. */
static drape_status look(drape_untangler *u)
{
    u->bounds.count = u->passage_count = 0;
    u->min_share = u->min_wanted = INFINITY;
    memset(u->passes, 0, (size_t)u->broad.points * sizeof *u->passes);
    memcpy(u->start, u->x, 3 * (size_t)u->broad.points * sizeof *u->x);
    for (int32_t i = 0; i < u->model->cloth_count + u->model->collider_count; i++)
        if (u->tree[i].count > 0)
            drape_bvh_fit(&u->tree[i], u->x);
    drape_status status = drape_untangle_contours(u);
    if (!status)
        status = drape_untangle_bodies(u);
    drape_untangle_sort_passages(u);
    return status ? status : drape_untangle_gaps(u);
}

/* The largest change of the length of an edge. */
static double strain_of(const drape_untangler *u)
{
    double strain = 0;
    for (int32_t e = 0; e < u->model->edge_count; e++)
        if (u->length[e] > 0)
            strain = fmax(strain, fabs(between(u->x, u->model->edge + 2 * (size_t)e) / u->length[e] - 1));
    return strain;
}

/* Whether it is still the cloth that was given: no edge is torn, and nothing has collapsed, whose
 * triangles have the area of those whose sides all have. */
static bool is_sound(const drape_untangler *u)
{
    const double share = u->crossing_count + u->sunk_count > 0 ? SHARE : 1, most = 1 + share * (STRETCH - 1),
                 least = 1 - share * (1 - SQUEEZE);
    for (int32_t e = 0; e < u->model->edge_count; e++) {
        const double length = between(u->x, u->model->edge + 2 * (size_t)e);
        if (!(length <= most * u->length[e] && length >= least * u->length[e]))
            return false;
    }
    for (int32_t f = 0; f < u->model->triangle_count; f++)
        if (!(area_of(u, f) >= SQUEEZE * SQUEEZE * u->face_area[f]))
            return false;
    return true;
}

/* What was reached in a sweep. Fewer crossings are better; then gaps of a part of the wanted ones, or
 * larger ones; then less strain. */
typedef struct rank {
    bool sound;
    int64_t crossings, sunk;
    double gap, strain;
} rank;

/* Whether a is better than b, and in no count worse than the start. */
static bool is_better(const rank *a, const rank *b, const rank *first)
{
    if (!a->sound || a->sunk > first->sunk || a->crossings - a->sunk > first->crossings - first->sunk)
        return false;
    if (a->crossings != b->crossings)
        return a->crossings < b->crossings;
    return a->gap != b->gap ? a->gap > b->gap : a->strain < b->strain;
}

/* Sweeps until nothing passes through anything, then for gaps, and then as long as there is strain that gets
 * less. */
static drape_status sweep_all(drape_untangler *u, const atomic_bool *cancel, drape_untangle_outcome *outcome)
{
    rank first = {0}, best = {0};
    int since = 0; /* sweeps since the best one */
    for (int i = 0;; i++) {
        if ((cancel && atomic_load(cancel)) || drape_check_cancel(u->ctx))
            return DRAPE_E_STOPPED;
        const drape_status status = look(u);
        if (status)
            return status;
        outcome->sweeps = i;
        const rank here = {is_sound(u), u->crossing_count + u->sunk_count, u->sunk_count,
                           fmin(u->min_wanted, ENOUGH), strain_of(u)};
        if (i == 0)
            first = here;
        const double gain = best.strain - here.strain;
        const bool better = i == 0 || is_better(&here, &best, &first);
        if (i == 0)
            outcome->min_share_before = u->min_share;
        since = better && (i == 0 || here.crossings < best.crossings || here.gap > best.gap ||
                           gain > LESS * best.strain)
                    ? 0
                    : since + 1;
        if (better) {
            best = here;
            outcome->crossings = u->crossing_count;
            outcome->sunk = u->sunk_count;
            outcome->min_share = u->min_share;
            memcpy(u->best, u->x, 3 * (size_t)u->broad.points * sizeof *u->x);
        }
        const bool clear = best.crossings == 0 && best.gap >= ENOUGH;
        if ((i == 0 && drape_untangle_is_clear(outcome)) || i == u->def->sweeps ||
            (clear && since >= POLISH) || (best.crossings == 0 && since >= PATIENCE))
            return DRAPE_OK;
        project(u);
    }
}

drape_status drape_untangle(drape_context *ctx, const drape_motion *motion, double t,
                            const drape_untangle_limits *limits, const atomic_bool *cancel, double *x,
                            drape_untangle_outcome *outcome)
{
    drape_arena arena = drape_arena_of(ctx);
    drape_untangler u = {
        .ctx = ctx, .arena = &arena, .model = motion->model, .def = limits, .sorter.arena = &arena};
    drape_status status = set_up(&u, motion, t, x);
    if (!status)
        status = sweep_all(&u, cancel, outcome);
    if (!status)
        memcpy(x, u.best, 3 * (size_t)u.model->node_count * sizeof *x);
    drape_arena_free(&arena);
    return status;
}
