/*
 * reference_inflation.c: membranes that are blown up. They bear no compression: all have stretch.tension. The
 * rims lie in planes of symmetry, in which nodes may move.
 */
#include "lab/sheet.h"

#include <gsl/gsl_sf_ellint.h>
#include <math.h>

#define INFLATED .areal_density = 1, .integrator = "'method': 'static', 'max_iterations': 2000"

/* ---- A square airbag ----
 *
 * Two flat squares with a diagonal of 1.2 m, joined along their edges: a quarter of one of them, E = 588 MPa,
 * nu = 0.4, 0.6 mm thick, under 5 kPa. The middle rises by 0.217 m (Contri & Schrefler), 0.216 m (Kang &
 * Im 1997) and to 0.218 m in other papers with a law for wrinkles. */

static double rise(const drape_reference_run *run)
{
    return drape_sim_positions(run->sim)[1];
}

DRAPE_REFERENCE(airbag_square, .entry.summary = "rise of the middle of a square airbag", .unit = "m",
                DRAPE_CASES(0), .model = "stretch.tension, load.pressure; square, 24 x 24 cells",
                .entry.reference =
                    "Contri & Schrefler 1988, A geometrically nonlinear finite element analysis of wrinkled "
                    "membrane surfaces by a no-compression material model",
                .tolerance = 0.01, DRAPE_KNOWN(0.217), .value = rise,
                SHEET(INFLATED, .grid = "square", .columns = 25, .rows = 25, .width = 0.42426406871192851,
                      .height = 0.42426406871192851, .young_modulus = 588e6, .poisson_ratio = 0.4,
                      .thickness = 6e-4, .tolerance = 1e-4,
                      .terms = "'stretch.tension', "
                               "{'type': 'load.pressure', 'pressure': 5000, 'point': [0, 0, 0]}",
                      .pins = "{'edge': 'left', 'normal': [1, 0, 0]}, {'edge': 'top', 'normal': [0, 0, 1]}, "
                              "{'edge': 'right', 'normal': [0, 1, 0]}, "
                              "{'edge': 'bottom', 'normal': [0, 1, 0]}"));

/* ---- Round ones ----
 *
 * A quarter of the upper half. The grid has a hole at the pole, whose radius of 1/50 changes the results by
 * its square. */

#define HOLE  "'top_radius': 0.02, 'bottom_radius': 1, 'angle': 90"
#define ROUND /* E h = 1000 N/m */                                                                           \
    INFLATED, .grid = "revolution", .young_modulus = 1e6, .poisson_ratio = 0.3, .thickness = 0.001,          \
              .tolerance = 1e-6,                                                                             \
              .pins = "{'edge': 'left', 'normal': [0, 0, 1]}, {'edge': 'right', 'normal': [1, 0, 0]}, "      \
                      "{'edge': 'bottom', 'normal': [0, 1, 0]}"

/* Distance of the last node, on the rim, from the axis. */
static double radius(const drape_reference_run *run)
{
    const double *x = drape_sim_positions(run->sim) + 3 * ((size_t)drape_model_node_count(run->model) - 1);
    return hypot(x[0], x[2]);
}

/* W = E h/(1 - nu) e^2 of the strain e = (l^2 - 1)/2 in all directions; d(4 pi R^2 W - p 4/3 pi R^3 l^3)/dl =
 * 0. */
static double sphere_expected(double pressure)
{
    const double p = 0.7 * pressure;
    return (p + sqrt(p * p + 4)) / 2;
}

DRAPE_REFERENCE(inflated_sphere, .entry.summary = "radius of a sphere under pressure over that at rest",
                .unit = "1", .parameter = "p R/(E h)", DRAPE_CASES(0.1, 0.3, 1),
                .model = "stretch.tension, load.follower; revolution, 24 x 24 cells",
                .entry.reference = "p R (1 - nu)/(E h) = l - 1/l, law of Saint Venant and Kirchhoff",
                .tolerance = 0.005, .expected = sphere_expected, .value = radius,
                SHEET(ROUND, .columns = 25, .rows = 25, .factor = 1000,
                      .mesh = "'height': 0.999799979995999, 'arc_radius': 1, " HOLE,
                      .terms = "'stretch.tension', {'type': 'load.follower', 'pressure': @}"));

/* Two discs that do not stretch, joined along their edges. With the modulus k = 1/sqrt 2, the radius is
 * sqrt 2/K(k) of theirs, and the thickness sqrt 2 (E(k) - K(k)/2) of the diameter, 0.599. */
static double mylar_expected(double thickness)
{
    const double k = sqrt(0.5), first = gsl_sf_ellint_Kcomp(k, GSL_PREC_DOUBLE),
                 second = gsl_sf_ellint_Ecomp(k, GSL_PREC_DOUBLE);
    return sqrt(2) * (thickness > 0 ? second - first / 2 : 1 / first);
}

static double mylar(const drape_reference_run *run)
{
    return run->parameter > 0 ? drape_sim_positions(run->sim)[1] / radius(run) : radius(run);
}

DRAPE_REFERENCE(mylar_balloon, .entry.summary = "shape of two discs that were joined and blown up",
                .unit = "1", .parameter = "0 radius over that of the discs, 1 thickness over diameter",
                DRAPE_CASES(0, 1), .model = "stretch.tension, load.follower; revolution, 16 x 16 cells",
                .entry.reference = "Paulsen 1994, What is the shape of a Mylar balloon?; Mladenov & Oprea "
                                   "2003, The Mylar balloon revisited",
                .tolerance = 0.005, .expected = mylar_expected, .value = mylar,
                /* Strains are some p r/(2 E h) = 5e-5. */
                SHEET(ROUND, .columns = 17, .rows = 17, .mesh = HOLE,
                      .terms = "'stretch.tension', {'type': 'load.follower', 'pressure': 0.1}"));
