/* mpi_ranks.h: the ranks of base/ranks.h by MPI. */
#ifndef DRAPE_MPI_MPI_RANKS_H
#define DRAPE_MPI_MPI_RANKS_H

#include "model/model.h"
#include "solvers/linear.h"

#include <mpi.h>

#define DRAPE_MPI_ARRAYS 2      /* of nodes, in one exchange */
#define DRAPE_MPI_VALUES 64     /* in one sum */
#define DRAPE_MPI_PIECE  196608 /* numbers in a message; a multiple of 3 */

struct drape_exchange {
    int neighbour_count;
    int *neighbour;                /* (neighbour_count) their ranks, ascending */
    int32_t *first_out, *first_in; /* (neighbour_count + 1) what is for and from each */
    int32_t *out, *in;             /* places in the owner's array; among the copies */
    char *outside, *inside;        /* messages of items of the largest size: for `out`, for `in` */
    MPI_Request *requests;         /* (2 x neighbour_count) */
};

typedef struct drape_mpi_ranks {
    drape_ranks base;
    MPI_Comm comm;
    drape_arena arena;
    drape_exchange *nodes, *blocks;
    int file;            /* descriptor, between drape_ranks.open and close */
    int *bytes, *places; /* (count) of what each rank shares */
    double *gathered;    /* (DRAPE_MPI_VALUES x count) */
    double *piece;       /* (DRAPE_MPI_PIECE) of a message of drape_ranks.gather */
    int32_t *numbers;    /* (DRAPE_MPI_PIECE) of its items */
} drape_mpi_ranks;

static inline drape_mpi_ranks *drape_mpi_ranks_of(const drape_ranks *ranks)
{
    return (drape_mpi_ranks *)(uintptr_t)ranks; /* base is its first member */
}

/* The ranks of a communicator, which becomes theirs. Errors: DRAPE_E_MEMORY. */
drape_status drape_mpi_ranks_create(drape_context *ctx, MPI_Comm comm, drape_mpi_ranks **out);
void drape_mpi_ranks_destroy(drape_mpi_ranks **ranks);

/* Plans the exchange of copies for a part of a model; owner: of the nodes of the whole model. Collective.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_mpi_ranks_plan(drape_mpi_ranks *ranks, const drape_model *part, const int32_t *owner);

/* ---- shared_file.c: arrays of which each rank has some items, written by all ranks into one file ---- */

/* drape_ranks.open, write and close. */
int drape_mpi_open(const drape_ranks *ranks, const char *path);
int drape_mpi_write(const drape_ranks *ranks, int64_t offset, bool little_endian, const drape_rows *rows,
                    uint64_t *sum);
int drape_mpi_close(const drape_ranks *ranks, bool durable);

/* ---- mpi_direct.c: the direct solver of a matrix that ranks share (pattern->ranks) ---- */

/* It is not in the table of linear solvers, as no scene names it: a run on several ranks has it in place of
 * direct ones (drape_linear_of). */
extern const drape_linear_ops drape_linear_mpi_direct;

/* drape_ranks.inertia: the signs of the pivots of MUMPS. *known: also false if the matrix is not
 * symmetric. */
drape_status drape_mpi_inertia(drape_context *ctx, const drape_pattern *pattern, const double *values,
                               int64_t *negative, bool *known);

#endif
