/*
 * test_first_order.c: the integrators that choose their own steps by a local error: they agree when their
 * tolerances are tight, have the orders that they are set to, and end at the ends of their runs.
 *
 * The sheet is that of test_order.c: E h = 20 N/m, 2 g a node, dashpots and drag: smooth, with waves that
 * steps of a millisecond resolve.
 */
#include <complex.h>

#include "integrators/integrator.h"
#include "support/scene.h"

#define END  0.2 /* [s] */
#define SIZE 0.5 /* [m] diagonal */

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.4, 'height': "   \
    "0.3},"                                                                                                  \
    "'material': {'young_modulus': 2e4, 'thickness': 1e-3, 'areal_density': 0.2},"                           \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.3},"                  \
    "{'type': 'damp.kelvin_voigt', 'beta': 2e-3}], 'velocity': [0.1, 0, 0.2],"                               \
    "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'%s}]}],"                                         \
    "'integrator': {'method': '%s', 'rtol': %g%s}, 'duration': 1}"

#define TRACK                                                                                                \
    ", 'track': [[0.03, [0, 0, 0]], [0.1, [0, 0.03, 0]], [0.15, [-0.02, 0.03, 0.02]], [1, [-0.02, 0, 0]]]"

/* Whether steps follow from a tolerance of the local error. */
static bool controls_error(const drape_integrator_ops *ops)
{
    return ops->own_steps && drape_param_find(ops->entry.params, ops->entry.param_count, "rtol") >= 0;
}

static double distance(const scene *a, const scene *b)
{
    double sum = 0;
    for (size_t i = 0; i < 3 * (size_t)a->model->node_count; i++)
        sum += pow(drape_sim_positions(a->sim)[i] - drape_sim_positions(b->sim)[i], 2);
    return sqrt(sum / a->model->node_count);
}

/* rtol 1e-11 of the size a step, in less than 1e3 steps, whose errors do not grow on a sheet with drag:
 * 1e-8 of the size at most. */
TEST(they_agree_at_tight_tolerances)
{
    for (int moved = 0; moved < 2; moved++) {
        scoped_scene first = {NULL};
        const char *track = moved ? TRACK : "";
        for (int i = 0; drape_integrators[i]; i++) {
            if (!controls_error(drape_integrators[i]))
                continue;
            scoped_scene s = scene_open(SHEET, track, drape_integrators[i]->entry.name, 1e-11, "");
            scene_advance(&s, END);
            if (!first.sim) {
                first = s;
                s = (scene){NULL};
                continue;
            }
            printf("# %s: %.3g m, %lld steps\n", drape_integrators[i]->entry.name, distance(&first, &s),
                   (long long)drape_sim_statistics(s.sim).steps_accepted);
            assert_below(distance(&first, &s), 1e-8 * SIZE);
        }
    }
}

/* Errors at rtol 1e-4 and 1e-9, as a power of the number of steps: its order, on average over the steps,
 * or down to one less. The steps at rtol 1e-4 are some 20, of which the first ones are as short as those
 * at 1e-9, and where waves of the sheet are stiff the stages, of order 2, take away some of the order.
 * With steps of one size, tests/time/test_order.c measures the orders. A variable order may be higher than
 * its limit where low orders suffice for the loose tolerance. */
static void check_order(const char *method, const char *setting, int order)
{
    char more[40];
    double error[2];
    int64_t steps[2];
    snprintf(more, sizeof more, ", '%s': %d", setting, order);
    scoped_scene reference = scene_open(SHEET, "", "ida", 1e-11, "");
    scene_advance(&reference, END);
    for (int k = 0; k < 2; k++) {
        scoped_scene s = scene_open(SHEET, "", method, k ? 1e-9 : 1e-4, more);
        scene_advance(&s, END);
        error[k] = distance(&reference, &s);
        steps[k] = drape_sim_statistics(s.sim).steps_accepted;
    }
    const double slope = log(error[0] / error[1]) / log((double)steps[1] / (double)steps[0]);
    printf("# %s, order %d: %lld to %lld steps, %.3g to %.3g m: %.2f\n", method, order, (long long)steps[0],
           (long long)steps[1], error[0], error[1], slope);
    ck_assert_double_ge(slope, order - 1);
}

TEST(dirk_has_the_order_that_is_set)
{
    for (int order = 2; order <= 5; order++)
        check_order("dirk", "order", order);
}

/* Thousands of steps end within their rounding errors of the end, but the run ends there, to the last
 * bit; so do parts of it. */
TEST(runs_end_at_their_ends)
{
    for (int i = 0; drape_integrators[i]; i++) {
        if (!controls_error(drape_integrators[i]))
            continue;
        scoped_scene s =
            scene_open(SHEET, TRACK, drape_integrators[i]->entry.name, 1e-3, ", 'max_step': 1e-4");
        for (double end = 0.1; end < 0.4; end += 0.1) {
            scene_advance(&s, end);
            ck_assert_double_eq(drape_sim_time(s.sim), end);
        }
        ck_assert_int_ge(drape_sim_statistics(s.sim).steps_accepted, 3000);
    }
}

/* What pins put in comes out, and what dashpots take is counted: the remainder is the error of the method,
 * and of the trapezoidal rule in two powers, which falls with the tolerance: rtol 1e-3 and 1e-7 of the
 * scene's size in each of the 10 to 100 steps that dissipate most. */
TEST(the_energy_balance_is_kept)
{
    for (int i = 0; drape_integrators[i]; i++) {
        if (!controls_error(drape_integrators[i]))
            continue;
        double remainder[2];
        for (int k = 0; k < 2; k++) {
            scoped_scene s = scene_open(SHEET, TRACK, drape_integrators[i]->entry.name, k ? 1e-7 : 1e-3, "");
            scene_advance(&s, 0.3);
            const drape_energy e = drape_sim_energy(s.sim);
            ck_assert_double_gt(e.dissipated, 1e-4);
            remainder[k] = fabs(e.numerical) / e.dissipated;
        }
        printf("# %s: remainder %.3g and %.3g of what is dissipated\n", drape_integrators[i]->entry.name,
               remainder[0], remainder[1]);
        assert_below(remainder[0], 1e-2);
        assert_below(remainder[1], 1e-4);
    }
}

/* ---- An oscillator ---- */

/* Compares the energies of successive steps of one size. */
typedef struct decay {
    double h, factor, before, worst;
    int count;
} decay;
