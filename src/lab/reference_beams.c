/* reference_beams.c: strips clamped horizontally at one end, at rest under loads, against rods. Without
 * lateral contraction (nu = 0) strip and rod are the same. */
#include "lab/sheet.h"

#include <math.h>

#define BEAM .model = "stretch.cst, bend.midedge; irregular"

/* Most strips: their mesh and thickness. */
#define NARROW(h) STRIP(h), .columns = 81, .rows = 4, .height = 0.02

/* ---- Under its own weight: a case is G = rho g L^3/B ----
 *
 * What is expected here, of the deflection under a force, and of the loads in reference_buckling.c, is by
 * shooting from the free end, with steps of order 8 that keep errors below 1e-12. */

/* At small G the membrane is soft, so that forces are far above the rounding of membrane forces; at large G
 * the sheet is thin, so that its stretch stays below 1e-4. */
static int heavy_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const double h = c->parameter > 5 ? 0.004 : 0.02;
    return SHEET_TEXT(text, STRIP(h), .columns = c->parameter > 50 ? 201 : 81, .rows = 4, .height = 0.02,
                      .gravity = {0, -STRIP_GRAVITY(c->parameter), 0},
                      .tolerance = c->parameter * 1e-13); /* at most a thousandth of the weight of a node */
}

static double slope_of(const drape_reference_run *run)
{
    double tip[3];
    lab_tip(run, tip);
    return -tip[1] / tip[0];
}

DRAPE_REFERENCE(
    cantilever, .entry.summary = "drop of the end over its reach", .unit = "1",
    .parameter = "G = rho g L^3/B", DRAPE_CASES(0.01, 0.1, 1, 10, 100, 1000), BEAM,
    .entry.reference = "theta'' + G (1 - s) cos theta = 0; Romero et al. 2021, the cantilever test",
    .tolerance = 0.01,
    DRAPE_KNOWN(0.0012499995535724228, 0.012499553655398449, 0.12456176644170086, 1.0668023204331165,
                5.8881046233274752, 21.335440499922601),
    .scene = heavy_scene, .value = slope_of);

/* ASTM D1388 pushes a strip over an edge until the chord to its end falls to 41.5 degrees, and takes the
 * bending length as half of the overhang: there G = 8, within 0.04 %. */
DRAPE_REFERENCE(bending_length, .entry.summary = "angle of the chord to the end", .unit = "degree",
                .parameter = "G = rho g L^3/B", DRAPE_CASES(8), BEAM,
                .entry.reference = "ASTM D1388; Peirce 1930, The handle of cloth as a measurable quantity",
                .tolerance = 0.005, DRAPE_KNOWN(ROD_CHORD), .value = lab_chord,
                SHEET(NARROW(0.004), .tolerance = 1e-12, VARIED(gravity[1], -STRIP_GRAVITY(1))));

/* ---- A force at the end that stays vertical ---- */

DRAPE_REFERENCE(
    end_load, .entry.summary = "deflection of the end w/L", .unit = "1", .parameter = "P L^2/B",
    DRAPE_CASES(1, 2, 4), .model = "stretch.cst, bend.midedge, load.line; irregular",
    .entry.reference =
        "theta'' + P cos theta = 0; Bisshopp & Drucker 1945, Large deflection of cantilever beams",
    .tolerance = 0.005, DRAPE_KNOWN(0.30172077379983125, 0.49345748039674453, 0.66996418127769808),
    .value = lab_sinking,
    SHEET(NARROW(0.004), .tolerance = 1e-12, .factor = -STRIP_RIGIDITY,
          .terms = "'stretch.cst', 'bend.midedge', "
                   "{'type': 'load.line', 'edge': 'right', 'force': [0, @, 0]}"));

/* ---- Strips that become arcs: by a moment at the end, M/B, or by their rest shape ---- */

static double arc_rise(double curvature)
{
    return (1 - cos(curvature)) / curvature;
}

DRAPE_REFERENCE(end_moment, .entry.summary = "rise of the end w/L", .unit = "1", .parameter = "M L/B",
                DRAPE_CASES(0.3, 1, 2, 3.1415926535897932,
                            4.7123889803846899), /* to three quarters of a circle */
                .model = "stretch.cst, bend.midedge, load.moment; irregular",
                .entry.reference = "an arc of curvature M/B", .tolerance = 0.005, .expected = arc_rise,
                .value = lab_rise,
                SHEET(NARROW(0.01), .tolerance = 1e-11, .factor = STRIP_RIGIDITY,
                      .terms = "'stretch.cst', 'bend.midedge', "
                               "{'type': 'load.moment', 'edge': 'right', 'moment': @}"));

/* Two clamps turned against each other by half of the angle each, of which the right one slides along x: the
 * moment and with it the curvature is the same everywhere, and E = B kappa^2 L w/2. */
static double rolled_energy(double angle)
{
    return angle * angle / 2;
}

static double energy_of_roll(const drape_reference_run *run)
{
    return drape_sim_energy(run->sim).elastic / (STRIP_RIGIDITY * 0.05);
}

DRAPE_REFERENCE(
    rolled_strip, .entry.summary = "energy of a strip between clamps that turn, E L/(B w)", .unit = "1",
    .parameter = "angle [rad]", DRAPE_CASES(0.5, 1, 2, 3.1415926535897932),
    .model = "stretch.cst, bend.midedge; irregular", .entry.reference = "an arc: angle^2/2",
    .tolerance = 0.001, .expected = rolled_energy, .value = energy_of_roll,
    SHEET(FREE_STRIP(0.01), .columns = 41, .rows = 4, .height = 0.05, .tolerance = 1e-10,
          .factor = 90 / 3.1415926535897932,
          .pins = "{'edge': 'left', 'clamp': true, 'turns': [{'time': 0, 'rotate': [0, 0, 1, 0]}, "
                  "{'time': 1, 'rotate': [0, 0, 1, @]}]},\n "
                  "{'edge': 'right', 'clamp': true, 'axis': [1, 0, 0], 'turns': "
                  "[{'time': 0, 'rotate': [0, 0, 1, 0]}, {'time': 1, 'rotate': [0, 0, -1, @]}]}"));

DRAPE_REFERENCE(rest_curvature, .entry.summary = "rise of the end w/L", .unit = "1",
                .parameter = "curvature L", DRAPE_CASES(1, 3.14159265358979323846), BEAM,
                .entry.reference = "an arc", .tolerance = 0.005, .expected = arc_rise, .value = lab_rise,
                /* It starts flat. */
                SHEET(NARROW(0.02), .tolerance = 1e-12, .factor = 1,
                      .terms = "'stretch.cst', {'type': 'bend.midedge', 'curvature': [@, 0, 0]}"));
