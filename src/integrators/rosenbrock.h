/* rosenbrock.h: the coefficients of rosenbrock.c, for the test of their orders. */
#ifndef DRAPE_INTEGRATORS_ROSENBROCK_H
#define DRAPE_INTEGRATORS_ROSENBROCK_H

#define DRAPE_ROSENBROCK_STAGES 6

/* As in Hairer & Wanner 1996, (7.25). c_ii = 0: its part is on the left. gammas: the sums of the rows of
 * gamma_ij. The embedded solution has the order less 1. */
typedef struct drape_rosenbrock_scheme {
    int stages, order;
    double gamma;
    double a[DRAPE_ROSENBROCK_STAGES][DRAPE_ROSENBROCK_STAGES],
        c[DRAPE_ROSENBROCK_STAGES][DRAPE_ROSENBROCK_STAGES];
    double m[DRAPE_ROSENBROCK_STAGES], e[DRAPE_ROSENBROCK_STAGES];
    double b[DRAPE_ROSENBROCK_STAGES]; /* m_j = sum b_i omega_ij, omega the inverse of gamma_ij */
    double alpha[DRAPE_ROSENBROCK_STAGES], gammas[DRAPE_ROSENBROCK_STAGES];
} drape_rosenbrock_scheme;

extern const drape_rosenbrock_scheme drape_rosenbrock_rodas;

#endif
