/*
 * rod.c: see sheet.h. With t from the free end and psi the angle from the vertical,
 *     psi'' = (G t + P) sin psi,  psi'(0) = 0,  psi(1) = pi/2,  drop = int cos psi,  reach = int sin psi.
 * psi(0) is as small as exp(-G^(1/2)); it is sought by its logarithm, on which psi(1) depends smoothly, so
 * shooting from the free end loses no digits.
 */
#include "lab/sheet.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gsl/gsl_roots.h>
#include <math.h>

#define TOLERANCE 1e-12 /* relative */
#define STEP      1e-4  /* the first */
#define DEGREES   (180 / 3.14159265358979323846)
#define HALF_PI   1.57079632679489661923

double drape_root(double (*f)(double x, void *context), void *context, double low, double high)
{
    gsl_function function = {f, context};
    gsl_root_fsolver *solver = gsl_root_fsolver_alloc(gsl_root_fsolver_brent);
    if (!solver || gsl_root_fsolver_set(solver, &function, low, high)) {
        gsl_root_fsolver_free(solver);
        return NAN;
    }
    for (int k = 0; k < 200 && high - low > 1e-14 * fabs(high); k++) {
        gsl_root_fsolver_iterate(solver);
        low = gsl_root_fsolver_x_lower(solver);
        high = gsl_root_fsolver_x_upper(solver);
    }
    const double root = gsl_root_fsolver_root(solver);
    gsl_root_fsolver_free(solver);
    return root;
}

int drape_ode(int (*rate)(double t, const double y[], double dy[], void *context), void *context, size_t n,
              double step, double tolerance, double *y)
{
    gsl_odeiv2_system system = {rate, NULL, n, context};
    gsl_odeiv2_driver *driver =
        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, step, tolerance, TOLERANCE);
    double t = 0;
    const int status = driver ? gsl_odeiv2_driver_apply(driver, &t, 1, y) : GSL_ENOMEM;
    if (status)
        y[0] = NAN;
    if (driver)
        gsl_odeiv2_driver_free(driver);
    return status;
}

typedef struct rod {
    double weight, force;
} rod;

/* y: psi, psi', drop, reach. Beyond the horizontal the rod is continued straight, so that psi(1) rises with
 * psi(0): otherwise it would turn over, and there would be more than one root. */
static int rod_rate(double t, const double y[], double dy[], void *context)
{
    const rod *r = context;
    dy[0] = y[1];
    dy[1] = y[0] < HALF_PI ? (r->weight * t + r->force) * sin(y[0]) : 0;
    dy[2] = cos(y[0]);
    dy[3] = sin(y[0]);
    return GSL_SUCCESS;
}

static double overshoot(double log_tip, void *context)
{
    double y[4] = {exp(log_tip), 0, 0, 0};
    drape_ode(rod_rate, context, 4, STEP, TOLERANCE * 1e-12, y);
    return y[0] - HALF_PI;
}

void drape_rod_tip(double weight, double force, double *drop, double *reach)
{
    rod r = {weight, force};
    /* psi(1) >= psi(0), and <= psi(0) cosh sqrt(G + P). */
    const double growth = sqrt(weight + force), least = log(HALF_PI) - growth - 1;
    double y[4] = {exp(drape_root(overshoot, &r, least, log(HALF_PI) + 0.1)), 0, 0, 0};
    drape_ode(rod_rate, &r, 4, STEP, TOLERANCE * 1e-12, y);
    *drop = y[2];
    *reach = y[3];
}

double drape_rod_chord(double weight)
{
    double drop, reach;
    drape_rod_tip(weight, 0, &drop, &reach);
    return atan2(drop, reach) * DEGREES;
}

typedef struct string {
    double power, k;
} string;

static int string_rate(double t, const double y[], double dy[], void *context)
{
    const string *s = context;
    dy[0] = y[1];
    dy[1] = -s->k * pow(t, s->power) * y[0];
    return GSL_SUCCESS;
}

static double end_of(double k, void *context)
{
    string *s = context;
    double y[2] = {1, 0};
    s->k = k;
    drape_ode(string_rate, s, 2, STEP, TOLERANCE * 1e-12, y);
    return y[0];
}

double drape_rod_threshold(double power, double low, double high)
{
    string s = {power, 0};
    return drape_root(end_of, &s, low, high);
}
