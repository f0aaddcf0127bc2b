/* sun_shell.c: see sun_shell.h. */
#include "solvers/sun_shell.h"

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
