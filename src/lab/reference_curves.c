/* reference_curves.c: virtual tests of membranes: those of stretch.curve, whose measured curves they must
 * give back, a strip of a fabric of the table that is pulled along the warp and a sheet that is sheared as
 * by KES-FB1; and a sheet of stretch.cst that is drawn out between rollers. */
#include "compile/fabrics.h"
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Advances, and sums the forces of the pins [N] on the nodes for which `component` at rest is `at` [m]. */
static drape_status pull_of(drape_reference_run *run, size_t component, double at, double force[3])
{
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    const double *rest = drape_model_rest_positions(run->model);
    double *reactions = drape_arena_take(&run->arena, 3 * nodes, sizeof *reactions);
    drape_status status = reactions ? lab_advance(run) : DRAPE_E_MEMORY;
    if (!status)
        status = drape_sim_reactions(run->sim, reactions);
    memset(force, 0, 3 * sizeof *force);
    for (size_t i = 0; !status && i < nodes; i++)
        for (size_t k = 0; k < 3 && fabs(rest[3 * i + component] - at) < 1e-9; k++)
            force[k] += reactions[3 * i + k];
    return status;
}

/* ---- Tension: the knit of the t-shirt, which stiffens twelvefold ----
 *
 * Wang et al.'s law: c goes linearly from 34.477 to 405.87 N/m at a strain of 1/6, S = 2 c E, and the force
 * is S l per width at rest. The curve has sixteen points of it. */

#define SIDE 0.1 /* [m] */

static const char knit[] = "wang2011_tshirt";

static double law(double strain)
{
    int i = 1;
    while (strcmp(drape_fabrics[i].name, knit) != 0)
        i++;
    const drape_fabric *f = &drape_fabrics[i];
    const double l = 1 + strain, c = f->tension.warp + 6 * strain * (f->stretched.warp - f->tension.warp);
    return c * l * (l * l - 1) / 2;
}

static int pulled(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 5, 'rows': 5, 'width': %g, "
        "'height': %g},\n 'material': {'fabric': '%s'}, "
        "'terms': [{'type': 'stretch.curve', 'warp_direction': [1, 0, 0]}],\n "
        "'pins': [{'edge': 'left'}, "
        "{'edge': 'right', 'track': [[0, [0, 0, 0]], [1, [%.17g, 0, 0]]]}]}],\n "
        "'gravity': [0, 0, 0], 'integrator': {'method': 'be', 'dt': 0.1}, 'duration': 1}",
        SIDE, SIDE, knit, SIDE * c->parameter);
}

static drape_status measure_pull(drape_reference_run *run, double *value)
{
    double force[3];
    const drape_status status = pull_of(run, 0, SIDE, force);
    *value = force[0] / SIDE;
    return status;
}

DRAPE_REFERENCE(curve_tension, .entry.summary = "force per width of a strip pulled along the warp",
                .unit = "N/m",
                .entry.reference = "the law of Wang, O'Brien & Ramamoorthi 2011; the t-shirt's own",
                .parameter = "strain", DRAPE_CASES(0.01, 0.03, 0.06, 0.1, 0.125, 0.15),
                .model = "stretch.curve; irregular", .tolerance = 0.01, .expected = law, .scene = pulled,
                .measure = measure_pull);

/* ---- Tension between rollers: a plane that moves, whose nodes are free to come nearer to each other ----
 *
 * The strain is the same everywhere. Without a stress across, S = E (e + e^2/2) along, whatever nu is, by the
 * Green strain; the force is S (1 + e) h per width at rest. */

static double uniaxial(double strain)
{
    return 100 * (strain + strain * strain / 2) * (1 + strain);
}

static int drawn(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 5, 'rows': 5, 'width': %g, "
        "'height': %g},\n 'material': {'young_modulus': 1e5, 'poisson_ratio': 0.3, 'thickness': 1e-3, "
        "'areal_density': 0.2}, 'terms': ['stretch.cst'],\n 'pins': [{'edge': 'left', 'normal': [1, 0, 0]}, "
        "{'edge': 'right', 'normal': [1, 0, 0], 'track': [[0, [0, 0, 0]], [1, [%.17g, 0, 0]]]}, "
        "{'corner': 'top-left', 'normal': [0, 0, 1]}, {'box': [[-1, -1, -1], [1, 1, 1]], 'normal': [0, 1, "
        "0]}]}],\n 'gravity': [0, 0, 0], 'integrator': {'method': 'static', 'tolerance': 1e-10}, 'duration': "
        "1}",
        SIDE, SIDE, SIDE * c->parameter);
}

DRAPE_REFERENCE(roller_tension, .entry.summary = "force per width of a sheet drawn out between rollers",
                .unit = "N/m", .entry.reference = "uniaxial tension, Green strain", .parameter = "strain",
                DRAPE_CASES(0.01, 0.1, 0.3), .model = "stretch.cst; irregular", .tolerance = 1e-6,
                .expected = uniaxial, .scene = drawn, .measure = measure_pull);

/* ---- Shear, as KES-FB1 measures it: one edge moves along itself while a force W per length holds the sheet
 * taut ----
 *
 * The edge feels F = T3 + W tan g along itself, so T3 = F - W tan g, whatever W is: here that which the yarns
 * have that keep their lengths. All nodes of this sheet are held, so that it is sheared alike everywhere; a
 * specimen of KES, 20 cm wide and 5 cm long with free sides, feels 1.5 to 2.5 % less (40 x 10 cells). */

/* [degrees], [N/m]: of the size and shape that a KES shear test gives, but not those of a fabric. */
static const double angles[] = {0.5, 1, 2, 4, 8}, forces[] = {0.6, 0.9, 1.4, 2.3, 4.6};
#define ANGLES (int)(sizeof angles / sizeof *angles)

static double given(double degrees)
{
    int i = 0;
    while (i < ANGLES - 1 && angles[i] < degrees)
        i++;
    return forces[i];
}

/* The lower edge moves about the upper one, so that the yarns between them keep their length at the end. */
static int sheared(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    const double angle = c->parameter * (acos(-1) / 180);
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': %g, "
        "'height': %g},\n 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.1, "
        "'shear_curve': [[%g, %g], [%g, %g], [%g, %g], [%g, %g], [%g, %g]]},\n "
        "'terms': ['stretch.curve'], 'pins': [{'edge': 'top'}, "
        "{'edge': 'bottom', 'track': [[0, [0, 0, 0]], [1, [%.17g, 0, %.17g]]]}]}],\n "
        "'gravity': [0, 0, 0], 'integrator': {'method': 'be', 'dt': 0.1}, 'duration': 1}",
        SIDE, SIDE, angles[0], forces[0], angles[1], forces[1], angles[2], forces[2], angles[3], forces[3],
        angles[4], forces[4], SIDE * sin(angle), SIDE * (1 - cos(angle)));
}

/* The sheet pulls the lower edge towards the upper one, along z: W is -force[2]. */
static drape_status measure_shear(drape_reference_run *run, double *value)
{
    double force[3];
    const drape_status status = pull_of(run, 2, -SIDE, force);
    *value = (force[0] + force[2] * tan(run->parameter * (acos(-1) / 180))) / SIDE;
    return status;
}

DRAPE_REFERENCE(curve_shear, .entry.summary = "force per length of a sheared edge less W tan g",
                .unit = "N/m", .entry.reference = "the points of the scene", .parameter = "degrees",
                DRAPE_CASES(0.5, 1, 2, 4, 8), .model = "stretch.curve; square", .tolerance = 0.01,
                .expected = given, .scene = sheared, .measure = measure_shear);
