/* quasi_parts.h: what quasi.c, which uses the matrix, and quasi_build.c, which makes it, share. */
#ifndef DRAPE_INTEGRATORS_QUASI_PARTS_H
#define DRAPE_INTEGRATORS_QUASI_PARTS_H

#include "integrators/quasi.h"
#include "integrators/scalar.h"
#include "solvers/linear.h"
#include "solvers/pcg.h"
#include "solvers/prolong.h"

/* The matrix on the coarse space. Its pattern's blocks are the slots. */
typedef struct drape_quasi_coarse {
    drape_prolong prolong;
    drape_pattern pattern;
    double *elastic, *damping, *mass; /* (slots) of the scalar part */
    int64_t *pair_start; /* (pairs + 1): what a pair adds to which slots at or below the diagonal */
    int32_t *slot;
    double *weight;
    double *sum;    /* (6 x slots) symmetric blocks */
    double *values; /* of the pattern */
    double *b, *x;
    const drape_linear_ops *row;
    void *solver;
} drape_quasi_coarse;

/* Blocks of R that are not zero, at or below the diagonal. */
typedef struct drape_quasi_remainder {
    double *values; /* of the system's pattern; NULL: there is no R */
    int32_t count;
    int32_t *row, *column; /* (lower blocks of the pattern) */
    double *block;         /* (9 x ...) row by row, made symmetric on the diagonal */
} drape_quasi_remainder;

struct drape_quasi {
    drape_context *ctx;
    drape_arena *arena;
    drape_system *system;
    const drape_model *model;
    int32_t nodes, pairs; /* free nodes; pairs of all terms that have some */
    int32_t *pair;        /* (pairs x 2) free nodes, -1 pinned */
    double *h;            /* (6 x pairs) */
    drape_scalar scalar;
    drape_quasi_coarse coarse;
    drape_quasi_remainder remainder;
    double *inverse; /* (6 x nodes) of the diagonal blocks */
    drape_pcg pcg;
    int64_t factorizations;
    double factor_seconds;
};

/* All that does not change with the state. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER. */
drape_status drape_quasi_build(drape_quasi *quasi, int spacing);

/* Room for R in the system's present pattern. Errors: DRAPE_E_MEMORY. */
drape_status drape_quasi_make_room(drape_quasi *quasi);
void drape_quasi_free_room(drape_quasi *quasi);

/* Slots of the coarse pattern: the block at (row, column); -1 where there is none. */
static inline int32_t drape_quasi_slot(const drape_pattern *pattern, int32_t row, int32_t column)
{
    return drape_pattern_has(pattern, row, column) ? drape_pattern_find(pattern, row, column) : -1;
}

#endif
