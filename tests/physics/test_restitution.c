/*
 * test_restitution.c: the energy of impacts. A patch that falls flat on a floor has one gap, so its rebound
 * has a closed form for every barrier. What is lost is counted as dissipated, contact
 * never pulls, and a sheet at rest does not depend on restitution.
 */
#include "support/scene.h"

#define DISTANCE 0.01                               /* [m] activation distance */
#define EPS      sqrt(2 * 0.2 * sqrt(2) * DISTANCE) /* [m/s] of the law: L 0.2 sqrt(2) m, no gravity */
#define MASS     (0.2 * 0.2 * 0.2)
#define PARTS    20000 /* of a quadrature */

static const char *const methods[] = {"be",         "bdf2", "trbdf2", "midpoint",
                                      "rosenbrock", "dirk", "radau",  "ida"};
#define METHODS (sizeof methods / sizeof *methods)

/* The integral of y / (1 + k f(y)) from 0 to y, f as in contact/restitution.h: m eps^2 of it is the energy
 * that the barrier takes up from an impact at eps y (k > 0), or returns to a rebound at that
 * speed (k < 0). */
static double barrier_energy(double k, double y)
{
    double sum = 0;
    for (int i = 0; i < PARTS; i++) {
        const double at = (i + 0.5) * y / PARTS;
        sum += at / (1 + k * (at < 1 ? 2 * at - at * at : 1)) * y / PARTS;
    }
    return sum;
}

/* With one gap s, m u du = N ds: the speed of rebound after an impact at v. */
static double rebound_of(double e, double v)
{
    const double k = (1 - e * e) / (1 + e * e), energy = barrier_energy(k, v / EPS);
    double low = 0, high = e > 0 ? v / EPS : fmin(1, v / EPS);
    for (int i = 0; i < 50; i++) {
        const double y = (low + high) / 2;
        *(barrier_energy(-k, y) < energy ? &low : &high) = y;
    }
    return low * EPS;
}

/* A patch above a floor, without gravity, thrown down at v, which moves it by `share` of
 * DISTANCE in a step. */
static scene open_patch(const char *method, double share, double e, double v)
{
    return scene_open(
        "{'drape': 1, 'gravity': [0,0,0], 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3,"
        " 'width': 0.2, 'height': 0.2, 'transform': {'translate': [0, 0.0101, 0]}}, 'velocity': [0,%.17g,0],"
        " 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0], 'restitution': %.17g}],"
        " 'contact': {'distance': %g}, 'integrator': {'method': '%s',"
        " 'dt': %.17g, 'max_step': %.17g, 'tolerance': 1e-9, 'rtol': 1e-6}, 'duration': 100}",
        -v, e, DISTANCE, method, share * DISTANCE / v, share * DISTANCE / v);
}

/* Advances over so many times DISTANCE/20 at the speed v, and looks at the forces after each: a floor without
 * friction pushes up only. */
static void advance_patch(scene *s, double v, int count)
{
    double f[27];
    for (int k = 1; k <= count; k++) {
        scene_advance(s, k * DISTANCE / 20 / v);
        ck_assert_int_eq(drape_sim_contact_forces(s->sim, f), DRAPE_OK);
        for (int i = 0; i < 9; i++)
            ck_assert_double_ge(f[3 * i + 1], 0);
    }
}

/* The force acts mostly in the inner half of the activation distance, for n steps in and out together: 100
 * of methods of second order, which err by a multiple of 1/n^2, and 1600 of be, which errs by a multiple of
 * 1/n. Of a speed 4 and 8 of these are allowed, and twice as much of an energy: that of the sum of energies
 * is what the methods lose or gain themselves. */
TEST(patches_rebound_by_their_coefficient)
{
    const double coefficients[] = {0, 0.5, 1}, speeds[] = {0.5 * EPS, 2.5 * EPS, 10 * EPS};
    for (size_t k = 0; k < METHODS; k++)
        for (int i = 0; i < 9; i++) {
            const double e = coefficients[i / 3], v = speeds[i % 3], u = rebound_of(e, v);
            const double own = k == 0 ? 8.0 / 1600 : 4.0 / (100 * 100);
            scoped_scene s = open_patch(methods[k], 1.0 / (k == 0 ? 3200 : 200), e, v);
            advance_patch(&s, v, (int)(30 * (1 + v / u)));
            const drape_energy energy = drape_sim_energy(s.sim);
            const double got = sqrt(2 * energy.kinetic / MASS), all = MASS * v * v / 2;
            printf("# %s, e = %g: %g m/s rebounds at %.5f of it, law %.5f; dissipated %.4f, numerical %.2g\n",
                   methods[k], e, v, got / v, u / v, energy.dissipated / all, energy.numerical / all);
            ck_assert_double_eq(energy.contact, 0);
            assert_below(fabs(got - u) / v, own);
            assert_below(fabs(energy.numerical) / all, 2 * own);
            ck_assert(e == 1 ? energy.dissipated == 0 : energy.dissipated > 0);
            if (v > 5 * EPS) /* the coefficient itself, up to (1 - e^2) (eps/v)^2 and, of 0, eps/v */
                assert_below(fabs(got / v - e), e > 0 ? own + (1 - e * e) * EPS * EPS / (v * v) : EPS / v);
        }
}

/* A sheet that lies on the floor at rest does so at the same height, to the tolerance of Newton's method
 * over the weight of a node: equilibria have no velocity. */
TEST(rest_is_the_same)
{
    double height[2];
    for (int k = 0; k < 2; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.2,"
            " 'height': 0.2, 'transform': {'translate': [0, 0.009, 0]}},"
            " 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200},"
            " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 10}]}],"
            " 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0], 'friction': 0.3,"
            " 'restitution': %d}], 'contact': {'distance': %g},"
            " 'integrator': {'dt': 0.01, 'tolerance': 1e-12}, 'duration': 10}",
            k, DISTANCE);
        scene_advance(&s, 6);
        height[k] = drape_sim_positions(s.sim)[1];
    }
    printf("# a sheet at rest: %.12g and %.12g m\n", height[0], height[1]);
    ck_assert(height[0] > 0.5 * DISTANCE && height[0] < DISTANCE);
    assert_below(fabs(height[0] - height[1]), 1e-9 * DISTANCE);
}

/* Steps of 1/30 to 1/480 s, in which a fall of 0.6 m crosses the activation distance of a millimetre 110
 * to 7 times over: with coefficient 0 nothing rebounds, but for 2 % that a step of gravity makes of the
 * fall's energy, and with 0.5 it does to a quarter of the height. The speed of the impact is known to a
 * step's gravity, g dt/v = 0.1 at 1/30 s, and the energy, in three such steps around it, to thrice as
 * much. */
TEST(impacts_within_a_step_rebound_by_their_coefficient)
{
    static const char *const fixed[] = {"be", "newton_k", "bdf2", "trbdf2", "midpoint"};
    const double fall = 0.599, speed = sqrt(2 * 9.81 * fall);
    for (size_t k = 0; k < sizeof fixed / sizeof *fixed; k++)
        for (int i = 0; i < 10; i++) {
            const double e = i < 5 ? 0 : 0.5, dt = 1 / (30.0 * (1 << i % 5));
            double least = INFINITY, most = -INFINITY;
            scoped_scene s = scene_open(
                "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.3, "
                "'height': "
                "0.3, 'orientation': 'horizontal', 'transform': {'translate': [0, 0.6, 0]}}, 'material': "
                "{'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': ['stretch.edge', "
                "'bend.hinge']}], 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0], "
                "'restitution': "
                "%g}], 'integrator': {'method': '%s', 'dt': %.17g}, 'duration': 2}",
                e, fixed[k], dt);
            for (int f = 1; f <= 39; f++) { /* until 0.65 s; the next impact is at 0.7 s */
                scene_advance(&s, f / 60.0);
                const double y = drape_sim_positions(s.sim)[1];
                most = y < least || isinf(least) ? -INFINITY : fmax(most, y);
                least = fmin(least, y);
            }
            const double rebound = isinf(most) ? 0 : (most - least) / fall;
            printf("# %s, e = %g, dt = 1/%.0f s: rebounds to %.4f of the height\n", fixed[k], e, 1 / dt,
                   rebound);
            assert_below(fabs(rebound - e * e), 0.02 + e * e * 3 * 9.81 * dt / speed);
        }
}
