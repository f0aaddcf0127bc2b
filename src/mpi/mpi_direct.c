/*
 * mpi_direct.c: the direct solver of a matrix that ranks share, MUMPS by PETSc; see mpi_ranks.h. The rows of
 * a rank's own nodes are complete in its values, and go into a matrix of PETSc of block size 3.
 *
 * MUMPS has LDL' of a symmetric matrix, whose inertia says whether it is definite, else LU.
 */
#include "mpi/mpi_ranks.h"

#include <math.h>
#include <petscksp.h>
#include <string.h>

/* [%] beyond what MUMPS expects to need: pivots that are moved for accuracy need more, and more on more
 * ranks. */
#define LEAST_WORKSPACE 50
#define MOST_WORKSPACE  1600
#define INERTIA_ERROR   1e-8 /* as in solvers/general.c */

typedef struct mpi_linear {
    const drape_pattern *pattern;
    const drape_mpi_ranks *ranks;
    Mat matrix;
    Vec b, x; /* without values of their own */
    KSP direct;
    double *diagonal;         /* (n) of the matrix */
    bool counts;              /* the pivots by their signs, as if it were symmetric; it never solves */
    bool symmetric, definite; /* of the last matrix; a definite one was asked for */
    bool factored;
    PetscInt workspace; /* from LEAST_WORKSPACE to MOST_WORKSPACE */
} mpi_linear;

/* ---- Creation ---- */

static void destroy(void **state)
{
    mpi_linear *s = *state;
    KSPDestroy(&s->direct);
    VecDestroy(&s->b);
    VecDestroy(&s->x);
    MatDestroy(&s->matrix);
}

static drape_status create(drape_arena *arena, const drape_pattern *p, void **state)
{
    const PetscInt own = p->ranks->own_blocks, n = 3 * own;
    mpi_linear *s = drape_arena_take(arena, 1, sizeof *s);
    PetscInt *inside = drape_arena_take(arena, 2 * (size_t)n, sizeof *inside);
    double *diagonal = drape_arena_take(arena, (size_t)p->n, sizeof *diagonal);
    const bool good = s && inside && diagonal;
    if (drape_ranks_agree_memory(p->ranks, arena->ctx, good))
        return DRAPE_E_MEMORY;
    s->pattern = p;
    s->diagonal = diagonal;
    s->ranks = drape_mpi_ranks_of(p->ranks);
    s->workspace = LEAST_WORKSPACE;
    PetscInt *outside = inside + n;
    /* The nonzeros of each row in columns here, and in those of other ranks: the pattern is symmetric,
     * columns are rows. */
    for (PetscInt i = 0; i < own; i++) {
        PetscInt blocks = 0;
        for (int32_t k = p->block_start[i]; k < p->block_start[i + 1]; k++)
            blocks += p->block_row[k] < own;
        for (PetscInt r = 3 * i; r < 3 * i + 3; r++) {
            inside[r] = 3 * blocks;
            outside[r] = 3 * (p->block_start[i + 1] - p->block_start[i] - blocks);
        }
    }
    PetscErrorCode code;
    const bool failed = (code = MatCreate(s->ranks->comm, &s->matrix)) ||
                        (code = MatSetSizes(s->matrix, n, n, PETSC_DETERMINE, PETSC_DETERMINE)) ||
                        (code = MatSetType(s->matrix, MATAIJ)) || (code = MatSetBlockSize(s->matrix, 3)) ||
                        (code = MatSeqAIJSetPreallocation(s->matrix, 0, inside)) ||
                        (code = MatMPIAIJSetPreallocation(s->matrix, 0, inside, 0, outside)) ||
                        (code = MatSetOption(s->matrix, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_TRUE)) ||
                        (code = MatSetOption(s->matrix, MAT_ROW_ORIENTED, PETSC_FALSE)) ||
                        (code = VecCreateMPIWithArray(s->ranks->comm, 3, n, PETSC_DETERMINE, NULL, &s->b)) ||
                        (code = VecCreateMPIWithArray(s->ranks->comm, 3, n, PETSC_DETERMINE, NULL, &s->x));
    drape_arena_release(arena, inside);
    *state = s;
    if (!failed)
        return DRAPE_OK;
    destroy(state);
    *state = NULL;
    return drape_fail(arena->ctx, DRAPE_E_SOLVER, "PETSc cannot set up a matrix of %lld unknowns: code %d",
                      (long long)(3 * p->ranks->all_blocks), (int)code);
}

/* ---- Factors ---- */

/* Returns whether that failed here, as the next one. */
static bool fill_matrix(mpi_linear *s, const double *values)
{
    const drape_pattern *p = s->pattern;
    const drape_ranks *ranks = p->ranks;
    bool failed = false;
    for (int32_t j = 0; j < p->block_count; j++) {
        const PetscInt column = (PetscInt)ranks->block[j];
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1] && !failed; k++) {
            const int32_t i = p->block_row[k];
            const PetscInt row = (PetscInt)(i < ranks->own_blocks ? ranks->block[i] : -1);
            double block[9];
            int64_t stride;
            const double *from = drape_pattern_at(p, (double *)(uintptr_t)values, j, k, &stride);
            if (row < 0)
                continue;
            for (int c = 0; c < 3; c++)
                memcpy(block + 3 * c, from + c * stride, 3 * sizeof *block);
            failed = MatSetValuesBlocked(s->matrix, 1, &row, 1, &column, block, INSERT_VALUES);
        }
    }
    return failed || MatAssemblyBegin(s->matrix, MAT_FINAL_ASSEMBLY) ||
           MatAssemblyEnd(s->matrix, MAT_FINAL_ASSEMBLY) ||
           MatSetOption(s->matrix, MAT_SYMMETRIC, s->symmetric ? PETSC_TRUE : PETSC_FALSE);
}

static bool begin_direct(mpi_linear *s)
{
    PC pc;
    Mat factors;
    return KSPDestroy(&s->direct) || /* another kind of factors takes another object */
           KSPCreate(s->ranks->comm, &s->direct) || KSPSetType(s->direct, KSPPREONLY) ||
           KSPGetPC(s->direct, &pc) || PCSetType(pc, s->symmetric ? PCCHOLESKY : PCLU) ||
           PCFactorSetMatSolverType(pc, MATSOLVERMUMPS) || KSPSetOperators(s->direct, s->matrix, s->matrix) ||
           PCFactorSetUpMatSolverType(pc) || PCFactorGetMatrix(pc, &factors) ||
           MatMumpsSetIcntl(factors, 13, 1) || /* else the last front counts no negative pivots */
           MatMumpsSetIcntl(factors, 14, s->workspace) ||
           (s->counts &&
            MatMumpsSetIcntl(factors, 24, 1)); /* counts pivots that are zero, instead of failing */
}

/* Whether there are factors and, if a definite matrix is asked for, no negative pivot. *lacks: the workspace
 * or a buffer was too small, by the errors of MUMPS. */
static bool factor_once(mpi_linear *s, bool *lacks)
{
    PCType type = NULL;
    PC pc = NULL;
    Mat factors;
    PCFailedReason reason = PC_NOERROR;
    PetscInt negative = 0 /* pivots */, error = 0;
    bool failed = s->direct && (KSPGetPC(s->direct, &pc) || PCGetType(pc, &type));
    if (!failed && (!pc || strcmp(type, s->symmetric ? PCCHOLESKY : PCLU) != 0))
        failed = begin_direct(s);
    failed = failed || KSPSetOperators(s->direct, s->matrix, s->matrix) || KSPGetPC(s->direct, &pc) ||
             KSPSetUp(s->direct) || PCGetFailedReason(pc, &reason) || PCFactorGetMatrix(pc, &factors);
    const bool small = !failed && reason && !MatMumpsGetInfog(factors, 1, &error) &&
                       (error == -8 || error == -9 || error == -15 || error == -17 || error == -20);
    *lacks = drape_ranks_any(s->pattern->ranks, small);
    failed = failed || reason || (s->definite && MatMumpsGetInfog(factors, 12, &negative));
    return drape_ranks_all(s->pattern->ranks, !failed && negative == 0);
}

/* ---- Factor and solve ---- */

static drape_status factor_any(mpi_linear *s, const double *values, bool definite)
{
    const drape_pattern *p = s->pattern;
    bool finite = true, lacks = false;
    s->factored = false;
    for (int64_t i = 0; i < 9 * (int64_t)p->block_start[p->ranks->own_blocks] && finite; i++)
        finite = isfinite(values[i]);
    if (!drape_ranks_all(p->ranks, finite))
        return DRAPE_RETRY_LINEAR;
    s->symmetric = s->counts || drape_pattern_is_symmetric(p, values, s->diagonal);
    s->definite = definite && s->symmetric;
    if (fill_matrix(s, values))
        return DRAPE_E_SOLVER;
    s->factored = factor_once(s, &lacks);
    while (lacks && s->workspace < MOST_WORKSPACE) {
        s->workspace *= 2;
        KSPDestroy(&s->direct);
        s->factored = factor_once(s, &lacks);
    }
    return s->factored ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static drape_status factor(void *state, const double *values)
{
    return factor_any(state, values, false);
}

static drape_status factor_definite(void *state, const double *values)
{
    return factor_any(state, values, true);
}

static drape_status solve(void *state, const double *b, double *x)
{
    mpi_linear *s = state;
    KSPConvergedReason reason = 0;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    const bool failed = VecPlaceArray(s->b, b) || VecPlaceArray(s->x, x) || KSPSolve(s->direct, s->b, s->x) ||
                        KSPGetConvergedReason(s->direct, &reason);
    VecResetArray(s->b);
    VecResetArray(s->x);
    bool finite = !failed && reason > 0;
    for (int64_t i = 0; i < 3 * (int64_t)s->pattern->ranks->own_blocks && finite; i++)
        finite = isfinite(x[i]);
    return drape_ranks_all(s->pattern->ranks, finite) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

/* Whether the factors are those of the matrix, which need not be symmetric: the residual of a solution, over
 * |A| |x| + |b|, is small. */
static bool solves(mpi_linear *s)
{
    Vec b = NULL, x = NULL, left = NULL;
    PetscReal a = 0, length = 0, right = 0, error = INFINITY;
    const bool failed = MatCreateVecs(s->matrix, &x, &b) || VecDuplicate(b, &left) || VecSetRandom(b, NULL) ||
                        KSPSolve(s->direct, b, x) || MatMult(s->matrix, x, left) || VecAXPY(left, -1, b) ||
                        VecNorm(left, NORM_INFINITY, &error) || VecNorm(x, NORM_INFINITY, &length) ||
                        VecNorm(b, NORM_INFINITY, &right) || MatNorm(s->matrix, NORM_INFINITY, &a);
    VecDestroy(&b);
    VecDestroy(&x);
    VecDestroy(&left);
    return drape_ranks_all(s->pattern->ranks, !failed && error < INERTIA_ERROR * (a * length + right));
}

drape_status drape_mpi_inertia(drape_context *ctx, const drape_pattern *p, const double *values,
                               int64_t *negative, bool *known)
{
    drape_arena arena = drape_arena_of(ctx);
    void *state = NULL;
    PC pc;
    Mat factors;
    PetscInt below = 0, zero = 0;
    *negative = 0;
    *known = false;
    drape_status status = create(&arena, p, &state);
    mpi_linear *s = state;
    if (!status) {
        s->counts = true;
        status = factor_any(s, values, false);
    }
    if (!status && !KSPGetPC(s->direct, &pc) && !PCFactorGetMatrix(pc, &factors) &&
        !MatMumpsGetInfog(factors, 12, &below) && !MatMumpsGetInfog(factors, 28, &zero)) {
        *negative = below;
        *known = zero == 0 && solves(s);
    }
    if (state)
        destroy(&state);
    drape_arena_free(&arena);
    return status < 0 ? status : DRAPE_OK;
}

/* The caller makes factors anew from the values. */
static void archive(void *state, drape_archive *a, const double *values)
{
    if (drape_archive_has_read(a) && values && factor(state, values))
        drape_archive_fail(a, DRAPE_E_SOLVER, "a matrix of the checkpoint has no factors here");
}

const drape_linear_ops drape_linear_mpi_direct = {
    .entry = {.name = "mpi_direct", .summary = "MUMPS by PETSc", .reference = "Amestoy et al. 2001, MUMPS"},
    .borrows_heap = true,
    .create = create,
    .factor = factor,
    .factor_definite = factor_definite,
    .solve = solve,
    .archive = archive,
    .destroy = destroy,
};
