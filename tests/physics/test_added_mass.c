/*
 * test_added_mass.c: air.added_mass against closed forms: apparent masses, frequencies, lift and induced drag
 * of a wing of low aspect ratio, Munk's moment, what is conserved in still air and in steady wind, the
 * work of gusts, and which integrators take it. The onset of flutter is a reference of `drape validate`:
 * strip_flutter, flag_flutter.
 */
#include "assemble/check.h"
#include "base/vec3.h"
#include "support/bytes.h"
#include "support/scene.h"

#define SPAN  0.4
#define MASS  0.2                                  /* [kg/m2] of the sheet */
#define ADDED (0.78539816339744831 * 1.225 * SPAN) /* [kg/m2] */

/* A sheet of 0.5 x 0.4 m; members of its mesh, of air.added_mass, of the cloth, and of the scene follow. */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 6, 'rows': 5, 'width': 0.5, "          \
    "'height': 0.4%s}, 'material': {'young_modulus': 1e5, 'poisson_ratio': 0.3, 'thickness': 1e-3, "         \
    "'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.midedge', {'type': 'air.added_mass', 'span': "    \
    "0.4%s}]%s}], %s}"
enum { NODES = 30 };

static const char *const methods[] = {"be", "bdf2", "trbdf2", "newton_k"};
enum { METHODS = sizeof methods / sizeof *methods, EXACT = 3 /* the first ones solve to a tolerance */ };

/* ---- Closed forms ---- */

/* A free sheet that begins to fall, turned by 0.5 about x: along its normal gravity moves the air, too, and
 * along the sheet it does not. One step gives that up to rounding: the forces of second order in the velocity
 * vanish where a method evaluates them at the start, and are 1e-4 of h g elsewhere. */
TEST(apparent_mass)
{
    const double h = 1e-4, g = 9.81, n[3] = {0, cos(0.5), sin(0.5)}, t[3] = {0, -sin(0.5), cos(0.5)};
    for (int m = 0; m < METHODS; m++) {
        char turn[64], members[256];
        snprintf(turn, sizeof turn, ", 'transform': {'rotate': [1, 0, 0, %.17g]}", 0.5 * 45 / atan(1));
        snprintf(members, sizeof members,
                 "'gravity': [0, %g, 0], 'integrator': {'method': '%s', 'dt': %g}, 'duration': 1", -g,
                 methods[m], h);
        scoped_scene s = scene_open(SHEET, turn, "", "", members);
        scene_advance(&s, h);
        for (size_t i = 0; i < NODES; i++) {
            const double *v = drape_sim_velocities(s.sim) + 3 * i;
            assert_below(fabs(vec3_dot(v, n) + h * g * n[1] * MASS / (MASS + ADDED)), 2e-4 * h * g);
            assert_below(fabs(vec3_dot(v, t) + h * g * t[1]), 2e-4 * h * g);
        }
    }
}

/* The sum of the forces of air at rest on a flat sheet at an angle of attack a, and their moment about its
 * centre. */
static void forces_at(double a, const char *wake, double sum[3], double *moment)
{
    char air[128];
    snprintf(air, sizeof air, ", 'wind': [%.17g, %.17g, 0]%s", 3 * cos(a), 3 * sin(a), wake);
    scoped_scene s = scene_open(SHEET, "", air, "", "'gravity': [0, 0, 0], 'duration': 1");
    const drape_state *state = scene_state(&s);
    double g[3 * NODES], centre[3] = {0};
    drape_system_force(s.sim->system,
                       &(drape_point){.x = state->x, .v = state->v, .internal = state->internal}, g);
    memset(sum, 0, 3 * sizeof *sum);
    *moment = 0;
    for (size_t i = 0; i < 3 * NODES; i++) {
        sum[i % 3] -= g[i];
        centre[i % 3] += state->x[i] / NODES;
    }
    for (size_t i = 0; i < 3 * NODES; i += 3)
        *moment -= (state->x[i] - centre[0]) * g[i + 1];
}

/* Without its wake the air has no force on a flat sheet in steady wind, but Munk's moment m_a A U^2 sin a cos
 * a, which turns it across the wind. The wake leaves the lift m_a s U^2 sin a cos a, as a force along the
 * normal, and half of tan a times that along the sheet, into the wind, times cos^2 a: of small a, Jones's
 * lift and induced drag, in sum m_a s U^2 a and half of that times a. Rounding: 40 triangles, about 100
 * operations each. */
TEST(lift_and_moment)
{
    const double angles[] = {0, 0.02, 0.3, 1.2};
    for (int k = 0; k < 4; k++) {
        const double a = angles[k], scale = ADDED * 9, u = cos(a), b = sin(a);
        double sum[3], moment;
        forces_at(a, ", 'wake': false", sum, &moment);
        for (int i = 0; i < 3; i++)
            assert_below(fabs(sum[i]), 1e-12 * scale);
        assert_below(fabs(moment + scale * 0.5 * 0.4 * u * b), 1e-12 * scale);
        forces_at(a, "", sum, &moment);
        /* the wake leaves at the right edge alone: the side edges are along the wind */
        assert_below(fabs(sum[1] - scale * 0.4 * u * u * u * b), 1e-12 * scale);
        assert_below(fabs(sum[0] + scale * 0.4 * u * u * b * b / 2), 1e-12 * scale);
        const double drag = sum[0] * u + sum[1] * b, lift = sum[1] * u - sum[0] * b;
        if (a < 0.1) {
            assert_below(fabs(lift - scale * 0.4 * a), 4 * a * a * scale * 0.4 * a);
            assert_below(fabs(drag - scale * 0.4 * a * a / 2), 4 * a * a * scale * 0.4 * a * a / 2);
        }
    }
}

/* The first frequency of a clamped strip, 3.516 sqrt(B/(m + m_a)/L^4), by its first three passages through
 * rest. Of 20 edges the error is below half of (1.875/20)^2 = 0.9 %; that of trbdf2 with 200 steps a period
 * is far less. */
TEST(frequency_in_still_air)
{
    enum { STRIP = 63 };
    const double k = 1.8751040687, sigma = 0.7340955138, rigidity = 1e6 * 1e-9 / 12;
    for (int with = 0; with < 2; with++) {
        const double omega = k * k * sqrt(rigidity / (MASS + (with ? ADDED : 0))),
                     h = 8 * atan(1) / omega / 200;
        scoped_scene s =
            scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 21, 'rows': "
                       "3, 'width': 1, 'height': "
                       "0.1}, 'material': {'young_modulus': 1e6, 'poisson_ratio': 0, 'thickness': "
                       "1e-3, 'areal_density': "
                       "0.2}, 'terms': ['stretch.cst', 'bend.midedge', {'type': 'air.added_mass', "
                       "'span': %.17g}], 'pins': "
                       "[{'edge': 'left', 'clamp': true}]}], 'gravity': [0, 0, 0], 'integrator': "
                       "{'method': 'trbdf2', 'dt': "
                       "%.17g, 'tolerance': 1e-13}, 'duration': 100}",
                       with ? SPAN : 0.0, h);
        double v[3 * STRIP] = {0}, before = 0, zero = 0;
        ck_assert_int_eq(s.model->node_count, STRIP);
        size_t tip = 0;
        for (size_t i = 0; i < STRIP; i++)
            tip = s.model->rest[3 * i] > s.model->rest[3 * tip] ? i : tip;
        const double left = s.model->rest[3 * tip] - 1;
        for (size_t i = 0; i < STRIP; i++) {
            const double x = k * (s.model->rest[3 * i] - left);
            v[3 * i + 1] = 1e-4 * (cosh(x) - cos(x) - sigma * (sinh(x) - sin(x)));
        }
        ck_assert_int_eq(drape_sim_set_state(s.sim, 0, s.model->rest, v), DRAPE_OK);
        for (int passed = 0; passed < 3;) {
            const double t = drape_sim_time(s.sim);
            scene_advance(&s, t + h);
            const double now = drape_sim_velocities(s.sim)[3 * tip + 1];
            if (t > 0 && before * now < 0) {
                zero = t + h * before / (before - now);
                passed++;
            }
            before = now;
        }
        /* the velocity is that of cos(omega t) */
        assert_below(fabs(zero * omega / (10 * atan(1)) - 1), 4.5e-3);
    }
}

/* ---- What is conserved ---- */

/* A sheet that turns and bends. */
static void set_moving(scene *s)
{
    double v[3 * NODES];
    for (size_t i = 0; i < NODES; i++) {
        const double *x = s->model->rest + 3 * i;
        v[3 * i] = 0.4 + x[2];
        v[3 * i + 1] = 0.7 + 2 * x[0] - 3 * x[2] + 6 * x[0] * x[0];
        v[3 * i + 2] = 0.2 - 2 * x[0];
    }
    ck_assert_int_eq(drape_sim_set_state(s->sim, 0, s->model->rest, v), DRAPE_OK);
}

/* Linear momentum of sheet and air. */
static void momentum_of(scene *s, double sum[3])
{
    const drape_state *state = scene_state(s);
    double p[3 * NODES];
    drape_system_momentum(s->sim->system, &(drape_point){.x = state->x, .v = state->v, .t = state->t}, p);
    memset(sum, 0, 3 * sizeof *sum);
    for (size_t i = 0; i < 3 * NODES; i++)
        sum[i % 3] += s->model->mass[i / 3] * state->v[i] + p[i];
}

static scene open_free(const char *air, const char *method, double h)
{
    char members[256];
    snprintf(members, sizeof members,
             "'gravity': [0, 0, 0], 'integrator': {'method': '%s', 'dt': %.17g, 'tolerance': 1e-12}, "
             "'duration': 1",
             method, h);
    scene s = scene_open(SHEET, "", air, "", members);
    set_moving(&s);
    return s;
}

/* A step changes the momentum by h times the residuals that it leaves, 90 of at most the tolerance. */
TEST(momentum_is_conserved)
{
    for (int m = 0; m < EXACT; m++) {
        scoped_scene s = open_free(", 'wind': [2, 0.5, -1], 'wake': false", methods[m], 0.01);
        double before[3], after[3];
        momentum_of(&s, before);
        scene_watch(&s);
        scene_advance(&s, 0.5);
        momentum_of(&s, after);
        ck_assert_int_eq(s.unconverged, 0);
        for (int k = 0; k < 3; k++)
            assert_below(fabs(after[k] - before[k]),
                         0.5 * 3 * NODES * fmax(s.residual, 1e-12) + 1e-13 * MASS * 0.2);
    }
}

/* All of it moves with the pins of the track below. */
static void set_carried(scene *s)
{
    double v[3 * NODES] = {0};
    for (size_t i = 0; i < NODES; i++)
        v[3 * i + 1] = 0.5;
    ck_assert_int_eq(drape_sim_set_state(s->sim, 0, s->model->rest, v), DRAPE_OK);
}

/* The energy that an account misses over 0.1 s, by steps of that size, with the wake, in wind that rises, and
 * of a sheet that pins carry. */
static double missed(const char *air, const char *cloth, const char *method, double h)
{
    char members[256];
    snprintf(members, sizeof members,
             "'gravity': [0, 0, 0], 'integrator': {'method': '%s', 'dt': %.17g, 'tolerance': 1e-11}, "
             "'duration': 1",
             method, h);
    scoped_scene s = scene_open(SHEET, "", air, cloth, members);
    if (*cloth)
        set_carried(&s);
    else
        set_moving(&s);
    scene_advance(&s, 0.1);
    const double numerical = drape_sim_energy(s.sim).numerical;
    return numerical;
}

/* Second-order methods miss an energy of second order: a quarter at half the step, or less. */
TEST(account_of_energy)
{
    static const struct {
        const char *air, *cloth;
    } cases[] = {{"", ""},
                 {", 'wake': false", ""},
                 {", 'wind': [3, 1, 0.5]", ""},
                 {", 'wind': [3, 1, 0.5], 'ramp': 0.12", ""},
                 {", 'wind': [3, 1, 0.5]",
                  ", 'pins': [{'edge': 'left', 'track': [[0, [0, 0, 0]], [0.2, [0, 0.1, 0]]]}]"}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++)
        for (int m = 1; m < EXACT; m++) {
            const double coarse = missed(cases[k].air, cases[k].cloth, methods[m], 1e-3),
                         fine = missed(cases[k].air, cases[k].cloth, methods[m], 5e-4);
            assert_below(fabs(fine), 0.35 * fabs(coarse) + 1e-9);
        }
}

/* ---- Integration ---- */

static void blow(void *user, double t, int32_t count, const double *x, double *w, double *gradient)
{
    (void)user;
    for (int32_t i = 0; i < count; i++) {
        w[3 * i] += 3 + 2 * t + 0.5 * x[3 * i + 1];
        w[3 * i + 1] += 1;
        if (gradient)
            gradient[9 * i + 1] += 0.5;
    }
}

/* The wind of a host is felt as that of the scene, its derivatives are exact, and its work is counted. */
TEST(wind_of_a_host)
{
    static drape_check_result rows[DRAPE_MAX_CHECK_RESULTS];
    int count = 0;
    double numerical[2];
    for (int k = 0; k < 2; k++) {
        scoped_scene s = open_free("", "trbdf2", 1e-3 / (1 + k));
        ck_assert_int_eq(drape_sim_set_wind(s.sim, blow, NULL), DRAPE_OK);
        set_moving(&s);
        ck_assert_int_eq(drape_check_derivatives(s.ctx, s.sim->system, 5, rows, &count), DRAPE_OK);
        for (int i = 0; i < count; i++)
            ck_assert_msg(rows[i].pass, "%s of %s is off by %g", rows[i].what, rows[i].term, rows[i].error);
        scene_advance(&s, 0.1);
        numerical[k] = drape_sim_energy(s.sim).numerical;
    }
    assert_below(fabs(numerical[1]), 0.35 * fabs(numerical[0]));
}
