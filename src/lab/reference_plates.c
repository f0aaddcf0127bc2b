/* reference_plates.c: the deflection w D/(q a^4) in the middle of a square plate of side a = 1 m under its
 * weight q, by D = 1 N m. It is some 1e-4 thicknesses, so that the membrane adds its square. */
#include "lab/sheet.h"

#include <gsl/gsl_multifit.h>
#include <math.h>
#include <string.h>

#define THICKNESS 0.1
#define PRESSURE  0.01 /* [Pa] */
#define PLATE_SHEET                                                                                          \
    .width = 1, .height = 1, .thickness = THICKNESS, .areal_density = 1, .gravity = {0, -PRESSURE, 0},       \
    .tolerance = 1e-10
#define EDGES(how)                                                                                           \
    "{'edge': 'left'" how "}, {'edge': 'right'" how "}, {'edge': 'top'" how "}, {'edge': 'bottom'" how "}"

/* The deflection of a plate supported on all sides, by Navier's double series, whose terms of odd m and n are
 * 16/(pi^6 m n (m^2 + n^2)^2) with alternating signs; it does not depend on nu. */
#define NAVIER 0.0040623526606737891

/* constants: the number of rows, and whether the edges are clamped. */
static int plate_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const int rows = (int)c->reference->constants[0];
    const double nu = c->parameter;
    return SHEET_TEXT(text, PLATE_SHEET, .columns = rows, .rows = rows, .poisson_ratio = nu,
                      .young_modulus = 12 * (1 - nu * nu) / (THICKNESS * THICKNESS * THICKNESS),
                      .pins = c->reference->constants[1] > 0 ? EDGES(", 'clamp': true") : EDGES(""));
}

static int hinges_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, PLATE_SHEET, .grid = "square", .columns = 49, .rows = 49,
                      .mesh = c->parameter > 0 ? "'diagonals': 'parallel'" : "'diagonals': 'alternating'",
                      .young_modulus = 12 * (1 - 1.0 / 9) / (THICKNESS * THICKNESS * THICKNESS),
                      .poisson_ratio = 1.0 / 3, .terms = "'stretch.edge', 'bend.hinge'", .pins = EDGES(""));
}

/* The deflection along -y at (x, z) at rest: of the least-squares quadratic through the nodes around. */
static double deflection(const drape_reference_run *run, double x, double z)
{
    enum { MAX_NODES = 64, TERMS = 6 };
    const double *rest = drape_model_rest_positions(run->model), *at = drape_sim_positions(run->sim);
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    /* Twice the square root of the area per node: a dozen nodes or so lie within that distance. */
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (size_t i = 0; i < nodes; i++)
        for (size_t k = 0; k < 2; k++) {
            low[k] = fmin(low[k], rest[3 * i + 2 * k]);
            high[k] = fmax(high[k], rest[3 * i + 2 * k]);
        }
    const double near = 2 * sqrt((high[0] - low[0]) * (high[1] - low[1]) / (double)nodes);
    size_t found[MAX_NODES], count = 0;
    for (size_t i = 0; i < nodes && count < MAX_NODES; i++)
        if (hypot(rest[3 * i] - x, rest[3 * i + 2] - z) < near)
            found[count++] = i;
    double powers[MAX_NODES * TERMS], y[MAX_NODES], fit[TERMS], covariance[TERMS * TERMS], squares;
    for (size_t i = 0; i < count; i++) {
        const double u = rest[3 * found[i]] - x, w = rest[3 * found[i] + 2] - z;
        memcpy(powers + i * TERMS, (const double[TERMS]){1, u, w, u * u, u * w, w * w},
               TERMS * sizeof *powers);
        y[i] = -at[3 * found[i] + 1];
    }
    gsl_multifit_linear_workspace *work = count < TERMS ? NULL : gsl_multifit_linear_alloc(count, TERMS);
    if (!work)
        return NAN;
    gsl_matrix_view p = gsl_matrix_view_array(powers, count, TERMS),
                    c = gsl_matrix_view_array(covariance, TERMS, TERMS);
    gsl_vector_view v = gsl_vector_view_array(y, count), f = gsl_vector_view_array(fit, TERMS);
    const int failed = gsl_multifit_linear(&p.matrix, &v.vector, &f.vector, &c.matrix, &squares, work);
    gsl_multifit_linear_free(work);
    return failed ? NAN : fit[0];
}

static double middle(const drape_reference_run *run)
{
    return deflection(run, 0.5, -0.5) / PRESSURE;
}

#define PLATE .entry.summary = "w D/(q a^4) in the middle", .unit = "1", .value = middle

DRAPE_REFERENCE(plate_supported, PLATE, .parameter = "nu", DRAPE_CASES(0.3, 0),
                .model = "stretch.cst, bend.midedge; irregular",
                .entry.reference = "Navier's series; Timoshenko & Woinowsky-Krieger 1959, 30",
                .tolerance = 0.005, DRAPE_KNOWN(NAVIER), .scene = plate_scene, .constants = {33, false});

/* The error falls with the square of the mesh size, from 1.2 % at 33 rows. */
DRAPE_REFERENCE(plate_clamped, PLATE, .parameter = "nu", DRAPE_CASES(0.3),
                .model = "stretch.cst, bend.midedge; irregular",
                .entry.reference = "Taylor & Govindjee 2004, Solution of clamped rectangular plate problems",
                .tolerance = 0.005, DRAPE_KNOWN(0.00126532), .scene = plate_scene, .constants = {57, true});

/* On grids of right triangles hinges do not converge to the plate: their energy is not that of an isotropic
 * one. These factors are those at 160 rows; they hold within 1 % from 40 on. */
DRAPE_REFERENCE(plate_hinges, PLATE, .parameter = "diagonals: 0 alternating, 1 parallel", DRAPE_CASES(0, 1),
                .model = "stretch.edge, bend.hinge; square",
                .entry.reference = "Navier's series; the hinges' limit: docs/validate.md", .tolerance = 0.02,
                DRAPE_KNOWN(NAVIER), DRAPE_DOCUMENTED(NAVIER * 0.744, NAVIER * 0.555), .scene = hinges_scene);
