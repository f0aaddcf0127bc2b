/* test_singular.c: a singular Jacobian: the step fails with "singular" and is rolled back; a smaller step,
 * with another inertia, succeeds. */
#include "host.h"

/* Without springs the Jacobian is M/h^2, and the Hessian of the user-defined term cancels exactly that. */
static host_sim open_singular(const char *integrator, const char *controller)
{
    host_sim s = host_open(integrator, controller, false);
    host_step = HOST_DT;
    return s;
}

TEST(fixed_stops_and_keeps_the_state)
{
    for (int setting = 0; setting < HOST_SETTINGS; setting++) {
        host_sim s = open_singular(host_settings[setting], "'type': 'fixed'");
        host_watch(&s);
        ck_assert_int_eq(drape_sim_advance(s.sim, 3 * HOST_DT), DRAPE_OK);
        host_copy before = host_copy_state(&s);
        drape_statistics work = drape_sim_statistics(s.sim);
        host_break(HOST_SINGULAR, 1, true);
        drape_status status = drape_sim_advance(s.sim, 4 * HOST_DT);
        int64_t count = 0;
        ck_assert_int_eq(status, DRAPE_E_SOLVER);
        host_check_state(&s, &before);
        host_check_message(&s, "singular (retry_linear)");
        ck_assert_str_eq(drape_sim_reason(s.sim, 0, &count), "singular");
        ck_assert_int_eq(count, 1);
        ck_assert_int_gt(drape_sim_statistics(s.sim).factorizations, work.factorizations);
        host_break(HOST_NOTHING, 0, false); /* and the sim can continue */
        ck_assert_int_eq(drape_sim_advance(s.sim, 5 * HOST_DT), DRAPE_OK);
        ck_assert_double_eq(drape_sim_time(s.sim), 5 * HOST_DT);
        ck_assert_int_eq(s.nonfinite + s.unconverged, 0);
        host_close(&s);
    }
}

TEST(halving_finds_a_regular_one)
{
    for (int setting = 0; setting < HOST_SETTINGS; setting++) {
        host_sim s = open_singular(host_settings[setting], "'type': 'halving'");
        host_watch(&s);
        host_break(HOST_SINGULAR, 1, true);
        drape_status status = drape_sim_advance(s.sim, 1 * HOST_DT);
        ck_assert_msg(status == DRAPE_OK, "{%s}: %s", host_settings[setting], drape_context_message(s.ctx));
        ck_assert_double_eq(drape_sim_time(s.sim), 1 * HOST_DT);
        ck_assert_int_ge(s.rejected, 1);
        ck_assert_int_eq(s.nonfinite + s.unconverged, 0);
        ck_assert_double_lt(drape_sim_statistics(s.sim).h_max, HOST_DT);
        host_close(&s);
    }
}
