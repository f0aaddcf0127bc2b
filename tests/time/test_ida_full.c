/*
 * test_ida_full.c: the elimination of velocities changes nothing: IDA with the Schur complement K + c_j D +
 * c_j^2 M has the trajectory of IDA with the unreduced system, factored by SUNDIALS' own KLU
 * (support/ida_full.h).
 *
 * In exact arithmetic both are the same, step by step. Only round-off differs: a Newton correction d of the
 * order of the tolerance is solved to DBL_EPSILON times a condition number of 1 + (w h)^2 < 1e5: below
 * 1e-13 m for d < 1e-2 m. It grows from step to step: IDA makes one correction a step with old factors if
 * that is within its tolerance, and the part that the old factors do not correct grows by some factor a
 * step until there are new ones. With dashpots, whose matrix rotates with the sheet, that factor reaches 5,
 * and round-off can grow as far as the tolerance of the run. Hence short runs, weak dashpots and a
 * tolerance that keeps the factors recent. The matrix is the exact one, as a part of it would be another
 * iteration. 1e-10 m leaves room for a thousandfold growth; the bound of velocities is larger by the 1e2/s
 * of the stiffest wave that the steps resolve.
 */
#include "integrators/first_order.h"
#include "solvers/linear.h"
#include "support/ida_full.h"
#include "support/scene.h"

#define BOUND_X 1e-10 /* [m] */
#define BOUND_V 1e-8  /* [m/s] */

static scene sheet(const char *more)
{
    return scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 5, 'width': "
                      "0.5, 'height': 0.4},"
                      "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.2},"
                      "'terms': [%s 'stretch.edge', 'bend.hinge'], 'velocity': [0.1, 0, 0.2],"
                      "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}],"
                      "'integrator': {'method': 'ida'}, 'duration': 1}",
                      more);
}

/* The full system takes the steps that IDA chooses, without a bound on the effort. */
static drape_status lift_limit(void *user, const drape_event *event)
{
    (void)user;
    ((drape_first_order *)event->sim->integrator)->limit = INFINITY;
    return DRAPE_OK;
}

static void compare_order(const char *linear, const char *terms, double rtol, int max_order, double duration)
{
    const drape_setting settings[] = {{"rtol", rtol, NULL},         {"atol_x", 0.7 * rtol, NULL},
                                      {"atol_v", 2 * rtol, NULL},   {"max_order", max_order, NULL},
                                      {"linear_solver", 0, linear}, {"matrix", 0, "exact"}};
    drape_sim_def def = sim_def();
    ida_full full;
    scoped_scene s = sheet(terms);
    drape_sim_destroy(&s.sim);
    def.integrator_settings = settings;
    def.integrator_setting_count = 6;
    scene_start(&s, &def);
    scene_watch(&s);
    ck_assert_int_eq(drape_sim_observe(s.sim, lift_limit, NULL), DRAPE_OK);
    ck_assert(ida_full_open(&full, s.ctx, s.model, 0.7 * rtol, 2 * rtol, max_order, IDA_FULL_COLAMD));
    while (full.now.t < duration)
        ck_assert_int_ge(ida_full_step(&full, duration), 0);
    scene_advance(&s, duration);
    const drape_state *now = scene_state(&s);
    double x = 0, v = 0, moved = 0;
    long steps = 0;
    for (size_t i = 0; i < 3 * (size_t)s.model->node_count; i++) {
        x = fmax(x, fabs(now->x[i] - full.now.x[i]));
        v = fmax(v, fabs(now->v[i] - full.now.v[i]));
        moved = fmax(moved, fabs(now->x[i] - s.model->rest[i]));
    }
    IDAGetNumSteps(full.ida, &steps);
    printf("# rtol %g, order %d: %ld steps\n", rtol, max_order, steps);
    ck_assert(moved > 0.1); /* the sheet has swung */
    ck_assert_int_eq(steps, s.accepted);
    ck_assert_int_eq(full.residuals, drape_sim_statistics(s.sim).residuals);
    ck_assert_int_eq(full.jacobians, drape_sim_statistics(s.sim).jacobians);
    assert_below(x, BOUND_X);
    assert_below(v, BOUND_V);
    ida_full_close(&full);
}

static void compare(const char *terms, double rtol, int max_order, double duration)
{
    for (int i = 0; drape_linears_names[i]; i++)
        compare_order(drape_linears_names[i], terms, rtol, max_order, duration);
}

TEST(the_reduced_system_gives_the_trajectory_of_the_full_one)
{
    compare("", 1e-3, 2, 0.4);
    compare("", 1e-5, 5, 0.4);
}

/* Dashpots in continuous time make K nonsymmetric, which a solver for symmetric matrices has to notice. D
 * is in the reduced matrix, in its right-hand side and in both blocks of the full one. */
TEST(damping_leaves_the_trajectories_equal)
{
    const char *terms =
        "{'type': 'damp.kelvin_voigt', 'beta': 5e-4}, {'type': 'drag.viscous', 'coefficient': 0.3},";
    compare(terms, 1e-4, 2, 0.4);
    compare(terms, 1e-4, 5, 0.4);
}
