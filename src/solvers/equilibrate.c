/* equilibrate.c: see equilibrate.h. */
#include "solvers/equilibrate.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Sets each step to a power of 2 near the inverse root of the largest magnitude, and multiplies the factors
 * by it. False if one is zero; *done stays true if all steps are 1. */
static bool take_roots(int64_t n, const double *largest, double *step, double *factor, bool *done)
{
    for (int64_t i = 0; i < n; i++) {
        int exponent;
        if (!(largest[i] > 0))
            return false;
        frexp(largest[i], &exponent);
        *done &= exponent / 2 == 0;
        step[i] = ldexp(1, -(exponent / 2));
        factor[i] *= step[i];
    }
    return true;
}

bool drape_equilibrate(const drape_pattern *p, const double *values, bool symmetric, double *row,
                       double *column, double *scaled, double *work)
{
    const size_t n = (size_t)p->n;
    double *row_step = work, *column_step = work + n, *row_largest = work + 2 * n,
           *column_largest = work + 3 * n;
    bool done = false, regular = true;
    memcpy(scaled, values, (size_t)p->nonzeros * sizeof *scaled);
    for (size_t i = 0; i < n; i++)
        row[i] = column[i] = row_step[i] = column_step[i] = 1;
    /* each pass halves the exponents; the largest then are between 1/4 and 2 */
    for (int range = DBL_MAX_EXP - DBL_MIN_EXP; regular && !done && range > 0; range /= 2) {
        /* Multiplies by the factors, and finds the largest magnitude of each row and column. */
        memset(row_largest, 0, (size_t)p->n * sizeof *row_largest);
        for (int64_t j = 0; j < p->n; j++) {
            double most = 0;
            for (int64_t k = p->column[j]; k < p->column[j + 1]; k++) {
                const int64_t i = drape_pattern_row(p, j, k);
                scaled[k] *= row_step[i] * column_step[j];
                const double size = fabs(scaled[k]);
                most = size > most ? size : most;
                row_largest[i] = size > row_largest[i] ? size : row_largest[i];
            }
            column_largest[j] = most;
        }
        done = true;
        regular = take_roots(p->n, symmetric ? column_largest : row_largest, row_step, row, &done) &&
                  take_roots(p->n, column_largest, column_step, column, &done);
    }
    return regular;
}
