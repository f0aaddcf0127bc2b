/* test_path.c: drape_sim_path: a truss that snaps through and a column that buckles, against closed forms;
 * steps that are rejected; refusals. test_modes.c has memory that fails. */
#include "drape/lab.h"
#include "support/scene.h"

#include <gsl/gsl_sf_ellint.h>
#include <math.h>
#include <string.h>

#define MAX_POINTS 400

typedef struct trace {
    int32_t node; /* that is observed */
    int count, limits, bifurcations, switches;
    drape_path_point point[MAX_POINTS];
    double x[MAX_POINTS][3];
} trace;

static drape_status observe(void *user, drape_sim *sim, const drape_path_point *point)
{
    trace *t = user;
    ck_assert(t->count < MAX_POINTS);
    ck_assert_int_eq(point->number, t->count);
    t->limits += point->event == DRAPE_PATH_LIMIT;
    t->bifurcations += point->event == DRAPE_PATH_BIFURCATION;
    t->switches += point->event == DRAPE_PATH_SWITCHED;
    t->point[t->count] = *point;
    memcpy(t->x[t->count++], drape_sim_positions(sim) + 3 * (size_t)t->node, sizeof t->x[0]);
    return DRAPE_OK;
}

static drape_path_def define(trace *t)
{
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.observer = observe;
    def.user = t;
    return def;
}

/* ---- A truss of four bars: von Mises's, with one free node ---- */

#define WIDE      1.0 /* half the distance of the supports along x, and along z */
#define DEEP      0.5
#define HIGH      0.1 /* of the free node */
#define STIFFNESS 1000.0
#define MASS      1.0
#define GRAVITY   1.0
#define APEX      2

/* Springs along edges; those between supports do nothing. */
static scene open_truss(void)
{
    static const double x[] = {-WIDE, 0, -DEEP, -WIDE, 0, DEEP, 0, HIGH, 0, WIDE, 0, -DEEP, WIDE, 0, DEEP};
    static const int32_t triangle[] = {0, 1, 2, 1, 4, 2, 4, 3, 2, 3, 0, 2}, held[] = {0, 1, 3, 4},
                         apex[] = {APEX};
    const drape_setting material[] = {
        {"young_modulus", 1, NULL}, {"thickness", 1e-3, NULL}, {"areal_density", 1, NULL}};
    const drape_setting spring[] = {{"stiffness", STIFFNESS, NULL}};
    const drape_entry_def term = {"spring.structural", spring, 1};
    drape_mass_def mass;
    drape_pin_def pin = pin_def();
    drape_cloth_def cloth = cloth_def();
    drape_scene_def def = scene_def();
    scene s = scene_empty();
    drape_mass_def_init(&mass, sizeof mass);
    mass.nodes = apex;
    mass.node_count = 1;
    mass.mass = MASS;
    pin.nodes = held;
    pin.node_count = 4;
    cloth.mesh.positions = x;
    cloth.mesh.node_count = 5;
    cloth.mesh.triangles = triangle;
    cloth.mesh.triangle_count = 4;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = &term;
    cloth.term_count = 1;
    cloth.pins = &pin;
    cloth.pin_count = 1;
    cloth.masses = &mass;
    cloth.mass_count = 1;
    def.cloths = &cloth;
    def.cloth_count = 1;
    def.gravity[1] = -GRAVITY;
    assert_ok(s.ctx, drape_model_create(s.ctx, &def, &s.model));
    scene_start(&s, NULL);
    return s;
}

static const double ground2 = WIDE * WIDE + DEEP * DEEP;

/* E = 4 k/2 (l - L)^2 with l^2 = b^2 + y^2, and dE/dy + f m g = 0. */
static double load_at(double y)
{
    const double l = sqrt(ground2 + y * y), rest = sqrt(ground2 + HIGH * HIGH);
    return 4 * STIFFNESS * y * (rest / l - 1) / (MASS * GRAVITY);
}

/* dE/dy is extremal where l^3 = b^2 L. */
static double limit_height(void)
{
    return sqrt(pow(ground2 * sqrt(ground2 + HIGH * HIGH), 2.0 / 3) - ground2);
}

/* Along the path the factor rises to the first limit, falls to the second, at the opposite height, and rises
 * again. Residuals of 1e-8 of the largest force, 60 N in a bar, change the factor by 1e-6/(m g) at most. */
TEST(a_truss_snaps_through)
{
    static trace t;
    scoped_scene s = open_truss();
    const double limit = limit_height();
    drape_path_def def = define(&t);
    t.node = APEX;
    def.to = 2 * load_at(limit);
    def.step = 0.1 * load_at(limit);
    def.max_arc = 0.02;
    assert_ok(s.ctx, drape_sim_path(s.sim, &def));
    double highest = 0, lowest = 0;
    for (int k = 0; k < t.count; k++) {
        const double y = t.x[k][1];
        assert_below(fabs(t.point[k].factor - load_at(y)), 1e-6);
        assert_below(hypot(t.x[k][0], t.x[k][2]), 1e-9);
        ck_assert_int_eq(t.point[k].unstable, fabs(y) < limit);
        ck_assert(t.point[k].arc >= (k ? t.point[k - 1].arc : 0));
        const double l = sqrt(ground2 + y * y), rest = sqrt(ground2 + HIGH * HIGH);
        ck_assert_double_eq_tol(t.point[k].elastic, 2 * STIFFNESS * (l - rest) * (l - rest), 1e-9);
        if (t.point[k].unstable == 0 && y > 0)
            highest = fmax(highest, t.point[k].factor);
        lowest = fmin(lowest, t.point[k].factor);
    }
    ck_assert_int_eq(t.limits, 2);
    ck_assert_int_eq(t.bifurcations, 0);
    ck_assert(t.point[t.count - 1].factor == def.to && t.x[t.count - 1][1] < -limit);
    /* Steps of 0.02 m miss the limits, where the factor is a parabola, by less than a tenth. */
    ck_assert(highest > 0.9 * load_at(limit) && lowest < -0.9 * load_at(limit));
}

/* Load control ends at the first limit: steps are at last 1e-7 of the first one, and the factor is within the
 * 1e-6/(m g) above. */
TEST(load_control_stops_at_a_limit)
{
    static trace t;
    scoped_scene s = open_truss();
    drape_path_def def = define(&t);
    t.node = APEX;
    def.to = 2 * load_at(limit_height());
    def.step = 0.1 * load_at(limit_height());
    def.load_control = true;
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_E_STEP_TOO_SMALL);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "limit point"));
    const double reached = t.point[t.count - 1].factor / load_at(limit_height());
    ck_assert(reached > 0.999 && reached <= 1 + 1e-6 / load_at(limit_height()));
    ck_assert_double_eq(drape_sim_positions(s.sim)[3 * APEX + 1], t.x[t.count - 1][1]);
}

/* ---- A column ---- */

#define RIGIDITY 1e-4
#define PI       3.14159265358979323846

/* The load at factor 1 is pi^2/4 B/L^2, at which a strip clamped at its left end buckles. */
static scene open_column(void)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 41, 'rows': 3, 'width': 1, "
        "'height': 0.04}, 'material': {'young_modulus': %.17g, 'poisson_ratio': 0, 'thickness': 0.01, "
        "'areal_density': 0.1}, 'terms': ['stretch.cst', 'bend.midedge', {'type': 'load.line', 'edge': "
        "'right', 'force': [%.17g, 0, 0]}], 'pins': [{'edge': 'left', 'clamp': true}]}], "
        "'gravity': [0, 0, 0], 'duration': 1}",
        12 * RIGIDITY / 1e-6, -PI * PI / 4 * RIGIDITY);
}

/* P = K(k)^2 B/L^2, and the end is 2 k/K L to the side, with k the sine of half of its angle: Euler. */
static double elastica(double aside)
{
    double low = 0, high = 0.9;
    for (int i = 0; i < 60; i++) {
        const double k = (low + high) / 2;
        *(2 * k / gsl_sf_ellint_Kcomp(k, GSL_PREC_DOUBLE) < aside ? &low : &high) = k;
    }
    const double k = gsl_sf_ellint_Kcomp(low, GSL_PREC_DOUBLE);
    return k * k / (PI * PI / 4);
}

/* The straight path buckles at 1; the branch is the elastica, on either side. 40 cells are within .5 %. */
TEST(a_column_follows_the_elastica)
{
    for (int side = -1; side <= 1; side += 2) {
        static trace t;
        memset(&t, 0, sizeof t);
        scoped_scene s = open_column();
        drape_path_def def = define(&t);
        double farthest = 0;
        t.node = 40;
        def.to = 1.3;
        def.branch = side;
        def.max_arc = 0.05;
        assert_ok(s.ctx, drape_sim_path(s.sim, &def));
        ck_assert_int_eq(t.switches, 1);
        ck_assert_int_eq(t.bifurcations, 0);
        bool switched = false;
        for (int k = 0; k < t.count; k++) {
            const double aside = t.x[k][1];
            switched = switched || t.point[k].event == DRAPE_PATH_SWITCHED;
            ck_assert_int_eq(t.point[k].unstable, 0);
            if (switched)
                ck_assert_double_eq_tol(t.point[k].factor / elastica(fabs(aside)), 1, 0.005);
            else
                ck_assert(t.point[k].factor < 1.005 && fabs(aside) < 1e-6);
            if (switched)
                ck_assert(side * aside > 0);
            farthest = fmax(farthest, fabs(aside));
        }
        ck_assert(farthest > 0.6);
    }
}

/* ---- A strip that has buckled between clamps, and is pushed back ---- */

/* Its paths are a loop through asymmetric shapes, all unstable but near the two symmetric ones, at factors
 * within 57, which are hardly a step away from the paths of the symmetric shapes, whose factor grows without
 * bound. A correction that goes far from the direction of the prediction lands on one of them. */
TEST(a_path_does_not_jump_to_another)
{
    static trace t;
    memset(&t, 0, sizeof t);
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 31, 'rows': 3, 'width': 1, "
        "'height': "
        "0.06}, 'material': {'young_modulus': 1200, 'poisson_ratio': 0, 'thickness': 0.01, 'areal_density': "
        "0.1}, 'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'left', 'clamp': true}, "
        "{'edge': 'right', 'clamp': true, 'track': [[0, [0, 0, 0]], [1, [-0.05, 0, 0]]]}]}], "
        "'gravity': [0, 1e-3, 0], 'integrator': {'method': 'static'}, 'duration': 1}");
    drape_path_def def = define(&t);
    scene_advance(&s, 1);
    def.from = 1;
    def.to = 20000;
    def.step = 500;
    def.max_arc = 0.01;
    def.max_points = 50;
    assert_ok(s.ctx, drape_sim_path(s.sim, &def));
    ck_assert_int_eq(t.count, 50);
    ck_assert_int_ge(t.limits, 2);
    for (int k = 0; k < t.count; k++)
        ck_assert_msg(fabs(t.point[k].factor) < 60, "point %d: factor %g", k, t.point[k].factor);
}

/* ---- Refusals ---- */

static drape_status give_up(void *user, drape_sim *sim, const drape_path_point *point)
{
    (void)user, (void)sim;
    return point->number == 3 ? DRAPE_E_FILE : DRAPE_OK;
}

static drape_status enough(void *user, drape_sim *sim, const drape_path_point *point)
{
    (void)user, (void)sim;
    return point->number == 3;
}

TEST(wrong_requests_are_refused)
{
    static trace t;
    scoped_scene s = open_truss();
    drape_path_def def = define(&t);
    drape_path_def_init(NULL, sizeof def);
    ck_assert_int_eq(drape_sim_path(NULL, &def), DRAPE_E_ARGUMENT);
    def.to = def.from;
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_E_ARGUMENT);
    def = define(&t);
    def.step = 0;
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_E_ARGUMENT);
    def = define(&t);
    def.observer = give_up;
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_E_FILE);
    def.observer = enough;
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_OK);
    scene_close(&s);
    s = scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 1, "
                   "'height': 1}, 'material': {'young_modulus': 1e3, 'thickness': 1e-2, 'areal_density': 1}, "
                   "'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'top', 'clamp': true}]}], "
                   "'colliders': [{'type': 'plane', 'point': [0, -9, 0], 'normal': [0, 1, 0]}], "
                   "'duration': 1}");
    def = define(&t);
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "without contact"));
    scene_close(&s);
    s = scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 1, "
                   "'height': 1}, 'material': {'young_modulus': 1e3, 'thickness': 1e-2, 'areal_density': 1}, "
                   "'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'top', 'clamp': true}]}], "
                   "'gravity': [0, 0, 0], 'duration': 1}");
    ck_assert_int_eq(drape_sim_path(s.sim, &def), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "no load deforms"));
}

/* ---- Loads that vary in time, and a load without a potential ---- */

#define STRIP                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 3, 'width': 1, 'height': "     \
    "0.3}, 'material': {'young_modulus': 1e6, 'poisson_ratio': 0, 'thickness': 1e-3, 'areal_density': "      \
    "0.2}, 'terms': ['stretch.cst', 'bend.midedge', {%s}], 'pins': [{'edge': 'left'}, {'edge': 'right'}]}]," \
    "'gravity': [0, 0, 0], 'integrator': {'method': 'static'}, 'duration': 1}"
#define STRIP_NODES 21

static drape_status keep_last(void *user, drape_sim *sim, const drape_path_point *point)
{
    if (point->number > 0)
        memcpy(user, drape_sim_positions(sim), 3 * STRIP_NODES * sizeof(double));
    return DRAPE_OK;
}

static void follow_strip(const char *load, double *x)
{
    scoped_scene s = scene_open(STRIP, load);
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.observer = keep_last;
    def.user = x;
    assert_ok(s.ctx, drape_sim_path(s.sim, &def));
}

/* From the start, whatever a history is there, a path has the load of the scene: the bits of one without. */
TEST(a_path_has_the_full_load)
{
    double x[2][3 * STRIP_NODES];
    follow_strip("'type': 'load.line', 'edge': 'top', 'force': [0, 1, 0]", x[0]);
    follow_strip("'type': 'load.line', 'edge': 'top', 'force': [0, 1, 0], 'ramp': 3", x[1]);
    ck_assert_mem_eq(x[0], x[1], sizeof *x);
}

/* Of a follower pressure on a strip with open sides the stiffness is not symmetric: the path ends at the
 * equilibrium that `static` finds, both to 1e-8 of the forces, 1e-7 of the size; modes are refused. */
TEST(a_follower_pressure_has_a_path_and_no_modes)
{
    static const char load[] = "'type': 'load.follower', 'pressure': 50";
    double x[3 * STRIP_NODES];
    drape_modes modes;
    follow_strip(load, x);
    scoped_scene s = scene_open(STRIP, load);
    scene_advance(&s, 1);
    for (int i = 0; i < 3 * STRIP_NODES; i++)
        ck_assert_double_eq_tol(x[i], scene_state(&s)->x[i], 1e-7);
    ck_assert_int_eq(drape_sim_modes(s.sim, NULL, &modes), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "a load that follows the cloth"));
    scene_close(&s);
    drape_modes_def def;
    drape_modes_def_init(&def, sizeof def);
    def.buckling = true;
    def.load_factor = 0;
    s = scene_open(STRIP, load);
    ck_assert_int_eq(drape_sim_modes(s.sim, &def, &modes), DRAPE_E_ARGUMENT);
}
