/*
 * sun_shell.h: a custom SUNLinearSolver and a custom SUNMatrix, by which SUNDIALS calls functions of ours
 * where it wants a matrix factored or a linear system solved. SUNDIALS initialises the solver at each of its
 * solves and clears the matrix before each Jacobian: both do nothing here, so the analysis and the pattern
 * are kept and nothing is allocated. (KLU's own wrapper in SUNDIALS repeats the analysis in each KINSol.)
 */
#ifndef DRAPE_SOLVERS_SUN_SHELL_H
#define DRAPE_SOLVERS_SUN_SHELL_H

#include "solvers/sundials_compat.h"

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

typedef struct drape_sun_shell {
    SUNLinearSolver solver;
    SUNMatrix matrix;
} drape_sun_shell;

/* content: of the solver that setup and solve get. These return 0, > 0 for a recoverable and < 0 for a fatal
 * failure: the signs of drape_status. Errors: DRAPE_E_MEMORY; even then the shell must be destroyed. */
drape_status drape_sun_shell_create(drape_context *ctx, SUNContext sun, void *content,
                                    int (*setup)(SUNLinearSolver, SUNMatrix),
                                    int (*solve)(SUNLinearSolver, SUNMatrix, N_Vector, N_Vector, sunrealtype),
                                    drape_sun_shell *shell);
void drape_sun_shell_destroy(drape_sun_shell *shell);

#endif
