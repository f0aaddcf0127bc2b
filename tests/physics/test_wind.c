/* test_wind.c: drag.wind against closed forms: the force on a flat sheet, a sheet that falls horizontally,
 * and one that the wind carries along. */
#include "support/scene.h"

#include "assemble/check.h"
#include "base/vec3.h"

#define DENSITY     1.225 /* of the air [kg/m3] */
#define COEFFICIENT 1.17

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 5, 'width': 0.5, "             \
    "'height': 0.4%s}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': "     \
    "['stretch.edge', 'bend.hinge', {'type': 'drag.wind', 'wind': [%g, %g, %g]}]}], "                        \
    "'gravity': [0, %g, 0], 'integrator': {'dt': 0.01, 'tolerance': 1e-12}, 'duration': 1}"

/* The sum over the nodes is 1/2 rho C A |u.n| (u.n) n. Rounding: 60 triangles, about 20 operations each. */
TEST(force_on_a_flat_sheet)
{
    const double wind[3] = {3, -2, 1.5}, n[3] = {0, cos(0.5), sin(0.5)}; /* y turned about x by 0.5 */
    char turn[64];
    snprintf(turn, sizeof turn, ", 'transform': {'rotate': [1, 0, 0, %.17g]}", 0.5 * 45 / atan(1));
    scoped_scene s = scene_open(SHEET, turn, wind[0], wind[1], wind[2], 0.0);
    const drape_state *state = scene_state(&s);
    double g[90], along = vec3_dot(wind, n),
                  force = 0.5 * DENSITY * COEFFICIENT * 0.5 * 0.4 * fabs(along) * along;
    ck_assert_int_eq(s.model->node_count, 30);
    drape_system_force(s.sim->system,
                       &(drape_point){.x = state->x, .v = state->v, .internal = state->internal}, g);
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < 30; i++)
            sum -= g[3 * i + k];
        ck_assert_double_eq_tol(sum, force * n[k], 1200 * DBL_EPSILON * fabs(force));
    }
}

/* A sheet in wind at an angle of attack a has C_N = C (4 + pi) sin a/(4 + pi sin a) along its normal
 * (Rayleigh 1876), and friction along it; both derivatives. */
TEST(plate_and_friction)
{
    enum { NODES = 30 };
    static drape_check_result rows[DRAPE_MAX_CHECK_RESULTS];
    const double pi = 4 * atan(1), degrees[] = {2, 20, 60, 90, 135};
    for (int k = 0; k < 5; k++) {
        const double a = degrees[k] * pi / 180, speed = 3;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 5, 'width': "
            "0.5, 'height': 0.4}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': "
            "200}, 'terms': ['stretch.edge', {'type': 'drag.wind', 'law': 'plate', 'coefficient': "
            "0.88, 'friction': 0.03, 'wind': [%.17g, %.17g, 0]}]}], 'gravity': [0, 0, 0], "
            "'integrator': {'dt': 0.01}, 'duration': 1}",
            speed * cos(a), speed * sin(a));
        const drape_state *state = scene_state(&s);
        const double scale = 0.5 * DENSITY * 0.5 * 0.4 * speed * speed,
                     normal = scale * 0.88 * (4 + pi) * sin(a) / (4 + pi * sin(a)),
                     along = scale * 0.03 * cos(a) * fabs(cos(a));
        double g[3 * NODES], sum[3] = {0};
        int count = 0;
        drape_system_force(s.sim->system,
                           &(drape_point){.x = state->x, .v = state->v, .internal = state->internal}, g);
        for (int i = 0; i < 3 * NODES; i++)
            sum[i % 3] -= g[i];
        /* Rounding: 40 triangles, about 50 operations each. */
        ck_assert_double_eq_tol(sum[0], along, 2000 * DBL_EPSILON * scale);
        ck_assert_double_eq_tol(sum[1], normal, 2000 * DBL_EPSILON * scale);
        ck_assert_double_eq_tol(sum[2], 0, 2000 * DBL_EPSILON * scale);
        ck_assert_int_eq(drape_check_derivatives(s.ctx, s.sim->system, 3, rows, &count), DRAPE_OK);
        for (int i = 0; i < count; i++)
            ck_assert_msg(rows[i].pass, "%s of %s is off by %g", rows[i].what, rows[i].term, rows[i].error);
    }
}

/* Its derivatives in a wind; the tests of all terms have it in air at rest. */
TEST(derivatives_in_a_wind)
{
    static drape_check_result rows[DRAPE_MAX_CHECK_RESULTS];
    scoped_scene s = scene_open(SHEET, "", 3.0, -2.0, 1.5, -9.81);
    int count = 0;
    ck_assert_int_eq(drape_check_derivatives(s.ctx, s.sim->system, 3, rows, &count), DRAPE_OK);
    ck_assert_int_gt(count, 0);
    for (int i = 0; i < count; i++)
        ck_assert_msg(rows[i].pass, "%s of %s is off by %g", rows[i].what, rows[i].term, rows[i].error);
}

/* A wind as a host may give it: rotating, sheared and changing with time; dw/dx is its matrix. */
static void swirl(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    static const double matrix[9] = {0.7, -2.1, 0.4, 1.9, -0.6, 0.3, -0.8, 1.1, 0.5};
    (void)user;
    for (int32_t p = 0; p < count; p++)
        for (int i = 0; i < 3; i++) {
            wind[3 * p + i] = 2.385 + t;
            for (int j = 0; j < 3; j++)
                wind[3 * p + i] += matrix[3 * i + j] * x[3 * p + j];
            for (int j = 0; gradient && j < 3; j++)
                gradient[9 * p + 3 * i + j] = matrix[3 * i + j];
        }
}

/* dg/dx includes the change of the wind as nodes move, dg/dv does not: for both drags, their sum in the
 * system, and D. */
TEST(derivatives_in_the_wind_of_a_host)
{
    static drape_check_result rows[DRAPE_MAX_CHECK_RESULTS];
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 5, "
                   "'width': 0.5, 'height': 0.4}, 'material': {'young_modulus': 1e5, 'thickness': "
                   "1e-3, 'density': 200}, 'terms': ['stretch.edge', {'type': 'drag.wind', 'wind': "
                   "[3, -2, 1.5]}, {'type': 'drag.viscous', 'coefficient': 0.7}]}], 'duration': 1}");
    for (int still = 0; still < 2; still++) {
        int count = 0, drags = 0;
        ck_assert_int_eq(drape_sim_set_wind(s.sim, still ? NULL : swirl, NULL), DRAPE_OK);
        ck_assert_int_eq(drape_check_derivatives(s.ctx, s.sim->system, 3, rows, &count), DRAPE_OK);
        for (int i = 0; i < count; i++) {
            ck_assert_msg(rows[i].pass, "%s of %s is off by %g", rows[i].what, rows[i].term, rows[i].error);
            drags += strncmp(rows[i].term, "drag.", 5) == 0;
        }
        ck_assert_int_ge(drags, 2);
    }
}

/*
 * A horizontal sheet stays flat: every node has the same share of weight and wind. Backward Euler's v1 = v0
 * + h (k u1 |u1| - g), u = w - v, k = rho C/(2 sigma), is for headwind, u1 = u0 + h g - h k u1^2, the
 * positive root u1 = (sqrt(1 + 4 h k (u0 + h g)) - 1)/(2 h k).
 * Tolerance: a residual of 1e-12 N on the smallest mass, 200 * 1e-3 * 0.01/6 kg (a corner in one triangle),
 * moves v by h r/m = 3e-11 m/s a step, n = 100 of them; the contraction of u itself is not counted.
 */
static void fall_level(double wind, double gravity)
{
    scoped_scene s = scene_open(SHEET, "", 0.0, wind, 0.0, -gravity);
    double h = 0.01, k = DENSITY * COEFFICIENT / (2 * 0.2), u = wind;
    scene_advance(&s, 1);
    for (int n = 0; n < 100; n++)
        u = (sqrt(1 + 4 * h * k * (u + h * gravity)) - 1) / (2 * h * k);
    printf("# wind %g, gravity %g: v %.12g m/s, backward Euler %.12g m/s\n", wind, gravity,
           drape_sim_velocities(s.sim)[1], wind - u);
    for (int i = 0; i < s.model->node_count; i++) {
        ck_assert_double_eq_tol(drape_sim_velocities(s.sim)[3 * i + 1], wind - u, 3e-9);
        ck_assert_double_eq_tol(drape_sim_velocities(s.sim)[3 * i], 0, 3e-9);
    }
}

TEST(a_level_sheet_falls_and_flies)
{
    fall_level(0, 9.81); /* to its terminal speed, sqrt(g/k) = 1.655 m/s */
    fall_level(4, 0);    /* the wind carries it along */
}
