/* terms.h: the table of terms. A row is the constant drape_term_<word> of term_<word>.c; its interface is
 * drape/extend.h. */
#ifndef DRAPE_TERMS_TERMS_H
#define DRAPE_TERMS_TERMS_H

#include "drape/extend.h"

extern const drape_term_ops *const drape_terms[]; /* NULL-ended */

#endif
