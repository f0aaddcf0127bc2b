/*
 * pushed_strip: a strip clamped upright above a table is pushed down on it by a share of its length. It buckles; its end
 * stays below the clamp as long as friction holds it there, and slips if the friction is below the ratio of the forces at
 * the end (Sano, Yamaguchi & Wada 2017, Slip morphology of elastic strips on frictional rigid substrates). With s from the
 * clamp, the angle theta from the vertical, and N and f the forces of the table times L^2/B,
 *     theta'' = -(N sin theta + f cos theta),  theta(0) = theta'(1) = 0,  int cos theta = 1 - share,  int sin theta = 0
 * and the threshold is f/N. The strip has neither weight nor, but for the time of the push, inertia; a pull aside of 1e-3 of
 * the buckling load says to which side it goes.
 */
#include "lab/strip.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_multiroots.h>
#include <gsl/gsl_odeiv2.h>
#include <math.h>
#include <stdio.h>

#define RIGIDITY  1.0 /* B [N m] */
#define THICKNESS 0.02
#define DENSITY   0.1          /* [kg/m2] */
#define DISTANCE  2e-3         /* [m] of the table's barrier: all that is not known of the push */
#define STIFFNESS 1e4          /* [Pa] of it: 20 N/m on half a cell of 25 mm are 1600 Pa */
#define ASIDE     0.2          /* [m/s2]: 0.02 of the 20.19 N/m that buckle it */
#define SLIPPED   0.05         /* [m]: the end of a strip that slips goes 0.2 m or more */
#define EULER     4.4934094579 /* tan k = k */

static const double shares[] = {0.1, 0.2};

static int rate(double s, const double y[], double dy[], void *forces)
{
    (void)s;
    const double *f = forces;
    dy[0] = y[1];
    dy[1] = -(f[0] * sin(y[0]) + f[1] * cos(y[0]));
    dy[2] = cos(y[0]);
    dy[3] = sin(y[0]);
    return GSL_SUCCESS;
}

/* u: theta'(0), N, f. out: theta'(1), the place of the end. */
static int miss(const gsl_vector *u, void *share, gsl_vector *out)
{
    double forces[] = {gsl_vector_get(u, 1), gsl_vector_get(u, 2)}, y[4] = {0, gsl_vector_get(u, 0), 0, 0},
           s = 0;
    gsl_odeiv2_system system = {rate, NULL, 4, forces};
    gsl_odeiv2_driver *driver =
        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, 1e-2, 1e-12, 1e-12);
    const int status = driver ? gsl_odeiv2_driver_apply(driver, &s, 1, y) : GSL_ENOMEM;
    gsl_odeiv2_driver_free(driver);
    gsl_vector_set(out, 0, y[1]);
    gsl_vector_set(out, 1, y[2] - 1 + *(const double *)share);
    gsl_vector_set(out, 2, y[3]);
    return status;
}

/* From the mode in which a clamped and pinned column buckles, of that size: theta is -f (1 - cos k s)/k^2 + f sin(k s)/k,
 * the mean of theta^2/2 the share. */
static void guess(double share, gsl_vector *u)
{
    double mean = 0;
    for (int i = 0; i < 1000; i++) {
        const double a = EULER * (i + 0.5) / 1000, theta = sin(a) / EULER - (1 - cos(a)) / (EULER * EULER);
        mean += theta * theta / 1000;
    }
    const double f = sqrt(2 * share / mean);
    gsl_vector_set(u, 0, f);
    gsl_vector_set(u, 1, EULER * EULER);
    gsl_vector_set(u, 2, f);
}

static int solve(double share, gsl_multiroot_fsolver *solver, gsl_vector *u)
{
    gsl_multiroot_function function = {miss, 3, &share};
    int status = gsl_multiroot_fsolver_set(solver, &function, u);
    for (int k = 0; k < 100 && !status; k++) {
        status = gsl_multiroot_fsolver_iterate(solver);
        if (gsl_multiroot_test_residual(solver->f, 1e-9) == GSL_SUCCESS)
            break;
    }
    gsl_vector_memcpy(u, solver->x);
    return gsl_multiroot_test_residual(solver->f, 1e-9);
}

/* In steps of the share from small ones, where the guess is good. */
static double expected(double share)
{
    enum { STEPS = 10 };
    gsl_multiroot_fsolver *solver = gsl_multiroot_fsolver_alloc(gsl_multiroot_fsolver_hybrids, 3);
    gsl_vector *u = gsl_vector_alloc(3);
    double value = NAN;
    int status = solver && u ? GSL_SUCCESS : GSL_ENOMEM;
    if (!status)
        guess(share / STEPS, u);
    for (int k = 1; k <= STEPS && !status; k++)
        status = solve(share * k / STEPS, solver, u);
    if (!status)
        value = fabs(gsl_vector_get(u, 2)) / gsl_vector_get(u, 1);
    gsl_multiroot_fsolver_free(solver);
    gsl_vector_free(u);
    return value;
}

/* The table is touched from the beginning, so that the push is that of the track. */
static int scene(double share, double mu, char *text, size_t size)
{
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 3, 'rows': 41, 'width': 0.05, "
        "'height': 1, "
        "'orientation': 'vertical'},\n 'material': {'young_modulus': %.17g, 'poisson_ratio': 0, 'thickness': "
        "%g, "
        "'areal_density': %g},\n 'terms': ['stretch.cst', 'bend.midedge'],\n 'pins': [{'edge': 'top', "
        "'clamp': true, "
        "'track': [[0, [0, 0, 0]], [1, [0, %.17g, 0]]]}]}],\n 'gravity': [0, 0, %g], 'colliders': [{'type': "
        "'plane', "
        "'point': [0, %.17g, 0], 'normal': [0, 1, 0], 'friction': %.17g}],\n 'contact': {'distance': %g, "
        "'friction_velocity': 1e-4, 'stiffness': %g},\n 'integrator': {'method': 'be', 'dt': 0.01, "
        "'tolerance': 1e-6}, "
        "'duration': 1.5}",
        12 * RIGIDITY / (THICKNESS * THICKNESS * THICKNESS), THICKNESS, DENSITY, -share, ASIDE,
        -1 - DISTANCE / 2, mu, DISTANCE, STIFFNESS);
}

/* 1 where the end stays. */
static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    const int32_t nodes = drape_model_node_count(run->model);
    *value = fabs(drape_sim_positions(run->sim)[3 * (size_t)(nodes - 1) + 2]) < SLIPPED;
    return status;
}

const drape_reference drape_reference_pushed_strip = {
    .entry.name = "pushed_strip",
    .entry.summary = "friction above which the end of a pushed strip stays",
    .unit = "1",
    .parameter = "push over length",
    .model = "stretch.cst, bend.midedge; irregular; plane; be",
    .entry.reference = "theta'' + N sin theta + f cos theta = 0, mu = f/N; Sano, Yamaguchi & Wada 2017",
    .tolerance = 0.03,
    .parameters = shares,
    .case_count = sizeof shares / sizeof *shares,
    .expected = expected,
    .scene = scene,
    .measure = measure,
    .low = 0.85,
    .high = 1.15,
};
