/*
 * part.h: the part of a compiled model that one rank of a distributed run has: the nodes that it owns, every
 * element, edge and triangle that touches one of these, and copies of the other nodes of these. Forces and
 * rows of matrices of its own nodes are complete without any other rank, and are sums of the same numbers in
 * the same order as in one process.
 */
#ifndef DRAPE_MPI_PART_H
#define DRAPE_MPI_PART_H

#include "mpi/ranks.h"

/* owner (node_count): the rank of each node; the same on all ranks, and each rank owns a free node: parts of equal
 * numbers of nodes, with few edges between them. Errors: DRAPE_E_MEMORY, DRAPE_E_ARGUMENT (there are fewer free
 * nodes than ranks). */
drape_status drape_partition(const drape_mpi_ranks *ranks, const drape_model *whole, int32_t *owner);

/* Refuses, in one line, a model with something that a part cannot have. Errors: DRAPE_E_ARGUMENT. */
drape_status drape_part_check(const drape_model *whole);

/* The part of ranks->rank. owner (whole->node_count): the rank of each node; each owns a free node. Also sets
 * what of *ranks depends on it. The part uses names, tracks, colliders and choices of `whole`, which must
 * outlive it; its large arrays are its own. Errors: DRAPE_E_MEMORY. */
drape_status drape_part_create(const drape_model *whole, const int32_t *owner, drape_mpi_ranks *ranks,
                               drape_model **out);

/* Frees elements and pattern of a model, which nothing needs besides its part. */
void drape_part_shed(drape_model *whole);

#endif
