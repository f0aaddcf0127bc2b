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

/* A node of an open edge; by x. */
typedef struct open_node {
    double x;
    int32_t node;
} open_node;

static int compare(const void *left, const void *right)
{
    const open_node *a = left, *b = right;
    if (a->x != b->x)
        return a->x < b->x ? -1 : 1;
    return (a->node > b->node) - (a->node < b->node);
}

/* The largest distance of a node from that nearest to it; INFINITY if a node has none within the limit. */
static double largest_gap(const drape_mesh *mesh, const open_node *list, int32_t count, double limit)
{
    double largest = 0;
    for (int32_t i = 0; i < count && largest < INFINITY; i++) {
        double nearest = INFINITY;
        for (int step = -1; step <= 1; step += 2)
            for (int32_t j = i + step; j >= 0 && j < count && fabs(list[j].x - list[i].x) < limit; j += step)
                if (list[j].node != list[i].node)
                    nearest = fmin(nearest, distance(mesh, list[i].node, list[j].node));
        largest = nearest < limit ? fmax(largest, nearest) : INFINITY;
    }
    return largest;
}

void drape_remedy_open(drape_context *ctx, const drape_mesh *mesh, char text[DRAPE_REMEDY_SIZE])
{
    int32_t edges = 0, count = 0, first = -1;
    double shortest = INFINITY, gap = INFINITY;
    for (int32_t e = 0; e < mesh->edge_count; e++) {
        const bool open = mesh->edge_triangle[2 * (size_t)e + 1] < 0;
        first = open && first < 0 ? e : first;
        edges += open;
        shortest = fmin(shortest, distance(mesh, mesh->edge[2 * (size_t)e], mesh->edge[2 * (size_t)e + 1]));
    }
    open_node *list =
        2 * (int64_t)edges <= MAX_NODES ? drape_alloc(ctx, 2 * (size_t)edges, sizeof *list) : NULL;
    for (int32_t e = 0; list && e < mesh->edge_count; e++)
        for (int end = 0; end < 2 && mesh->edge_triangle[2 * (size_t)e + 1] < 0; end++) {
            const int32_t node = mesh->edge[2 * (size_t)e + (size_t)end];
            list[count++] = (open_node){mesh->x[3 * (size_t)node], node};
        }
    if (list) {
        qsort(list, (size_t)count, sizeof *list, compare);
        gap = largest_gap(mesh, list, count, MUCH_LESS * shortest);
        drape_free(ctx, list);
    }
    if (gap < INFINITY) {
        snprintf(text, DRAPE_REMEDY_SIZE,
                 "; remedy: merge vertices by a distance of %.2g m: the nodes of its %d open edges lie in "
                 "pairs, at "
                 "most %.2g m apart",
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

void drape_remedy_degenerate(const drape_mesh *mesh, const int32_t *triangle, char text[DRAPE_REMEDY_SIZE])
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
        snprintf(text, DRAPE_REMEDY_SIZE, "; remedy: merge nodes %d and %d, which are %.2g m apart",
                 (int)triangle[(least + 1) % 3], (int)triangle[(least + 2) % 3], side[least]);
        return;
    }
    const double *x = mesh->x + 3 * (size_t)triangle[most];
    snprintf(
        text, DRAPE_REMEDY_SIZE,
        "; remedy: move node %d, at (%.4g, %.4g, %.4g) m, off the line between the others, or dissolve it",
        (int)triangle[most], x[0], x[1], x[2]);
}
