/* remedy.c: see remedy.h. */
#include "mesh/remedy.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/vec3.h"

#define MAX_NODES 4096 /* on open edges whose neighbours are searched for: that takes their square at worst */
#define MUCH_LESS .5   /* ratio of the distance of pairs and the shortest edge below which they are merged */
#define SAFETY    2.0  /* ratio of the distance that is advised and that of pairs */
#define LEAST     1e-3 /* of the shortest edge: distance that is advised if pairs are at the same place */

static double distance(const drape_mesh *mesh, int32_t a, int32_t b)
{
    double ab[3];
    vec3_sub(mesh->x + 3 * (size_t)b, mesh->x + 3 * (size_t)a, ab);
    return vec3_norm(ab);
}

/* An end of an open edge; by x. */
typedef struct open_node {
    double x;
    int32_t node, edge; /* edge: its number among the open ones */
    int32_t same;       /* an earlier node of the list at the same place, or itself */
} open_node;

/* An open edge, by the first of the nodes at the places of its ends. */
typedef struct open_edge {
    int32_t end[2], ends;
} open_edge;

static int compare(const void *left, const void *right)
{
    const open_node *a = left, *b = right;
    if (a->x != b->x)
        return a->x < b->x ? -1 : 1;
    return a->node != b->node ? (a->node > b->node) - (a->node < b->node)
                              : (a->edge > b->edge) - (a->edge < b->edge);
}

static int compare_edges(const void *left, const void *right)
{
    const int32_t *a = ((const open_edge *)left)->end, *b = ((const open_edge *)right)->end;
    return a[0] != b[0] ? (a[0] > b[0]) - (a[0] < b[0]) : (a[1] > b[1]) - (a[1] < b[1]);
}

/* Halves the path: chains stay short. */
static int32_t root_of(open_node *list, int32_t i)
{
    while (list[i].same != i)
        i = list[i].same = list[list[i].same].same;
    return i;
}

/* Joins nodes that are nearer than the limit. Returns the largest distance of a node from its nearest. */
static double join_near(const drape_mesh *mesh, open_node *list, int32_t count, double limit)
{
    double largest = 0;
    for (int32_t i = 0; i < count; i++) {
        double nearest = INFINITY;
        for (int step = -1; step <= 1; step += 2)
            for (int32_t j = i + step; j >= 0 && j < count && fabs(list[j].x - list[i].x) < limit;
                 j += step) {
                const double apart = distance(mesh, list[i].node, list[j].node);
                const int32_t a = root_of(list, i), b = root_of(list, j);
                if (!(apart < limit))
                    continue;
                list[a > b ? a : b].same = a < b ? a : b;
                if (list[j].node != list[i].node)
                    nearest = fmin(nearest, apart);
            }
        largest = nearest < limit ? fmax(largest, nearest) : largest;
    }
    return largest;
}

/* Whether every open edge lies on another one once the nodes are joined, and none has become a point. */
static bool edges_meet(open_node *list, int32_t count, open_edge *edge)
{
    bool meet = count > 0;
    for (int32_t i = 0; i < count; i++) {
        const int32_t root = root_of(list, i);
        edge[list[i].edge].end[edge[list[i].edge].ends++] = root;
    }
    for (int32_t e = 0; e < count / 2; e++) {
        const int32_t a = edge[e].end[0], b = edge[e].end[1];
        edge[e].end[0] = a < b ? a : b;
        edge[e].end[1] = a < b ? b : a;
        meet = meet && a != b;
    }
    qsort(edge, (size_t)count / 2, sizeof *edge, compare_edges);
    for (int32_t e = 0; meet && e < count / 2; e += 2)
        meet = e + 1 < count / 2 && compare_edges(&edge[e], &edge[e + 1]) == 0 &&
               (e + 2 == count / 2 || compare_edges(&edge[e + 1], &edge[e + 2]) != 0);
    return meet;
}

/* The distance within which nodes of open edges must be merged to close the mesh: the largest distance of
 * such a node from its nearest. INFINITY if merging does not close the mesh, or without memory. */
static double gap_of(drape_context *ctx, const drape_mesh *mesh, int32_t edges, double limit)
{
    drape_arena scratch = drape_arena_of(ctx);
    open_node *list = drape_arena_take(&scratch, 2 * (size_t)edges, sizeof *list);
    open_edge *edge = drape_arena_take(&scratch, (size_t)edges, sizeof *edge);
    double gap = INFINITY;
    int32_t count = 0;
    for (int32_t e = 0; list && edge && e < mesh->edge_count; e++)
        for (int end = 0; end < 2 && mesh->edge_triangle[2 * (size_t)e + 1] < 0; end++, count++) {
            const int32_t node = mesh->edge[2 * (size_t)e + (size_t)end];
            list[count] = (open_node){.x = mesh->x[3 * (size_t)node], .node = node, .edge = count / 2};
        }
    if (list && edge) {
        qsort(list, (size_t)count, sizeof *list, compare);
        for (int32_t i = 0; i < count; i++)
            list[i].same = i;
        gap = join_near(mesh, list, count, limit);
        gap = edges_meet(list, count, edge) ? gap : INFINITY;
    }
    drape_arena_free(&scratch);
    return gap;
}

void drape_remedy_open(drape_context *ctx, const drape_mesh *mesh, char text[DRAPE_REMEDY_SIZE])
{
    int32_t edges = 0, first = -1;
    double shortest = INFINITY;
    for (int32_t e = 0; e < mesh->edge_count; e++) {
        const bool open = mesh->edge_triangle[2 * (size_t)e + 1] < 0;
        first = open && first < 0 ? e : first;
        edges += open;
        shortest = fmin(shortest, distance(mesh, mesh->edge[2 * (size_t)e], mesh->edge[2 * (size_t)e + 1]));
    }
    const double gap =
        2 * (int64_t)edges <= MAX_NODES ? gap_of(ctx, mesh, edges, MUCH_LESS * shortest) : INFINITY;
    if (gap < INFINITY) {
        snprintf(text, DRAPE_REMEDY_SIZE,
                 "; remedy: merge vertices by a distance of %.2g m: that closes its %d open edges, whose "
                 "nodes are at most %.2g m apart",
                 fmax(SAFETY * gap, LEAST * shortest), (int)edges, gap);
        return;
    }
    const double *a = mesh->x + 3 * (size_t)mesh->edge[2 * (size_t)first];
    const double *b = mesh->x + 3 * (size_t)mesh->edge[2 * (size_t)first + 1];
    snprintf(text, DRAPE_REMEDY_SIZE,
             "; remedy: fill the holes, which have %d open edges, this one from (%.4g, %.4g, %.4g) to (%.4g, "
             "%.4g, "
             "%.4g) m",
             (int)edges, a[0], a[1], a[2], b[0], b[1], b[2]);
}

void drape_remedy_degenerate(const drape_mesh *mesh, const int32_t *triangle, bool may_merge,
                             char text[DRAPE_REMEDY_SIZE])
{
    double side[3]; /* opposite to each corner */
    int least = 0, most = 0;
    *text = 0;
    if (mesh->rows > 0) /* a grid has no author: its parameters are wrong */
        return;
    for (int k = 0; k < 3; k++) {
        side[k] = distance(mesh, triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
        least = side[k] < side[least] ? k : least;
        most = side[k] > side[most] ? k : most;
    }
    if (!(side[least] > LEAST * side[most])) {
        snprintf(text, DRAPE_REMEDY_SIZE,
                 may_merge ? "; remedy: merge nodes %d and %d, which are %.2g m apart"
                           : "; remedy: move nodes %d and %d, which are %.2g m apart, away from each other",
                 (int)triangle[(least + 1) % 3], (int)triangle[(least + 2) % 3], side[least]);
        return;
    }
    const double *x = mesh->x + 3 * (size_t)triangle[most];
    snprintf(text, DRAPE_REMEDY_SIZE,
             "; remedy: move node %d, at (%.4g, %.4g, %.4g) m, off the line between the others%s",
             (int)triangle[most], x[0], x[1], x[2], may_merge ? ", or dissolve it" : "");
}
