/*
 * sum.h: sums over the elements of terms, by several threads. Each share of the work owns a range of nodes:
 * it adds to their forces and to their columns of matrices and to no others, and evaluates all blocks of
 * elements that touch one of its nodes; a block that touches nodes of two shares is evaluated for both. So
 * no two threads write to the same place, and each place is added to in the order of elements: the bits are
 * the same for any number of threads.
 */
#ifndef DRAPE_ASSEMBLE_SUM_H
#define DRAPE_ASSEMBLE_SUM_H

#include "assemble/block.h"
#include "base/thread_pool.h"

typedef struct drape_summer drape_summer;

/* Where sums are written; NULL: not wanted. */
typedef struct drape_sums {
    double *node_energy;          /* (node_count) each element's energy in equal parts on its nodes */
    double *g;                    /* (node_count x 3) */
    double *values;               /* (pattern->nonzeros) */
    const drape_pattern *pattern; /* of values */
    int32_t *const
        *blocks; /* (term_count) each as drape_term.block, for this pattern; NULL: those of the terms */
} drape_sums;

/* The pool must outlive it; NULL: one thread. Errors: DRAPE_E_MEMORY. */
drape_status drape_summer_create(drape_arena *arena, const drape_model *model, drape_pool *pool,
                                 drape_summer **out);

/* From now on, terms that are constraints are left out. */
void drape_summer_leave_constraints(drape_summer *summer);
/* From now on, the losses of measured fabrics are left out. */
void drape_summer_leave_losses(drape_summer *summer);
bool drape_summer_leaves(const drape_summer *summer, const drape_term *term);

/* Overwrites the sums in `to` with those over all terms. */
void drape_summer_add(drape_summer *summer, const drape_request *want, const drape_sums *to);

/* Adds one term, on the calling thread; *energy, if not NULL, becomes its energy. */
void drape_summer_add_term(drape_summer *summer, const drape_term *term, const drape_request *want,
                           const drape_sums *to, double *energy);

/* The power of the forces of a term by its directions that turn [W], on the calling thread. */
double drape_summer_turning_power(drape_summer *summer, const drape_term *term, const drape_request *want);

/* The measures q (element count) of one term at a point, on the calling thread. */
void drape_summer_measure(drape_summer *summer, const drape_term *term, const drape_point *point, double *q);

/* The forces on the measures of all terms, into want->stress. */
void drape_summer_stress(drape_summer *summer, const drape_request *want);

/* For a term of pairs: the block of each element, xx xy xz yy yz zz, as (element count x 6). want->hessian
 * must be set. */
void drape_summer_pairs(drape_summer *summer, const drape_term *term, const drape_request *want, double *h);

#endif
