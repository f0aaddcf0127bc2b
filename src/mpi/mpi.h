/*
 * mpi.h: a run on several ranks, as the program drives it. Each rank compiles the scene, keeps its part of
 * the model, and steps it with the code of one process; base/ranks.h has what that code exchanges.
 */
#ifndef DRAPE_MPI_MPI_H
#define DRAPE_MPI_MPI_H

#include "model/model.h"

typedef struct drape_mpi drape_mpi;

/* Whether the environment says that a launcher started this process with others; MPI is not touched if
 * not. */
bool drape_mpi_is_launched(void);

/* Starts MPI and PETSc. *out is NULL if there is only one rank. It must be ended before the process is.
 * Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER. */
drape_status drape_mpi_begin(drape_context *ctx, drape_mpi **out);
/* Ends them; collective. */
void drape_mpi_end(drape_mpi **mpi);

int drape_mpi_rank(const drape_mpi *mpi);
int drape_mpi_count(const drape_mpi *mpi);

/* The lowest rank for which `here` is true, whose value all get; -1: it is true for none. Collective. */
int drape_mpi_agree(const drape_mpi *mpi, bool here, int *value);

/* Whether all ranks have the same value. Collective. */
bool drape_mpi_is_same(const drape_mpi *mpi, uint64_t value);

/* The part of a compiled model of this rank, which lasts no longer than the model and mpi. Collective.
 * Errors: DRAPE_E_ARGUMENT (the model has what a part cannot have, with its place in the scene),
 * DRAPE_E_MEMORY. */
drape_status drape_mpi_share(drape_mpi *mpi, drape_model *whole, drape_model **part);

#endif
