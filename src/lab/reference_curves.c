/* reference_curves.c: virtual tests of membranes: those of stretch.curve, whose measured curves they must
 * give back, a strip of a fabric of the table that is pulled along the warp and a sheet that is sheared as
 * by KES-FB1; and a sheet of stretch.cst that is drawn out between rollers. */
#include "compile/fabrics.h"
#include "lab/sheet.h"

#include <math.h>
#include <string.h>

/* ---- Tension: the knit of the t-shirt, which stiffens twelvefold ----
 *
 * Wang et al.'s law: c goes linearly from 34.477 to 405.87 N/m at a strain of 1/6, S = 2 c E, and the force
 * is S l per width at rest. The curve has sixteen points of it. */

#define SIDE 0.1 /* [m] */

/* Square sheets without gravity; the edge that moves arrives after 1 s. */
#define SQUARE .width = SIDE, .height = SIDE
#define MOVED  .integrator = "'method': 'be'", .dt = 0.1

#define KNIT "wang2011_tshirt"

static double law(double strain)
{
    int i = 1;
    while (strcmp(drape_fabrics[i].name, KNIT) != 0)
        i++;
    const drape_fabric *f = &drape_fabrics[i];
    const double l = 1 + strain, c = f->tension.warp + 6 * strain * (f->stretched.warp - f->tension.warp);
    return c * l * (l * l - 1) / 2;
}

static drape_status measure_pull(drape_reference_run *run, double *value)
{
    double force[3] = {0};
    DRAPE_TRY(lab_advance(run));
    DRAPE_TRY(lab_pull(run, 0, SIDE, force));
    *value = force[0] / SIDE;
    return DRAPE_OK;
}

DRAPE_REFERENCE(
    curve_tension, .entry.summary = "force per width of a strip pulled along the warp", .unit = "N/m",
    .entry.reference = "the law of Wang, O'Brien & Ramamoorthi 2011; the t-shirt's own",
    .parameter = "strain", DRAPE_CASES(0.01, 0.03, 0.06, 0.1, 0.125, 0.15),
    .model = "stretch.curve; irregular", .tolerance = 0.01, .expected = law, .measure = measure_pull,
    SHEET(SQUARE, MOVED, .columns = 5, .rows = 5, .material = "'fabric': '" KNIT "'",
          .terms = "{'type': 'stretch.curve', 'warp_direction': [1, 0, 0]}",
          .pins = "{'edge': 'left'}, {'edge': 'right', 'track': [[0, [0, 0, 0]], [1, [@, 0, 0]]]}",
          .factor = SIDE));

/* ---- Tension between rollers: a plane that moves, whose nodes are free to come nearer to each other ----
 *
 * The strain is the same everywhere. Without a stress across, S = E (e + e^2/2) along, whatever nu is, by the
 * Green strain; the force is S (1 + e) h per width at rest. */

static double uniaxial(double strain)
{
    return 100 * (strain + strain * strain / 2) * (1 + strain);
}

DRAPE_REFERENCE(roller_tension, .entry.summary = "force per width of a sheet drawn out between rollers",
                .unit = "N/m", .entry.reference = "uniaxial tension, Green strain", .parameter = "strain",
                DRAPE_CASES(0.01, 0.1, 0.3), .model = "stretch.cst; irregular", .tolerance = 1e-6,
                .expected = uniaxial, .measure = measure_pull,
                SHEET(SQUARE, .columns = 5, .rows = 5, .young_modulus = 1e5, .poisson_ratio = 0.3,
                      .thickness = 1e-3, .areal_density = 0.2, .terms = "'stretch.cst'", .tolerance = 1e-10,
                      .pins = "{'edge': 'left', 'normal': [1, 0, 0]}, {'edge': 'right', 'normal': [1, 0, 0], "
                              "'track': [[0, [0, 0, 0]], [1, [@, 0, 0]]]},\n {'corner': 'top-left', "
                              "'normal': [0, 0, 1]}, {'box': [[-1, -1, -1], [1, 1, 1]], 'normal': [0, 1, 0]}",
                      .factor = SIDE));

/* ---- Shear, as KES-FB1 measures it: one edge moves along itself while a force W per length holds the sheet
 * taut ----
 *
 * The edge feels F = T3 + W tan g along itself, so T3 = F - W tan g, whatever W is: here that which the yarns
 * have that keep their lengths. All nodes of this sheet are held, so that it is sheared alike everywhere; a
 * specimen of KES, 20 cm wide and 5 cm long with free sides, feels 1.5 to 2.5 % less (40 x 10 cells). */

/* The lower edge moves about the upper one, so that the yarns between them keep their length at the end. */
static int sheared(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const double angle = c->parameter * DEGREE;
    return SHEET_TEXT(
        text, SQUARE, MOVED, .grid = "square", .columns = 2, .rows = 2,
        /* [degrees], [N/m]: of the size and shape that a KES shear test gives, but not those of a fabric. */
        .material = "'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.1, "
                    "'shear_curve': [[0.5, 0.6], [1, 0.9], [2, 1.4], [4, 2.3], [8, 4.6]]",
        .terms = "'stretch.curve'",
        .pins = SHEET_FORMAT("{'edge': 'top'}, "
                             "{'edge': 'bottom', 'track': [[0, [0, 0, 0]], [1, [%.17g, 0, %.17g]]]}",
                             SIDE * sin(angle), SIDE * (1 - cos(angle))));
}

/* The sheet pulls the lower edge towards the upper one, along z: W is -force[2]. */
static drape_status measure_shear(drape_reference_run *run, double *value)
{
    double force[3] = {0};
    DRAPE_TRY(lab_advance(run));
    DRAPE_TRY(lab_pull(run, 2, -SIDE, force));
    *value = (force[0] + force[2] * tan(run->parameter * DEGREE)) / SIDE;
    return DRAPE_OK;
}

DRAPE_REFERENCE(curve_shear, .entry.summary = "force per length of a sheared edge less W tan g",
                .unit = "N/m", .entry.reference = "the points of the scene", .parameter = "degrees",
                DRAPE_CASES(0.5, 1, 2, 4, 8), .model = "stretch.curve; square", .tolerance = 0.01,
                DRAPE_KNOWN(0.6, 0.9, 1.4, 2.3, 4.6), .scene = sheared, .measure = measure_shear);
