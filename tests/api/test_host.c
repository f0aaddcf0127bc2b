/* test_host.c: what a host can do while a sim runs, through the public header only: move pins and colliders,
 * push nodes, set the wind, cancel, and read forces. */
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "drape/extend.h"
#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64) /* [s], exact in binary */

/* ---- Pins ---- */

typedef struct watch {
    double worst; /* [m] */
    double speed[3], from[3], t0;
    int frames;
} watch;

/* Node 0 moves from `from` at `speed`, also at each frame between. */
static drape_status watch_pin(void *user, const drape_event *event)
{
    watch *w = user;
    double expected[3];
    if (event->kind != DRAPE_EVENT_FRAME)
        return DRAPE_OK;
    for (int k = 0; k < 3; k++)
        expected[k] = w->from[k] + w->speed[k] * (event->time - w->t0);
    w->worst = fmax(w->worst, distance(expected, event->positions));
    w->frames++;
    return DRAPE_OK;
}

/* A fixed pin and one on a track, moved along a straight line by the host: at the end they are at the target
 * to the bit, in between on the line up to rounding (1 m, some ten operations), and afterwards they stay. */
TEST(pins_go_where_they_are_sent)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host h = open_scene(
            SHEET, "",
            "{'corner': 'top-left'}, {'corner': 'top-right', 'track': [[0, [0,0,0]], [9, [0,0,9]]]}", "", "");
        drape_sim_def def = sim_def();
        def.integrator = methods[i];
        def.dt = FRAME / 4;
        def.frame_rate = 4 / FRAME;
        drape_sim_destroy(&h.sim);
        good(&h, drape_sim_create(h.ctx, h.model, &def, &h.sim));
        watch w = {.speed = {0.3, -0.2, 0.1}};
        good(&h, drape_sim_observe(h.sim, watch_pin, &w));
        const int32_t nodes[2] = {0, 4};
        for (int f = 1; f <= 4; f++) {
            double to[6];
            for (int k = 0; k < 3; k++) {
                to[k] = drape_model_rest_positions(h.model)[k] + w.speed[k] * f * FRAME;
                to[3 + k] = drape_model_rest_positions(h.model)[12 + k] + 0.1 * f * FRAME;
            }
            good(&h, drape_sim_move_pins(h.sim, 2, nodes, FRAME, to, NULL));
            good(&h, drape_sim_advance(h.sim, f * FRAME));
            ck_assert_msg(memcmp(drape_sim_positions(h.sim), to, 3 * sizeof *to) == 0, "%s", methods[i]);
            ck_assert(memcmp(drape_sim_positions(h.sim) + 12, to + 3, 3 * sizeof *to) == 0);
        }
        ck_assert_int_eq(w.frames, 17);
        ck_assert_double_le(w.worst, 20 * DBL_EPSILON);
        double at[3];
        memcpy(at, drape_sim_positions(h.sim), sizeof at);
        good(&h, drape_sim_advance(h.sim, 6 * FRAME));
        ck_assert(memcmp(drape_sim_positions(h.sim), at, sizeof at) == 0);
    }
}

/* A cubic through positions and velocities of x = a sin(w t) is off by at most (a w^4 h^4)/384 inside, and
 * restarts no integrator: ida, which restarts at every kink, takes fewer steps than with straight paths. */
TEST(velocities_make_a_motion_smooth)
{
    const double a = 0.05, w = 9;
    double steps[2], worst[2] = {0, 0};
    for (int straight = 0; straight < 2; straight++) {
        scoped_host h = open_scene(SHEET, "", "{'edge': 'top'}", "'method': 'ida', 'rtol': 1e-4", "");
        const int32_t node = 2;
        const double *rest = drape_model_rest_positions(h.model) + 6;
        for (int f = 1; f <= 32; f++) {
            double t = f * FRAME, to[3] = {rest[0], rest[1], rest[2] + a * sin(w * t)},
                   v[3] = {0, 0, a * w * cos(w * t)};
            good(&h, drape_sim_move_pins(h.sim, 1, &node, FRAME, to, straight ? NULL : v));
            for (int part = 1; part <= 4; part++) {
                good(&h, drape_sim_advance(h.sim, t - FRAME + part * FRAME / 4));
                double is = drape_sim_positions(h.sim)[8] - rest[2];
                if (f > 1) /* the first frame starts at rest, the sine does not */
                    worst[straight] = fmax(worst[straight], fabs(is - a * sin(w * drape_sim_time(h.sim))));
            }
        }
        steps[straight] = (double)drape_sim_statistics(h.sim).steps_accepted;
    }
    ck_assert_double_le(worst[0], a * pow(w * FRAME, 4) / 384 * (1 + 1e-6));
    ck_assert_double_le(worst[1], a * pow(w * FRAME, 2) / 8 * (1 + 1e-6));
    ck_assert_double_ge(worst[1], 10 * worst[0]);
    ck_assert_msg(steps[0] < 0.7 * steps[1], "smooth %g steps, straight %g", steps[0], steps[1]);
}

/* After the host has moved a pin, a state that the host sets may have it anywhere. */
TEST(a_state_takes_moved_pins_along)
{
    scoped_host h = open_scene(SHEET, "", "{'edge': 'top'}", "", "");
    const int32_t node = 1;
    double x[60], v[60] = {0}, to[3] = {0.125, 0.1, 0};
    memcpy(x, drape_sim_positions(h.sim), sizeof x);
    x[4] += 0.01;
    ck_assert_int_eq(drape_sim_set_state(h.sim, 0, x, v), DRAPE_E_ARGUMENT);
    good(&h, drape_sim_move_pins(h.sim, 1, &node, FRAME, to, NULL));
    good(&h, drape_sim_advance(h.sim, FRAME));
    good(&h, drape_sim_set_state(h.sim, 0, x, v));
    ck_assert(memcmp(drape_sim_positions(h.sim), x, sizeof x) == 0);
    good(&h, drape_sim_advance(h.sim, FRAME));
    ck_assert(memcmp(drape_sim_positions(h.sim) + 3, x + 3, 3 * sizeof *x) == 0);
}

/* ---- Colliders ---- */

#define BALL                                                                                                 \
    "'colliders': [{'type': 'sphere', 'center': [0.25, -0.3, 0.16], 'radius': 0.1, 'friction': 0.3%s}], "

#define STIFFNESS "'contact': {'stiffness': 2000}, "

/* As with pins: a ball that the host moves from key to key behaves as one on the track. The stiffness is
 * given, because its default depends on the speed of tracks. */
TEST(a_collider_goes_where_it_is_sent)
{
    static const char *const settings[] = {"'method': 'be', 'dt': 0.0078125, 'tolerance': 1e-9",
                                           "'method': 'verlet', 'dt': 0.0078125"};
    static const double keys[2][3] = {{0, 0, -0.1}, {0, 0.05, -0.12}};
    for (int i = 0; i < 2; i++) {
        char moving[256], still[256];
        snprintf(moving, sizeof moving, BALL STIFFNESS,
                 ", 'track': [[0, [0,0,0]], [0.125, [0,0,-0.1]], [0.25, [0,0.05,-0.12]]]");
        snprintf(still, sizeof still, BALL STIFFNESS, "");
        scoped_host on = open_scene(SHEET, "", "{'edge': 'top'}", settings[i], moving),
                    by = open_scene(SHEET, "", "{'edge': 'top'}", settings[i], still);
        for (int k = 0; k < 2; k++) {
            double worst = 0;
            good(&by, drape_sim_move_collider(by.sim, 0, 0.125, keys[k], NULL));
            good(&by, drape_sim_advance(by.sim, 0.125 * (k + 1)));
            good(&on, drape_sim_advance(on.sim, 0.125 * (k + 1)));
            for (int n = 0; n < 20; n++)
                worst = fmax(worst, distance(drape_sim_positions(on.sim) + 3 * n,
                                             drape_sim_positions(by.sim) + 3 * n));
            ck_assert_msg(worst <= 1e-7, "%s, key %d: %g m apart", settings[i], k, worst);
            drape_collider_motion at = drape_sim_collider(by.sim, 0);
            ck_assert(memcmp(at.displacement, keys[k], sizeof at.displacement) == 0);
            ck_assert_str_eq(at.type, "sphere");
        }
        ck_assert_double_gt(fabs(drape_sim_positions(by.sim)[3 * 17 + 2]), 0.01); /* the sheet touched it */
    }
}

/* ---- Forces ---- */

/* Reactions of the pins balance the weight and the push: their sum is the weight of all nodes less the push,
 * up to the residuals of 16 free nodes at 1e-8 N. */
TEST(reactions_carry_the_weight)
{
    scoped_host h = open_scene(SHEET, "", "{'corner': 'top-left'}, {'corner': 'top-right'}",
                               "'method': 'static', 'tolerance': 1e-8", "");
    double push[60] = {0}, forces[60], mass = 0;
    for (int n = 0; n < 20; n++)
        mass += drape_model_masses(h.model)[n];
    for (int pushed = 0; pushed < 2; pushed++) {
        if (pushed)
            push[3 * 12 + 2] = 0.07, push[3 * 4] = 0.02; /* a free node, and a pinned one */
        good(&h, drape_sim_push(h.sim, push));
        good(&h, drape_sim_advance(h.sim, 0.5 * (pushed + 1)));
        good(&h, drape_sim_reactions(h.sim, forces));
        double sum[3] = {0}, expected[3] = {-(pushed ? 0.02 : 0), 9.81 * mass, -(pushed ? 0.07 : 0)};
        for (int n = 0; n < 20; n++)
            for (int k = 0; k < 3; k++) {
                sum[k] += forces[3 * n + k];
                ck_assert(n == 0 || n == 4 || forces[3 * n + k] == 0);
            }
        for (int k = 0; k < 3; k++)
            ck_assert_msg(fabs(sum[k] - expected[k]) <= 18e-8, "%d: %g for %g N", k, sum[k], expected[k]);
        if (!pushed) /* the diagonals alternate, so the sheet is its own mirror image */
            ck_assert_double_eq_tol(forces[1], forces[13], 1e-6);
    }
}

/* A triangle without inner forces, pushed by F on each node: backward Euler gives v_n = n h F/m and x_n - x_0
 * = h^2 F/m n (n + 1)/2, so the energy F (x_n - x_0) - m v_n^2/2 = h^2 F^2/m n/2 is lost. Rounding: some 100
 * operations on 1 m, 1 J. */
TEST(a_push_does_its_work)
{
    scoped_host h = open_scene(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 1, 'edge_length': 1}, 'material': "
        "{'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}], 'gravity': "
        "[0,0,0], 'integrator': {'method': 'be', 'dt': 0.015625, 'tolerance': 1e-12}, 'duration': 1}");
    int nodes = drape_model_node_count(h.model), n = 16;
    double push[12], before[12], dt = FRAME, a = 3, lost = 0;
    const double *m = drape_model_masses(h.model);
    ck_assert_int_eq(nodes, 4);
    memcpy(before, drape_sim_positions(h.sim), sizeof before);
    for (int i = 0; i < 12; i++)
        push[i] = i % 3 == 1 ? a * m[i / 3] : 0;
    good(&h, drape_sim_push(h.sim, push));
    good(&h, drape_sim_advance(h.sim, n * dt));
    for (int i = 0; i < nodes; i++) {
        ck_assert_double_eq_tol(drape_sim_velocities(h.sim)[3 * i + 1], n * dt * a, 1e-9);
        ck_assert_double_eq_tol(drape_sim_positions(h.sim)[3 * i + 1] - before[3 * i + 1],
                                dt * dt * a * n * (n + 1) / 2, 1e-9);
        lost += dt * dt * a * a * m[i] * n / 2;
    }
    ck_assert_double_eq_tol(drape_sim_energy(h.sim).numerical, lost, 1e-9);
    good(&h, drape_sim_push(h.sim, NULL));
    good(&h, drape_sim_advance(h.sim, 2 * n * dt));
    ck_assert_double_eq_tol(drape_sim_velocities(h.sim)[1], n * dt * a, 1e-9);
}

/* Pushes act in every integrator: a sheet under 1 g that is pushed up with 1 g floats. */
TEST(every_integrator_is_pushed)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host h = open_scene(SHEET, "", "", "", "");
        drape_sim_def def = sim_def();
        def.integrator = methods[i];
        def.dt = FRAME / 4;
        drape_sim_destroy(&h.sim);
        good(&h, drape_sim_create(h.ctx, h.model, &def, &h.sim));
        double push[60];
        for (int k = 0; k < 60; k++)
            push[k] = k % 3 == 1 ? 9.81 * drape_model_masses(h.model)[k / 3] : 0;
        good(&h, drape_sim_push(h.sim, push));
        good(&h, drape_sim_advance(h.sim, 0.5));
        for (int n = 0; n < 20; n++)
            ck_assert_msg(distance(drape_sim_positions(h.sim) + 3 * n,
                                   drape_model_rest_positions(h.model) + 3 * n) < 1e-6,
                          "%s: node %d fell", methods[i], n);
        good(&h, drape_sim_push(h.sim, NULL));
        good(&h, drape_sim_advance(h.sim, 1));
        ck_assert_msg(drape_sim_positions(h.sim)[1] < -0.5, "%s", methods[i]);
    }
}

/* With springs only, verlet sums the forces itself and not through the system: pushes and drag springs act
 * there too. */
TEST(springs_of_verlet_are_pushed_and_pulled)
{
    scoped_host h =
        open_scene("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 1, "
                   "'height': 1}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, "
                   "'terms': [{'type': 'spring.structural', 'stiffness': 10}]}], 'integrator': {'method': "
                   "'verlet', 'dt': 0.005}, 'duration': 1}");
    double push[243];
    for (int k = 0; k < 243; k++)
        push[k] = k % 3 == 1 ? 9.81 * drape_model_masses(h.model)[k / 3] : 0;
    good(&h, drape_sim_push(h.sim, push));
    good(&h, drape_sim_advance(h.sim, 0.1));
    for (int n = 0; n < 81; n++)
        ck_assert_double_eq_tol(drape_sim_positions(h.sim)[3 * n + 1],
                                drape_model_rest_positions(h.model)[3 * n + 1], 1e-9);
    good(&h, drape_sim_set_drag_spring(h.sim, 40, 1, (const double[]){0.5, 0.5, -0.5}));
    good(&h, drape_sim_advance(h.sim, 0.2));
    ck_assert_double_gt(drape_sim_positions(h.sim)[3 * 40 + 1], 0.01);
}

/* A sheet on a table is carried by the table, up to the residuals of 20 nodes at 1e-8 N; the force along the
 * table is friction. */
TEST(contact_carries_the_weight)
{
    scoped_host h =
        open_scene("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': "
                   "0.5, 'height': 0.4, 'transform': {'translate': [0, 0.0005, 0]}}, 'material': "
                   "{'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', "
                   "'bend.hinge']}], 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': "
                   "[0,1,0]}], 'integrator': {'method': 'static', 'tolerance': 1e-8}, 'duration': 1}");
    double forces[60], on[3], sum[3] = {0}, mass = 0;
    good(&h, drape_sim_contact_forces(h.sim, forces)); /* before any step, too */
    good(&h, drape_sim_advance(h.sim, 1));
    good(&h, drape_sim_contact_forces(h.sim, forces));
    good(&h, drape_sim_collider_force(h.sim, 0, on));
    for (int n = 0; n < 20; n++) {
        mass += drape_model_masses(h.model)[n];
        ck_assert_double_gt(forces[3 * n + 1], 0);
        for (int k = 0; k < 3; k++)
            sum[k] += forces[3 * n + k];
    }
    ck_assert_double_eq_tol(sum[1], 9.81 * mass, 20e-8);
    for (int k = 0; k < 3; k++)
        ck_assert_double_eq_tol(on[k], -sum[k], 1e-12 * 9.81 * mass);
    good(&h, drape_sim_reactions(h.sim, forces));
    for (int i = 0; i < 60; i++)
        ck_assert(forces[i] == 0); /* no pins */
}

/* ---- Wind ---- */

/* w = w0 + w1 t + G x */
typedef struct field {
    double w0[3], w1[3], g[9];
    bool lagged; /* it does not give its gradient */
    long calls;
} field;

static void blow(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    field *f = user;
    f->calls++;
    for (int32_t p = 0; p < count; p++)
        for (int i = 0; i < 3; i++) {
            wind[3 * p + i] = f->w0[i] + f->w1[i] * t;
            for (int j = 0; j < 3; j++)
                wind[3 * p + i] += f->g[3 * i + j] * x[3 * p + j];
            for (int j = 0; gradient && !f->lagged && j < 3; j++)
                gradient[9 * p + 3 * i + j] = f->g[3 * i + j];
        }
}

#define DRAG                                                                                                 \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 2, 'edge_length': 1}, 'material': "    \
    "{'young_modulus': 1e2, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', %s]}], "           \
    "'gravity': [0,0,0], 'integrator': {'method': '%s', 'dt': 0.015625%s}, 'duration': 1}"

/* A viscous medium that accelerates as a whole: with k = c/sigma, backward Euler gives every node
 *     v1 = (v0 + h k w(t1))/(1 + h k).
 * Tolerance: a residual of 1e-12 N on at least 0.03 kg changes v by h r/m < 1e-12 m/s per step, in 16
 * steps. */
TEST(wind_takes_cloth_along)
{
    scoped_host h =
        open_scene(DRAG, "{'type': 'drag.viscous', 'coefficient': 0.5}", "be", ", 'tolerance': 1e-12");
    field f = {.w0 = {1, -2, 0.5}, .w1 = {3, 0, -1}};
    double v[3] = {0}, k = 0.5 / 0.2;
    good(&h, drape_sim_set_wind(h.sim, blow, &f));
    for (int n = 1; n <= 16; n++) {
        good(&h, drape_sim_advance(h.sim, n * FRAME));
        for (int c = 0; c < 3; c++) {
            v[c] = (v[c] + FRAME * k * (f.w0[c] + f.w1[c] * n * FRAME)) / (1 + FRAME * k);
            for (int i = 0; i < drape_model_node_count(h.model); i++)
                ck_assert_double_eq_tol(drape_sim_velocities(h.sim)[3 * i + c], v[c], 1e-10);
        }
    }
    ck_assert_int_gt(f.calls, 16);
}

/* ---- Cancelling ---- */

static const char pins[] = "{'corner': 'top-left'}, {'corner': 'top-right'}";

typedef struct trigger {
    drape_sim *sim;
    int at, calls;
} trigger;

/* Cancels in the middle of a step: at the n-th evaluation of the wind. */
static void still_air(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    trigger *now = user;
    (void)t, (void)count, (void)x, (void)wind, (void)gradient;
    if (++now->calls == now->at)
        drape_sim_cancel(now->sim);
}

/* A cancelled step is rolled back: the state is the one before it, and the next advance repeats the same
 * step. */
TEST(a_step_can_be_cancelled)
{
    for (int i = 0; i < METHODS; i++) {
        char method[64];
        snprintf(method, sizeof method, "'method': '%s', 'dt': 0.0078125", methods[i]);
        scoped_host h = open_scene(SHEET, ", {'type': 'drag.viscous', 'coefficient': 0.1}", pins, method, "");
        trigger t = {.sim = h.sim};
        good(&h, drape_sim_set_wind(h.sim, still_air, &t));
        good(&h, drape_sim_advance(h.sim, 0.125));
        double time = drape_sim_time(h.sim);
        uint64_t before = drape_sim_hash(h.sim);
        int64_t count = 0, accepted = drape_sim_statistics(h.sim).steps_accepted;
        t.at = t.calls + 1;
        says(&h, drape_sim_advance(h.sim, 0.25), DRAPE_E_STOPPED, "cancelled");
        if (drape_sim_statistics(h.sim).steps_accepted ==
            accepted) { /* otherwise the step completed before the cancellation was noticed */
            ck_assert_double_eq(drape_sim_time(h.sim), time);
            ck_assert_uint_eq(drape_sim_hash(h.sim), before);
            for (int k = 0; drape_sim_reason(h.sim, k, &count); k++)
                if (strcmp(drape_sim_reason(h.sim, k, &count), "cancelled") == 0)
                    break;
            ck_assert_msg(count == 1, "%s", methods[i]);
        }
        good(&h, drape_sim_advance(h.sim, 0.25));
        ck_assert_double_eq(drape_sim_time(h.sim), 0.25);
    }
}

static drape_sim *volatile signalled;

static void on_alarm(int number)
{
    (void)number;
    drape_sim_cancel(signalled);
}

static atomic_int attempts; /* of the advance that is to be cancelled */

static drape_status count_attempt(void *user, const drape_event *event)
{
    (void)user;
    attempts += event->kind == DRAPE_EVENT_ATTEMPT;
    return DRAPE_OK;
}

static void *cancel_by_thread(void *main_thread)
{
    while (attempts < 3)
        sched_yield();
    if (main_thread)
        pthread_kill(*(pthread_t *)main_thread, SIGALRM);
    else
        drape_sim_cancel(signalled);
    return NULL;
}

/* Cancels an advance that would take hours, from a signal handler and from another thread. */
TEST(a_signal_and_a_thread_can_cancel)
{
    pthread_t here = pthread_self(), thread;
    ck_assert(signal(SIGALRM, on_alarm) != SIG_ERR);
    for (int by_signal = 0; by_signal < 2; by_signal++) {
        scoped_host h = open_scene(SHEET, "", pins, "", "");
        signalled = h.sim;
        attempts = 0;
        good(&h, drape_sim_observe(h.sim, count_attempt, NULL));
        ck_assert_int_eq(pthread_create(&thread, NULL, cancel_by_thread, by_signal ? &here : NULL), 0);
        says(&h, drape_sim_advance(h.sim, 1e8), DRAPE_E_STOPPED, "cancelled");
        ck_assert_int_eq(pthread_join(thread, NULL), 0);
        ck_assert_double_gt(drape_sim_time(h.sim), 0);
    }
}

/* ---- Reading ---- */

/* Normals of a sheet in the plane z = 0, rows downwards, are its normal; those of a bent sheet are unit
 * vectors; a sheet collapsed to a point has none. */
TEST(normals_are_of_length_one)
{
    scoped_host h = open_scene(SHEET, "", pins, "", "");
    double n[60], point[60] = {0}, first = 0;
    drape_sim_normals(h.sim, n);
    first = n[2];
    ck_assert_double_eq_tol(fabs(first), 1, 4 * DBL_EPSILON);
    for (int i = 0; i < 20; i++) {
        ck_assert_double_eq_tol(n[3 * i], 0, 4 * DBL_EPSILON);
        ck_assert_double_eq_tol(n[3 * i + 2], first, 4 * DBL_EPSILON);
    }
    /* like the first triangle: seen from the tip of the normal, its corners run counterclockwise */
    const int32_t *t = drape_model_triangles(h.model);
    const double *a = drape_model_rest_positions(h.model) + 3 * t[0],
                 *b = drape_model_rest_positions(h.model) + 3 * t[1],
                 *c = drape_model_rest_positions(h.model) + 3 * t[2];
    ck_assert_double_gt(((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) * first, 0);
    good(&h, drape_sim_advance(h.sim, 0.3));
    drape_sim_normals(h.sim, n);
    for (int i = 0; i < 20; i++)
        ck_assert_double_eq_tol(hypot(hypot(n[3 * i], n[3 * i + 1]), n[3 * i + 2]), 1, 8 * DBL_EPSILON);
    drape_model_normals(h.model, point, n);
    for (int i = 0; i < 60; i++)
        ck_assert(n[i] == 0);
    drape_sim_normals(NULL, n);
    drape_sim_normals(h.sim, NULL);
}

/* ---- Together ---- */

typedef struct job {
    const drape_model *model;
    int index;
    uint64_t hash;
} job;

/* All that can be read of forces and places in one state. */
typedef struct reading {
    double reactions[60], contact[60], force[3], torque[3];
    int32_t contacts;
    drape_contact_point first;
    drape_hit nearest, met;
} reading;

/* Reads all that the integrator has. */
static void read_all(const host *h, bool pushes, reading *r)
{
    const double from[] = {0.2, 0.1, 0.3}, along[] = {0.01, -0.3, -1};
    memset(r, 0, sizeof *r);
    good(h, drape_sim_reactions(h->sim, r->reactions));
    good(h, drape_sim_closest(h->sim, 3, 1, from, 10, &r->nearest));
    good(h, drape_sim_cast(h->sim, 3, 1, from, along, 10, &r->met));
    if (!pushes)
        return;
    good(h, drape_sim_contact_forces(h->sim, r->contact));
    good(h, drape_sim_collider_force(h->sim, 0, r->force));
    good(h, drape_sim_collider_torque(h->sim, 0, NULL, r->torque));
    good(h, drape_sim_contacts(h->sim, 1, &r->first, &r->contacts));
}

/* An observer that reads in every event, of each kind. */
typedef struct reader {
    host *h;
    bool pushes;
    reading last; /* of the last attempt */
    int events[3], rejected, contacts;
} reader;

static drape_status read_forces(void *user, const drape_event *event)
{
    reader *r = user;
    reading now;
    read_all(r->h, r->pushes, &now);
    r->events[event->kind]++;
    r->contacts += now.contacts > 0;
    r->rejected += event->kind == DRAPE_EVENT_ATTEMPT && !event->attempt->accepted;
    r->last = now;
    return DRAPE_OK;
}

static drape_status look(void *user, const drape_event *event)
{
    (void)user, (void)event;
    return DRAPE_OK;
}

/* What an observer reads after each attempt, accepted or rejected, in each frame and at each event, are the
 * forces of the state that the sim has then, the same as the host reads after the advance; and reading leaves
 * no trace: the run has the same bits as one whose observer only looks. A ball is driven into a sheet that
 * swings, with large steps, of which some are rejected. */
TEST(observers_read_forces)
{
    int rejected = 0;
    for (int i = 0; i < 2 * METHODS; i++) {
        const char *method = methods[i / 2], *friction = i % 2 ? "lagged" : "implicit";
        const bool pushes = strcmp(method, "verlet") != 0;
        char rest[512], choice[256];
        snprintf(rest, sizeof rest, BALL, ", 'track': [[0, [0,0,0]], [0.25, [0,0,-0.2]]]");
        snprintf(rest + strlen(rest), sizeof rest - strlen(rest),
                 " 'contact': {'friction': '%s'}, 'events': [{'type': 'height', 'height': -0.4}],", friction);
        snprintf(choice, sizeof choice, "'method': '%s', 'tolerance': 1e-9%s", method,
                 pushes ? ", 'dt': 0.03125, 'max_iterations': 12" : ", 'dt': 0.0005");
        scoped_host h = open_scene(SHEET, "", "{'corner': 'top-left'}", choice, rest),
                    plain = open_scene(SHEET, "", "{'corner': 'top-left'}", choice, rest);
        reader r = {.h = &h, .pushes = pushes};
        reading after;
        ck_assert_int_eq(drape_model_node_count(h.model), 20);
        good(&h, drape_sim_observe(h.sim, read_forces, &r));
        good(&plain, drape_sim_observe(plain.sim, look, NULL));
        for (int k = 1; k <= 16; k++) {
            good(&h, drape_sim_advance(h.sim, 2 * k * FRAME));
            good(&plain, drape_sim_advance(plain.sim, 2 * k * FRAME));
            read_all(&h, pushes, &after);
            ck_assert_msg(memcmp(&after, &r.last, sizeof after) == 0, "%s %s", method, friction);
            ck_assert_msg(drape_sim_hash(h.sim) == drape_sim_hash(plain.sim), "%s %s at %g s", method,
                          friction, drape_sim_time(h.sim));
        }
        ck_assert_int_gt(r.events[DRAPE_EVENT_ATTEMPT], 15);
        ck_assert_int_eq(r.events[DRAPE_EVENT_FRAME], 33);
        ck_assert_int_gt(r.events[DRAPE_EVENT_ROOT], 0);
        ck_assert(!pushes || r.contacts > 0);
        rejected += r.rejected;
    }
    ck_assert_int_gt(rejected, 10);
}

/* One sim and the host that drives it. */
static void *run_job(void *user)
{
    job *j = user;
    scoped_context *ctx = NULL;
    scoped_sim *sim = NULL;
    field f = {.w0 = {j->index, 0, 1}};
    double forces[60];
    const int32_t node = 2;
    bool bad = drape_context_create(NULL, &ctx) || drape_sim_create(ctx, j->model, NULL, &sim) ||
               drape_sim_set_wind(sim, blow, &f);
    for (int i = 1; !bad && i <= 16; i++) {
        double to[3] = {0.25 + 0.01 * j->index * i, 0.01 * i, 0}, by[3] = {0, 0, -0.01 * i};
        bad = drape_sim_move_pins(sim, 1, &node, FRAME, to, NULL) ||
              drape_sim_move_collider(sim, 0, FRAME, by, NULL) || drape_sim_advance(sim, i * FRAME) ||
              drape_sim_reactions(sim, forces) || drape_sim_contact_forces(sim, forces);
    }
    j->hash = bad ? 0 : drape_sim_hash(sim);
    return NULL;
}

/* Hosts in several threads on one model do not affect each other: each gets the same result as alone. */
TEST(hosts_in_threads_share_a_model)
{
    enum { THREADS = 4 };
    char ball[256];
    snprintf(ball, sizeof ball, BALL, "");
    scoped_host h = open_scene(SHEET, ", 'drag.wind'", "{'edge': 'top'}", "", ball);
    pthread_t thread[THREADS];
    job jobs[THREADS], alone[THREADS];
    for (int i = 0; i < THREADS; i++) {
        alone[i] = jobs[i] = (job){.model = h.model, .index = i};
        run_job(&alone[i]);
        ck_assert_uint_ne(alone[i].hash, 0);
    }
    ck_assert_uint_ne(alone[0].hash, alone[1].hash);
    for (int i = 0; i < THREADS; i++)
        ck_assert_int_eq(pthread_create(&thread[i], NULL, run_job, &jobs[i]), 0);
    for (int i = 0; i < THREADS; i++) {
        ck_assert_int_eq(pthread_join(thread[i], NULL), 0);
        ck_assert_uint_eq(jobs[i].hash, alone[i].hash);
    }
}
