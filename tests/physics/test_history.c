/* test_history.c: loads that vary in time: the factors, the same bits as loads of that size, impulses and
 * work, steps that end where the course of a load has a kink; refusals. */
#include "integrators/integrator.h"
#include "model/history.h"
#include "support/scene.h"

/* ---- The factor ---- */

/* Linear and cubic through (0, 1), (1, 3), (3, 2), (4, 2): constant outside, through the values, beyond
 * none of them, the cubic with a continuous slope: a difference over d = 1e-6 misses the slope by d/2 f''
 * < 1e-5 or, at a key, twice that. A cubic over one interval is the smooth step s^2 (3 - 2 s) to the bit. */
TEST(factors_are_those_of_the_keys)
{
    double time[] = {0, 1, 3, 4}, value[] = {1, 3, 2, 2}, slope[4];
    drape_history h = {.name = "h", .key_count = 4, .time = time, .value = value};
    drape_history_slopes(4, time, value, slope);
    for (int cubic = 0; cubic < 2; cubic++) {
        h.slope = cubic ? slope : NULL;
        for (int k = 0; k < 4; k++)
            ck_assert_double_eq(drape_history_factor(&h, time[k]), value[k]);
        ck_assert_double_eq(drape_history_factor(&h, -5), 1);
        ck_assert_double_eq(drape_history_factor(&h, 7), 2);
        ck_assert_double_eq(drape_history_largest(&h), 3);
        for (double t = -1; t < 5; t += 1.0 / 64) {
            const double d = 1e-6, f = drape_history_factor(&h, t);
            const double before = (f - drape_history_factor(&h, t - d)) / d,
                         after = (drape_history_factor(&h, t + d) - f) / d;
            ck_assert(f >= 1 && f <= 3);
            if (cubic)
                assert_below(fabs(after - before), 4e-5);
        }
    }
    h.slope = NULL;
    ck_assert_double_eq(drape_history_factor(&h, 0.25), 1.5);
    ck_assert_double_eq(drape_history_factor(&h, 2.5), 2.25);
    ck_assert_double_eq(drape_history_next_kink(&h, -1, 9), 0);
    ck_assert_double_eq(drape_history_next_kink(&h, 1, 9), 3);
    ck_assert_double_eq(drape_history_next_kink(&h, 3, 9), 9); /* constant before and after t = 4 */
    double two[] = {0, 0.5}, rise[] = {0, 1}, flat[] = {0, 0};
    const drape_history ramp = {.name = "", .key_count = 2, .time = two, .value = rise, .slope = flat};
    for (double t = 0; t <= 0.5; t += 1.0 / 128)
        ck_assert_double_eq(drape_history_factor(&ramp, t), 2 * t * (2 * t) * (3 - 2 * (2 * t)));
}

/* ---- Every load ---- */

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.3, 'height': "   \
    "0.3}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': "           \
    "['stretch.cst', 'bend.midedge' %s], 'pins': [{'edge': 'left'}]}], "

/* Twice a load, and the load with the history 2: the same positions but for the order of sums, 1e-11 m. */
static const struct {
    const char *twice, *once;
} loads[] = {
    {"'type': 'load.line', 'edge': 'right', 'force': [0, 0.2, 0.4]",
     "'type': 'load.line', 'edge': 'right', 'force': [0, 0.1, 0.2]"},
    {"'type': 'load.moment', 'edge': 'right', 'moment': 0.002",
     "'type': 'load.moment', 'edge': 'right', 'moment': 0.001"},
    {"'type': 'load.point', 'node': 7, 'force': [0, 0.02, 0]",
     "'type': 'load.point', 'node': 7, 'force': [0, 0.01, 0]"},
    {"'type': 'load.pressure', 'pressure': 2", "'type': 'load.pressure', 'pressure': 1"},
    {"'type': 'load.follower', 'pressure': 2", "'type': 'load.follower', 'pressure': 1"},
    {"'type': 'drag.wind', 'wind': [1, 4, 0]", "'type': 'drag.wind', 'wind': [0.5, 2, 0]"},
};

static scene loaded(const char *load, const char *history, const char *method)
{
    char terms[512];
    snprintf(terms, sizeof terms, ", {%s%s}", load, history);
    return scene_open(SHEET
                      "'histories': [{'name': 'h', 'times': [0, 1], 'values': [2, 2]}], 'gravity': [0, "
                      "0, 0], 'integrator': {'method': '%s', 'dt': 0.01}, 'controller': {'type': '%s'}, "
                      "'duration': 1}",
                      terms, method, strcmp(method, "verlet") == 0 ? "stable" : "halving");
}

TEST(a_history_multiplies_every_load)
{
    static const char *const methods[] = {"be", "rosenbrock", "verlet", "newton_k"};
    for (size_t i = 0; i < sizeof loads / sizeof *loads; i++)
        for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
            scene a = loaded(loads[i].twice, "", methods[m]),
                  b = loaded(loads[i].once, ", 'history': 'h'", methods[m]),
                  c = loaded(loads[i].once, "", methods[m]);
            scene_advance(&a, 0.05), scene_advance(&b, 0.05), scene_advance(&c, 0.05);
            for (int k = 0; k < 48; k++)
                ck_assert_msg(fabs(scene_state(&a)->x[k] - scene_state(&b)->x[k]) <= 1e-11, "%s, %s",
                              loads[i].once, methods[m]);
            ck_assert_uint_ne(drape_sim_hash(a.sim), drape_sim_hash(c.sim));
            ck_assert_double_eq_tol(drape_sim_energy(a.sim).gravity, drape_sim_energy(b.sim).gravity, 1e-11);
            scene_close(&a), scene_close(&b), scene_close(&c);
        }
}

/* Backward Euler gives a free sheet the velocity g sum h f(t_k) to rounding, under gravity with a history
 * that is linear from 0 to 2 in 0.1 s, and then falls to -1 in 0.2 s. */
TEST(gravity_with_a_history_adds_up_to_its_impulse)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': "
                   "0.3, 'height': 0.2}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, "
                   "'areal_density': 0.2}, 'terms': ['stretch.cst']}], 'gravity': [0, -10, 0], "
                   "'gravity_history': 'sway', 'histories': [{'name': 'sway', 'times': [0, 0.1, 0.3], "
                   "'values': [0, 2, -1]}], 'integrator': {'dt': 0.01, 'tolerance': 1e-13}, 'controller': "
                   "{'type': 'fixed'}, 'duration': 1}");
    double sum = 0;
    scene_advance(&s, 0.4);
    for (int k = 1; k <= 40; k++) {
        const double t = 0.01 * k;
        sum -= 0.01 * 10 * (t < 0.1 ? 20 * t : t < 0.3 ? 2 - 15 * (t - 0.1) : -1);
    }
    for (int i = 0; i < 4; i++)
        ck_assert_double_eq_tol(scene_state(&s)->v[3 * i + 1], sum, 1e-10);
}

/* ---- Work and kinks ---- */

typedef struct ends {
    double wanted[4];
    int found;
} ends;

static drape_status note_ends(void *user, const drape_event *event)
{
    ends *e = user;
    for (int k = 0; event->kind == DRAPE_EVENT_ATTEMPT && k < 4; k++)
        e->found += event->attempt->accepted && drape_sim_time(event->sim) == e->wanted[k];
    return DRAPE_OK;
}

/* Methods that control their error end steps at the keys. */
TEST(steps_end_at_kinks)
{
    static const char *const methods[] = {"ida", "radau", "rosenbrock", "dirk"};
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        scoped_scene s = scene_open(
            SHEET
            "'gravity': [0, -9.81, 0], 'gravity_history': 'steps', 'histories': [{'name': 'steps', "
            "'times': [0.013, 0.029, 0.03, 0.071], 'values': [0, 1, 0.2, 3]}, {'name': 'unused', 'times': "
            "[0.02], 'values': [1]}], 'integrator': {'method': '%s', 'dt': 0.01, 'error': 1e-3}, "
            "'duration': 1}",
            "", methods[m]);
        ends e = {.wanted = {0.013, 0.029, 0.03, 0.071}};
        ck_assert_int_eq(drape_sim_observe(s.sim, note_ends, &e), DRAPE_OK);
        scene_advance(&s, 0.1);
        ck_assert_msg(e.found == 4, "%s: %d", methods[m], e.found);
    }
}

/* A free sheet of mass m under gravity f(t) g from rest, f = t/T: v = g t^2/(2 T) = 1 m/s. The potential
 * -m g f y and the work of the changing factor are both in the account, which closes although radau makes
 * few steps: to the errors of its tolerance, 1e-8 of the energy. */
TEST(the_energy_account_closes)
{
    for (int cubic = 0; cubic < 2; cubic++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.3, "
            "'height': 0.3}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, "
            "'terms': ['stretch.cst']}], 'gravity': [0, -10, 0], 'gravity_history': 'up', 'histories': "
            "[{'name': 'up', 'times': [0, 0.2], 'values': [0, 1], 'interpolation': '%s'}], 'integrator': "
            "{'method': 'radau', 'rtol': 1e-10, 'atol_x': 1e-12, 'atol_v': 1e-12}, 'duration': 1}",
            cubic ? "cubic" : "linear");
        scene_watch(&s);
        scene_advance(&s, 0.2);
        const drape_energy e = drape_sim_energy(s.sim);
        const double mass = 0.2 * 0.09, v = 1;
        ck_assert_double_eq_tol(e.kinetic, mass * v * v / 2, 1e-8 * mass * v * v);
        printf("# %ld steps\n", s.accepted);
        assert_below(fabs(e.numerical), 1e-8 * e.kinetic);
    }
}

/* ---- Statics ---- */

/* An equilibrium has the loads of its time: a quarter of the load with the factor 4, to the residual of
 * static, 1e-10 N over 10 N/m. */
TEST(an_equilibrium_has_the_load_of_its_time)
{
    scene a = loaded("'type': 'load.line', 'edge': 'right', 'force': [0.2, 0, 0]", "", "static");
    scene b = scene_open(
        SHEET "'histories': [{'name': 'h', 'times': [0, 1], 'values': [0, 8], 'interpolation': "
              "'cubic'}], 'gravity': [0, 0, 0], 'integrator': {'method': 'static'}, 'duration': 1}",
        ", {'type': 'load.line', 'edge': 'right', 'force': [0.05, 0, 0], 'history': 'h'}");
    scene_advance(&a, 0.5), scene_advance(&b, 0.5);
    for (int i = 0; i < 48; i++)
        ck_assert_double_eq_tol(scene_state(&a)->x[i], scene_state(&b)->x[i], 1e-9);
    scene_close(&a), scene_close(&b);
}

/* ---- Jumps ---- */

/* A free sheet at rest, whose gravity g = 10 is switched on within 1 ns before the end of a step of h = 5 ms.
 * Which methods of fixed steps feel it in this step is open, so that v = g (0.05 s + h) at most; but no check
 * takes its work for energy out of nothing. */
TEST(a_jump_at_the_end_of_a_step_is_no_error)
{
    static const char *const methods[] = {"be", "bdf2", "trbdf2", "verlet", "newton_k"};
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.3, "
            "'height': 0.3}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, "
            "'terms': ['stretch.cst']}], 'gravity': [0, -10, 0], 'gravity_history': 'on', 'histories': "
            "[{'name': 'on', 'times': [0, 0.049999999, 0.05], 'values': [0, 0, 1]}], 'integrator': "
            "{'method': '%s', 'dt': 0.005}, 'duration': 1}",
            methods[m]);
        scene_watch(&s);
        scene_advance(&s, 0.1);
        const double v = -scene_state(&s)->v[1];
        printf("# %s: %.4g m/s\n", methods[m], v);
        ck_assert(v > 0.5 * (1 - 1e-3) && v < 0.55 * (1 + 1e-3));
    }
}

/* ---- Of a host ---- */

TEST(histories_of_a_host)
{
    double times[] = {0, 1}, values[] = {1, 2};
    drape_history_def history;
    drape_history_def_init(&history, sizeof history);
    ck_assert_ptr_null(history.name);
    history.name = "h";
    history.times = times;
    history.values = values;
    history.time_count = history.value_count = 2;
    const drape_setting material[] = {{"young_modulus", 1e4, NULL},
                                      {"thickness", 1e-3, NULL},
                                      {"areal_density", 1, NULL}},
                        grid[] = {
                            {"columns", 2, NULL}, {"rows", 2, NULL}, {"width", 1, NULL}, {"height", 1, NULL}};
    drape_cloth_def cloth = cloth_def();
    drape_scene_def def = scene_def();
    cloth.mesh.grid = (drape_entry_def){"square", grid, 4};
    cloth.material = material;
    cloth.material_count = 3;
    def.cloths = &cloth;
    def.cloth_count = 1;
    def.histories = &history;
    def.history_count = 1;
    def.gravity_history = "h";
    scoped_scene s = scene_empty();
    assert_ok(s.ctx, drape_model_create(s.ctx, &def, &s.model));
    ck_assert_int_eq(s.model->history_count, 1);
    ck_assert_ptr_eq(s.model->terms[0].history, s.model->histories);
    drape_model_destroy(&s.model);
    const struct {
        const char *name;
        double times[2], values[2];
        size_t count;
        const char *says;
    } wrong[] = {
        {NULL, {0, 1}, {0, 1}, 2, "\"name\" is missing"},
        {"h", {1, 1}, {0, 1}, 2, "increase"},
        {"h", {0, NAN}, {0, 1}, 2, "a time is finite"},
        {"h", {0, 1}, {0, INFINITY}, 2, "a factor is finite"},
        {"h", {0, 1e-320}, {0, 1e9}, 2, "1e30 per second"},
        {"h", {0, 1}, {0, 1}, 1, "one value for each time"},
        {"g", {0, 1}, {0, 1}, 2, "there is no history \"h\""},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        history.name = wrong[i].name;
        history.times = wrong[i].times;
        history.values = wrong[i].values;
        history.value_count = wrong[i].count;
        ck_assert_int_eq(drape_model_create(s.ctx, &def, &s.model), DRAPE_E_ARGUMENT);
        ck_assert_msg(strstr(drape_context_message(s.ctx), wrong[i].says), "%s",
                      drape_context_message(s.ctx));
    }
}
