/* mpi.c: see mpi.h. */
#include "mpi/mpi.h"

#include "mpi/part.h"

#include <petscsys.h>
#include <stdlib.h>

struct drape_mpi {
    drape_context *ctx;
    drape_mpi_ranks *ranks;
};

/* Open MPI, MPICH and Intel MPI, and Slurm by PMIx. */
bool drape_mpi_is_launched(void)
{
    static const char *const names[] = {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"};
    bool launched = false;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        launched = launched || getenv(names[i]);
    return launched;
}

/* Failures of PETSc are return codes; it prints nothing. */
static PetscErrorCode keep_quiet(MPI_Comm comm, int line, const char *function, const char *file,
                                 PetscErrorCode code, PetscErrorType type, const char *message, void *user)
{
    (void)comm, (void)line, (void)function, (void)file, (void)type, (void)message, (void)user;
    return code;
}

drape_status drape_mpi_begin(drape_context *ctx, drape_mpi **out)
{
    int count = 1, provided;
    *out = NULL;
    if (MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &provided))
        return drape_fail(ctx, DRAPE_E_SOLVER, "MPI cannot start");
    MPI_Comm_size(MPI_COMM_WORLD, &count);
    if (count == 1) {
        MPI_Finalize();
        return DRAPE_OK;
    }
    drape_mpi *mpi = drape_alloc(ctx, 1, sizeof *mpi);
    *out = mpi;
    if (!mpi)
        return DRAPE_E_MEMORY;
    PetscErrorCode code;
    if ((code = PetscOptionsSetValue(NULL, "-no_signal_handler", NULL)) ||
        (code = PetscOptionsSetValue(NULL, "-skip_petscrc", NULL)) || (code = PetscInitializeNoArguments()) ||
        (code = PetscPushErrorHandler(keep_quiet, NULL)))
        return drape_fail(ctx, DRAPE_E_SOLVER, "PETSc cannot start: code %d", (int)code);
    mpi->ctx = ctx;
    return drape_mpi_ranks_create(ctx, PETSC_COMM_WORLD, &mpi->ranks);
}

void drape_mpi_end(drape_mpi **out)
{
    drape_mpi *mpi = *out;
    if (!mpi)
        return;
    drape_mpi_ranks_destroy(&mpi->ranks);
    drape_free(mpi->ctx, mpi);
    *out = NULL;
    PetscFinalize();
    MPI_Finalize();
}

void drape_mpi_abort(int code)
{
    MPI_Abort(MPI_COMM_WORLD, code);
}

int drape_mpi_rank(const drape_mpi *mpi)
{
    return mpi ? mpi->ranks->base.rank : 0;
}

int drape_mpi_count(const drape_mpi *mpi)
{
    return mpi ? mpi->ranks->base.count : 1;
}

int drape_mpi_agree(const drape_mpi *mpi, bool here, int *value)
{
    if (!mpi)
        return here ? 0 : -1;
    const drape_ranks *ranks = &mpi->ranks->base;
    if (!drape_ranks_any(ranks, here))
        return -1;
    const int from = drape_ranks_find(ranks, here);
    ranks->broadcast(ranks, from, value, sizeof *value);
    return from;
}

bool drape_mpi_is_same(const drape_mpi *mpi, uint64_t value)
{
    uint64_t first = value;
    if (!mpi)
        return true;
    mpi->ranks->base.broadcast(&mpi->ranks->base, 0, &first, sizeof first);
    return drape_ranks_all(&mpi->ranks->base, first == value);
}

drape_status drape_mpi_share(drape_mpi *mpi, drape_model *whole, drape_model **part)
{
    *part = NULL;
    drape_status status = drape_part_check(whole);
    int32_t *owner = status ? NULL : drape_alloc(mpi->ctx, (size_t)whole->node_count, sizeof *owner);
    if (!status && !owner)
        status = DRAPE_E_MEMORY;
    if (!status)
        status = drape_partition(mpi->ranks, whole, owner);
    if (!status)
        status = drape_part_create(whole, owner, mpi->ranks, part);
    status = drape_ranks_agree(&mpi->ranks->base, whole->ctx, status);
    if (!status)
        status = drape_mpi_ranks_plan(mpi->ranks, *part, owner);
    if (!status)
        drape_part_shed(whole);
    else
        drape_model_destroy(part);
    drape_free(mpi->ctx, owner);
    return status;
}
