/*
 * reference_shells.c: thin shells whose bending is nearly isometric, where membranes of flat triangles lock.
 * The expected displacements are those that Sze, Liu & Lo (2004) tabulate under the largest load of each
 * problem. A case is a point where they are measured. A roof that snaps through has no single state under a
 * load: there the loads of points of the path of equilibria are compared.
 */
#include "drape/lab.h"

#include "lab/strip.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* A shell: the mesh, material and terms, pins and load of its one cloth. The bound on residuals is 1e-6 of
 * the largest nodal load or smaller. */
static int shell_scene(const char *mesh, const char *material, const char *load, const char *pins,
                       char text[DRAPE_LAB_TEXT])
{
    return snprintf(text, DRAPE_LAB_TEXT,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'revolution', %s},\n "
                    "'material': {%s, 'areal_density': 1},\n "
                    "'terms': ['stretch.patch', 'bend.midedge', %s],\n 'pins': [%s]}],\n "
                    "'gravity': [0, 0, 0], 'integrator': {'method': 'static', 'tolerance': 1e-6, "
                    "'max_iterations': 2000}, 'duration': 1}",
                    mesh, material, load, pins);
}

/* The nodes at a corner of the grid: its row and column are the first or the last ones. */
static size_t corner(const drape_reference_run *run, size_t columns, bool last_row, bool last_column)
{
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    return (last_row ? nodes - columns : 0) + (last_column ? columns - 1 : 0);
}

/* Advances; *value is the displacement of a node along an axis, with a sign. */
static drape_status measure_displacement(drape_reference_run *run, size_t node, int axis, double sign,
                                         double *value)
{
    const drape_status status = lab_advance(run);
    const size_t i = 3 * node + (size_t)axis;
    *value = sign * (drape_sim_positions(run->sim)[i] - drape_model_rest_positions(run->model)[i]);
    return status;
}

#define SZE "Sze, Liu & Lo 2004, Popular benchmark problems for geometric nonlinear analysis of shells"

/* A ring, cut along a radius and clamped at one side of the cut, is lifted at the other. */

enum { SLIT_COLUMNS = 81 };

static double slit_expected(double at_rim)
{
    return at_rim > 0 ? 17.528 : 13.891;
}

static int slit_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return shell_scene("'rows': 11, 'columns': 81, 'top_radius': 6, 'bottom_radius': 10",
                       "'young_modulus': 21e6, 'poisson_ratio': 0, 'thickness': 0.03",
                       "{'type': 'load.line', 'edge': 'right', 'force': [0, 0.8, 0]}",
                       "{'edge': 'left', 'clamp': true}", text);
}

static drape_status slit_measure(drape_reference_run *run, double *value)
{
    return measure_displacement(run, corner(run, SLIT_COLUMNS, run->parameter > 0, true), 1, 1, value);
}

DRAPE_REFERENCE(slit_annulus, .entry.summary = "rise of a corner of a slit ring that is lifted at one side",
                .entry.reference = SZE, .unit = "m", .parameter = "corner: 0 inner, 1 outer",
                DRAPE_CASES(0, 1), .model = "stretch.patch, bend.midedge; revolution, 10 x 80 cells",
                .tolerance = 0.01, .expected = slit_expected, .scene = slit_scene, .measure = slit_measure);

/* A quarter of a hemisphere with a hole of 18 degrees, pulled outwards at one point of the equator and pushed
 * inwards at the other, in planes of symmetry that halve the loads. */

enum { HEMISPHERE_COLUMNS = 33 };

static double hemisphere_expected(double inwards)
{
    return inwards > 0 ? 8.178 : 4.067;
}

static int hemisphere_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return shell_scene(
        "'rows': 33, 'columns': 33, 'top_radius': 3.0901699437494745, 'bottom_radius': 10, "
        "'height': 9.5105651629515364, 'arc_radius': 10, 'angle': 90, 'diagonals': 'parallel'",
        "'young_modulus': 6.825e7, 'poisson_ratio': 0.3, 'thickness': 0.04",
        "{'type': 'load.point', 'node': 1056, 'force': [200, 0, 0]}, {'type': 'load.point', 'node': 1088, "
        "'force': [0, 0, 200]}",
        "{'edge': 'left', 'normal': [0, 0, 1], 'clamp': true}, {'edge': 'right', 'normal': [1, 0, 0], "
        "'clamp': true}",
        text);
}

static drape_status hemisphere_measure(drape_reference_run *run, double *value)
{
    const bool inwards = run->parameter > 0;
    return measure_displacement(run, corner(run, HEMISPHERE_COLUMNS, true, inwards), inwards ? 2 : 0, 1,
                                value);
}

DRAPE_REFERENCE(pinched_hemisphere, .entry.summary = "displacement of a loaded point of a hemisphere",
                .entry.reference = SZE, .unit = "m", .parameter = "point: 0 pulled, 1 pushed",
                DRAPE_CASES(0, 1), .model = "stretch.patch, bend.midedge; revolution, 32 x 32 cells",
                .tolerance = 0.005, .expected = hemisphere_expected, .scene = hemisphere_scene,
                .measure = hemisphere_measure);

/* An eighth of an open cylinder that is pulled apart at the middle of its length. */

enum { CYLINDER_COLUMNS = 37 };

static double cylinder_expected(double at_side)
{
    return at_side > 0 ? 4.551 : 2.768;
}

static int cylinder_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return shell_scene(
        "'rows': 25, 'columns': 37, 'top_radius': 4.953, 'bottom_radius': 4.953, 'height': 5.175, "
        "'angle': 90",
        "'young_modulus': 10.5e6, 'poisson_ratio': 0.3125, 'thickness': 0.094",
        "{'type': 'load.point', 'node': 36, 'force': [0, 0, -10000]}",
        "{'edge': 'left', 'normal': [0, 0, 1], 'clamp': true}, {'edge': 'right', 'normal': [1, 0, 0], "
        "'clamp': true}, {'edge': 'top', 'normal': [0, 1, 0], 'clamp': true}",
        text);
}

static drape_status cylinder_measure(drape_reference_run *run, double *value)
{
    const bool at_side = run->parameter > 0;
    return measure_displacement(run, corner(run, CYLINDER_COLUMNS, false, !at_side), at_side ? 0 : 2, -1,
                                value);
}

DRAPE_REFERENCE(cylinder_pull_out, .entry.summary = "displacement at the middle of a cylinder pulled apart",
                .entry.reference = SZE, .unit = "m", .parameter = "point: 0 pulled, 1 at the side",
                DRAPE_CASES(0, 1), .model = "stretch.patch, bend.midedge; revolution, 24 x 36 cells",
                .tolerance = 0.01, .expected = cylinder_expected, .scene = cylinder_scene,
                .measure = cylinder_measure);

/* ---- Hinged roofs ----
 *
 * A shallow panel of a cylinder, 508 mm square, hinged along its straight edges, under a force in the middle.
 * It snaps through; the thin one snaps back, too, so that only an arc length passes its limit points. A
 * quarter, with planes of symmetry, has a quarter of the load. Points of the path, in parts of 3000 N over
 * mm, and the loads of the first limit points are from Table 9 of the paper, whose mesh this is. Its elements
 * have transverse shear strains, these have none: 32 x 32 cells are 1.5 % above its first points, and 0.1 %
 * (thick) and 0.3 % (thin) below its limits. */

#define ROOF_LOAD 3000.0 /* [N] of the whole roof at factor 1 */

static int roof_scene(double thickness, char text[DRAPE_LAB_TEXT])
{
    char material[200];
    snprintf(material, sizeof material,
             "'young_modulus': 3102.75e6, 'poisson_ratio': 0.3, 'thickness': %.17g", thickness);
    return shell_scene(
        "'rows': 17, 'columns': 17, 'top_radius': 2.54, 'bottom_radius': 2.54, 'height': 0.254, "
        "'angle': 5.7295779513082321",
        material, "{'type': 'load.point', 'node': 0, 'force': [-750, 0, 0]}",
        "{'edge': 'left', 'normal': [0, 0, 1], 'clamp': true}, {'edge': 'top', 'normal': [0, 1, 0], "
        "'clamp': true}, {'edge': 'right'}",
        text);
}

/* The last three points of a path, and what was found on it. */
typedef struct roof_path {
    const double *rest;
    double target;     /* [mm] deflection at which the load is sought; INFINITY: at the first limit point */
    double w[3], p[3]; /* [mm], [N] */
    double load;       /* [N]; NAN: not found */
} roof_path;

/* The coefficients of p = c0 + c1 (w - w1) + c2 (w - w1)^2 through the three points. */
static void roof_parabola(const roof_path *path, double c[3])
{
    const double *w = path->w, *p = path->p;
    const double before = (p[1] - p[0]) / (w[1] - w[0]), after = (p[2] - p[1]) / (w[2] - w[1]);
    c[0] = p[1];
    c[2] = (after - before) / (w[2] - w[0]);
    c[1] = before + c[2] * (w[1] - w[0]);
}

static drape_status roof_point(void *user, drape_sim *sim, const drape_path_point *point)
{
    roof_path *path = user;
    double c[3];
    memmove(path->w, path->w + 1, 2 * sizeof path->w[0]);
    memmove(path->p, path->p + 1, 2 * sizeof path->p[0]);
    path->w[2] = 1e3 * (path->rest[0] - drape_sim_positions(sim)[0]);
    path->p[2] = ROOF_LOAD * point->factor;
    if (point->number < 2 || isfinite(path->load))
        return DRAPE_OK;
    roof_parabola(path, c);
    if (path->w[2] > path->target) {
        const double w = path->target - path->w[1];
        path->load = c[0] + w * (c[1] + w * c[2]);
        return DRAPE_RETRY_REJECTED; /* the path may end */
    }
    if (point->event == DRAPE_PATH_LIMIT)
        path->load = c[0] - c[1] * c[1] / (4 * c[2]);
    return DRAPE_OK;
}

static drape_status roof_measure(drape_reference_run *run, double target, double *value)
{
    roof_path path = {.rest = drape_model_rest_positions(run->model), .target = target, .load = NAN};
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.max_arc = 5e-4; /* [m]: some 20 points before the limit */
    def.observer = roof_point;
    def.user = &path;
    const drape_status status = drape_sim_path(run->sim, &def);
    *value = path.load;
    return status;
}

static double roof_load_expected(double w)
{
    return ROOF_LOAD * (w < 1 ? 0.0877 : w < 3 ? 0.1980 : w < 5 ? 0.4686 : w < 9 ? 0.6908 : 0.7412);
}

static int roof_load_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return roof_scene(0.0127, text);
}

static drape_status roof_load_measure(drape_reference_run *run, double *value)
{
    return roof_measure(run, run->parameter, value);
}

DRAPE_REFERENCE(hinged_roof, .entry.summary = "load at a deflection of the middle of a hinged roof",
                .entry.reference = SZE, .unit = "N", .parameter = "deflection [mm]",
                DRAPE_CASES(0.693, 1.638, 4.477, 8.237, 10.358),
                .model = "stretch.patch, bend.midedge, load.point; revolution, 16 x 16 cells; path",
                .tolerance = 0.01, .expected = roof_load_expected, .scene = roof_load_scene,
                .measure = roof_load_measure);

static double roof_limit_expected(double thickness)
{
    return ROOF_LOAD * (thickness > 10 ? 0.7421 : 0.1953);
}

static int roof_limit_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    return roof_scene(1e-3 * c->parameter, text);
}

/* The path goes on through the snap to the full load: that it arrives there is part of the test. */
static drape_status roof_limit_measure(drape_reference_run *run, double *value)
{
    return roof_measure(run, INFINITY, value);
}

DRAPE_REFERENCE(hinged_roof_limit, .entry.summary = "load at which a hinged roof snaps through",
                .entry.reference = SZE, .unit = "N", .parameter = "thickness [mm]", DRAPE_CASES(12.7, 6.35),
                .model = "stretch.patch, bend.midedge, load.point; revolution, 16 x 16 cells; path",
                .tolerance = 0.01, .expected = roof_limit_expected, .scene = roof_limit_scene,
                .measure = roof_limit_measure);
