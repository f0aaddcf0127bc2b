/* pendulum.c: see pendulum.h. */
#include "lab/pendulum.h"

#include <gsl/gsl_sf_ellint.h>
#include <math.h>
#include <stdio.h>

#define GRAVITY 9.81
#define PI      3.14159265358979323846
#define STEPS   400

const double pendulum_angles[PENDULUM_ANGLES] = {30, 90, 150};

double pendulum_period(double degrees)
{
    return 2 / PI * gsl_sf_ellint_Kcomp(sin(degrees * PI / 360), GSL_PREC_DOUBLE);
}

static double step_size(void)
{
    return 2 * PI / sqrt(GRAVITY) / STEPS;
}

int pendulum_scene(const char *integrator, double degrees, char *text, size_t size)
{
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': "
        "1, "
        "'orientation': 'vertical', 'transform': {'rotate': [1, 0, 0, %g]}},\n 'material': {'young_modulus': "
        "1e7, "
        "'poisson_ratio': 0, 'thickness': 1e-2, 'areal_density': 0.1, 'mass': 'uniform'},\n 'terms': "
        "['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'top'}]}],\n 'gravity': [0, %g, 0], "
        "'integrator': "
        "{%s, 'dt': %.17g}, 'controller': {'type': 'fixed'}, 'duration': 10}",
        degrees, -GRAVITY, integrator, step_size());
}

/* From the first to the second crossing of the vertical is half a period. */
drape_status pendulum_measure(drape_reference_run *run, double *value)
{
    const size_t at = 3 * 2 + 2; /* z of the first node of the lower row */
    double z = drape_sim_positions(run->sim)[at], crossing[2] = {NAN, NAN};
    drape_status status = DRAPE_OK;
    for (int k = 1, found = 0; !status && found < 2 && k < 4 * STEPS; k++) {
        const double before = z;
        status = drape_sim_advance(run->sim, k * step_size());
        z = drape_sim_positions(run->sim)[at];
        if (before * z < 0)
            crossing[found++] = k - 1 + before / (before - z);
    }
    *value = 2 * (crossing[1] - crossing[0]) / STEPS;
    return status;
}
