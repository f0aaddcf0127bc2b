/* fit.c: see fit.h. */
#include "lab/fit.h"

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_fit.h>
#include <math.h>

#define MAX_POINTS 64
#define CONFIDENCE 0.975 /* two-sided 95 % */
#define SAME_ORDER 0.1   /* by which orders between neighbours may differ from that of the finest two */

double lab_student(double degrees_of_freedom)
{
    return gsl_cdf_tdist_Pinv(CONFIDENCE, degrees_of_freedom);
}

size_t lab_same_order(const double *x, const double *y, size_t count)
{
    double order = NAN;
    for (size_t i = 1; i < count; i++) {
        const double here = log(y[i] / y[i - 1]) / log(x[i] / x[i - 1]);
        if (i > 1 && !(fabs(here - order) < SAME_ORDER))
            return i;
        order = i > 1 ? order : here;
    }
    return count;
}

lab_line lab_fit_power(const double *x, const double *y, size_t count)
{
    double u[MAX_POINTS], v[MAX_POINTS], cov00, cov01, cov11, squares;
    lab_line line = {NAN, NAN, NAN, NAN};
    size_t n = count < MAX_POINTS ? count : MAX_POINTS;
    if (n < 2)
        return line;
    for (size_t i = 0; i < n; i++) {
        u[i] = log(x[i]);
        v[i] = log(y[i]);
    }
    gsl_fit_linear(u, 1, v, 1, n, &line.intercept, &line.slope, &cov00, &cov01, &cov11, &squares);
    if (n > 2) {
        double half = lab_student((double)n - 2) * sqrt(cov11);
        line.low = line.slope - half;
        line.high = line.slope + half;
    }
    return line;
}
