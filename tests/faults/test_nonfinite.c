/* test_nonfinite.c: the nth evaluation of a force or of a Hessian is not finite, for every n. No such number
 * enters a state; with fixed steps the run fails and reports it, with halved steps it recovers. */
#include "host.h"

enum { EVALUATIONS = 60 };

/* Modified Newton evaluates so few Jacobians that some n are not reached in these steps. */
enum { MAX_STEPS = 14 };

/* Makes steps until one fails or the fault has occurred. After a failed step the state is the one before
 * it. */
static bool fails_cleanly(host_sim *s, const char *reason)
{
    for (int k = 1; k <= MAX_STEPS && !host_has_broken(); k++) {
        host_copy before = host_copy_state(s);
        drape_status status = drape_sim_advance(s->sim, HOST_DT * k);
        ck_assert_int_eq(s->nonfinite, 0);
        ck_assert_int_eq(s->unconverged, 0);
        if (!status)
            continue;
        ck_assert_int_lt(status, 0);
        host_check_state(s, &before);
        ck_assert_int_eq(drape_sim_statistics(s->sim).steps_rejected, 1);
        if (!host_has_broken()) /* modified Newton with fixed steps may fail without a fault */
            return false;
        host_check_message(s, reason);
        return true;
    }
    return false;
}

/* With the controller "fixed". KINSOL recovers from some faults by a shorter Newton step, and the step
 * converges; the others end the run with e_solver. */
static void check_fixed(host_fault kind, const char *reason)
{
    for (int setting = 0; setting < HOST_SETTINGS; setting++) {
        int failures = 0;
        for (long n = 1; n <= EVALUATIONS; n++) {
            host_sim s = host_open(host_settings[setting], "'type': 'fixed'", true);
            host_watch(&s);
            host_break(kind, n, false);
            failures += fails_cleanly(&s, reason);
            host_close(&s);
        }
        ck_assert_msg(failures >= 3, "{%s}: %d of %d fail", host_settings[setting], failures, EVALUATIONS);
    }
}

TEST(a_nan_force_stops_fixed_steps)
{
    check_fixed(HOST_NAN_FORCE, "nonfinite");
}

TEST(an_infinite_force_stops_fixed_steps)
{
    check_fixed(HOST_INFINITE_FORCE, "nonfinite");
}

TEST(a_nan_hessian_stops_fixed_steps)
{
    check_fixed(HOST_NAN_HESSIAN, "singular");
}

TEST(an_infinite_hessian_stops_fixed_steps)
{
    check_fixed(HOST_INFINITE_HESSIAN, "singular");
}

/* With a time budget: while no force is finite, steps of any size fail, and the cloth is held, at a nominal
 * step a call. Calls succeed, time goes on, and no state has a number that is not finite. Afterwards it falls
 * again. */
TEST(a_budget_holds_the_cloth)
{
    host_sim s = host_open("", "'type': 'halving'", true);
    drape_realtime report;
    int held = 0;
    host_watch(&s);
    for (int k = 1; k <= 30; k++) {
        if (k == 11 || k == 21)
            host_break(k == 11 ? HOST_NAN_FORCE : HOST_NOTHING, 1, true);
        const drape_status status = drape_sim_advance_realtime(s.sim, HOST_DT, 1e9, &report);
        ck_assert_msg(status == DRAPE_OK, "frame %d: %s", k, drape_context_message(s.ctx));
        ck_assert_double_eq(drape_sim_time(s.sim), k * HOST_DT);
        ck_assert_int_eq(report.held, k > 10 && k <= 20);
        held += report.held;
    }
    double fastest = 0;
    for (int i = 0; i < 3 * drape_model_node_count(s.model); i++)
        fastest = fmax(fastest, fabs(drape_sim_velocities(s.sim)[i]));
    ck_assert_double_gt(fastest, 0);
    ck_assert_int_eq(s.nonfinite, 0);
    ck_assert_int_eq(drape_sim_statistics(s.sim).steps_held, held);
    drape_warning warning = {.name = ""};
    bool warned = false;
    for (int i = 0; !warned && drape_sim_warning(s.sim, i, &warning); i++)
        warned = strcmp(warning.name, "held") == 0;
    ck_assert(warned);
    host_close(&s);
}

/* Pins that a host moves meanwhile take the cloth with them: at the end of each of these steps it has the
 * shape that it had, and the velocity of the pins. */
TEST(cloth_that_is_held_goes_with_its_pins)
{
    host_sim s = host_open("", "'type': 'halving'", true);
    const int32_t pins[2] = {0, 2}, nodes = drape_model_node_count(s.model);
    double start[96], before[96];
    drape_realtime report;
    ck_assert_int_le(3 * nodes, 96);
    memcpy(start, drape_sim_positions(s.sim), 3 * (size_t)nodes * sizeof *start);
    for (int k = 1; k <= 20; k++) {
        double at[6];
        if (k == 11)
            host_break(HOST_NAN_FORCE, 1, true);
        for (int i = 0; i < 6; i++)
            at[i] = start[3 * pins[i / 3] + i % 3] + (i % 3 == 0 ? k * HOST_DT : 0);
        memcpy(before, drape_sim_positions(s.sim), 3 * (size_t)nodes * sizeof *before);
        ck_assert_int_eq(drape_sim_move_pins(s.sim, 2, pins, HOST_DT, at, NULL), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance_realtime(s.sim, HOST_DT, 1e9, &report), DRAPE_OK);
        ck_assert_int_eq(report.held, k > 10);
        for (int32_t i = 0; k > 10 && i < 3 * nodes; i++) {
            const double v = i % 3 == 0; /* [m/s] */
            ck_assert_double_eq_tol(drape_sim_positions(s.sim)[i] - before[i], v * HOST_DT, 1e-15);
            ck_assert_double_eq_tol(drape_sim_velocities(s.sim)[i], v, 1e-12);
        }
    }
    host_close(&s);
}

/* A persistent fault ends the run, after as many attempts as there are halvings down to dt_min, in the state
 * before the step. */
TEST(a_fault_that_stays_ends_the_run)
{
    static const host_fault kinds[] = {HOST_NAN_FORCE, HOST_INFINITE_FORCE, HOST_NAN_HESSIAN,
                                       HOST_INFINITE_HESSIAN};
    for (int k = 0; k < 4; k++)
        for (int setting = 0; setting < HOST_SETTINGS; setting++)
            for (int late = 0; late < 2; late++) {
                host_sim s = host_open(host_settings[setting], "'type': 'halving', 'dt_min': 1e-6", true);
                host_watch(&s);
                if (late)
                    ck_assert_int_eq(drape_sim_advance(s.sim, 0.05), DRAPE_OK);
                host_copy before = host_copy_state(&s);
                long attempts = s.attempts;
                host_break(kinds[k], 1, true);
                ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STEP_TOO_SMALL);
                host_check_state(&s, &before);
                host_check_message(&s, kinds[k] >= HOST_NAN_HESSIAN ? "singular" : "nonfinite");
                ck_assert_int_eq(s.attempts - attempts, 14); /* 2^-19 s > 1e-6 s > 2^-20 s */
                ck_assert_double_eq(s.last_h, HOST_DT / 8192);
                ck_assert_int_eq(s.nonfinite, 0);
                ck_assert_int_eq(s.unconverged, 0);
                host_close(&s);
            }
}

/* on_failure "accept" accepts an unconverged step, but never one that is not finite. */
TEST(accept_takes_no_nan)
{
    for (long n = 1; n <= EVALUATIONS; n++) {
        host_sim s = host_open(", 'on_failure': 'accept', 'max_iterations': 2, 'globalization': 'none'",
                               "'type': 'fixed'", true);
        host_watch(&s);
        host_break(HOST_NAN_FORCE, n, false);
        drape_status status = drape_sim_advance(s.sim, 0.3);
        ck_assert(status == DRAPE_OK || status == DRAPE_E_SOLVER);
        ck_assert_int_eq(s.nonfinite, 0);
        ck_assert_int_gt(s.unconverged + s.rejected, 0);
        host_close(&s);
    }
}

/* The smallest allowed dt_min, as any number above 0 is allowed. The run still ends, even at t = 0, where a
 * step of any length changes the time. */
TEST(a_tiny_dt_min_ends_too)
{
    host_sim s = host_open("", "'type': 'halving', 'dt_min': 1e-30", true);
    host_watch(&s);
    host_copy before = host_copy_state(&s);
    host_break(HOST_NAN_FORCE, 1, true);
    ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STEP_TOO_SMALL);
    host_check_state(&s, &before);
    ck_assert_int_lt(s.attempts, 110);
    host_close(&s);
}
