/* test_controllers.c: what every controller does with an attempted step. */
#include "control/control.h"

#include "assemble/state.h"
#include "models.h"
#include "support/suite.h"

static void defaults(const drape_controller_ops *ops, double *values)
{
    for (int i = 0; i < ops->entry.param_count; i++)
        values[i] = generic_value(&ops->entry.params[i]);
}

/* Calls judge of a controller: an attempt with step h from time t that ended with *status, for a sheet at
 * rest. */
static drape_verdict judge(const drape_controller_ops *ops, const double *values, double t, double h,
                           drape_step_info *info, drape_status *status)
{
    const drape_entry_def term = {.type = "stretch.edge"};
    scoped_context *ctx = make_context();
    scoped_model *model = make_model(ctx, &(model_def){.mesh = MESH_SQUARE, .terms = &term, .term_count = 1});
    drape_arena arena = drape_arena_of(ctx);
    drape_state in, out;
    double scratch[2] = {0, 0};
    ck_assert_int_eq(drape_state_create(&arena, model, &in), DRAPE_OK);
    ck_assert_int_eq(drape_state_create(&arena, model, &out), DRAPE_OK);
    in.t = t;
    out.t = t + h;
    drape_trial trial = {.model = model,
                         .in = &in,
                         .out = &out,
                         .order = 1,
                         .scratch = scratch,
                         .h = h,
                         .dt = h,
                         .info = info,
                         .status = *status};
    drape_verdict verdict = ops->judge(values, &trial);
    *status = verdict == DRAPE_STOP ? trial.stop : trial.status; /* what ends the advance */
    if (verdict == DRAPE_RETRY)
        ck_assert(trial.h_next > 0 && trial.h_next < h && t + trial.h_next > t);
    if (verdict == DRAPE_ACCEPT && ops->own_steps)
        ck_assert(trial.h_next > 0);
    drape_arena_free(&arena);
    return verdict;
}

TEST(entries_are_well_formed)
{
    int count = 0;
    for (; drape_controllers[count]; count++) {
        const drape_controller_ops *ops = drape_controllers[count];
        ck_assert_ptr_eq(drape_controller_registry.entries[count], &ops->entry);
        ck_assert(ops->judge != NULL);
    }
    ck_assert_int_eq(drape_registry_count(&drape_controller_registry), count);
}

TEST(good_steps_are_accepted)
{
    for (int i = 0; drape_controllers[i]; i++) {
        double values[DRAPE_MAX_PARAMS];
        drape_step_info info = {.reason = DRAPE_REASON_CONVERGED};
        drape_status status = DRAPE_OK;
        defaults(drape_controllers[i], values);
        ck_assert_int_eq(judge(drape_controllers[i], values, 1, 0.01, &info, &status), DRAPE_ACCEPT);
        ck_assert_int_eq(status, DRAPE_OK);
        status = DRAPE_RETRY_NONLINEAR;
        info.usable = true; /* on_failure "accept" */
        ck_assert_int_eq(judge(drape_controllers[i], values, 1, 0.01, &info, &status), DRAPE_ACCEPT);
        ck_assert_int_eq(status, DRAPE_RETRY_NONLINEAR);
    }
}

TEST(failures_that_no_smaller_step_cures_keep_their_status)
{
    static const drape_status statuses[] = {DRAPE_E_SOLVER, DRAPE_E_MEMORY, DRAPE_E_ARGUMENT};
    for (int i = 0; drape_controllers[i]; i++)
        for (int k = 0; k < 3; k++) {
            double values[DRAPE_MAX_PARAMS];
            drape_step_info info = {.reason = DRAPE_REASON_SOLVER};
            drape_status status = statuses[k];
            defaults(drape_controllers[i], values);
            ck_assert_int_eq(judge(drape_controllers[i], values, 1, 0.01, &info, &status), DRAPE_STOP);
            ck_assert_int_eq(status, statuses[k]);
        }
}

/* An attempt that always fails is given up with a status that says so, at any time. */
TEST(endless_failure_ends)
{
    static const double times[] = {0, 1e-300, 1, 1e9, -5};
    for (int i = 0; drape_controllers[i]; i++)
        for (int k = 0; k < 5; k++)
            for (drape_status failed = DRAPE_RETRY_NONLINEAR; failed <= DRAPE_RETRY_REJECTED; failed++) {
                double values[DRAPE_MAX_PARAMS], h = 1;
                drape_step_info info = {.reason = DRAPE_REASON_MAX_ITERATIONS};
                drape_status status = failed;
                int attempts = 1;
                drape_verdict verdict;
                defaults(drape_controllers[i], values);
                while ((verdict = judge(drape_controllers[i], values, times[k], h, &info, &status)) ==
                       DRAPE_RETRY) {
                    ck_assert_int_eq(status, failed);
                    h /= 2;
                    ck_assert_int_lt(attempts++, 60);
                    status = failed;
                }
                ck_assert_int_eq(verdict, DRAPE_STOP);
                ck_assert_int_lt(status, 0);
            }
}

static const drape_controller_ops *controller_named(const char *name)
{
    return drape_controllers[drape_registry_find(&drape_controller_registry, NULL, name)];
}

TEST(fixed_never_halves)
{
    drape_step_info info = {.reason = DRAPE_REASON_MAX_ITERATIONS};
    drape_status status = DRAPE_RETRY_DEGENERATE;
    ck_assert_int_eq(judge(controller_named("fixed"), NULL, 0, 1, &info, &status), DRAPE_STOP);
    ck_assert_int_eq(status, DRAPE_E_SOLVER);
}

TEST(halving_stops_at_dt_min)
{
    drape_step_info info = {.reason = DRAPE_REASON_MAX_ITERATIONS};
    const double dt_min = 0.25;
    drape_status status = DRAPE_RETRY_LINEAR;
    ck_assert_int_eq(judge(controller_named("halving"), &dt_min, 3, 0.5, &info, &status), DRAPE_RETRY);
    ck_assert_int_eq(judge(controller_named("halving"), &dt_min, 3, 0.499, &info, &status), DRAPE_STOP);
    ck_assert_int_eq(status, DRAPE_E_STEP_TOO_SMALL);
}

TEST(halving_stops_where_the_time_stands_still)
{
    drape_step_info info = {.reason = DRAPE_REASON_MAX_ITERATIONS};
    const double dt_min = 1e-300;
    drape_status status = DRAPE_RETRY_LINEAR;
    ck_assert_int_eq(judge(controller_named("halving"), &dt_min, 1e6, 1e-11, &info, &status), DRAPE_STOP);
    ck_assert_int_eq(status, DRAPE_E_STEP_TOO_SMALL);
}
