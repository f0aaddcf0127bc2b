/* chain: frequencies of a hanging chain. The strip is brought to equilibrium, then started with the velocity
 * of a mode; how long two of its periods take is read off the crossings of the mode. Steps are 1/200 of a
 * period: the implicit midpoint rule is slow by (2 pi/200)^2/12 = 8e-5; the strip is 0.05 % longer than at
 * rest. */
#include "lab/strip.h"

#include <gsl/gsl_sf_bessel.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define GRAVITY 9.81
#define STEPS   200  /* of a period */
#define SPEED   1e-2 /* [m/s] of the free end */

static const double modes[] = {1, 2, 3};

/* omega [rad/s], length 1 m: u = J0(2 omega sqrt(s/g)), s from the free end */
static double expected(double mode)
{
    return gsl_sf_bessel_zero_J0((unsigned)mode) / 2 * sqrt(GRAVITY);
}

static int scene(double mode, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 3, 'rows': 81, 'width': 0.025, "
        "'height': 1, 'orientation': 'vertical'},\n 'material': {'young_modulus': 1e6, 'poisson_ratio': 0, "
        "'thickness': 1e-3, 'areal_density': 0.1},\n 'terms': ['stretch.cst'], 'pins': [{'edge': "
        "'top'}]}],\n "
        "'gravity': [0, %g, 0], 'integrator': {'method': 'midpoint', 'dt': %.17g, 'tolerance': 1e-10}, "
        "'controller': {'type': 'fixed'}, 'duration': 1}",
        -GRAVITY, 2 * 3.14159265358979323846 / expected(mode) / STEPS);
}

/* How much of a mode there is: other modes are orthogonal to it by the mass. */
static double amplitude(const drape_reference_run *run, const double *mode)
{
    const double *mass = drape_model_masses(run->model), *x = drape_sim_positions(run->sim);
    double sum = 0;
    for (int32_t i = 0; i < drape_model_node_count(run->model); i++)
        sum += mass[i] * mode[3 * (size_t)i + 2] * x[3 * (size_t)i + 2];
    return sum;
}

/* Times of four crossings of 0 after the start: two periods. */
static drape_status swing(drape_reference_run *run, const double *mode, double dt, double *omega)
{
    double now = 0, crossing = 0;
    drape_status status = DRAPE_OK;
    int found = 0;
    for (int k = 1; !status && found < 4 && k < 4 * STEPS; k++) {
        const double before = now;
        status = drape_sim_advance(run->sim, k * dt);
        now = amplitude(run, mode);
        if (before * now < 0) {
            crossing = (k - 1 + before / (before - now)) * dt;
            found++;
        }
    }
    *omega = found == 4 ? 4 * 3.14159265358979323846 / crossing : NAN;
    return status;
}

static drape_status measure(drape_reference_run *run, double *value)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    const double *rest = drape_model_rest_positions(run->model);
    const double zero = gsl_sf_bessel_zero_J0((unsigned)run->parameter);
    double *x = calloc(2 * n, sizeof *x), *v = x + n;
    drape_status status = x ? lab_settle(run, x) : DRAPE_E_MEMORY;
    for (size_t i = 0; !status && i < n; i += 3)
        v[i + 2] = SPEED * (rest[i + 1] < 0 ? gsl_sf_bessel_J0(zero * sqrt(fmax(0, 1 + rest[i + 1]))) : 0);
    if (!status)
        status = drape_sim_set_state(run->sim, 0, x, v);
    if (!status)
        status = swing(run, v, 2 * 3.14159265358979323846 / expected(run->parameter) / STEPS, value);
    free(x);
    return status;
}

const drape_reference drape_reference_chain = {
    .entry.name = "chain",
    .entry.summary = "frequency of a hanging chain",
    .unit = "rad/s",
    .parameter = "mode",
    .model = "stretch.cst; irregular; midpoint",
    .entry.reference = "omega_n = j_0n/2 sqrt(g/L); D. Bernoulli 1733",
    .tolerance = 0.005,
    .parameters = modes,
    .case_count = sizeof modes / sizeof *modes,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
