/*
 * block.h: evaluates a block of elements of one term: their forces and Hessians, not yet added anywhere.
 * Strain measures and their derivatives become forces here:
 *     g = f dq,  f summed over elasticity, the elements' own dashpots and laws
 *     H = f ddq + (df/dq + w df/dq') dq dq'                       step methods: q' = w q + history
 *     H = f ddq + df/dq dq dq' + df/dq' dq (ddq v + w dq)'        continuous time: q' = dq . v
 * An energy of motion T becomes the force r dT/dv - dT/dx, r of drape_point, with
 *     H = r T_vx - T_xx + w (r T_vv - T_xv)
 * Inner loops run over elements, so that compilers can vectorise them.
 */
#ifndef DRAPE_ASSEMBLE_BLOCK_H
#define DRAPE_ASSEMBLE_BLOCK_H

#include "assemble/system.h"

#define DRAPE_BLOCK 32 /* elements; few enough that their Hessians stay in the cache */

/* Selects the parts of a sum over a term, and where it is evaluated. */
typedef struct drape_request {
    const drape_point *point;
    bool energy, hessian;
    bool conservative, dissipative; /* which parts of the forces */
    double positive_share;       /* how much of the positive semidefinite part, see drape_system_jacobian */
    bool velocity;               /* the Hessian wanted is dg/dv alone */
    bool remainder;              /* only what belongs to no measure */
    bool lossless;               /* without the losses of measured fabrics */
    bool momentum;               /* only the energies of motion and, in place of forces, their momenta */
    const double *along;         /* (node_count x 3) displacement of the nodes; NULL: none */
    double *stress;              /* (measure_count) gets the forces on measures; NULL: not wanted */
    const bool *without;         /* (term_count) terms that are left out; NULL: none */
    const double *against;       /* (node_count x 3) v relative to the medium; NULL: the medium rests */
    const double *wind_gradient; /* (node_count x 3 x 3) W of wind.h; NULL with `against` */
} drape_request;

/*
 * With `pairs` the results are the force and the block of a pair: g = (-pull, pull), H = (block -block;
 * -block block), component k of element i at [k DRAPE_BLOCK + i]. Otherwise number k of element i lies at
 * [start(i) + stride k]. With `mirrored`, only the Hessian's blocks on and below the diagonal are written;
 * those above are their transposes.
 */
typedef struct drape_block {
    int32_t first, count;
    bool pairs, mirrored;
    bool flat;  /* all Hessians are 0 and were not written */
    int stride; /* 1, or DRAPE_LANES: elements are interleaved */
    double energy[DRAPE_BLOCK];
    double gradient[DRAPE_BLOCK * DRAPE_MAX_ELEMENT_DOFS];
    double hessian[DRAPE_BLOCK * DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS];
    /* For measures: */
    double q[DRAPE_BLOCK], dq[DRAPE_BLOCK * DRAPE_MAX_ELEMENT_DOFS];
    double per_length[DRAPE_BLOCK]; /* of pairs: dq = per_length (-d, d) */
    double strain[DRAPE_BLOCK], rate[DRAPE_BLOCK];
    double force[DRAPE_BLOCK], by_strain[DRAPE_BLOCK], by_rate[DRAPE_BLOCK];
    double of_ddq[DRAPE_BLOCK],
        of_dq[DRAPE_BLOCK]; /* H = of_ddq ddq + of_dq dq dq' + what is not symmetric */
    double scratch[DRAPE_BLOCK * DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS];
} drape_block;
_Static_assert(DRAPE_BLOCK <= DRAPE_PAIR_BLOCK, "a term with pair takes a whole block");
_Static_assert(DRAPE_BLOCK % DRAPE_LANES == 0, "a block is a whole number of lanes");

/* The position of an element's first number, if each element has that many. */
static inline size_t drape_block_start(const drape_block *b, int32_t i, int numbers)
{
    if (b->stride == 1)
        return (size_t)i * (size_t)numbers;
    return (size_t)(i - i % DRAPE_LANES) * (size_t)numbers + (size_t)(i % DRAPE_LANES);
}

/* Whether the forces on the measures of a term depend on their rates. */
bool drape_block_has_rates(const drape_term *term, const drape_request *want);

/* Whether the Hessian has the part df/dq' dq (ddq v)', which is not symmetric. */
bool drape_block_is_nonsymmetric(const drape_term *term, const drape_request *want);

/* From b->q and, in continuous time, b->rate: the forces on the measures, their energies, their stresses at
 * measures changed by `ahead`, and the weights in the Hessian, as wanted. */
void drape_block_stress(const drape_term *term, const drape_request *want, drape_block *b,
                        const double *ahead);

/* The caller sets b->first and b->count. */
void drape_block_evaluate(const drape_term *term, const drape_request *want, drape_block *b);

#endif
