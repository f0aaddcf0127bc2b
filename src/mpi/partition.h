/* partition.h: which rank owns which node: parts of equal numbers of nodes, with few edges between them. */
#ifndef DRAPE_MPI_PARTITION_H
#define DRAPE_MPI_PARTITION_H

#include "mpi/ranks.h"

/* owner (node_count): the rank of each node; the same on all ranks, and each rank owns a free node.
 * Errors: DRAPE_E_MEMORY, DRAPE_E_ARGUMENT (there are fewer free nodes than ranks). */
drape_status drape_partition(const drape_mpi_ranks *ranks, const drape_model *whole, int32_t *owner);

#endif
