/* untangler.c: see untangler.h. The topology of all sheets, and the sweeps. */
#include "untangle/workspace.h"

#include "colliders/deformed.h"
#include "geometry/mesh_distance.h"

#include <string.h>

#define ENOUGH   0.5  /* share of the wanted gap: the cloth is clear if every gap is as large */
#define LESS     0.05 /* a sweep is worth its cost if the strain falls by this share */
#define POLISH   6    /* so many sweeps in a row that are not worth it are the last ones of clear cloth, */
#define PATIENCE 30   /* and so many those of cloth whose gaps are too small */
#define STRETCH  2.0  /* largest length of an edge, in the given one: longer ones are torn */
#define SQUEEZE  0.25 /* smallest length of an edge, in the given one: shorter ones have collapsed */
#define SHARE    0.25 /* share of the strain between these two allowed while something still crosses */

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

/* Numbers the connected pieces of cloth. */
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
    for (int32_t i = 0; i < m->support_count; i++) /* supported nodes would leave their planes */
        u->mobility[m->supports[i].node] = 0;
    for (int32_t i = 0; m->image_set_count > 0 && i < m->image_start[m->image_set_count]; i++)
        u->mobility[m->image[i]] = 0; /* and nodes of periodic edges would lose their period */
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

/* ---- Sweeps ---- */

/* Finds what is wrong with the present positions, and the bounds that mend it. */
static drape_status analyse(drape_untangler *u)
{
    u->bound_count = u->passage_count = 0;
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

/* Whether the present positions are still the cloth that was given: no edge is torn, none has collapsed, and
 * no triangle has less area than one all of whose sides are as short as they may be. */
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

/* What was reached in a sweep. Fewer crossings are better; then a larger smallest gap, up to the share that
 * is enough; then less strain. */
typedef struct rank {
    bool sound;
    int64_t crossings, sunk;
    double gap, strain;
} rank;

/* Whether a is better than b, and has no more crossings or sunk nodes than the first positions. */
static bool is_better(const rank *a, const rank *b, const rank *first)
{
    if (!a->sound || a->sunk > first->sunk || a->crossings - a->sunk > first->crossings - first->sunk)
        return false;
    if (a->crossings != b->crossings)
        return a->crossings < b->crossings;
    return a->gap != b->gap ? a->gap > b->gap : a->strain < b->strain;
}

/* Sweeps until nothing passes through anything, then until gaps are large enough, and then as long as the
 * strain falls. */
static drape_status sweep_all(drape_untangler *u, const atomic_bool *cancel, drape_untangle_outcome *outcome)
{
    rank first = {0}, best = {0};
    int since = 0; /* sweeps since the best one */
    for (int i = 0;; i++) {
        if ((cancel && atomic_load(cancel)) || drape_check_cancel(u->ctx))
            return DRAPE_E_STOPPED;
        const drape_status status = analyse(u);
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
        drape_untangle_project(u);
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
