/* approx_jacobian_parts.h: shared by approx_jacobian.c, which updates and solves with the matrix, and
 * approx_jacobian_build.c, which makes what does not change with the state. */
#ifndef DRAPE_NONLINEAR_APPROX_JACOBIAN_PARTS_H
#define DRAPE_NONLINEAR_APPROX_JACOBIAN_PARTS_H

#include "nonlinear/approx_jacobian.h"
#include "nonlinear/nonsymmetric.h"
#include "nonlinear/scalar_stiffness.h"
#include "solvers/linear.h"
#include "solvers/pcg.h"
#include "solvers/prolong.h"

/* The matrix on the coarse space. Its slots are the blocks of its pattern. */
typedef struct coarse_matrix {
    drape_prolong prolong;
    drape_pattern pattern;
    double *elastic, *damping, *mass; /* (slots) of the scalar stiffness */
    int64_t *pair_start; /* (pairs + 1) where the list of each pair begins: what it adds to which slots on
                            or below the diagonal */
    int32_t *slot;
    double *weight;
    double *sum;    /* (6 x slots) symmetric blocks */
    double *values; /* of the pattern */
    double *b, *x;
    const drape_linear_ops *linear;
    void *solver;
} coarse_matrix;

/* The nonzero blocks of R on or below the diagonal. */
typedef struct remainder_matrix {
    drape_arena arena; /* holds the arrays */
    double *values;    /* of the system's pattern; NULL: there is no R */
    int64_t version;   /* of that pattern */
    int32_t count;
    int32_t *row, *column; /* (lower blocks of the pattern) */
    double *block;         /* (9 x lower blocks) row by row; diagonal ones symmetric */
} remainder_matrix;

struct drape_approx_jacobian {
    drape_arena *arena;
    drape_system *system;
    const drape_model *model;
    int32_t nodes, pairs; /* number of free nodes; number of pairs of all terms of pairs */
    int32_t *pair;        /* (pairs x 2) free nodes; -1: pinned */
    double *h;            /* (6 x pairs) */
    drape_scalar_stiffness scalar;
    coarse_matrix coarse;
    bool coarse_due; /* its factors are not of this solve */
    bool has_friction;
    int most; /* iterations of conjugate gradients in a solution */
    remainder_matrix remainder;
    double *inverse; /* (6 x nodes) of the diagonal blocks */
    drape_pcg pcg;
    drape_nonsymmetric friction;
};

/* Everything that does not change with the state. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER. */
drape_status drape_approx_jacobian_build(drape_approx_jacobian *jacobian);

/* Takes the arrays of R for the system's present pattern. Errors: DRAPE_E_MEMORY. */
drape_status drape_approx_jacobian_extend(drape_approx_jacobian *jacobian);

#endif
