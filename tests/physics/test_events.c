/* test_events.c: when events occur: against free fall, which is known, and against the numerical solution
 * itself, under every integrator; what they leave unchanged; and checkpoints between. */
#include "support/bytes.h"
#include "support/sample.h"
#include "support/scene.h"

#define GRAVITY 9.81
#define HEIGHT  0.7
#define PROMISE 1e-10 /* [s] to which events are located */

/* Integrators that integrate in time. */
static const drape_integrator_ops *method(int i)
{
    const drape_integrator_ops *const *all = drape_integrators;
    for (; *all; all++)
        if (!(*all)->steady_state && i-- == 0)
            return *all;
    return NULL;
}

/* Free fall of a sheet from rest at y = 0, in steps of 0.01 s. events: objects, each followed by a comma but
 * the last. */
static scene fall(const char *name, const char *velocity, const char *events)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet', 'velocity': %s,"
        " 'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.2, 'height': 0.2},"
        " 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.cst']}],"
        " 'integrator': {'method': '%s', 'dt': 0.01}, 'events': [%s], 'duration': 1}",
        velocity, name, events);
}

static double lowest(const scene *s)
{
    double y = INFINITY;
    for (int32_t i = 0; i < s->model->node_count; i++)
        y = fmin(y, drape_sim_positions(s->sim)[3 * (size_t)i + 1]);
    return y;
}

/* Whether the method follows free fall exactly, up to rounding: seen by a run without events. */
static bool is_exact(const char *name)
{
    scoped_scene s = fall(name, "[0, 0, 0]", "");
    scene_advance(&s, 0.1);
    const double t = drape_sim_time(s.sim), error = lowest(&s) + GRAVITY / 2 * t * t;
    return fabs(error) < 1e-13;
}

/* The state at a stop is one of the run, and the lowest node is at the height to 1e-10 s of its speed. With
 * methods that are exact on free fall that is the time of the formula. */
TEST(free_fall_stops_at_its_height)
{
    const double time = sqrt(2 * HEIGHT / GRAVITY), speed = GRAVITY * time;
    int exact = 0;
    for (int i = 0; method(i); i++) {
        const char *name = method(i)->entry.name;
        scoped_scene s = fall(name, "[0, 0, 0]", "{'type': 'height', 'height': -0.7, 'action': 'stop'}");
        ck_assert_msg(drape_sim_advance(s.sim, 1) == DRAPE_E_STOPPED, "%s: %s", name,
                      drape_context_message(s.ctx));
        drape_event_record record;
        drape_sim_event(s.sim, 0, &record);
        ck_assert(record.count == 1 && record.direction == -1 && record.last == drape_sim_time(s.sim));
        ck_assert_msg(fabs(lowest(&s) + HEIGHT) <= PROMISE * speed, "%s: %g m from the height", name,
                      lowest(&s) + HEIGHT);
        if (is_exact(name)) {
            ck_assert_msg(fabs(record.last - time) <= PROMISE, "%s: %g s from the formula", name,
                          record.last - time);
            exact++;
        }
        printf("# %s: %.3g s, %.3g m, %lld repeated\n", name, record.last - time, lowest(&s) + HEIGHT,
               (long long)drape_sim_statistics(s.sim).steps_rejected);
    }
    ck_assert_int_ge(exact, 3); /* midpoint, trbdf2 and verlet */
}

/* An event that is recorded where another one stops the run has its root at the same time, and is reported.
 */
TEST(an_event_is_recorded_where_another_stops)
{
    for (int i = 0; method(i); i++)
        for (int k = 0; k < 6; k++) {
            const char *name = method(i)->entry.name;
            char events[200];
            snprintf(events, sizeof events,
                     "{'type': 'height', 'height': %g}, {'type': 'height', 'height': %g, 'action': 'stop'}",
                     -0.05 - 0.0137 * k, -0.05 - 0.0137 * k);
            scoped_scene s = fall(name, "[0, 0, 0]", events);
            ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STOPPED);
            drape_event_record recorded, stop;
            drape_sim_event(s.sim, 0, &recorded);
            drape_sim_event(s.sim, 1, &stop);
            ck_assert_msg(recorded.count == 1 && stop.count == 1, "%s %d: %d and %d times", name, k,
                          (int)recorded.count, (int)stop.count);
            ck_assert_double_le(fabs(recorded.last - stop.last), PROMISE);
        }
}

/* A recorded event is at the same time as far as dense output is exact. Where it is on free fall, so is its
 * kinetic energy, m g^2 t^2 / 2. */
TEST(recorded_events_are_located_on_dense_output)
{
    for (int i = 0; method(i); i++) {
        const char *name = method(i)->entry.name;
        if (!is_exact(name))
            continue;
        scoped_scene s = fall(name, "[0, 0, 0]",
                              "{'type': 'height', 'height': -0.7, 'of': 'center'},"
                              "{'type': 'plane', 'normal': [0, -2, 0], 'offset': 0.3, 'of': 'highest'},"
                              "{'type': 'energy', 'bound': 0.01}");
        double mass = 0;
        for (int32_t k = 0; k < s.model->node_count; k++)
            mass += s.model->mass[k];
        const double times[] = {sqrt(2 * HEIGHT / GRAVITY), sqrt(2 * 0.3 / GRAVITY),
                                sqrt(2 * 0.01 / mass) / GRAVITY};
        scene_advance(&s, 0.5);
        for (int k = 0; k < 3; k++) {
            drape_event_record record;
            ck_assert_int_eq(drape_sim_event(s.sim, k, &record), 3);
            ck_assert_int_eq(record.count, 1);
            ck_assert_msg(fabs(record.last - times[k]) <= PROMISE, "%s %d: %g s off", name, k,
                          record.last - times[k]);
        }
        ck_assert_int_eq(drape_sim_statistics(s.sim).steps_rejected, 0);
    }
}

/* ---- A swinging, pulled sheet above a floor ---- */

/* The sheet is pinned at two corners, one of which is pulled away, and falls on a plane. */
static scene swing(const char *name, const char *events)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet',"
        " 'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.4, 'height': 0.4,"
        "          'transform': {'rotate': [1, 0, 0, 80]}},"
        " 'material': {'young_modulus': 3e4, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.cst', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}],"
        " 'pins': [{'name': 'held', 'corner': 'top-left'},"
        "          {'name': 'pulled', 'corner': 'top-right', 'track': [[0, [0,0,0]], [1, [0.2,0,0]]]}]}],"
        " 'colliders': [{'type': 'plane', 'point': [0, -0.25, 0], 'normal': [0, 1, 0], 'friction': 0.3}],"
        " 'integrator': {'method': '%s', 'dt': 0.01}, 'events': [%s], 'duration': 1}",
        name, events);
}

static const char watching[] = "{'type': 'height', 'height': -0.1, 'cloth': 'sheet', 'node': 22},"
                               "{'type': 'plane', 'normal': [0, 1, 1], 'offset': 0.1},"
                               "{'type': 'energy', 'bound': 0.02},"
                               "{'type': 'energy', 'of': 'total', 'bound': 0.001},"
                               "{'type': 'pin_force', 'pins': 'held', 'limit': 0.5},"
                               "{'type': 'pin_force', 'of': 'largest', 'limit': 0.6}";

/* Evaluating forces and energies between steps leaves no trace, in contact and with damping. */
TEST(recording_changes_no_bit)
{
    for (int i = 0; method(i); i++) {
        const char *name = method(i)->entry.name;
        scoped_scene plain = swing(name, ""), watched = swing(name, watching);
        int64_t found = 0;
        scene_advance(&plain, 0.6);
        scene_advance(&watched, 0.6);
        ck_assert_msg(drape_sim_hash(plain.sim) == drape_sim_hash(watched.sim), "%s", name);
        ck_assert_int_eq(drape_sim_statistics(plain.sim).newton_iterations,
                         drape_sim_statistics(watched.sim).newton_iterations);
        for (int k = 0; k < 6; k++)
            found += watched.sim->events.watches[k].count;
        ck_assert_msg(found >= 4, "%s: %lld events", name, (long long)found);
    }
}

/* The function of an event in the present state. */
static double at_stop(scene *s, int32_t event)
{
    const drape_model_event *e = &s->model->events[event];
    double forces[3 * 25], value;
    const drape_energy energy = drape_sim_energy(s->sim);
    ck_assert_int_eq(drape_sim_reactions(s->sim, forces), DRAPE_OK);
    const drape_event_point point = {.model = s->model,
                                     .event = e,
                                     .x = drape_sim_positions(s->sim),
                                     .v = drape_sim_velocities(s->sim),
                                     .energy = &energy,
                                     .reactions = forces};
    value = e->ops->measure(&point);
    return value - e->values[e->ops->bound];
}

/* Each of the events stops the run in turn: in the state of the stop its function, evaluated through the
 * functions that a host has, is 0 to what it changes in 1e-10 s, judged by the state 1e-4 s later. Steps that
 * are counted lead to the same bits as those of a host that advances to the time of the event, except with a
 * method that stops short of a tolerance, and begins its iterations from what an attempt left. */
TEST(a_stop_is_a_state_of_the_run_at_the_root)
{
    static const char *const stops[] = {
        "{'type': 'height', 'height': -0.1, 'cloth': 'sheet', 'node': 22, 'action': 'stop'}",
        "{'type': 'energy', 'bound': 0.02, 'action': 'stop'}",
        "{'type': 'pin_force', 'pins': 'held', 'limit': 0.5, 'action': 'stop'}",
    };
    for (int i = 0; method(i); i++)
        for (int k = 0; k < 3; k++) {
            const char *name = method(i)->entry.name;
            scoped_scene s = swing(name, stops[k]), plain = swing(name, "");
            ck_assert_msg(drape_sim_advance(s.sim, 1) == DRAPE_E_STOPPED, "%s %d: %s", name, k,
                          drape_context_message(s.ctx));
            const double t = drape_sim_time(s.sim), f = at_stop(&s, 0);
            if (!method(i)->own_steps && !method(i)->error_bound) {
                scene_advance(&plain, t);
                ck_assert_msg(drape_sim_hash(plain.sim) == drape_sim_hash(s.sim), "%s %d", name, k);
            }
            const long long repeated = (long long)drape_sim_statistics(s.sim).steps_rejected;
            scene_advance(&s, t + 1e-4);
            const double rate = fabs(at_stop(&s, 0) - f) / 1e-4;
            printf("# %s %d: t = %.12g, f = %.3g, f / f' = %.3g s, %lld repeated\n", name, k, t, f, f / rate,
                   repeated);
            ck_assert_msg(fabs(f) <= PROMISE * rate, "%s %d: %g, %g a second", name, k, f, rate);
        }
}

typedef struct film {
    double x[3][75], v[75]; /* the last three frames, and the velocities of the one in the middle */
    int64_t count;
    double worst, fastest;
} film;

/* ---- Checkpoints ---- */

static const char stopping[] = "{'type': 'height', 'height': -0.05, 'node': 22},"
                               "{'type': 'height', 'height': -0.1, 'node': 22, 'action': 'stop'},"
                               "{'type': 'energy', 'bound': 0.02}";

typedef struct saver {
    bytes saved;
    int attempt; /* the number of the attempt after which the sim is saved */
} saver;

static drape_status save_at(void *user, const drape_event *event)
{
    saver *s = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->index == s->attempt)
        s->saved = bytes_save(event->sim);
    return DRAPE_OK;
}

/* Wherever it is saved, also while a step is repeated to end at an event and before that is reported, the
 * restored sim stops in the same state, with the same events. */
TEST(a_restored_sim_has_the_same_events)
{
    for (int i = 0; method(i); i++) {
        const char *name = method(i)->entry.name;
        scoped_scene whole = swing(name, stopping);
        ck_assert_int_eq(drape_sim_advance(whole.sim, 1), DRAPE_E_STOPPED);
        const int attempts = (int)whole.sim->attempts;
        for (int k = 0; k < attempts; k += k < attempts - 6 ? 1 + attempts / 6 : 1) {
            scoped_scene s = swing(name, stopping), restored = swing(name, stopping);
            saver keeper = {.attempt = k};
            drape_sim_observe(s.sim, save_at, &keeper);
            ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STOPPED);
            ck_assert_int_eq(drape_sim_restore_from(restored.sim, keeper.saved.data, keeper.saved.size),
                             DRAPE_OK);
            ck_assert_int_eq(drape_sim_advance(restored.sim, 1), DRAPE_E_STOPPED);
            ck_assert_msg(drape_sim_hash(restored.sim) == drape_sim_hash(whole.sim), "%s, attempt %d of %d",
                          name, k, attempts);
            for (int e = 0; e < 3; e++) {
                drape_event_record a, b;
                drape_sim_event(whole.sim, e, &a);
                drape_sim_event(restored.sim, e, &b);
                ck_assert_msg(a.count == b.count && (a.count == 0 || a.last == b.last), "%s %d", name, k);
            }
            free(keeper.saved.data);
        }
    }
}

/* ---- Releasing pins ---- */

/* A sheet that swings down from two corners, one of which moves sideways at 0.2 m/s; pins: its list. */
static scene hung(const char *name, const char *pins, const char *events)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet',"
        " 'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.4, 'height': 0.4},"
        " 'material': {'young_modulus': 3e4, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.cst', 'bend.hinge'], 'pins': %s}],"
        " 'integrator': {'method': '%s', 'dt': 0.01, 'tolerance': 1e-9}, 'events': [%s], 'duration': 1}",
        pins, name, events);
}

static const char both[] =
    "[{'name': 'held', 'corner': 'top-left'},"
    " {'name': 'pulled', 'corner': 'top-right', 'track': [[0, [0,0,0]], [1, [0.2,0,0]]]}]";
static const char one[] = "[{'name': 'held', 'corner': 'top-left'}]";
static const char tears[] = "{'type': 'pin_force', 'pins': 'pulled', 'limit': 0.4, 'action': 'release'}";

/* The same scene without the pin goes on from the state in which the event stops a run. */
static void check_release(const char *name)
{
    scoped_scene s = hung(name, both, tears),
                 stopped = hung(name, both,
                                "{'type': 'pin_force', 'pins': 'pulled',"
                                " 'limit': 0.4, 'action': 'stop'}"),
                 without = hung(name, one, "");
    ck_assert_int_eq(drape_sim_advance(stopped.sim, 0.4), DRAPE_E_STOPPED);
    const double t = drape_sim_time(stopped.sim);
    const int32_t node = stopped.model->moved_node[0];
    double v[75];
    memcpy(v, drape_sim_velocities(stopped.sim), sizeof v);
    ck_assert_double_eq_tol(v[3 * node], 0.2, 1e-12); /* the speed of the track */
    v[3 * node] = 0.2;                                /* without the rounding of a mean over the step */
    v[3 * node + 1] = v[3 * node + 2] = 0;
    ck_assert_int_eq(drape_sim_set_state(without.sim, t, drape_sim_positions(stopped.sim), v), DRAPE_OK);
    scene_advance(&s, 0.4);
    scene_advance(&without, 0.4);
    ck_assert_msg(drape_sim_hash(s.sim) == drape_sim_hash(without.sim), "%s", name);
    const drape_model *model = drape_sim_model(s.sim);
    ck_assert(model != s.model && drape_model_dof_count(model) == drape_model_dof_count(s.model) + 3);
    ck_assert(s.model->pinned[node] && !model->pinned[node]);
    ck_assert(memcmp(model->mass, without.model->mass, 25 * sizeof *model->mass) == 0);
    ck_assert_int_eq(model->pattern.nonzeros, without.model->pattern.nonzeros);
    drape_event_record record;
    drape_sim_event(s.sim, 0, &record);
    ck_assert(record.count == 1 && record.last == t);
    const double to[3] = {0, 0, 0};
    ck_assert_int_eq(drape_sim_move_pins(s.sim, 1, &node, 0.1, to, NULL), DRAPE_E_ARGUMENT);
}

/* After the release the run is that of a scene without the pin, started from the state of the event: every
 * bit of it. */
TEST(a_released_pin_is_gone)
{
    for (int i = 0; method(i); i++)
        check_release(method(i)->entry.name);
}

/* The sheet is let go as a whole, while a host pushes it upwards by half of its weight: the center of mass
 * then falls at g/2 from where and as fast as it was, with nothing lost: the masses of released nodes are
 * part of it. Counts go on. */
TEST(a_sheet_that_is_let_go_falls)
{
    scoped_scene s = hung("midpoint", both, "{'type': 'energy', 'bound': 0.01, 'action': 'release'}");
    double lift[75] = {0};
    for (size_t i = 0; i < 25; i++)
        lift[3 * i + 1] = s.model->mass[i] * GRAVITY / 2;
    ck_assert_int_eq(drape_sim_push(s.sim, lift), DRAPE_OK);
    scene_advance(&s, 0.05);
    drape_statistics before = drape_sim_statistics(s.sim);
    double start[2][3] = {{0}}, end[3] = {0}, mass = 0, t = 0;
    for (int i = 0; i < 100 && drape_sim_model(s.sim) == s.model; i++)
        scene_advance(&s, 0.05 + 0.005 * i);
    const drape_model *model = drape_sim_model(s.sim);
    ck_assert_int_eq(model->free_count, model->node_count);
    for (int k = 0; k < 2; k++) {
        const double *x = drape_sim_positions(s.sim), *v = drape_sim_velocities(s.sim);
        t = drape_sim_time(s.sim);
        for (size_t i = 0; k == 0 && i < 75; i++) {
            start[0][i % 3] += model->mass[i / 3] * x[i];
            start[1][i % 3] += model->mass[i / 3] * v[i];
            mass += model->mass[i / 3] / 3;
        }
        if (k == 0)
            scene_advance(&s, t + 0.3);
    }
    for (size_t i = 0; i < 75; i++)
        end[i % 3] += model->mass[i / 3] * drape_sim_positions(s.sim)[i];
    for (int k = 0; k < 3; k++)
        /* residuals of 1e-9 N on 25 nodes for 0.3 s move the center of 8 g by 1e-9 25 / 0.008 0.3^2 / 2 */
        ck_assert_double_eq_tol(
            end[k] / mass, (start[0][k] + 0.3 * start[1][k]) / mass - (k == 1) * GRAVITY / 4 * 0.09, 1.5e-7);
    const drape_statistics after = drape_sim_statistics(s.sim);
    ck_assert(after.steps_accepted > before.steps_accepted + 30 &&
              after.newton_iterations > before.newton_iterations + 30);
}

static const char falls[] =
    "{'type': 'height', 'height': -0.1, 'node': 22, 'action': 'release', 'pins': 'held'},"
    "{'type': 'energy', 'bound': 0.02}";

/* In contact, with friction and damping: a checkpoint from before, during and after the release leads to the
 * same end, in a sim of the scene's own model. */
TEST(a_release_is_in_checkpoints)
{
    for (int i = 0; method(i); i++) {
        const char *name = method(i)->entry.name;
        scoped_scene s = swing(name, falls);
        bytes saved[4];
        for (int k = 0; k < 4; k++) {
            scene_advance(&s, (double[]){0.2, 0.35, 0.5, 0.55}[k]);
            saved[k] = bytes_save(s.sim);
        }
        ck_assert_msg(drape_sim_model(s.sim)->free_count == s.model->free_count + 1, "%s", name);
        scene_advance(&s, 0.6);
        for (int k = 0; k < 4; k++) {
            if (!in_sample((size_t)i, (size_t)k, 2))
                continue;
            scoped_scene other = swing(name, falls);
            assert_ok(other.ctx, drape_sim_restore_from(other.sim, saved[k].data, saved[k].size));
            for (int m = k + 1; m < 4; m++)
                scene_advance(&other, (double[]){0.2, 0.35, 0.5, 0.55}[m]);
            scene_advance(&other, 0.6);
            ck_assert_msg(drape_sim_hash(other.sim) == drape_sim_hash(s.sim), "%s from %d", name, k);
            ck_assert_int_eq(drape_sim_statistics(other.sim).newton_iterations,
                             drape_sim_statistics(s.sim).newton_iterations);
            /* and back to a sim in which nothing was released */
            ck_assert_int_eq(drape_sim_restore_from(other.sim, saved[0].data, saved[0].size), DRAPE_OK);
            ck_assert(drape_sim_model(other.sim) == other.model);
        }
        for (int k = 0; k < 4; k++)
            free(saved[k].data);
    }
}
