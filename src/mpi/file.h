/* file.h: an array of which each rank has some items, written by all ranks into one file. */
#ifndef DRAPE_MPI_FILE_H
#define DRAPE_MPI_FILE_H

#include "mpi/ranks.h"

/* drape_ranks.write. */
int drape_mpi_write(const drape_ranks *ranks, const char *path, int64_t offset, bool durable,
                    const double *values, int width, int32_t count, const uint8_t *counted,
                    const int32_t *number, uint64_t *sum);

#endif
