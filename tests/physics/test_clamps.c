/* test_clamps.c: clamped edges that turn with their pins, under every integrator. */
#include "assemble/check.h"
#include "assemble/system.h"
#include "integrators/integrator.h"
#include "support/scene.h"

#define PI 3.14159265358979323846

static const double length = 0.3, width = 0.1, young = 1e4, thickness = 4e-3;

static double rigidity(void)
{
    return young * thickness * thickness * thickness / 12;
}

/* A strip whose left clamp turns by `left` degrees and, if `right` is not 0, whose right one, which slides
 * along the strip, turns by that, both in the time `turning`. dt of the methods of fixed steps. */
static scene strip(const char *method, const char *terms, double left, double right, double turning,
                   double dt, double density)
{
    char pin[300] = "";
    if (right != 0)
        snprintf(pin, sizeof pin,
                 ", {'edge': 'right', 'clamp': true, 'axis': [1, 0, 0], 'turns': [{'time': 0, 'rotate': "
                 "[0, 0, 1, 0]}, {'time': %.17g, 'rotate': [0, 0, 1, %.17g]}]}",
                 turning, right);
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': 2, 'width': %g, "
        "'height': %g}, 'material': {'young_modulus': %g, 'poisson_ratio': 0, 'thickness': %g, "
        "'areal_density': %g}, 'terms': ['stretch.cst', %s], 'pins': [{'edge': 'left', 'clamp': true, "
        "'turns': [{'time': 0, 'rotate': [0, 0, 1, 0]}, {'time': %.17g, 'rotate': [0, 0, 1, %.17g]}]}%s]}], "
        "'gravity': [0, 0, 0], 'integrator': {'method': '%s', 'dt': %.17g, 'rtol': 1e-6, 'tolerance': "
        "1e-11}, 'controller': {'type': '%s'}, 'duration': 9}",
        8, length, width, young, thickness, density, terms, turning, left, pin, method, dt,
        strcmp(method, "verlet") == 0 ? "stable" : "halving");
}

/* Without loads a strip follows its clamp as a rigid body. The residual of 1e-11 N times the flexibility
 * L^3/(3 B w) = 1700 m/N bounds the displacement; ten times that for its nodes. */
TEST(a_strip_turns_with_its_clamp)
{
    const double angle = 130 * PI / 180;
    scoped_scene s = strip("static", "'bend.midedge'", 130, 0, 1, 1, 0.2);
    scene_advance(&s, 1);
    for (int32_t i = 0; i < s.model->node_count; i++) {
        const double *x = scene_state(&s)->x + 3 * i, *rest = s.model->rest + 3 * i,
                     arm = rest[0] - s.model->rest[0];
        ck_assert_double_lt(fabs(x[0] - s.model->rest[0] - arm * cos(angle)), 2e-7);
        ck_assert_double_lt(fabs(x[1] - s.model->rest[1] - arm * sin(angle)), 2e-7);
        ck_assert_double_lt(fabs(x[2] - rest[2]), 2e-7);
    }
    ck_assert_double_lt(drape_sim_energy(s.sim).elastic, 1e-16);
}

/* By every method the strip comes to the same place, and the work of the clamps, on springs and on dashpots,
 * is in the balance. The bending waves of 8 rows reach w = 600/s, that of the lowest 40/s: methods of second
 * order in steps of .5 ms keep the balance to (w h)^2/12 = 1 % of the work at most, backward Euler takes
 * w h/2 = 1 % of the low waves and all of the high ones, of those
 * that choose their steps, radau takes the longest, and the rule for the work has an error of their square
 * over 12. */
TEST(the_work_of_clamps_that_turn_is_in_the_balance)
{
    double reference = 0, dissipated = 0;
    for (int i = 0; drape_integrators[i]; i++) {
        const drape_integrator_ops *ops = drape_integrators[i];
        if (ops->steady_state)
            continue;
        scoped_scene s =
            strip(ops->entry.name, "'bend.midedge', {'type': 'damp.kelvin_voigt', 'beta': 0.005}", 30, -30,
                  0.1, 5e-4, 0.2);
        scene_advance(&s, 0.12);
        const drape_energy e = drape_sim_energy(s.sim);
        const double whole = e.elastic + e.kinetic + e.dissipated, share = ops->own_steps ? 3e-3 : 0.02;
        printf("# %s: elastic %.8g, kinetic %.3g, dissipated %.8g, numerical %.3g J\n", ops->entry.name,
               e.elastic, e.kinetic, e.dissipated, e.numerical);
        ck_assert_msg(fabs(e.numerical) < share * whole, "%s: %g of %g J", ops->entry.name, e.numerical,
                      whole);
        ck_assert_double_gt(e.dissipated, 0.1 * e.elastic);
        if (reference == 0)
            reference = e.elastic, dissipated = e.dissipated;
        ck_assert_msg(fabs(e.elastic / reference - 1) < 0.02, "%s: %g J", ops->entry.name, e.elastic);
        ck_assert_msg(fabs(e.dissipated / dissipated - 1) < 0.05, "%s: %g J", ops->entry.name, e.dissipated);
    }
}

/* Rolled slowly, dashpots in parallel with the springs dissipate beta B kappa'^2 L w T, half of it at the
 * clamps; the inertia adds the kinetic energy of a start and a stop, m (w L/8)^2 8/15 = 0.6 % of that. */
TEST(dashpots_at_clamps_feel_their_turning)
{
    static const char *const methods[] = {"be", "trbdf2", "ida", "radau", "rosenbrock"};
    const double rate = 60 * PI / 180 / length / 2;
    const double expected = 0.05 * rigidity() * rate * rate * length * width * 2;
    for (int i = 0; i < 5; i++) {
        scoped_scene s = strip(methods[i], "'bend.midedge', {'type': 'damp.kelvin_voigt', 'beta': 0.05}", 30,
                               -30, 2, 0.02, 0.0005);
        scene_advance(&s, 2.2);
        const double dissipated = drape_sim_energy(s.sim).dissipated;
        printf("# %s: %.8g J, expected %.8g\n", methods[i], dissipated, expected);
        ck_assert_msg(fabs(dissipated / expected - 1) < 0.015, "%s: %g, not %g J", methods[i], dissipated,
                      expected);
    }
}

/* Friction between yarns slips while the strip is rolled and unrolled: once over the loop, 2 HB (2 kappa -
 * 2 kappa_f) over the area is dissipated beyond where it began. */
TEST(yarns_slip_while_clamps_turn)
{
    scoped_scene s = strip("static", "{'type': 'bend.midedge', 'friction': 2, 'friction_curvature': 0.5}", 30,
                           -30, 1, 0.1, 0.2);
    const double curvature = 60 * PI / 180 / length, limit = 2 * rigidity();
    for (int k = 1; k <= 10; k++)
        scene_advance(&s, 0.1 * k);
    const double expected = limit * (curvature - 0.5) * length * width;
    ck_assert_double_lt(fabs(drape_sim_energy(s.sim).dissipated / expected - 1), 1e-6);
}

TEST(derivatives_while_clamps_turn)
{
    scoped_scene s =
        strip("be", "'bend.midedge', {'type': 'damp.kelvin_voigt', 'beta': 0.01}", 90, -90, 1, 0.01, 0.2);
    drape_check_result results[DRAPE_MAX_CHECK_RESULTS];
    int count = 0;
    ck_assert_int_eq(drape_check_derivatives(s.ctx, s.sim->system, 7, results, &count), DRAPE_OK);
    ck_assert_int_gt(count, 5);
    for (int i = 0; i < count; i++)
        ck_assert_msg(results[i].error < results[i].limit, "%s, %s: %g", results[i].term, results[i].what,
                      results[i].error);
}
