/* file.h: arrays of which each rank has some items, written by all ranks into one file. */
#ifndef DRAPE_MPI_FILE_H
#define DRAPE_MPI_FILE_H

#include "mpi/ranks.h"

/* drape_ranks.open, write and close. */
int drape_mpi_open(const drape_ranks *ranks, const char *path);
int drape_mpi_write(const drape_ranks *ranks, int64_t offset, bool little_endian, const drape_rows *rows,
                    uint64_t *sum);
int drape_mpi_close(const drape_ranks *ranks, bool durable);

#endif
