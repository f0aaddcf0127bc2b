/*
 * matrix.h: a matrix A near the Jacobian J of a step equation, and what solves with it: the interface by
 * which a Newton iteration (newton.c) gets its corrections. Each kind is a file of its own that knows nothing
 * of the others; matrix.c chooses.
 */
#ifndef DRAPE_NONLINEAR_MATRIX_H
#define DRAPE_NONLINEAR_MATRIX_H

#include "nonlinear/solve_report.h"

/* Of conjugate gradients for each correction, at most. */
#define DRAPE_LINEAR_ITERATIONS 60

/* Statuses > 0: there is no solution by this matrix. Errors, < 0: DRAPE_E_MEMORY, where contact couples new
 * nodes; DRAPE_E_STOPPED. */
typedef struct drape_matrix_ops {
    bool exact;  /* without positive parts A is J, and solutions are exact up to the linear tolerance */
    bool direct; /* a solution by the factors costs a small part of them */
    /* A solve begins. friction: solutions have that of contact; most: iterations of conjugate gradients.
     * NULL: nothing to do. */
    void (*begin)(void *matrix, bool friction, int most);
    /* Computes A at a point, whose contacts the pattern of the system has afterwards. positive: with the
     * positive semidefinite parts of all elements. */
    drape_status (*assemble)(void *matrix, const drape_point *point, double mass_weight, bool positive,
                             drape_work *work);
    /* Factors it; definite: only if it is positive definite, else DRAPE_RETRY_LINEAR. */
    drape_status (*factor)(void *matrix, bool definite, drape_work *work);
    /* x = A^-1 b (free DOFs). tolerance: relative residual that an iterative solver may leave. *definite: A
     * was, as far as it was seen. */
    drape_status (*solve)(void *matrix, const double *b, double tolerance, double *x, bool *definite,
                          drape_work *work);
    void (*archive)(void *matrix, drape_archive *a); /* each solve begins with a new matrix */
    size_t (*bytes)(const void *matrix);             /* outside of its arena */
    void (*destroy)(void *matrix);
} drape_matrix_ops;

typedef struct drape_matrix {
    const drape_matrix_ops *ops; /* NULL: none */
    void *self;
} drape_matrix;

/* Makes what newton_k corrects with in steps of dt [s]. *usual: the matrix that factored_jacobian.h says,
 * factored or approximate. *approximate: with contact, where the usual matrix is a factored one and an
 * approximate one would serve, too, that one for the least effort: contact takes most of the iterations for
 * its active set, which costs less without factors; else there is none.
 * Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER; even then both must be destroyed. */
drape_status drape_matrix_choose(drape_arena *arena, drape_system *system, double dt, drape_matrix *usual,
                                 drape_matrix *approximate);

#endif
