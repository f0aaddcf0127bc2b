/* pendulum: the period of two nodes on a stiff sheet that hangs from an axis, over that of small swings.
 * Steps are 1/400 of the latter: the implicit midpoint rule is slow by (2 pi/400)^2/12 = 2e-5; the sheet
 * stretches by less than 1e-4. */
#include "lab/strip.h"

#include <gsl/gsl_sf_ellint.h>
#include <math.h>
#include <stdio.h>

#define GRAVITY 9.81
#define PI      3.14159265358979323846
#define STEPS   400

static const double angles[] = {30, 90, 150};

static double expected(double degrees)
{
    return 2 / PI * gsl_sf_ellint_Kcomp(sin(degrees * PI / 360), GSL_PREC_DOUBLE);
}

static double step_size(void)
{
    return 2 * PI / sqrt(GRAVITY) / STEPS;
}

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': "
        "1, "
        "'orientation': 'vertical', 'transform': {'rotate': [1, 0, 0, %g]}},\n 'material': {'young_modulus': "
        "1e7, "
        "'poisson_ratio': 0, 'thickness': 1e-2, 'areal_density': 0.1, 'mass': 'uniform'},\n 'terms': "
        "['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'top'}]}],\n 'gravity': [0, %g, 0], "
        "'integrator': "
        "{'method': 'midpoint', 'dt': %.17g, 'tolerance': 1e-9}, 'controller': {'type': 'fixed'}, "
        "'duration': 10}",
        degrees, -GRAVITY, step_size());
}

/* From the first to the second crossing of the vertical is half a period. */
static drape_status measure(drape_lab_run *run, double *value)
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

const drape_reference drape_reference_pendulum = {
    .name = "pendulum",
    .quantity = "period over that of small swings",
    .unit = "1",
    .parameter = "degrees",
    .model = "stretch.cst, bend.midedge; square; midpoint",
    .source = "T/T0 = 2/pi K(sin(a/2))",
    .tolerance = 0.001,
    .parameters = angles,
    .case_count = sizeof angles / sizeof *angles,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
