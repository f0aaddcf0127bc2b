/*
 * term_parts.h: measures that are linear combinations of parts, q_e = sum_p c_ep s_p. Each part is
 * evaluated once:
 *     g = sum_p (sum_e c_ep f_e) ds_p
 *     H = sum_p (sum_e c_ep f_e) dds_p + sum_e w_e dq_e dq_e',  dq_e = sum_p c_ep ds_p
 * with the forces f_e on the measures and their weights w_e of block.h. The first sum of H is over parts of
 * few nodes, the second over patches: elements with the same nodes, whose products are added together.
 */
#ifndef DRAPE_ASSEMBLE_TERM_PARTS_H
#define DRAPE_ASSEMBLE_TERM_PARTS_H

#include "assemble/block.h"

/* Results by part and by element, which the sums read. Gradients of a part have DRAPE_LANES numbers a node,
 * the last of which is 0. */
typedef struct drape_parts_work {
    double *s, *rate, *ahead;                          /* (parts) s, ds . v, ds . along */
    double *ds, *turn;                                 /* (parts x part nodes x DRAPE_LANES) ds, dds v */
    double *force, *of_ddq, *of_dq, *by_rate, *energy; /* (elements) as in drape_block */
} drape_parts_work;

/* NULL for a term without parts, or if memory is out, which the arena keeps. */
drape_parts_work *drape_parts_create(drape_arena *arena, const drape_term *term);

/* Evaluates one block of DRAPE_BLOCK parts, and then, when all parts are evaluated, the forces on one block
 * of elements. b is scratch. */
void drape_parts_measure(const drape_term *term, const drape_request *want, int32_t block, drape_block *b,
                         drape_parts_work *work);
void drape_parts_stress(const drape_term *term, const drape_request *want, int32_t block, drape_block *b,
                        drape_parts_work *work);

/* When the forces on all elements are known: their power by the directions that turn, as they move s with the
 * nodes at rest [W]. */
double drape_parts_turning_power(const drape_term *term, const drape_point *point,
                                 const drape_parts_work *work);

/* The sum of a quantity over the parts of an element, each with its weight. */
double drape_parts_combine(const drape_parts *parts, int32_t element, const double *of_part);

/* The forces and, if wanted, Hessians of the parts b->first ... of b->count, when the forces on all elements
 * are known, as if they were elements (drape_block_evaluate). */
void drape_parts_evaluate(const drape_term *term, const drape_request *want, const drape_parts_work *work,
                          drape_block *b);

/* A column of 3 x 3 blocks in a matrix. */
typedef struct drape_block_column {
    double *start;
    int64_t stride;
    int32_t first; /* block */
    bool wanted;
} drape_block_column;

/* Adds the sum of w dq dq' over the elements of a patch to the columns of its nodes that are wanted. block:
 * of each pair of its nodes, row by row; -1: no element of the patch couples them, or one is pinned. */
void drape_patch_add(const drape_term *term, const drape_request *want, const drape_parts_work *work,
                     int32_t patch, const int32_t *block, const drape_block_column *columns);

#endif
