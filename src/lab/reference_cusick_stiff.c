/* cusick_stiff: the overhang of a drape tester where it is so stiff that it hardly bends: a plate between two circles, clamped
 * at the inner, free at the outer, under its weight q. With r over the outer radius a, b the inner one,
 *     w D/(q a^4) = r^4/64 + c1 + c2 ln r + c3 r^2 + c4 r^2 ln r,
 *     w = w' = 0 at b;  w'' + nu w'/r = 0 and (w'' + w'/r)' = 0 at 1
 * (Timoshenko & Woinowsky-Krieger 1959, Theory of Plates and Shells, 3). */
#include "lab/cusick.h"
#include "lab/strip.h"

#include <gsl/gsl_linalg.h>
#include <math.h>
#include <stdio.h>

#define ROWS      21
#define SPOKES    180
#define THICKNESS 0.01
#define RIGIDITY  1.0 /* D [N m] */
#define GRAVITY   9.81
#define DENSITY   0.1 /* [kg/m2]: it bends by some 1e-3 of its thickness */

static const double ratios[] = {0.3, 0};

/* What the powers r^4/64, 1, ln r, r^2, r^2 ln r give in a condition. */
typedef struct condition {
    double load, by[4];
} condition;

static void conditions(double b, double nu, condition out[4])
{
    const double l = log(b);
    out[0] = (condition){pow(b, 4) / 64, {1, l, b * b, b * b * l}};
    out[1] = (condition){pow(b, 3) / 16, {0, 1 / b, 2 * b, b * (2 * l + 1)}};
    out[2] = (condition){(3 + nu) / 16, {0, nu - 1, 2 * (1 + nu), 3 + nu}};
    out[3] = (condition){1.0 / 2, {0, 0, 0, 4}};
}

/* At r = 1. */
static double expected(double nu)
{
    condition rows[4];
    double matrix[16], right[4], unknown[4];
    int sign;
    size_t order[4];
    conditions(CUSICK_INNER / CUSICK_OUTER, nu, rows);
    for (int i = 0; i < 4; i++) {
        right[i] = -rows[i].load;
        for (int k = 0; k < 4; k++)
            matrix[4 * i + k] = rows[i].by[k];
    }
    gsl_matrix_view m = gsl_matrix_view_array(matrix, 4, 4);
    gsl_vector_view b = gsl_vector_view_array(right, 4), c = gsl_vector_view_array(unknown, 4);
    gsl_permutation p = {4, order};
    if (gsl_linalg_LU_decomp(&m.matrix, &p, &sign) ||
        gsl_linalg_LU_solve(&m.matrix, &p, &b.vector, &c.vector))
        return NAN;
    return 1.0 / 64 + unknown[0] + unknown[2];
}

static int scene(double nu, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'annulus', 'rows': %d, 'columns': %d, 'inner_radius': %g, "
        "'outer_radius': %g},\n 'material': {'young_modulus': %.17g, 'poisson_ratio': %.17g, 'thickness': "
        "%g, "
        "'areal_density': %g},\n 'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'top', 'clamp': "
        "true}]}],\n 'gravity': [0, %g, 0], 'integrator': {'method': 'static', 'tolerance': 1e-9}, "
        "'duration': "
        "1}",
        ROWS, SPOKES, CUSICK_INNER, CUSICK_OUTER,
        12 * (1 - nu * nu) * RIGIDITY / (THICKNESS * THICKNESS * THICKNESS), nu, THICKNESS, DENSITY,
        -GRAVITY);
}

/* The mean of the outer rim. */
static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    const int32_t nodes = drape_model_node_count(run->model);
    const double *x = drape_sim_positions(run->sim);
    double sum = 0;
    for (int32_t i = nodes - SPOKES; i < nodes; i++)
        sum -= x[3 * (size_t)i + 1];
    *value = sum / SPOKES * RIGIDITY / (DENSITY * GRAVITY * pow(CUSICK_OUTER, 4));
    return status;
}

const drape_reference drape_reference_cusick_stiff = {
    .entry.name = "cusick_stiff",
    .entry.summary = "sinking of the rim of a drape tester's overhang w D/(q a^4)",
    .unit = "1",
    .parameter = "nu",
    .model = "stretch.cst, bend.midedge; annulus",
    .entry.reference = "plate between two circles; Timoshenko & Woinowsky-Krieger 1959, 3",
    .tolerance = 0.005,
    .parameters = ratios,
    .case_count = sizeof ratios / sizeof *ratios,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
