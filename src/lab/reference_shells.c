/*
 * reference_shells.c: thin shells whose bending is nearly isometric, where membranes of flat triangles lock.
 * The expected displacements are those that Sze, Liu & Lo (2004) tabulate under the largest load of each
 * problem. A case is a point where they are measured. A roof that snaps through has no single state under a
 * load: there the loads of points of the path of equilibria are compared.
 */
#include "lab/sheet.h"

#include <math.h>
#include <string.h>

/* The bound on residuals is 1e-6 of the largest nodal load or smaller. */
#define SHELL                                                                                                \
    .grid = "revolution", .areal_density = 1, .tolerance = 1e-6,                                             \
    .integrator = "'method': 'static', 'max_iterations': 2000"
#define TERMS "'stretch.patch', 'bend.midedge', "

#define SZE "Sze, Liu & Lo 2004, Popular benchmark problems for geometric nonlinear analysis of shells"

/* A ring, cut along a radius and clamped at one side of the cut, is lifted at the other. */
DRAPE_REFERENCE(slit_annulus, .entry.summary = "rise of a corner of a slit ring that is lifted at one side",
                .entry.reference = SZE, .unit = "m", .parameter = "corner: 0 inner, 1 outer",
                DRAPE_CASES(0, 1), .model = "stretch.patch, bend.midedge; revolution, 10 x 80 cells",
                .tolerance = 0.01, DRAPE_KNOWN(13.891, 17.528), .value = lab_displacement,
                .constants = {80, 2, 890, 2},
                SHEET(SHELL, .columns = 81, .rows = 11, .mesh = "'top_radius': 6, 'bottom_radius': 10",
                      .young_modulus = 21e6, .thickness = 0.03,
                      .terms = TERMS "{'type': 'load.line', 'edge': 'right', 'force': [0, 0.8, 0]}",
                      .pins = "{'edge': 'left', 'clamp': true}"));

/* A quarter of a hemisphere with a hole of 18 degrees, pulled outwards at one point of the equator and pushed
 * inwards at the other, in planes of symmetry that halve the loads. */
DRAPE_REFERENCE(
    pinched_hemisphere, .entry.summary = "displacement of a loaded point of a hemisphere",
    .entry.reference = SZE, .unit = "m", .parameter = "point: 0 pulled, 1 pushed", DRAPE_CASES(0, 1),
    .model = "stretch.patch, bend.midedge; revolution, 32 x 32 cells", .tolerance = 0.005,
    DRAPE_KNOWN(4.067, 8.178), .value = lab_displacement, .constants = {1056, 1, 1088, 3},
    SHEET(SHELL, .columns = 33, .rows = 33,
          .mesh = "'top_radius': 3.0901699437494745, 'bottom_radius': 10, 'height': 9.5105651629515364, "
                  "'arc_radius': 10, 'angle': 90, 'diagonals': 'parallel'",
          .young_modulus = 6.825e7, .poisson_ratio = 0.3, .thickness = 0.04,
          .terms = TERMS "{'type': 'load.point', 'node': 1056, 'force': [200, 0, 0]}, "
                         "{'type': 'load.point', 'node': 1088, 'force': [0, 0, 200]}",
          .pins = "{'edge': 'left', 'normal': [0, 0, 1], 'clamp': true}, "
                  "{'edge': 'right', 'normal': [1, 0, 0], 'clamp': true}"));

/* An eighth of an open cylinder that is pulled apart at the middle of its length. */
DRAPE_REFERENCE(cylinder_pull_out, .entry.summary = "displacement at the middle of a cylinder pulled apart",
                .entry.reference = SZE, .unit = "m", .parameter = "point: 0 pulled, 1 at the side",
                DRAPE_CASES(0, 1), .model = "stretch.patch, bend.midedge; revolution, 24 x 36 cells",
                .tolerance = 0.01, DRAPE_KNOWN(2.768, 4.551), .value = lab_displacement,
                .constants = {36, -3, 0, -1},
                SHEET(SHELL, .columns = 37, .rows = 25,
                      .mesh = "'top_radius': 4.953, 'bottom_radius': 4.953, 'height': 5.175, 'angle': 90",
                      .young_modulus = 10.5e6, .poisson_ratio = 0.3125, .thickness = 0.094,
                      .terms = TERMS "{'type': 'load.point', 'node': 36, 'force': [0, 0, -10000]}",
                      .pins = "{'edge': 'left', 'normal': [0, 0, 1], 'clamp': true}, "
                              "{'edge': 'right', 'normal': [1, 0, 0], 'clamp': true}, "
                              "{'edge': 'top', 'normal': [0, 1, 0], 'clamp': true}"));

/* ---- Hinged roofs ----
 *
 * A shallow panel of a cylinder, 508 mm square, hinged along its straight edges, under a force in the middle.
 * It snaps through; the thin one snaps back, too, so that only an arc length passes its limit points. A
 * quarter, with planes of symmetry, has a quarter of the load. Points of the path, in parts of 3000 N over
 * mm, and the loads of the first limit points are from Table 9 of the paper, whose mesh this is. Its elements
 * have transverse shear strains, these have none: 32 x 32 cells are 1.5 % above its first points, and 0.1 %
 * (thick) and 0.3 % (thin) below its limits. */

#define ROOF_LOAD 3000.0 /* [N] of the whole roof at factor 1 */

/* constants: the thickness [mm] of a roof whose load is sought at a deflection, the parameter; 0: the
 * parameter is the thickness, and the load at the first limit point is sought. */
static int roof_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(
        text, SHELL, .columns = 17, .rows = 17,
        .mesh = "'top_radius': 2.54, 'bottom_radius': 2.54, 'height': 0.254, 'angle': 5.7295779513082321",
        .young_modulus = 3102.75e6, .poisson_ratio = 0.3,
        .thickness = 1e-3 * (c->reference->constants[0] > 0 ? c->reference->constants[0] : c->parameter),
        .terms = TERMS "{'type': 'load.point', 'node': 0, 'force': [-750, 0, 0]}",
        .pins = "{'edge': 'left', 'normal': [0, 0, 1], 'clamp': true}, "
                "{'edge': 'top', 'normal': [0, 1, 0], 'clamp': true}, {'edge': 'right'}");
}

/* The last three points of a path, and what was found on it. */
typedef struct roof_path {
    const double *rest;
    double target;     /* [mm] deflection at which the load is sought; INFINITY: at the first limit point */
    double w[3], p[3]; /* [mm], [N] */
    double load;       /* [N]; NAN: not found */
} roof_path;

static drape_status roof_point(void *user, drape_sim *sim, const drape_path_point *point)
{
    roof_path *path = user;
    double *w = path->w, *p = path->p;
    memmove(w, w + 1, 2 * sizeof *w);
    memmove(p, p + 1, 2 * sizeof *p);
    w[2] = 1e3 * (path->rest[0] - drape_sim_positions(sim)[0]);
    p[2] = ROOF_LOAD * point->factor;
    if (point->number < 2 || isfinite(path->load))
        return DRAPE_OK;
    /* The coefficients of p = c0 + c1 (w - w1) + c2 (w - w1)^2 through the three points. */
    const double before = (p[1] - p[0]) / (w[1] - w[0]), after = (p[2] - p[1]) / (w[2] - w[1]);
    const double curved = (after - before) / (w[2] - w[0]);
    const double c[] = {p[1], before + curved * (w[1] - w[0]), curved};
    if (w[2] > path->target) {
        const double ahead = path->target - w[1];
        path->load = c[0] + ahead * (c[1] + ahead * c[2]);
        return DRAPE_RETRY_REJECTED; /* the path may end */
    }
    if (point->event == DRAPE_PATH_LIMIT)
        path->load = c[0] - c[1] * c[1] / (4 * c[2]);
    return DRAPE_OK;
}

/* The path goes on through the snap to the full load: that it arrives there is part of the test. */
static drape_status roof_measure(drape_reference_run *run, double *value)
{
    roof_path path = {.rest = drape_model_rest_positions(run->model),
                      .target = run->reference->constants[0] > 0 ? run->parameter : INFINITY,
                      .load = NAN};
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.max_arc = 5e-4; /* [m]: some 20 points before the limit */
    def.observer = roof_point;
    def.user = &path;
    DRAPE_TRY(drape_sim_path(run->sim, &def));
    *value = path.load;
    return DRAPE_OK;
}

DRAPE_REFERENCE(hinged_roof, .entry.summary = "load at a deflection of the middle of a hinged roof",
                .entry.reference = SZE, .unit = "N", .parameter = "deflection [mm]",
                DRAPE_CASES(0.693, 1.638, 4.477, 8.237, 10.358),
                .model = "stretch.patch, bend.midedge, load.point; revolution, 16 x 16 cells; path",
                .tolerance = 0.01,
                DRAPE_KNOWN(ROOF_LOAD * 0.0877, ROOF_LOAD * 0.1980, ROOF_LOAD * 0.4686, ROOF_LOAD * 0.6908,
                            ROOF_LOAD * 0.7412),
                .scene = roof_scene, .measure = roof_measure, .constants = {12.7});

DRAPE_REFERENCE(hinged_roof_limit, .entry.summary = "load at which a hinged roof snaps through",
                .entry.reference = SZE, .unit = "N", .parameter = "thickness [mm]", DRAPE_CASES(12.7, 6.35),
                .model = "stretch.patch, bend.midedge, load.point; revolution, 16 x 16 cells; path",
                .tolerance = 0.01, DRAPE_KNOWN(ROOF_LOAD * 0.7421, ROOF_LOAD * 0.1953), .scene = roof_scene,
                .measure = roof_measure);
