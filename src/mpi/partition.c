/* partition.c: see partition.h. By the graph partitioner of PETSc (PT-Scotch or ParMETIS), to which each rank
 * gives the edges of a range of nodes; where it fails, by recursive bisection at rest. */
#include "mpi/partition.h"

#include <petscmat.h>
#include <stdlib.h>
#include <string.h>

/* ---- By the graph ---- */

typedef struct graph {
    PetscInt first, last; /* the nodes of this rank's range */
    PetscInt *start, *to; /* of PETSc */
} graph;

/* Pairs of nodes that share an edge or a seam, each in both directions. */
static void visit(const drape_model *m, void (*see)(graph *, int32_t, int32_t), graph *g)
{
    for (int32_t e = 0; e < m->edge_count; e++)
        see(g, m->edge[2 * (size_t)e], m->edge[2 * (size_t)e + 1]);
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t k = 0; m->terms[i].seam >= 0 && el->nodes == 2 && k < el->count; k++)
            see(g, el->node[2 * (size_t)k], el->node[2 * (size_t)k + 1]);
    }
}

static void count(graph *g, int32_t a, int32_t b)
{
    if (a >= g->first && a < g->last)
        g->start[a - g->first + 1]++;
    if (b >= g->first && b < g->last)
        g->start[b - g->first + 1]++;
}

static void add(graph *g, int32_t a, int32_t b)
{
    if (a >= g->first && a < g->last)
        g->to[g->start[a - g->first]++] = b;
    if (b >= g->first && b < g->last)
        g->to[g->start[b - g->first]++] = a;
}

static PetscErrorCode make_graph(const drape_model *m, graph *g)
{
    const PetscInt nodes = g->last - g->first;
    PetscErrorCode code = PetscCalloc1((size_t)nodes + 1, &g->start);
    if (code)
        return code;
    visit(m, count, g);
    for (PetscInt i = 0; i < nodes; i++)
        g->start[i + 1] += g->start[i];
    code = PetscMalloc1((size_t)g->start[nodes] + 1, &g->to);
    if (code)
        return code;
    visit(m, add, g);
    for (PetscInt i = nodes; i > 0; i--)
        g->start[i] = g->start[i - 1];
    g->start[0] = 0;
    return 0;
}

/* Gives the range of each rank to all. */
static PetscErrorCode share(const drape_mpi_ranks *r, const graph *g, IS parts, int32_t *owner)
{
    const PetscInt *part;
    PetscErrorCode code = ISGetIndices(parts, &part);
    if (code)
        return code;
    for (PetscInt i = g->first; i < g->last; i++)
        owner[i] = (int32_t)part[i - g->first];
    int *counts = malloc(2 * (size_t)r->base.count * sizeof *counts), *places = counts + r->base.count;
    const int own[2] = {(int)(g->last - g->first), (int)g->first};
    if (!counts)
        return PETSC_ERR_MEM;
    MPI_Allgather(&own[0], 1, MPI_INT, counts, 1, MPI_INT, r->comm);
    MPI_Allgather(&own[1], 1, MPI_INT, places, 1, MPI_INT, r->comm);
    MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, owner, counts, places, MPI_INT32_T, r->comm);
    free(counts);
    return ISRestoreIndices(parts, &part);
}

static PetscErrorCode by_graph(const drape_mpi_ranks *r, const drape_model *m, int32_t *owner)
{
    const int64_t n = m->node_count;
    graph g = {.first = (PetscInt)(n * r->base.rank / r->base.count),
               .last = (PetscInt)(n * (r->base.rank + 1) / r->base.count)};
    Mat adjacency = NULL;
    MatPartitioning partitioning = NULL;
    IS parts = NULL;
    PetscErrorCode code = make_graph(m, &g);
    if (!code)
        code = MatCreateMPIAdj(r->comm, g.last - g.first, m->node_count, g.start, g.to, NULL, &adjacency);
    if (!code)
        code = MatPartitioningCreate(r->comm, &partitioning);
    if (!code)
        code = MatPartitioningSetAdjacency(partitioning, adjacency);
    if (!code)
        code = MatPartitioningSetFromOptions(partitioning);
    if (!code)
        code = MatPartitioningApply(partitioning, &parts);
    if (!code)
        code = share(r, &g, parts, owner);
    ISDestroy(&parts);
    MatPartitioningDestroy(&partitioning);
    MatDestroy(&adjacency);
    return code;
}

/* ---- By recursive bisection ---- */

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
            const double x = m->rest[3 * (size_t)places[i].node + (size_t)k];
            low[k] = fmin(low[k], x);
            high[k] = fmax(high[k], x);
        }
    }
    if (ranks == 1)
        return;
    for (int k = 1; k < 3; k++)
        axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
    for (int64_t i = 0; i < n; i++)
        places[i].x = m->rest[3 * (size_t)places[i].node + (size_t)axis];
    qsort(places, (size_t)n, sizeof *places, compare);
    const int half = ranks / 2;
    const int64_t cut = n * half / ranks;
    bisect(m, places, cut, first, half, owner);
    bisect(m, places + cut, n - cut, first + half, ranks - half, owner);
}

/* The free nodes, then the pinned ones, so that each rank has some of both. */
static drape_status by_place(const drape_mpi_ranks *r, const drape_model *m, int32_t *owner)
{
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

/* ---- Both ---- */

static bool is_good(const drape_mpi_ranks *r, const drape_model *m, const int32_t *owner)
{
    int32_t own = 0;
    for (int32_t i = 0; i < m->node_count; i++) {
        if (owner[i] < 0 || owner[i] >= r->base.count)
            return false;
        own += owner[i] == r->base.rank && !m->pinned[i];
    }
    return own > 0;
}

drape_status drape_partition(const drape_mpi_ranks *r, const drape_model *m, int32_t *owner)
{
    if (m->free_count < r->base.count)
        return drape_fail(m->ctx, DRAPE_E_ARGUMENT, "there are %d free nodes for %d ranks",
                          (int)m->free_count, r->base.count);
    const bool done = by_graph(r, m, owner) == 0;
    if (drape_ranks_all(&r->base, done && is_good(r, m, owner)))
        return DRAPE_OK;
    return by_place(r, m, owner);
}
