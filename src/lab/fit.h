/* fit.h: straight lines through points, and the confidence in them, by GSL. */
#ifndef DRAPE_LAB_FIT_H
#define DRAPE_LAB_FIT_H

#include <stddef.h>

typedef struct lab_line {
    double slope, intercept;
    double low, high; /* bounds of the slope's 95 % confidence interval; NaN for fewer than 3 points */
} lab_line;

/* By how many standard errors the 95 % confidence interval extends to either side: Student's t. */
double lab_student(double degrees_of_freedom);

/* Of points from the finest to the coarsest, the number of the first that show one order: those whose orders
 * between neighbours, log(y'/y) / log(x'/x), are within 0.1 of that of the first two. */
size_t lab_same_order(const double *x, const double *y, size_t count);

/* Least squares through (log x, log y) of positive points; count >= 2. */
lab_line lab_fit_power(const double *x, const double *y, size_t count);

#endif
