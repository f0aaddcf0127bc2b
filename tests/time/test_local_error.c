/*
 * test_local_error.c: solves that end by the local error of the step (nonlinear/stopping.h): what they leave,
 * in which units, and beside whom.
 */
#include "support/scene.h"

#define STEPS 24
#define SIDE  9

/* A sheet that hangs by a corner and swings, in units of length, mass and time. */
typedef struct units {
    double length, mass, time;
} units;

static const units metres = {1, 1, 1};

typedef struct course {
    int iterations[STEPS];
    bool by_error[STEPS];
    double x[3 * SIDE * SIDE];
    int steps;
} course;

static drape_status note(void *user, const drape_event *event)
{
    course *c = user;
    const drape_attempt *a = event->attempt;
    if (event->kind != DRAPE_EVENT_ATTEMPT || c->steps == STEPS)
        return DRAPE_OK;
    ck_assert(a->accepted && isfinite(a->error) && isfinite(a->left) && a->error >= 0 && a->left >= 0);
    c->by_error[c->steps] = strcmp(a->reason, "local_error") == 0;
    c->iterations[c->steps++] = a->iterations;
    return DRAPE_OK;
}

/* The sheet, with `others` as further cloths, and settings of the integrator. */
static void run(units u, const char *method, const char *settings, const char *others, course *c)
{
    const double dt = u.time / 64, pressure = u.mass / u.length / (u.time * u.time);
    memset(c, 0, sizeof *c);
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': %.17g,"
        "'height': %.17g}, 'material': {'young_modulus': %.17g, 'thickness': %.17g, 'areal_density': %.17g},"
        "'terms': ['stretch.cst', 'bend.hinge'], 'pins': [{'nodes': [0]}]}%s],"
        "'gravity': [0, %.17g, 0], 'integrator': {'method': '%s', 'dt': %.17g%s}, 'duration': %.17g}",
        SIDE, SIDE, u.length, u.length, 1e6 * pressure, 1e-3 * u.length,
        0.25 * u.mass / (u.length * u.length), others, -9.75 * u.length / (u.time * u.time), method, dt,
        settings, STEPS * dt);
    ck_assert_int_eq(drape_sim_observe(s.sim, note, c), DRAPE_OK);
    scene_advance(&s, STEPS * dt);
    ck_assert_int_eq(c->steps, STEPS);
    memcpy(c->x, drape_sim_positions(s.sim), sizeof c->x);
}

static int count_by_error(const course *c)
{
    int count = 0;
    for (int i = 0; i < STEPS; i++)
        count += c->by_error[i];
    return count;
}

static const char *const methods[] = {"be", "bdf2"};

/* All factors are powers of two, so that all numbers of one run are those of the other times such a power, to
 * the bit, if nothing in the rules has units of its own. */
TEST(solves_end_at_the_same_iteration_in_all_units)
{
    static course one, other;
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        run(metres, methods[m], "", "", &one);
        run((units){8, 4, 2}, methods[m], "", "", &other);
        ck_assert_int_gt(count_by_error(&one), 0);
        for (int i = 0; i < STEPS; i++)
            ck_assert(one.iterations[i] == other.iterations[i] && one.by_error[i] == other.by_error[i]);
        for (int i = 0; i < 3 * SIDE * SIDE; i++)
            ck_assert_double_eq(8 * one.x[i], other.x[i]);
    }
}

/* A heavy cloth in free fall has far more energy of inertia, and takes two iterations, fewer than the sheet
 * takes; one that hangs takes more in some steps. The positions may differ by rounding, as the factorisation
 * has another order. */
TEST(a_stranger_changes_no_end)
{
    static const char *const strangers[] = {"'thickness': 1e-3, 'areal_density': 1000}, 'terms': "
                                            "['stretch.cst'], 'velocity': [300, 0, 0]}",
                                            "'thickness': 1e-3, 'areal_density': 0.3}, 'terms': "
                                            "['stretch.cst'], 'pins': [{'nodes': [0]}]}"};
    static course alone, beside;
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        int later = 0;
        run(metres, methods[m], "", "", &alone);
        for (size_t k = 0; k < sizeof strangers / sizeof *strangers; k++) {
            char stranger[400];
            snprintf(stranger, sizeof stranger,
                     ", {'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 2, 'height': 2, "
                     "'transform': {'translate': [100, 0, 0]}}, 'material': {'young_modulus': 1e9, %s",
                     strangers[k]);
            run(metres, methods[m], "", stranger, &beside);
            for (int i = 0; i < STEPS; i++) {
                ck_assert(k == 1 || beside.iterations[i] <= 2 || beside.iterations[i] == alone.iterations[i]);
                ck_assert_int_ge(beside.iterations[i], alone.iterations[i]);
                later += k == 1 && beside.iterations[i] > alone.iterations[i];
            }
            for (int i = 0; i < 3 * SIDE * SIDE; i++)
                ck_assert_double_eq_tol(alone.x[i], beside.x[i], 1e-9);
        }
        printf("# %s: %d steps end later beside a sheet that hangs\n", methods[m], later);
        ck_assert_int_gt(later, 0);
    }
}

/* One step of backward Euler from each state of a run, to its local error and to a tight tolerance: where the
 * energy is convex along the difference x, |x| <= theta |e| in the norm of the masses, with theta = .33 and
 * e = (d - h v0)/2. The masses of the inner nodes are equal, and those at the edge half of them and less: the
 * Euclidean norms of x and e differ from those by at most a factor of 1 to 6 in m, sqrt(6). */
TEST(what_is_left_is_a_share_of_the_local_error)
{
    static const char scene_text[] =
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 1, 'height': "
        "1},"
        "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.25},"
        "'terms': ['stretch.cst', 'bend.hinge'], 'pins': [{'nodes': [0]}]}],"
        "'integrator': {'method': 'be', 'dt': 0.015625%s}, 'duration': 1}";
    scoped_scene a = scene_open(scene_text, ""), b = scene_open(scene_text, ", 'tolerance': 1e-10");
    double worst = 0, worst_estimate = INFINITY;
    for (int k = 0; k < STEPS; k++) {
        const drape_state *from = scene_state(&a);
        const double h = 1. / 64, t = from->t;
        double x0[3 * SIDE * SIDE], v0[3 * SIDE * SIDE], left = 0, own = 0;
        memcpy(x0, from->x, sizeof x0);
        memcpy(v0, from->v, sizeof v0);
        ck_assert_int_eq(drape_sim_set_state(b.sim, t, x0, v0), DRAPE_OK);
        scene_advance(&a, t + h);
        scene_advance(&b, t + h);
        for (int i = 0; i < 3 * SIDE * SIDE; i++) {
            const double x = drape_sim_positions(b.sim)[i], e = (x - x0[i] - h * v0[i]) / 2;
            left += pow(drape_sim_positions(a.sim)[i] - x, 2);
            own += e * e;
        }
        worst = fmax(worst, sqrt(left / own));
        const double estimate = drape_sim_statistics(a.sim).error_last;
        worst_estimate = fmin(worst_estimate, estimate / fmax(sqrt(left / (SIDE * SIDE)), 1e-12));
    }
    printf("# left: %g of the local error at most; the estimate is at least %g times what is left\n", worst,
           worst_estimate);
    ck_assert(worst <= 0.33 * sqrt(6));
    ck_assert(worst > 1e-9); /* the rule has ended solves */
    ck_assert(worst_estimate >= 1);
}

/* A tolerance that a scene gives is kept to, and near rest the residual ends all solves without one. */
TEST(a_tolerance_or_rest_is_solved_to_the_residual)
{
    static course c;
    run(metres, "be", ", 'tolerance': 1e-5", "", &c);
    ck_assert_int_eq(count_by_error(&c), 0);
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 1,"
                   "'height': 1, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e4,"
                   "'thickness': 1e-3, 'areal_density': 0.25}, 'terms': ['stretch.cst', 'bend.hinge',"
                   "{'type': 'damp.kelvin_voigt', 'beta': 0.05}], 'pins': [{'edge': 'top'}]}],"
                   "'integrator': {'method': 'be', 'dt': 0.05}, 'duration': 10}");
    scene_advance(&s, 9);
    scene_watch(&s);
    scene_advance(&s, 10);
    ck_assert(s.accepted >= 20 && s.residual <= drape_sim_statistics(s.sim).tolerance);
}

/* A stiff sheet of which two corners go to and fro by a seventh of its size in a step; the ball is far away,
 * but in scenes with contact no guess takes the pull of pins to all nodes. Of half of the change of its
 * motion, a seventh of its size where pins turn back, theta may be left in each step, 5 % of the size, and in
 * seven steps it was 25 %. Beside the pins the motion changes by about half of that. */
TEST(cloth_that_pins_take_along_is_solved)
{
    static const char scene_text[] =
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 20, 'rows': 20, 'width': 0.054, "
        "'height': "
        "0.054, 'orientation': 'horizontal'}, 'material': {'young_modulus': 3.9e8, 'thickness': 6.7e-4, "
        "'areal_density': 0.42}, 'terms': ['stretch.cst', 'bend.midedge', {'type': 'damp.kelvin_voigt', "
        "'beta': 0.006}], 'pins': [{'nodes': [0, 19], 'track': [[0, [0, 0, 0]], [0.058, [0.027, 0.011, 0]], "
        "[0.116, [0, 0, 0]]]}]}],"
        "'colliders': [{'type': 'sphere', 'center': [100, 0, 0], 'radius': 1}],"
        "'integrator': {'method': '%s'%s}, 'duration': 0.12}";
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        scoped_scene a = scene_open(scene_text, methods[m], ""),
                     b = scene_open(scene_text, methods[m], ", 'tolerance': 1e-8");
        double worst = 0;
        for (int k = 1; k <= 7; k++) {
            double squares = 0;
            scene_advance(&a, k / 60.);
            scene_advance(&b, k / 60.);
            for (int i = 0; i < 3 * 20 * 20; i++)
                squares += pow(drape_sim_positions(a.sim)[i] - drape_sim_positions(b.sim)[i], 2);
            worst = fmax(worst, sqrt(squares / (20 * 20)) / 0.054);
        }
        printf("# %s: %.3g of the size from the solved run\n", methods[m], worst);
        assert_below(worst, 0.15);
    }
}
