/* build_periodic.c: which nodes of a cloth are images of each other, where they start, and that the rest of
 * the scene leaves them so. See model/periodic.h. */
#include "model/periodic.h"

#include "base/search.h"
#include "base/vec3.h"
#include "compile/select.h"
#include "compile/stages.h"
#include "model/support.h"
#include "model/track.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SLIP   1e-6  /* of the size of the scene: how far a node may be from where the period puts it */
#define WITHIN 0.377 /* of the time between two keys of a turn: no simple part of a whole turn */

/* One edge of a pair. */
typedef struct side {
    int32_t *node; /* (count) local to the cloth; memory for all its nodes */
    int32_t count;
    uint8_t *taken; /* (nodes of the cloth) */
    double mean[3]; /* [m] at rest */
} side;

/* One item of "periodic". */
typedef struct pairing {
    drape_model *model;
    const drape_cloth *cloth;
    const drape_periodic_def *def;
    char pointer[96];
    side from, to;
    int32_t *partner; /* (from.count) of the node with the same number, local to the cloth */
} pairing;

static double distance(const double *a, const double *b)
{
    double d[3];
    vec3_sub(a, b, d);
    return vec3_norm(d);
}

/* ---- Pairs ---- */

static drape_status take_node(void *user, const char *key, int32_t local)
{
    side *s = user;
    (void)key;
    if (!s->taken[local])
        s->node[s->count++] = local;
    s->taken[local] = 1;
    return DRAPE_OK;
}

static drape_status list_side(const pairing *p, const char *key, const drape_selection_def *def, side *s)
{
    drape_arena *scratch = &p->model->scratch;
    const drape_mesh *mesh = &p->cloth->mesh;
    const char *pointer = DRAPE_FORMAT("%s/%s", p->pointer, key);
    s->node = drape_arena_take(scratch, (size_t)mesh->node_count, sizeof *s->node);
    s->taken = drape_arena_take(scratch, (size_t)mesh->node_count, sizeof *s->taken);
    const drape_selection selection = {.ctx = p->model->ctx,
                                       .pointer = pointer,
                                       .form = &drape_form_selection,
                                       .mesh = mesh,
                                       DRAPE_SELECTED_BY(def),
                                       .taken = s->taken,
                                       .take = take_node,
                                       .user = s};
    DRAPE_TRY(drape_arena_status(scratch));
    DRAPE_TRY(drape_select_nodes(&selection));
    for (int32_t i = 0; i < s->count; i++)
        vec3_add_scaled(1.0 / s->count, mesh->x + 3 * (size_t)s->node[i], s->mean);
    return DRAPE_OK;
}

static drape_status refuse_pair(const pairing *p, int32_t node, const double *at)
{
    const double *x = p->cloth->mesh.x;
    int32_t nearest = p->to.node[0];
    for (int32_t i = 0; i < p->to.count; i++)
        if (distance(x + 3 * (size_t)p->to.node[i], at) < distance(x + 3 * (size_t)nearest, at))
            nearest = p->to.node[i];
    return drape_refuse(
        p->model->ctx, p->pointer,
        "node %d displaced at rest as its edge is has no node of the other edge at (%g %g %g) "
        "m; the nearest, node %d, is %g m away",
        (int)node, at[0], at[1], at[2], (int)nearest, distance(x + 3 * (size_t)nearest, at));
}

/* Finds the partner of each node of `from`: the node of `to` at its place plus the displacement at rest.
 * Nodes of `to` are sorted by one coordinate, so that only near ones are compared. */
static drape_status match(pairing *p)
{
    drape_arena *scratch = &p->model->scratch;
    const double *x = p->cloth->mesh.x, slip = SLIP * p->model->length;
    const size_t count = (size_t)p->to.count;
    double extent[3] = {0};
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++)
            extent[k] = fmax(extent[k], fabs(x[3 * (size_t)p->to.node[i] + k] - p->to.mean[k]));
    const size_t flat = extent[1] > extent[0], axis = extent[2] > extent[flat] ? 2 : flat;
    drape_node_along *list = drape_arena_take(scratch, count, sizeof *list);
    p->partner = drape_arena_take(scratch, count, sizeof *p->partner);
    DRAPE_TRY(drape_arena_status(scratch));
    for (size_t i = 0; i < count; i++)
        list[i] = (drape_node_along){x[3 * (size_t)p->to.node[i] + axis], p->to.node[i]};
    qsort(list, count, sizeof *list, drape_compare_along);
    for (size_t i = 0; i < count; i++) {
        double at[3];
        size_t low = 0, high = count;
        for (size_t k = 0; k < 3; k++)
            at[k] = x[3 * (size_t)p->from.node[i] + k] + p->to.mean[k] - p->from.mean[k];
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (list[middle].along < at[axis] - slip)
                low = middle + 1;
            else
                high = middle;
        }
        while (low < count && list[low].along <= at[axis] + slip &&
               !(p->to.taken[list[low].node] && distance(x + 3 * (size_t)list[low].node, at) <= slip))
            low++;
        if (low == count || list[low].along > at[axis] + slip)
            return refuse_pair(p, p->from.node[i], at);
        p->partner[i] = list[low].node;
        p->to.taken[list[low].node] = 0; /* each is the partner of one */
        DRAPE_TRY(drape_check_cancel_after(p->model->ctx, count));
    }
    return DRAPE_OK;
}

/* Nodes inside the mesh are not on an edge that another one continues. */
static drape_status check_boundary(const pairing *p)
{
    const drape_mesh *mesh = &p->cloth->mesh;
    const side *const sides[2] = {&p->from, &p->to};
    uint8_t *outer = drape_arena_take(&p->model->scratch, (size_t)mesh->node_count, sizeof *outer);
    if (!outer)
        return DRAPE_E_MEMORY;
    for (size_t e = 0; e < (size_t)mesh->edge_count; e++)
        for (size_t k = 0; mesh->edge_triangle[2 * e + 1] < 0 && k < 2; k++)
            outer[mesh->edge[2 * e + k]] = 1;
    for (int s = 0; s < 2; s++)
        for (int32_t i = 0; i < sides[s]->count; i++)
            if (!outer[sides[s]->node[i]])
                return drape_refuse(p->model->ctx, p->pointer,
                                    "node %d is inside the mesh: periodic edges are of its boundary",
                                    (int)sides[s]->node[i]);
    return DRAPE_OK;
}

static drape_status find_pairs(pairing *p)
{
    DRAPE_TRY(list_side(p, "from", &p->def->from, &p->from));
    DRAPE_TRY(list_side(p, "to", &p->def->to, &p->to));
    for (int32_t i = 0; i < p->from.count; i++)
        if (p->to.taken[p->from.node[i]])
            return drape_refuse(p->model->ctx, p->pointer, "node %d is in both edges", (int)p->from.node[i]);
    if (p->from.count != p->to.count)
        return drape_refuse(p->model->ctx, p->pointer,
                            "one edge has %d nodes and the other %d: they are paired one by one",
                            (int)p->from.count, (int)p->to.count);
    DRAPE_TRY(check_boundary(p));
    return match(p);
}

/* ---- The start ---- */

/* How far x of the nodes of pair i are apart, less the displacement by. */
static double off(const pairing *p, int32_t i, const double *x, const double by[3])
{
    double at[3];
    memcpy(at, x + 3 * (size_t)p->from.node[i], sizeof at);
    vec3_add_scaled(1, by, at);
    return distance(at, x + 3 * (size_t)p->partner[i]);
}

/* Stretches the cloth by what the period is longer than the displacement at the start: in proportion to how
 * far along the displacement at rest a node is. */
static drape_status stretch(const pairing *p, const double now[3], double *x)
{
    const drape_mesh *mesh = &p->cloth->mesh;
    double along[3], more[3];
    vec3_sub(p->to.mean, p->from.mean, along);
    vec3_sub(p->def->period, now, more);
    const double square = vec3_dot(along, along);
    if (!(vec3_norm(more) > SLIP * p->model->length))
        return DRAPE_OK;
    if (!(sqrt(square) > SLIP * p->model->length))
        return drape_refuse(p->model->ctx, p->pointer,
                            "the edges coincide at rest, so the period is 0 0 0 or that of a \"start\"");
    if (!(vec3_norm(p->def->period) > SLIP * p->model->length))
        return drape_refuse(
            p->model->ctx, p->pointer,
            "the period 0 0 0 would leave the cloth no width; the edges of a closed tube meet "
            "in its \"start\"");
    for (int32_t i = 0; i < mesh->node_count; i++) {
        double arm[3];
        vec3_sub(mesh->x + 3 * (size_t)i, p->from.mean, arm);
        vec3_add_scaled(vec3_dot(arm, along) / square, more, x + 3 * (size_t)i);
    }
    return DRAPE_OK;
}

static drape_status place(pairing *p, bool may_move)
{
    drape_model *model = p->model;
    const size_t first = 3 * (size_t)p->cloth->first_node;
    double now[3] = {0};
    const double *x = model->start + first;
    for (int32_t i = 0; i < p->from.count; i++) {
        vec3_add_scaled(1.0 / p->from.count, x + 3 * (size_t)p->partner[i], now);
        vec3_add_scaled(-1.0 / p->from.count, x + 3 * (size_t)p->from.node[i], now);
    }
    const bool given = !isnan(p->def->period[0]);
    const double *by = given && !may_move ? p->def->period : now;
    for (int32_t i = 0; i < p->from.count; i++)
        if (!(off(p, i, x, by) <= SLIP * model->length))
            return drape_refuse(
                model->ctx, p->pointer,
                "at the start node %d is %g m from where the period (%g %g %g) m puts node %d",
                (int)p->partner[i], off(p, i, x, by), by[0], by[1], by[2], (int)p->from.node[i]);
    if (!given || !may_move)
        return DRAPE_OK;
    if (model->start == model->rest) {
        const size_t count = 3 * (size_t)model->node_count;
        double *start = drape_arena_take(&model->arena, count, sizeof *start);
        if (!start)
            return DRAPE_E_MEMORY;
        model->start = memcpy(start, model->rest, count * sizeof *start);
    }
    DRAPE_TRY(stretch(p, now, model->start + first));
    for (int32_t i = 0; i < p->from.count; i++)
        for (size_t k = 0; k < 3; k++)
            model->start[first + 3 * (size_t)p->partner[i] + k] =
                model->start[first + 3 * (size_t)p->from.node[i] + k] + p->def->period[k];
    return DRAPE_OK;
}

/* ---- Sets of images ---- */

/* parent (node_count): a tree of each set, whose root is its first node. */
static drape_status list_sets(drape_model *m, int32_t *parent)
{
    int32_t members = 0;
    m->image_set = drape_arena_take(&m->arena, (size_t)m->node_count, sizeof *m->image_set);
    if (!m->image_set)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < m->node_count; i++)
        m->image_set[i] = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        int32_t *set = &m->image_set[drape_set_of(parent, i)];
        if (parent[i] == i)
            continue;
        members += 1 + (*set < 0);
        *set = *set < 0 ? m->image_set_count++ : *set;
        m->image_set[i] = *set;
    }
    m->image_start = drape_arena_take(&m->arena, (size_t)m->image_set_count + 1, sizeof *m->image_start);
    m->image = drape_arena_take(&m->arena, (size_t)members, sizeof *m->image);
    DRAPE_TRY(drape_arena_status(&m->arena));
    for (int32_t i = 0; i < m->node_count; i++)
        if (m->image_set[i] >= 0)
            m->image_start[m->image_set[i] + 1]++;
    for (int32_t s = 0; s < m->image_set_count; s++)
        m->image_start[s + 1] += m->image_start[s];
    for (int32_t i = m->node_count; i-- > 0;) /* afterwards image_start[s + 1] is where s starts */
        if (m->image_set[i] >= 0)
            m->image[--m->image_start[m->image_set[i] + 1]] = i;
    for (int32_t s = 0; s < m->image_set_count; s++)
        m->image_start[s] = m->image_start[s + 1];
    m->image_start[m->image_set_count] = members;
    return DRAPE_OK;
}

/* Finds the image of each edge of the boundary: the edge between the partners of its nodes. */
static drape_status pair_mesh_edges(const pairing *p, int32_t *image)
{
    const drape_mesh *mesh = &p->cloth->mesh;
    int32_t *partner = drape_arena_take(&p->model->scratch, (size_t)mesh->node_count, sizeof *partner);
    if (!partner)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < mesh->node_count; i++)
        partner[i] = -1;
    for (int32_t i = 0; i < p->from.count; i++)
        partner[p->from.node[i]] = p->partner[i];
    for (int32_t e = 0; e < mesh->edge_count; e++) {
        const int32_t a = partner[mesh->edge[2 * (size_t)e]], b = partner[mesh->edge[2 * (size_t)e + 1]];
        const int32_t other = a < 0 || b < 0 ? -1 : drape_edge_between(mesh->edge, mesh->edge_count, a, b);
        if (other < 0 || mesh->edge_triangle[2 * (size_t)e + 1] >= 0 ||
            mesh->edge_triangle[2 * (size_t)other + 1] >= 0)
            continue;
        image[e] = other;
        image[other] = e;
    }
    return DRAPE_OK;
}

/* parent NULL: only checks that edges which were paired later have left the period as it was. */
static drape_status pair_edges(drape_model *model, size_t c, size_t i, const drape_periodic_def *def,
                               int32_t *parent)
{
    const int32_t first = model->cloths[c].first_node;
    pairing p = {.model = model, .cloth = &model->cloths[c], .def = def};
    snprintf(p.pointer, sizeof p.pointer, "/cloth/%zu/periodic/%zu", c, i);
    DRAPE_TRY(find_pairs(&p));
    DRAPE_TRY(place(&p, parent != NULL));
    if (!parent)
        return DRAPE_OK;
    for (int32_t k = 0; k < p.from.count; k++)
        drape_set_join(parent, first + p.from.node[k], first + p.partner[k]);
    return pair_mesh_edges(&p, model->cloths[c].edge_image);
}

drape_status drape_compile_periodic(drape_model *model, const drape_scene_def *def)
{
    size_t count = 0;
    for (size_t c = 0; c < def->cloth_count; c++)
        count += def->cloths[c].periodic_count;
    if (count == 0)
        return DRAPE_OK;
    int32_t *parent = drape_arena_take(&model->scratch, (size_t)model->node_count, sizeof *parent);
    if (!parent)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < model->node_count; i++)
        parent[i] = i;
    for (size_t c = 0; c < def->cloth_count; c++) {
        drape_cloth *cloth = &model->cloths[c];
        const size_t edges = (size_t)cloth->mesh.edge_count;
        if (def->cloths[c].periodic_count == 0)
            continue;
        cloth->edge_image = drape_arena_take(&model->arena, edges, sizeof *cloth->edge_image);
        if (!cloth->edge_image)
            return DRAPE_E_MEMORY;
        for (size_t e = 0; e < edges; e++)
            cloth->edge_image[e] = -1;
    }
    for (int pass = 0; pass < 2; pass++)
        for (size_t c = 0; c < def->cloth_count; c++)
            for (size_t i = 0; i < def->cloths[c].periodic_count; i++)
                DRAPE_TRY(pair_edges(model, c, i, &def->cloths[c].periodic[i], pass == 0 ? parent : NULL));
    DRAPE_TRY(list_sets(model, parent));
    drape_periodic_share(model, model->mass);
    for (int32_t c = 0; c < model->cloth_count; c++)
        model->cloths[c].node_mass = model->mass + model->cloths[c].first_node;
    return DRAPE_OK;
}

/* ---- What leaves images alike ---- */

static drape_status refuse_nodes(const drape_model *m, int32_t a, int32_t b, const char *what)
{
    const int32_t c = drape_model_cloth_of(m, a), first = m->cloths[c].first_node;
    const char *pointer = DRAPE_FORMAT("/cloth/%d/periodic", (int)c);
    return drape_refuse(m->ctx, pointer, "nodes %d and %d of periodic edges are the same node, but %s",
                        (int)(a - first), (int)(b - first), what);
}

drape_status drape_compile_pinned_images(const drape_model *m)
{
    for (int32_t s = 0; s < m->image_set_count; s++)
        for (int32_t k = m->image_start[s] + 1; k < m->image_start[s + 1]; k++) {
            const int32_t a = m->image[m->image_start[s]], b = m->image[k];
            if (m->pinned[a] != m->pinned[b])
                return refuse_nodes(m, a, b, "only one of them is pinned");
        }
    return DRAPE_OK;
}

static bool holds_alike(const drape_support *a, const drape_support *b)
{
    return !a || !b ? a == b
                    : a->count == b->count && memcmp(a->direction, b->direction, sizeof a->direction) == 0 &&
                          memcmp(a->normal, b->normal, sizeof a->normal) == 0 &&
                          memcmp(a->track, b->track, (size_t)a->count * sizeof *a->track) == 0;
}

static drape_status check_supports(const drape_model *m)
{
    for (int32_t s = 0; s < m->image_set_count; s++)
        for (int32_t k = m->image_start[s] + 1; k < m->image_start[s + 1]; k++) {
            const int32_t a = m->image[m->image_start[s]], b = m->image[k];
            if (!holds_alike(drape_support_of(m, a), drape_support_of(m, b)))
                return refuse_nodes(m, a, b, "pins hold them along different directions or tracks");
        }
    return DRAPE_OK;
}

/* Where a node with this track, or -1, is at time t. */
static void place_at(const drape_model *m, int32_t track, int32_t node, double t, double x[3])
{
    memcpy(x, m->start + 3 * (size_t)node, 3 * sizeof *x);
    if (track >= 0)
        drape_track_point(&m->tracks[track], m->start + 3 * (size_t)node, t, x);
}

static bool keep_period(const drape_model *m, const int32_t *track_of, int32_t a, int32_t b, double t)
{
    double of_a[3], of_b[3], more[3];
    place_at(m, track_of[a], a, t, of_a);
    place_at(m, track_of[b], b, t, of_b);
    for (size_t k = 0; k < 3; k++)
        more[k] = of_b[k] - of_a[k] - (m->start[3 * (size_t)b + k] - m->start[3 * (size_t)a + k]);
    return vec3_norm(more) <= SLIP * m->length;
}

/* Whether pins move both nodes alike: at the keys and, of a turn, also between two of them. */
static bool move_alike(const drape_model *m, const int32_t *track_of, int32_t a, int32_t b)
{
    const int32_t of_a = m->ride ? m->ride[a].collider : -1, of_b = m->ride ? m->ride[b].collider : -1;
    bool alike =
        of_a == of_b &&
        (of_a < 0 || (m->colliders[of_a].turns.key_count == 0 && m->colliders[of_a].frames.frame_count == 0));
    for (int end = 0; alike && end < 2; end++) {
        const int32_t number = track_of[end ? b : a];
        const drape_track *track = number >= 0 ? &m->tracks[number] : NULL;
        for (size_t k = 0; alike && track && k < track->key_count; k++)
            alike = keep_period(m, track_of, a, b, track->keys[k].time);
        for (size_t k = 0; alike && track && k < track->turns.key_count; k++) {
            const drape_turn *key = &track->turns.keys[k];
            const double next = k + 1 < track->turns.key_count ? key[1].time : key->time;
            alike = keep_period(m, track_of, a, b, key->time) &&
                    keep_period(m, track_of, a, b, key->time + WITHIN * (next - key->time));
        }
    }
    return alike;
}

static drape_status check_motions(drape_model *m)
{
    int32_t *track_of = drape_arena_take(&m->scratch, (size_t)m->node_count, sizeof *track_of);
    if (!track_of)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < m->node_count; i++)
        track_of[i] = -1;
    for (int32_t i = 0; i < m->moved_count; i++)
        track_of[m->moved_node[i]] = m->moved_track[i];
    for (int32_t s = 0; s < m->image_set_count; s++)
        for (int32_t k = m->image_start[s] + 1; k < m->image_start[s + 1]; k++) {
            const int32_t a = m->image[m->image_start[s]], b = m->image[k];
            if (m->pinned[a] && !move_alike(m, track_of, a, b))
                return refuse_nodes(m, a, b, "pins move them differently");
        }
    return DRAPE_OK;
}

static drape_status check_clamps(const drape_model *m)
{
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        for (int32_t e = 0; cloth->edge_image && e < cloth->mesh.edge_count; e++) {
            const int32_t image = cloth->edge_image[e];
            if (image > e && (cloth->edge_clamped[e] != cloth->edge_clamped[image] ||
                              (cloth->edge_turn && cloth->edge_turn[e] != cloth->edge_turn[image])))
                return refuse_nodes(m, cloth->first_node + cloth->mesh.edge[2 * (size_t)e],
                                    cloth->first_node + cloth->mesh.edge[2 * (size_t)image],
                                    "pins clamp the edges there differently");
        }
    }
    return DRAPE_OK;
}

/* Whether elements reach over edges of the mesh, as those of bending do: there would have to be one over the
 * periodic edge, too, and there is none. Within a triangle or, between two nodes, a cell of a grid they do
 * not. */
static bool reaches_over_edges(const drape_model *m, const drape_term *term)
{
    const drape_elements *el = &term->elements;
    const drape_mesh *mesh = &m->cloths[term->cloth].mesh;
    for (int32_t e = 0; e < el->count; e++)
        for (int a = 0; a < el->nodes; a++)
            for (int b = 0; b < a; b++) {
                const int32_t *node = el->node + (size_t)e * (size_t)el->nodes,
                              first = m->cloths[term->cloth].first_node, i = node[a] - first,
                              j = node[b] - first;
                if (i != j && drape_edge_between(mesh->edge, mesh->edge_count, i, j) < 0 &&
                    !(el->nodes == 2 && (mesh->rows > 0 && abs(i / mesh->columns - j / mesh->columns) <= 1 &&
                                         abs(i % mesh->columns - j % mesh->columns) <= 1)))
                    return true;
            }
    return false;
}

static int compare_keys(const void *a, const void *b)
{
    const int64_t p = *(const int64_t *)a, q = *(const int64_t *)b;
    return (p > q) - (p < q);
}

/* Whether elements of two nodes lie along both edges of a pair. The two edges are one, so such elements would
 * count twice; elements of triangles, which are beside one edge each, do not. A cloth of one or two cells
 * between its periodic edges may be refused for elements across it, which join images of the same nodes. */
static drape_status find_twins(drape_model *m, const drape_term *term, bool *found)
{
    const drape_elements *el = &term->elements;
    int32_t count = 0;
    *found = false;
    if (el->nodes != 2 || el->count == 0 || term->ops->constraint)
        return DRAPE_OK;
    int64_t *key = drape_arena_take(&m->scratch, (size_t)el->count, sizeof *key); /* the sets of both nodes */
    if (!key)
        return DRAPE_E_MEMORY;
    for (int32_t e = 0; e < el->count; e++) {
        const int64_t a = m->image_set[el->node[2 * (size_t)e]],
                      b = m->image_set[el->node[2 * (size_t)e + 1]];
        if (a >= 0 && b >= 0)
            key[count++] = (a < b ? a : b) * m->image_set_count + (a < b ? b : a);
    }
    qsort(key, (size_t)count, sizeof *key, compare_keys);
    for (int32_t i = 1; i < count; i++)
        *found = *found || key[i] == key[i - 1];
    return DRAPE_OK;
}

/* who: what the cloth of periodic edges has beside them. */
static drape_status refuse_cloth(const drape_model *m, int32_t cloth, const char *who, const char *why)
{
    const char *pointer = DRAPE_FORMAT("/cloth/%d/periodic", (int)cloth);
    return drape_refuse(m->ctx, pointer, "%s %s", who, why);
}

static bool is_periodic(const drape_model *m, const drape_cloth *cloth)
{
    for (int32_t i = 0; i < cloth->mesh.node_count; i++)
        if (m->image_set[cloth->first_node + i] >= 0)
            return true;
    return false;
}

static drape_status check_terms(drape_model *m)
{
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_term *term = &m->terms[i];
        bool twins;
        if (term->seam >= 0 || term->ops->law || term->ops->external || term->ops->periodic ||
            !is_periodic(m, &m->cloths[term->cloth]))
            continue;
        DRAPE_TRY(find_twins(m, term, &twins));
        if (twins)
            return refuse_cloth(m, term->cloth, term->ops->entry.name,
                                "has elements along both edges, which are one edge: they would count twice");
        if (reaches_over_edges(m, term))
            return refuse_cloth(
                m, term->cloth, term->ops->entry.name,
                "couples nodes across edges of triangles, but would not across the periodic edge");
    }
    return DRAPE_OK;
}

/* ---- Couplings ---- */

/* Lists or, if list is NULL, counts the pairs of images of a pair of nodes. */
static int64_t list_images(const drape_model *m, int32_t a, int32_t b, int32_t *list)
{
    const int32_t sets[2] = {m->image_set[a], m->image_set[b]}, own[2] = {a, b};
    const int32_t *node[2];
    int32_t count[2];
    int64_t listed = 0;
    for (int k = 0; k < 2; k++) {
        node[k] = sets[k] >= 0 ? m->image + m->image_start[sets[k]] : &own[k];
        count[k] = sets[k] >= 0 ? m->image_start[sets[k] + 1] - m->image_start[sets[k]] : 1;
    }
    if (sets[0] < 0 && sets[1] < 0)
        return 0;
    for (int32_t i = 0; i < count[0]; i++)
        for (int32_t j = 0; j < count[1]; j++, listed++)
            if (list) {
                list[2 * listed] = node[0][i];
                list[2 * listed + 1] = node[1][j];
            }
    return listed;
}

static int64_t visit_couplings(const drape_model *m, const drape_coupling *couplings, int count,
                               int32_t *list)
{
    int64_t listed = 0;
    for (int32_t s = 0; s < m->image_set_count; s++) {
        const int32_t node = m->image[m->image_start[s]];
        listed += list_images(m, node, node, list ? list + 2 * listed : NULL);
    }
    for (int c = 0; c < count; c++)
        for (int32_t e = 0; e < couplings[c].count; e++) {
            const int32_t *node = couplings[c].node + (size_t)e * (size_t)couplings[c].nodes;
            for (int a = 0; a < couplings[c].nodes; a++)
                for (int b = 0; b < a; b++)
                    listed += list_images(m, node[a], node[b], list ? list + 2 * listed : NULL);
        }
    return listed;
}

static drape_status couple_images(drape_model *m)
{
    drape_coupling *couplings = drape_arena_take(&m->scratch, (size_t)m->term_count + 2, sizeof *couplings);
    if (!couplings)
        return DRAPE_E_MEMORY;
    const int count = drape_model_couplings(m, NULL, couplings);
    const int64_t pairs = visit_couplings(m, couplings, count, NULL);
    if (pairs > INT32_MAX)
        return drape_refuse(m->ctx, "/cloth", "periodic edges have too many nodes");
    m->image_coupled = drape_arena_take(&m->arena, 2 * (size_t)pairs, sizeof *m->image_coupled);
    if (!m->image_coupled)
        return DRAPE_E_MEMORY;
    m->image_coupled_count = (int32_t)visit_couplings(m, couplings, count, m->image_coupled);
    return DRAPE_OK;
}

drape_status drape_compile_images(drape_model *m, const drape_scene_def *def)
{
    (void)def;
    if (m->image_set_count == 0)
        return DRAPE_OK;
    DRAPE_TRY(drape_compile_pinned_images(m));
    DRAPE_TRY(check_supports(m));
    DRAPE_TRY(check_motions(m));
    DRAPE_TRY(check_clamps(m));
    for (int32_t c = 0; m->contact.self && c < m->cloth_count; c++)
        if (is_periodic(m, &m->cloths[c]))
            return refuse_cloth(m, c, "cloth with periodic edges",
                                "has no self_contact: it would not touch its images");
    DRAPE_TRY(check_terms(m));
    return couple_images(m);
}
