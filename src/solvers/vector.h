/* vector.h: vectors of SUNDIALS over the unknowns: of one process, or of all ranks (base/ranks.h). */
#ifndef DRAPE_SOLVERS_VECTOR_H
#define DRAPE_SOLVERS_VECTOR_H

#include "base/ranks.h"

#include <nvector/nvector_serial.h>

/* A vector with these n values here, which stay the caller's; NULL: out of memory. */
static inline N_Vector drape_vector_make(const drape_ranks *ranks, int64_t n, double *values, SUNContext sun)
{
    return ranks ? ranks->vector(ranks, n, values, sun) : N_VMake_Serial(n, values, sun);
}

/* The same with values of its own. */
static inline N_Vector drape_vector_new(const drape_ranks *ranks, int64_t n, SUNContext sun)
{
    return ranks ? ranks->vector(ranks, n, NULL, sun) : N_VNew_Serial(n, sun);
}

#endif
