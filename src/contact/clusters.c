/* clusters.c: see clusters.h. */
#include "contact/clusters.h"

#include "geometry/bvh.h"

#include <string.h>

/* While the clusters are made. */
typedef struct builder {
    drape_clusters *of;
    const drape_model *model;
    const drape_bvh *faces;
    int32_t *owner[DRAPE_ELEMENT_KINDS]; /* the cluster of each element; -1 */
    drape_elements_of edges;             /* at each node */
    int32_t *seen;                       /* (node_count) the last cluster that has this point, plus 1 */
} builder;

static int32_t count_of(const drape_model *m, int kind)
{
    return kind == DRAPE_ELEMENT_NODE   ? m->node_count
           : kind == DRAPE_ELEMENT_EDGE ? m->edge_count
                                        : m->triangle_count;
}

/* ---- The tree ---- */

static int32_t cloth_of_face(const drape_model *m, int32_t face)
{
    return drape_model_cloth_of(m, m->triangle[3 * (size_t)face]);
}

/* Copies the branches of a tree of faces down to those whose faces make a cluster. */
static void cut(builder *b, int32_t from)
{
    drape_clusters *s = b->of;
    const drape_bvh_branch *branch = &b->faces->branches[from];
    const int32_t self = s->branch_count++;
    const int32_t *face = b->faces->order + branch->first;
    bool same = branch->count <= DRAPE_CLUSTER_FACES;
    for (int32_t i = 1; same && i < branch->count; i++)
        same = cloth_of_face(b->model, face[i]) == cloth_of_face(b->model, face[0]);
    if (same) {
        for (int32_t i = 0; i < branch->count; i++)
            b->owner[DRAPE_ELEMENT_FACE][b->faces->order[branch->first + i]] = s->count;
        s->branches[self].cluster = s->count;
        s->cluster[s->count++].cloth = cloth_of_face(b->model, b->faces->order[branch->first]);
        return;
    }
    cut(b, from + 1);
    s->branches[self].second = s->branch_count;
    cut(b, branch->second);
}

static void claim(builder *b, drape_element_kind kind, int32_t element, int32_t cluster)
{
    if (b->owner[kind][element] < 0)
        b->owner[kind][element] = cluster;
}

/* ---- Lists ---- */

static drape_status list_elements(drape_arena *arena, builder *b, int kind)
{
    drape_clusters *s = b->of;
    const int32_t count = count_of(b->model, kind), *owner = b->owner[kind];
    int32_t *filled = drape_alloc(arena->ctx, (size_t)s->count, sizeof *filled), groups = 0;
    for (int32_t i = 0; filled && i < count; i++)
        filled[owner[i]]++;
    for (int32_t i = 0; filled && i < s->count; i++) {
        s->cluster[i].first_group[kind] = groups;
        s->cluster[i].groups[kind] = (filled[i] + LANES - 1) / LANES;
        groups += s->cluster[i].groups[kind];
        filled[i] = 0;
    }
    s->groups[kind] = groups;
    s->element[kind] = drape_arena_take(arena, (size_t)groups, LANES * sizeof *s->element[kind]);
    const bool complete = filled && s->element[kind];
    for (int32_t i = 0; complete && i < LANES * groups; i++)
        s->element[kind][i] = -1;
    for (int32_t i = 0; complete && i < count; i++)
        s->element[kind][LANES * s->cluster[owner[i]].first_group[kind] + filled[owner[i]]++] = i;
    drape_free(arena->ctx, filled);
    return complete ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* Lists the points of a cluster, or only counts them where points is NULL. */
static int32_t list_points(builder *b, int32_t which, int32_t *points)
{
    const drape_clusters *s = b->of;
    const drape_cluster *cluster = &s->cluster[which];
    int32_t count = 0;
    for (int kind = 0; kind < DRAPE_ELEMENT_KINDS; kind++)
        for (int32_t i = 0; i < LANES * cluster->groups[kind]; i++) {
            const int32_t *element = &s->element[kind][LANES * cluster->first_group[kind] + i], *node;
            const int nodes =
                *element < 0 ? 0 : drape_element_nodes(b->model, (drape_element_kind)kind, element, &node);
            for (int a = 0; a < nodes; a++) {
                if (b->seen[node[a]] == which + 1)
                    continue;
                b->seen[node[a]] = which + 1;
                if (points)
                    points[count] = node[a];
                count++;
            }
        }
    return count;
}

static drape_status build(drape_arena *arena, drape_arena *temporary, const double *rest, drape_clusters *s)
{
    const drape_model *m = s->model;
    drape_bvh faces;
    builder b = {.of = s, .model = m, .faces = &faces};
    drape_status status = drape_bvh_build(temporary, m->triangle_count, 3, m->triangle, rest, &faces);
    for (int kind = 0; kind < DRAPE_ELEMENT_KINDS; kind++) {
        b.owner[kind] = drape_arena_take(temporary, (size_t)count_of(m, kind), sizeof *b.owner[kind]);
        for (int32_t i = 0; b.owner[kind] && i < count_of(m, kind); i++)
            b.owner[kind][i] = -1;
    }
    drape_elements_of_create(temporary, m->edge_count, 2, m->edge, m->node_count, &b.edges);
    b.seen = drape_arena_take(temporary, (size_t)m->node_count, sizeof *b.seen);
    s->cluster = drape_arena_take(arena, (size_t)m->triangle_count, sizeof *s->cluster);
    s->branches = drape_arena_take(arena, 2 * (size_t)m->triangle_count, sizeof *s->branches);
    s->faces_of_edge = drape_arena_take(arena, (size_t)m->edge_count, sizeof *s->faces_of_edge);
    if (status || drape_arena_status(temporary) || drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    cut(&b, 0);
    s->cluster = drape_arena_resize(arena, s->cluster, (size_t)s->count, sizeof *s->cluster);
    s->branches = drape_arena_resize(arena, s->branches, (size_t)s->branch_count, sizeof *s->branches);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    /* A node or an edge belongs to the first cluster that has one of its faces, or to the last cluster if it
     * has no face. */
    for (int32_t i = 0; i < m->triangle_count; i++) {
        const int32_t face = faces.order[i], *n = m->triangle + 3 * (size_t)face,
                      cluster = b.owner[DRAPE_ELEMENT_FACE][face];
        for (int a = 0; a < 3; a++) {
            const int32_t edge = drape_elements_of_edge(&b.edges, m->edge, n[a], n[(a + 1) % 3]);
            claim(&b, DRAPE_ELEMENT_NODE, n[a], cluster);
            if (edge < 0)
                continue;
            s->faces_of_edge[edge]++;
            claim(&b, DRAPE_ELEMENT_EDGE, edge, cluster);
        }
    }
    for (int kind = DRAPE_ELEMENT_NODE; kind <= DRAPE_ELEMENT_EDGE; kind++)
        for (int32_t i = 0; i < count_of(m, kind); i++)
            claim(&b, (drape_element_kind)kind, i, s->count - 1);
    for (int kind = 0; !status && kind < DRAPE_ELEMENT_KINDS; kind++)
        status = list_elements(arena, &b, kind);
    if (status)
        return status;
    int32_t count = 0;
    for (int32_t i = 0; i < s->count; i++) {
        s->cluster[i].first_point = count;
        s->cluster[i].points = list_points(&b, i, NULL);
        count += s->cluster[i].points;
    }
    s->point = drape_arena_take(arena, (size_t)count, sizeof *s->point);
    memset(b.seen, 0, (size_t)m->node_count * sizeof *b.seen);
    for (int32_t i = 0; s->point && i < s->count; i++)
        list_points(&b, i, s->point + s->cluster[i].first_point);
    return s->point ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_clusters_create(drape_arena *arena, const drape_model *model, const double *rest,
                                   drape_clusters *out)
{
    drape_arena temporary = drape_arena_of(arena->ctx);
    *out = (drape_clusters){.model = model};
    const drape_status status = model->triangle_count > 0 ? build(arena, &temporary, rest, out) : DRAPE_OK;
    drape_arena_free(&temporary);
    return status;
}

/* ---- Elements of points ---- */

drape_status drape_elements_of_create(drape_arena *arena, int32_t count, int size, const int32_t *point,
                                      int32_t points, drape_elements_of *out)
{
    const size_t entries = (size_t)count * (size_t)size;
    out->first = drape_arena_take(arena, (size_t)points + 2, sizeof *out->first);
    out->element = drape_arena_take(arena, entries, sizeof *out->element);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < entries; i++)
        out->first[point[i] + 2]++;
    for (int32_t i = 0; i < points; i++)
        out->first[i + 2] += out->first[i + 1];
    for (size_t i = 0; i < entries; i++)
        out->element[out->first[point[i] + 1]++] = (int32_t)(i / (size_t)size);
    return DRAPE_OK;
}

int32_t drape_elements_of_edge(const drape_elements_of *edges, const int32_t *edge, int32_t a, int32_t b)
{
    for (int32_t k = edges->first[a]; k < edges->first[a + 1]; k++) {
        const int32_t *ends = edge + 2 * (size_t)edges->element[k];
        if (ends[0] == b || ends[1] == b)
            return edges->element[k];
    }
    return -1;
}
