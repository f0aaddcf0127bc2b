/* terms.h: the tables of terms and seams, and what their files share. A term is the constant
 * drape_term_<name> of term_<name>.c, a seam drape_seam_<name> of seam_<name>.c; their interface is
 * drape/extend.h. */
#ifndef DRAPE_TERMS_TERMS_H
#define DRAPE_TERMS_TERMS_H

#include "base/reason.h"
#include "base/registry.h"
#include "base/vec3.h"

extern const drape_term_ops *const drape_terms[]; /* NULL-ended */
extern const drape_term_ops *const drape_seams[]; /* NULL-ended */
extern const drape_registry drape_term_registry, drape_seam_registry;

/* Define the function `measure` or `energy` of a term by one for DRAPE_LANES elements, or for one element
 * (drape_measure_range, drape_energy_range). */
#define DRAPE_MEASURE_BY(lanes)                                                                              \
    static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,             \
                        const double *internal, double *q, double *dq, double *ddq)                          \
    {                                                                                                        \
        drape_measure_range(el, first, count, x, internal, q, dq, ddq, lanes);                               \
    }
#define DRAPE_ENERGY_BY(one)                                                                                 \
    static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,              \
                       const double *internal, double *e, double *g, double *hess)                           \
    {                                                                                                        \
        (void)internal;                                                                                      \
        drape_energy_range(el, first, count, x, e, g, hess, one);                                            \
    }

/* drape_check_cancel_after, for builders of elements that take long. */
drape_status drape_term_check_cancel(drape_term_builder *builder, size_t work);

/* Rest value number `item` of an element. */
static inline double drape_rest_of(const drape_elements *el, int item, int32_t element)
{
    return el->rest[(size_t)item * (size_t)el->count + (size_t)element];
}

/* Whether an edge is on the boundary of the cloth. A periodic edge is not: the sheet goes on beyond it. */
static inline bool drape_on_boundary(const drape_cloth_view *cloth, int32_t edge)
{
    return cloth->edge_triangle[2 * (size_t)edge + 1] < 0 &&
           !(cloth->edge_image && cloth->edge_image[edge] >= 0);
}

/* Length of an element of two nodes [m]. */
static inline double drape_pair_length(const drape_elements *el, int32_t element, const double *x)
{
    const int32_t *node = el->node + 2 * (size_t)element;
    double d[3];
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], d);
    return vec3_norm(d);
}

/* The 6 x 6 block of two nodes that act on each other in opposite directions, by their difference only, from
 * the 3 x 3 one of a node on itself: [B -B; -B B]. */
static inline void drape_pair_block(const double block[9], double *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            out[6 * i + j] = out[6 * (3 + i) + 3 + j] = block[3 * i + j];
            out[6 * i + 3 + j] = out[6 * (3 + i) + j] = -block[3 * i + j];
        }
}

/* How a load or the wind varies in time; the library multiplies by it. One value each, after all others. */
#define DRAPE_TERM_HISTORY_PARAM                                                                             \
    DRAPE_TEXT("history", "name of a history of the scene, by which the load, or the wind, is multiplied",   \
               .derived = "none: it is constant")
#define DRAPE_TERM_RAMP_PARAM                                                                                \
    DRAPE_NUMBER("ramp", "s", 0, 0, 1e9,                                                                     \
                 "in place of a history: the time in which the load, or the wind, rises smoothly from 0; "   \
                 "0: it does not")

/* A step is rejected if it makes a length, an area or an altitude collapse, below this fraction of the one at
 * rest, or turns a hinge by more than so much [rad]: near pi its angle is ambiguous. */
#define DRAPE_MIN_RATIO 1e-6
#define DRAPE_MAX_TURN  2.8

/* The numbers of DRAPE_LANES elements from `first` on; beyond the end the last one is repeated. */
static inline void drape_lanes_elements(int32_t first, int32_t count, int32_t element[DRAPE_LANES])
{
    for (int32_t l = 0; l < DRAPE_LANES; l++)
        element[l] = first + l < count ? first + l : count - 1;
}

/* Whether a step lowered a ratio (of a length to its rest length). The slack is the rounding of coordinates
 * up to a thousand lengths from the origin. */
static inline bool drape_fell(double ratio, double before)
{
    return ratio < before - 1e-12;
}

/* For the check of a term: finds the lowest ratio, of what it is, of the elements 0, every, 2 every ... An
 * element below DRAPE_MIN_RATIO is ignored if the step did not lower its ratio; if before is NULL none is. */
typedef double drape_ratio(const drape_elements *el, int32_t element, const double *x);
drape_status drape_check_ratios(const drape_elements *el, const double *x, const double *before,
                                int32_t every, drape_ratio *ratio_of, drape_reason reason, const char *what,
                                drape_fault *fault);

#endif
