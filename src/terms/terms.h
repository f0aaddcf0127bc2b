/* terms.h: the table of terms. A row is the constant drape_term_<word> of term_<word>.c; its interface is
 * drape/extend.h. */
#ifndef DRAPE_TERMS_TERMS_H
#define DRAPE_TERMS_TERMS_H

#include "drape/extend.h"

extern const drape_term_ops *const drape_terms[]; /* NULL-ended */

/* Whether a step is to blame for a ratio (of a length to that at rest) below its limit: it fell. The slack is
 * rounding: of coordinates up to a thousand lengths away. */
static inline bool drape_fell(double ratio, double before)
{
    return ratio < before - 1e-12;
}

#endif
