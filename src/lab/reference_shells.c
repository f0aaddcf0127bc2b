/*
 * reference_shells.c: thin shells whose bending is nearly isometric, where membranes of flat triangles lock.
 * The expected displacements are those that Sze, Liu & Lo (2004) tabulate under the largest load of each
 * problem. A case is a point where they are measured.
 */
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
