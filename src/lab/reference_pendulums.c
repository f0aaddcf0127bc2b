/* reference_pendulums.c: the period of two nodes on a stiff sheet that hangs from an axis and is released at
 * an angle. Steps are 1/400 of the period of small swings; the sheet stretches by less than 1e-4. */
#include "lab/sheet.h"

#include <gsl/gsl_sf_ellint.h>
#include <math.h>

#define GRAVITY 9.81
#define PI      3.14159265358979323846
#define STEPS   400
#define STEP    0.0050151667017766174 /* [s] 2 pi/sqrt(g)/STEPS */

static double expected(double degrees)
{
    return 2 / PI * gsl_sf_ellint_Kcomp(sin(degrees * PI / 360), GSL_PREC_DOUBLE);
}

/* Half a period passes from the first to the second crossing of the vertical. */
static drape_status measure(drape_reference_run *run, double *value)
{
    const size_t at = 3 * 2 + 2; /* z of the first node of the lower row */
    double z = drape_sim_positions(run->sim)[at], crossing[2] = {NAN, NAN};
    drape_status status = DRAPE_OK;
    for (int k = 1, found = 0; !status && found < 2 && k < 4 * STEPS; k++) {
        const double before = z;
        status = drape_sim_advance(run->sim, k * STEP);
        z = drape_sim_positions(run->sim)[at];
        if (before * z < 0)
            crossing[found++] = k - 1 + before / (before - z);
    }
    *value = 2 * (crossing[1] - crossing[0]) / STEPS;
    return status;
}

#define PENDULUM(method)                                                                                     \
    .entry.summary = "period over that of small swings", .unit = "1", .parameter = "degrees",                \
    DRAPE_CASES(30, 90, 150), .entry.reference = "T/T0 = 2/pi K(sin(a/2))", .tolerance = 0.001,              \
    .expected = expected, .measure = measure,                                                                \
    SHEET(.grid = "square", .columns = 2, .rows = 2, .width = 1, .height = 1, .factor = 1,                   \
          .mesh = "'orientation': 'vertical', 'transform': {'rotate': [1, 0, 0, @]}", .young_modulus = 1e7,  \
          .thickness = 1e-2, .areal_density = 0.1, .material = "'mass': 'uniform'",                          \
          .pins = "{'edge': 'top'}", .gravity = {0, -GRAVITY, 0}, .integrator = "'method': " method,         \
          .dt = STEP, .others = "'controller': {'type': 'fixed'}", .duration = 10)

/* Slow by (2 pi/400)^2/12 = 2e-5 at small swings. */
DRAPE_REFERENCE(pendulum, PENDULUM("'midpoint', 'tolerance': 1e-9"),
                .model = "stretch.cst, bend.midedge; square; midpoint");

/* Slow by (2 pi/400)^2/3 = 8e-5 at small swings. */
DRAPE_REFERENCE(pendulum_bdf2, PENDULUM("'bdf2', 'tolerance': 1e-9"),
                .model = "stretch.cst, bend.midedge; square; bdf2");

/* The error is a fraction of that of bdf2. */
DRAPE_REFERENCE(pendulum_trbdf2, PENDULUM("'trbdf2', 'tolerance': 1e-9"),
                .model = "stretch.cst, bend.midedge; square; trbdf2");

/* ida chooses its steps; dt is the interval of observation. */
DRAPE_REFERENCE(pendulum_ida, PENDULUM("'ida', 'rtol': 1e-6, 'max_order': 5"),
                .model = "stretch.cst, bend.midedge; square; ida, order 5");
