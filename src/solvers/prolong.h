/*
 * prolong.h: a coarse space on a graph of nodes, by smoothed aggregation (Vanek, Mandel & Brezina 1996,
 * Algebraic multigrid by smoothed aggregation): seeds are chosen some edges apart, each node joins its
 * nearest seed, and the indicator functions of these aggregates are averaged over neighbours until they
 * overlap. The functions add up to 1 at each node, so a translation of everything is in the space. It
 * depends on the graph alone, so it exists for any mesh and is built once.
 */
#ifndef DRAPE_SOLVERS_PROLONG_H
#define DRAPE_SOLVERS_PROLONG_H

#include "base/arena.h"

#define DRAPE_PROLONG_FUNCTIONS 16 /* at a node, at most; beyond it the smallest are dropped */

/* Neighbours of each node, in both directions: neighbor[start[i]] ... neighbor[start[i + 1] - 1]. */
typedef struct drape_graph {
    int32_t count;
    const int32_t *start, *neighbor;
} drape_graph;

typedef struct drape_prolong {
    int32_t fine, coarse;
    int32_t *start;  /* (fine + 1) */
    int32_t *column; /* the coarse functions that are nonzero at each node */
    double *weight;  /* their values there */
} drape_prolong;

/* A suitable number of edges between seeds for this many nodes: larger for more nodes, so that the coarse
 * matrix costs no more than the fine one. */
int drape_prolong_spacing(int32_t nodes);

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_prolong_build(drape_arena *arena, const drape_graph *graph, int spacing,
                                 drape_prolong *out);

/* coarse (coarse x 3) = P' fine; fine (fine x 3) += P coarse. */
void drape_prolong_restrict(const drape_prolong *prolong, const double *fine, double *coarse);
void drape_prolong_add(const drape_prolong *prolong, const double *coarse, double *fine);

/* The pattern of the coarse matrix: which coarse functions are coupled through a symmetric graph of the
 * nodes. start (coarse + 1) and neighbor, including the diagonal, rows not sorted. Workspace is taken from
 * the arena, too: pass a temporary one. Errors: DRAPE_E_MEMORY. */
drape_status drape_prolong_meet(drape_arena *arena, const drape_prolong *prolong, const drape_graph *graph,
                                int32_t **start, int32_t **neighbor);

#endif
