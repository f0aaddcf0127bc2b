/* sun_linear.c: see sun_linear.h. */
#include "solvers/sun_linear.h"

#include "base/clock.h"

#include <string.h>
#include <sundials/sundials_nvector.h>

static SUNMatrix_ID matrix_id(SUNMatrix matrix)
{
    (void)matrix;
    return SUNMATRIX_CUSTOM;
}

static int keep_matrix(SUNMatrix matrix)
{
    (void)matrix;
    return 0;
}

static SUNLinearSolver_Type solver_type(SUNLinearSolver solver)
{
    (void)solver;
    return SUNLINEARSOLVER_DIRECT;
}

static SUNLinearSolver_ID solver_id(SUNLinearSolver solver)
{
    (void)solver;
    return SUNLINEARSOLVER_CUSTOM;
}

static int keep_solver(SUNLinearSolver solver)
{
    (void)solver;
    return 0;
}

drape_status drape_sun_shell_create(drape_context *ctx, SUNContext sun, void *content,
                                    int (*setup)(SUNLinearSolver, SUNMatrix),
                                    int (*solve)(SUNLinearSolver, SUNMatrix, N_Vector, N_Vector, sunrealtype),
                                    drape_sun_shell *shell)
{
    shell->solver = SUNLinSolNewEmpty(sun);
    shell->matrix = SUNMatNewEmpty(sun);
    if (!shell->solver || !shell->matrix)
        return drape_fail_memory(ctx, sizeof *shell->solver);
    shell->solver->content = content;
    shell->solver->ops->gettype = solver_type;
    shell->solver->ops->getid = solver_id;
    shell->solver->ops->initialize = keep_solver;
    shell->solver->ops->setup = setup;
    shell->solver->ops->solve = solve;
    shell->matrix->ops->getid = matrix_id;
    shell->matrix->ops->zero = keep_matrix;
    return DRAPE_OK;
}

void drape_sun_shell_destroy(drape_sun_shell *shell)
{
    if (shell->solver)
        SUNLinSolFreeEmpty(shell->solver);
    if (shell->matrix)
        SUNMatFreeEmpty(shell->matrix);
    *shell = (drape_sun_shell){0};
}

drape_status drape_sun_linear_factor(drape_sun_linear *linear, bool definite)
{
    double start = drape_clock_seconds();
    if (definite && linear->ops->factor_definite)
        linear->status = linear->ops->factor_definite(linear->state, linear->values);
    else
        linear->status = linear->ops->factor(linear->state, linear->values);
    linear->factor_seconds += drape_clock_seconds() - start;
    linear->factorizations++;
    return linear->status;
}

/* SUNDIALS expects 0, > 0 for a recoverable and < 0 for a fatal failure: the signs of drape_status. */
static int setup(SUNLinearSolver solver, SUNMatrix matrix)
{
    (void)matrix;
    return drape_sun_linear_factor(solver->content, false);
}

/* x = M^-1 b with the matrix M that was factored. */
static drape_status solve_factored(drape_sun_linear *linear, const double *b, double *x)
{
    int64_t iterations = 1;
    drape_status status;
    if (linear->ops->solve_inexact && linear->tolerance > 0)
        status = linear->ops->solve_inexact(linear->state, b, x, linear->tolerance, &iterations);
    else
        status = linear->ops->solve(linear->state, b, x);
    linear->iterations += iterations;
    return status;
}

/* The first failure of a solve stays in linear->status. */
static void precondition(void *user, const double *b, double *x)
{
    drape_sun_linear *linear = user;
    if (!linear->status)
        linear->status = solve_factored(linear, b, x);
    if (linear->status)
        memset(x, 0, (size_t)drape_pattern_own(linear->pattern) * sizeof *x);
}

drape_status drape_sun_linear_solve(drape_sun_linear *linear, const double *b, double *x)
{
    double start = drape_clock_seconds();
    linear->status = DRAPE_OK;
    if (linear->corrects)
        drape_refine_reduce(&linear->refine, precondition, linear, linear->exact, b,
                            linear->correction_tolerance, x);
    else
        linear->status = solve_factored(linear, b, x);
    linear->solve_seconds += drape_clock_seconds() - start;
    return linear->status;
}

static int solve(SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, sunrealtype tolerance)
{
    (void)matrix, (void)tolerance;
    return drape_sun_linear_solve(solver->content, N_VGetArrayPointer(b), N_VGetArrayPointer(x));
}

static drape_status take_near(drape_sun_linear *linear)
{
    linear->exact = drape_arena_take(&linear->arena, (size_t)linear->nonzeros, sizeof *linear->exact);
    return linear->exact ? drape_refine_create(&linear->arena, linear->pattern, &linear->refine)
                         : DRAPE_E_MEMORY;
}

/* Takes the pattern's values and creates the solver's state; neither exists yet. */
static drape_status create_state(drape_sun_linear *linear, const drape_pattern *pattern)
{
    linear->pattern = pattern;
    linear->nonzeros = pattern->nonzeros;
    linear->values = drape_arena_take(&linear->arena, (size_t)pattern->nonzeros, sizeof *linear->values);
    linear->positions = NULL;
    if (linear->ops->set_positions)
        linear->positions = drape_arena_take(&linear->arena, (size_t)pattern->n, sizeof *linear->positions);
    drape_status status =
        linear->values && (linear->positions || !linear->ops->set_positions) ? DRAPE_OK : DRAPE_E_MEMORY;
    if (!status && linear->near)
        status = take_near(linear);
    status = drape_ranks_agree(pattern->ranks, linear->arena.ctx, status);
    if (!status)
        status = linear->ops->create(&linear->arena, pattern, &linear->state);
    if (!status && linear->ops->use_threads)
        linear->ops->use_threads(linear->state, linear->pool);
    if (!status && linear->ops->watch)
        linear->ops->watch(linear->state, linear->cancel);
    return status;
}

drape_status drape_sun_linear_create(drape_arena *arena, SUNContext sun, const drape_linear_ops *ops,
                                     const drape_pattern *pattern, drape_pool *pool,
                                     const atomic_bool *const *cancel, drape_sun_linear **out)
{
    drape_sun_linear *linear = *out = drape_arena_take(arena, 1, sizeof *linear);
    drape_status status = DRAPE_E_MEMORY;
    if (linear) {
        linear->arena = drape_arena_within(arena);
        status = drape_sun_shell_create(arena->ctx, sun, linear, setup, solve, &linear->shell);
    }
    status = drape_ranks_agree(pattern->ranks, arena->ctx, status);
    if (!status) {
        linear->ops = ops;
        linear->pool = pool;
        linear->cancel = cancel;
        status = create_state(linear, pattern);
    }
    if (status)
        drape_sun_linear_destroy(out);
    return status;
}

drape_status drape_sun_linear_use_near(drape_sun_linear *linear, double tolerance)
{
    linear->near = true;
    linear->correction_tolerance = tolerance;
    return take_near(linear);
}

void drape_sun_linear_keep_exact(drape_sun_linear *linear)
{
    memcpy(linear->exact, linear->values, (size_t)linear->nonzeros * sizeof *linear->exact);
    linear->corrects = true;
}

void drape_sun_linear_forget_exact(drape_sun_linear *linear)
{
    linear->corrects = false;
}

void drape_sun_linear_set_positions(drape_sun_linear *linear, const double *x, const int32_t *node)
{
    if (!linear->positions)
        return;
    for (int32_t j = 0; j < linear->pattern->block_count; j++)
        memcpy(linear->positions + 3 * (size_t)j, x + 3 * (size_t)node[j], 3 * sizeof *x);
    linear->ops->set_positions(linear->state, linear->positions);
}

drape_status drape_sun_linear_extend_pattern(drape_sun_linear *linear, const drape_pattern *pattern)
{
    double start = drape_clock_seconds();
    linear->stale = true;
    linear->corrects = false;
    linear->exact = NULL;
    drape_linear_destroy(linear->ops, &linear->state);
    drape_arena_free(&linear->arena);
    drape_status status = create_state(linear, pattern);
    linear->stale = status != DRAPE_OK;
    linear->factor_seconds += drape_clock_seconds() - start;
    return status;
}

drape_status drape_sun_linear_ensure_pattern(drape_sun_linear *linear, const drape_pattern *pattern)
{
    return linear->pattern == pattern ? DRAPE_OK : drape_sun_linear_extend_pattern(linear, pattern);
}

void drape_sun_linear_archive(drape_sun_linear *linear, drape_archive *a, bool factors)
{
    bool there = linear->state && !linear->stale;
    drape_archive_mark(a, linear->ops->entry.name);
    drape_archive_int64(a, &linear->factorizations);
    drape_archive_int64(a, &linear->iterations);
    drape_archive_double(a, &linear->factor_seconds);
    drape_archive_double(a, &linear->solve_seconds);
    drape_archive_bool(a, &there);
    if (!there)
        return;
    drape_archive_same(a, "the number of nonzeros", linear->nonzeros);
    if (factors)
        drape_archive_doubles(a, linear->values, (size_t)linear->nonzeros);
    if (linear->near)
        drape_archive_bool(a, &linear->corrects);
    if (factors && linear->corrects)
        drape_archive_doubles(a, linear->exact, (size_t)linear->nonzeros);
    drape_linear_archive(linear->ops, linear->state, a, factors ? linear->values : NULL);
}

void drape_sun_linear_destroy(drape_sun_linear **out)
{
    drape_sun_linear *linear = *out;
    if (!linear)
        return;
    drape_linear_destroy(linear->ops, &linear->state);
    drape_arena_free(&linear->arena);
    drape_sun_shell_destroy(&linear->shell);
    *out = NULL;
}

size_t drape_sun_linear_bytes(const drape_sun_linear *linear)
{
    return linear ? drape_linear_bytes(linear->ops, linear->state) : 0;
}
