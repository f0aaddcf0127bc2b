/* reference_buckling.c: loads at which strips buckle. Where nothing disturbs them they stay straight, and the
 * signs of the eigenvalues of the Hessian say whether that equilibrium is stable. */
#include "lab/sheet.h"

#include <math.h>

#define UNSTABLE .unit = "1", .measure = lab_unstable_modes

/* ---- An upright strip clamped at its foot, under its weight ---- */

/* The scene has it along x, with gravity along -x. */

DRAPE_REFERENCE(self_buckling, .entry.summary = "G = rho g L^3/B at which an upright strip buckles", UNSTABLE,
                DRAPE_CASES(0), .model = "stretch.cst, bend.midedge; irregular",
                .entry.reference = "theta'' + G t theta = 0; Greenhill 1881", .tolerance = 0.02,
                DRAPE_KNOWN(7.8373474389433238), .low = 0.9, .high = 1.1,
                SHEET(STRIP(0.004), .columns = 41, .rows = 4, .height = 0.04, .tolerance = 1e-11,
                      VARIED(gravity[0], -STRIP_GRAVITY(1))));

/* ---- A strip clamped at one end with its width upright buckles sideways ---- */

/* beta'' + q^2 t^4/(4 E I G J) beta = 0 (Prandtl 1899, Michell 1899): q L^3 = 12.8538 sqrt(E I G J). Over
 * B w: the strip bends about its width with E I = B w and twists with G J = E h^3 w/(6 (1 + nu)) = 2 B w/(1 +
 * nu). */

/* The sag in the plane of the strip is (h/w)^2 times that of a strip bent about its thin side. */
static int lateral_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, STRIP(0.001), .columns = 121, .rows = 5, .height = 0.03,
                      .poisson_ratio = c->parameter, .mesh = "'orientation': 'vertical'",
                      .gravity = {0, -STRIP_GRAVITY(c->load), 0}, .tolerance = 1e-10);
}

DRAPE_REFERENCE(
    lateral_buckling, .entry.summary = "rho g L^3/B at which a strip on edge buckles sideways", UNSTABLE,
    .parameter = "nu", DRAPE_CASES(0.35, 0), .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "q L^3 = 12.8538 sqrt(E I G J); Prandtl 1899, Michell 1899; Romero et al. 2021",
    .tolerance = 0.05, DRAPE_KNOWN(15.645102488786442, 18.177966416633431), .scene = lateral_scene,
    .low = 0.85, .high = 1.15);

/* Hinges on the equilateral lattice are a plate with a bending Poisson ratio of -1/3, whatever the material's
 * is: E I = (8/9) D w, G J = (8/3) D w, and q L^3 = 12.8538 sqrt(E I G J) is 19.79 D w; a plate of the
 * membrane's own 1/3 has E I = (8/9) D w and G J = (4/3) D w. */
/* The strip runs along -z. load: rho g L^3/D. */
static int hinges_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    enum { EDGES = 8, STRIPS = 240 }; /* across and along the strip */
    const double edge = 0.035 / EDGES, thickness = 1e-3, poisson = 1.0 / 3;
    const double length =
        (STRIPS - 0.5) * sqrt(3) / 2 * edge; /* two pinned rows clamp the strip between them */
    return SHEET_TEXT(text, .grid = "equilateral",
                      .mesh = SHEET_FORMAT("'edges': %d, 'strips': %d, 'edge_length': %.17g, "
                                           "'transform': {'rotate': [0, 0, 1, 90]}",
                                           EDGES, STRIPS, edge),
                      .young_modulus =
                          12 * (1 - poisson * poisson) * STRIP_RIGIDITY / (thickness * thickness * thickness),
                      .poisson_ratio = poisson, .thickness = thickness,
                      .areal_density = c->load * STRIP_RIGIDITY / (GRAVITY * pow(length, 3)),
                      .terms = "'stretch.edge', 'bend.hinge'", .pins = "{'row': 0}, {'row': 1}",
                      .gravity = {0, -GRAVITY, 0}, .tolerance = 1e-9);
}

DRAPE_REFERENCE(lateral_buckling_hinges,
                .entry.summary = "rho g L^3/D at which a strip on edge buckles sideways", UNSTABLE,
                DRAPE_CASES(0), .model = "stretch.edge, bend.hinge; equilateral",
                .entry.reference = "q L^3 = 12.8538 sqrt(E I G J); the hinges' limit: docs/validate.md",
                .tolerance = 0.05, DRAPE_KNOWN(13.993405071951049), DRAPE_DOCUMENTED(19.789663236533631),
                .scene = hinges_scene, .low = 0.85, .high = 1.15);

/* ---- A pushed strip ----
 *
 * A strip clamped upright above a table is pushed down on it by a share of its length. It buckles; its end
 * stays below the clamp as long as friction holds it there, and slips if the coefficient of friction is below
 * the ratio of the forces at the end (Sano, Yamaguchi & Wada 2017, Slip morphology of elastic strips on
 * frictional rigid substrates). With s from the clamp, the angle theta from the vertical, and N and f the
 * forces of the table times L^2/B,
 *     theta'' = -(N sin theta + f cos theta),  theta(0) = theta'(1) = 0,
 *     int cos theta = 1 - share,  int sin theta = 0
 * and the threshold is f/N, found by shooting, from the mode of a clamped and pinned column on in ten steps
 * of the share. The strip has no weight and, except during the push, no inertia; a sideways pull
 * of 1e-3 of the buckling load determines to which side it goes. */

#define RIGIDITY  1.0 /* B [N m] */
#define THICKNESS 0.02
#define DENSITY   0.1  /* [kg/m2] */
#define DISTANCE  2e-3 /* [m] of the table's barrier: the uncertainty of the push */
#define STIFFNESS 1e4  /* [Pa] of it: 20 N/m on half a cell of 25 mm are 1600 Pa */
#define ASIDE     0.2  /* [m/s2]: 0.02 of the 20.19 N/m that buckle it */
#define SLIPPED   0.05 /* [m]: an end that slips moves 0.2 m or more */

/* The strip is in contact with the table from the start, so that the push is that of the track. */
static int pushed_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(
        text, .columns = 3, .rows = 41, .width = 0.05, .height = 1, .mesh = "'orientation': 'vertical'",
        .young_modulus = 12 * RIGIDITY / (THICKNESS * THICKNESS * THICKNESS), .thickness = THICKNESS,
        .areal_density = DENSITY,
        .pins = SHEET_FORMAT("{'edge': 'top', 'clamp': true, 'track': [[0, [0, 0, 0]], [1, [0, %.17g, 0]]]}",
                             -c->parameter),
        .gravity = {0, 0, ASIDE}, .integrator = "'method': 'be'", .dt = 0.01, .tolerance = 1e-6,
        .others = SHEET_FORMAT("'colliders': [{'type': 'plane', 'point': [0, %.17g, 0], 'normal': [0, 1, 0], "
                               "'friction': %.17g}],\n 'contact': {'distance': %g, "
                               "'friction_velocity': 1e-4, 'stiffness': %g}",
                               -1 - DISTANCE / 2, c->load, DISTANCE, STIFFNESS),
        .duration = 1.5);
}

/* Returns 1 if the end stays, 0 if it slips. */
static double stays(const drape_reference_run *run)
{
    const int32_t nodes = drape_model_node_count(run->model);
    return fabs(drape_sim_positions(run->sim)[3 * (size_t)(nodes - 1) + 2]) < SLIPPED;
}

DRAPE_REFERENCE(
    pushed_strip, .entry.summary = "friction above which the end of a pushed strip stays", .unit = "1",
    .parameter = "push over length", DRAPE_CASES(0.1, 0.2),
    .model = "stretch.cst, bend.midedge; irregular; plane; be",
    .entry.reference = "theta'' + N sin theta + f cos theta = 0, mu = f/N; Sano, Yamaguchi & Wada 2017",
    .tolerance = 0.03, DRAPE_KNOWN(0.15279255537728148, 0.23777378485542236), .scene = pushed_scene,
    .value = stays, .low = 0.85, .high = 1.15);
