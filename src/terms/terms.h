/* terms.h: the table of terms. A row is the constant drape_term_<word> of term_<word>.c; its interface is
 * drape/extend.h. */
#ifndef DRAPE_TERMS_TERMS_H
#define DRAPE_TERMS_TERMS_H

#include "drape/extend.h"

extern const drape_term_ops *const drape_terms[]; /* NULL-ended */

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

#endif
