/* terms.h: the table of terms. A term is the constant drape_term_<name> of term_<name>.c; its interface is
 * drape/extend.h. */
#ifndef DRAPE_TERMS_TERMS_H
#define DRAPE_TERMS_TERMS_H

#include "base/registry.h"

extern const drape_term_ops *const drape_terms[]; /* NULL-ended */
extern const drape_registry drape_term_registry;

/* DRAPE_LANES elements from `first` on; beyond the last of count it is repeated. */
static inline void drape_lanes_elements(int32_t first, int32_t count, int32_t element[DRAPE_LANES])
{
    for (int32_t l = 0; l < DRAPE_LANES; l++)
        element[l] = first + l < count ? first + l : count - 1;
}

/* Whether a step is to blame for a ratio (of a length to that at rest) below its limit: it fell. The slack is
 * rounding: of coordinates up to a thousand lengths away. */
static inline bool drape_fell(double ratio, double before)
{
    return ratio < before - 1e-12;
}

/* For check of a term: finds the lowest ratio of all elements, or of every so manyth, that a step is to blame for.
 * fault has reason, what and limit on entry. before may be NULL: none is excused. */
typedef double drape_ratio(const drape_elements *el, int32_t element, const double *x);
drape_status drape_check_ratios(const drape_elements *el, const double *x, const double *before,
                                int32_t every, drape_ratio *ratio_of, drape_fault *fault);

#endif
