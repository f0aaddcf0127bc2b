/* partition.c: see partition.h. By recursive coordinate bisection of where the nodes start: a plane across
 * the longest side of their box parts them in proportion to the ranks of either side. Runs on the same number
 * of ranks have the same parts; those of PT-Scotch differed from run to run. */
#include "mpi/partition.h"

#include <math.h>
#include <stdlib.h>

typedef struct place {
    double x; /* along the longest side of the box */
    int32_t node;
} place;

static int compare(const void *a, const void *b)
{
    const place *p = a, *q = b;
    return p->x < q->x ? -1 : p->x > q->x ? 1 : p->node < q->node ? -1 : 1;
}

/* Gives these nodes to `count` ranks from `first` on. */
static void bisect(const drape_model *m, place *places, int64_t n, int first, int ranks, int32_t *owner)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    int axis = 0;
    for (int64_t i = 0; i < n; i++) {
        owner[places[i].node] = first;
        for (int k = 0; k < 3; k++) {
            const double x = m->start[3 * (size_t)places[i].node + (size_t)k];
            low[k] = fmin(low[k], x);
            high[k] = fmax(high[k], x);
        }
    }
    if (ranks == 1)
        return;
    for (int k = 1; k < 3; k++)
        axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
    for (int64_t i = 0; i < n; i++)
        places[i].x = m->start[3 * (size_t)places[i].node + (size_t)axis];
    qsort(places, (size_t)n, sizeof *places, compare);
    const int half = ranks / 2;
    const int64_t cut = n * half / ranks;
    bisect(m, places, cut, first, half, owner);
    bisect(m, places + cut, n - cut, first + half, ranks - half, owner);
}

/* The free nodes, then the pinned ones, so that each rank has some of both. */
drape_status drape_partition(const drape_mpi_ranks *r, const drape_model *m, int32_t *owner)
{
    if (m->free_count < r->base.count)
        return drape_fail(m->ctx, DRAPE_E_ARGUMENT, "there are %d free nodes for %d ranks",
                          (int)m->free_count, r->base.count);
    place *places = drape_alloc(m->ctx, (size_t)m->node_count, sizeof *places);
    if (!places)
        return DRAPE_E_MEMORY;
    for (int pinned = 0; pinned < 2; pinned++) {
        int64_t n = 0;
        for (int32_t i = 0; i < m->node_count; i++)
            if ((m->pinned[i] != 0) == pinned)
                places[n++].node = i;
        bisect(m, places, n, 0, r->base.count, owner);
    }
    drape_free(m->ctx, places);
    return DRAPE_OK;
}
