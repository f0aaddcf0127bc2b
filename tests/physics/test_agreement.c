/*
 * test_agreement.c: settings that must not change the result, and settings that may change it within the
 * tolerance only.
 *
 * The scene: a sheet that hangs by two corners and swings out under gravity. Two runs whose residuals stay
 * below r1 and r2 solve perturbed problems: if the Hessian is not negative, they differ by at most
 * drift_bound(r1 + r2). Springs compressed by e have a negative stiffness of K e across their direction,
 * which with 6 springs a node is at most 12 K e; that of hinges is less. With d = h^2 12 K e/m, the error
 * then also grows by the solution of e_{n+1} - 2 e_n + e_{n-1} = d e_{n+1}, which is below cosh(n sqrt(d/(1
 * - d))).
 */
#include "solvers/linear.h"
#include "support/scene.h"

#define STEP  0.002
#define STEPS 40

static scene hung(const char *integrator)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 8, 'edge_length': 0.05},"
        "'material': {'young_modulus': 5e4, 'thickness': 1e-3, 'areal_density': 0.3, 'mass': 'uniform'},"
        "'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3},"
        "{'type': 'drag.viscous', 'coefficient': 0.1}],"
        "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}],"
        "'integrator': {'dt': %g, 'tolerance': 1e-12%s}, 'duration': 1}",
        STEP, integrator);
}

static void agree(const char *one, const char *other)
{
    scoped_scene a = hung(one), b = hung(other);
    const double spring = 0.866 * 50;
    double worst = 0;
    scene_watch(&a);
    scene_watch(&b);
    scene_advance(&a, STEPS * STEP);
    scene_advance(&b, STEPS * STEP);
    ck_assert_int_eq(a.accepted, STEPS); /* none was rejected, so both have the same steps */
    ck_assert_int_eq(b.accepted, STEPS);
    ck_assert_int_eq(a.unconverged + b.unconverged, 0);
    for (size_t i = 0; i < 3 * (size_t)a.model->node_count; i++)
        worst = fmax(worst, fabs(drape_sim_positions(a.sim)[i] - drape_sim_positions(b.sim)[i]));
    const double squeezed = fmax(0, -drape_sim_statistics(a.sim).strain_min);
    const double d = STEP * STEP * 12 * spring * squeezed / scene_min_mass(&a);
    const double noise = 2 * (1 + 1e-3 / STEP) * force_noise(spring, 0.6);
    assert_below(d, 0.1);
    assert_below(worst, drift_bound(&a, STEPS, STEP, a.residual + b.residual + noise) *
                            cosh(STEPS * sqrt(d / (1 - d))));
}

TEST(linear_solvers_agree)
{
    for (int i = 0; drape_linears_names[i]; i++) {
        char other[64];
        snprintf(other, sizeof other, ", 'linear_solver': '%s'", drape_linears_names[i]);
        agree(", 'linear_solver': 'klu'", other);
    }
}

TEST(line_search_and_full_steps_agree)
{
    agree(", 'globalization': 'line_search'", ", 'globalization': 'none'");
    agree(", 'globalization': 'work'", ", 'globalization': 'line_search'");
}

static uint64_t hash_after(const drape_sim_def *def, double t)
{
    scoped_scene s = hung("");
    if (def) {
        drape_sim_destroy(&s.sim);
        scene_start(&s, def);
    }
    scene_advance(&s, t);
    const uint64_t hash = drape_sim_hash(s.sim);
    return hash;
}

TEST(frames_do_not_change_a_bit)
{
    drape_sim_def def = sim_def();
    def.frame_rate = 7;
    const uint64_t seven = hash_after(&def, 0.5);
    def.frame_rate = 60;
    ck_assert(hash_after(&def, 0.5) == seven);
    def.frame_rate = 1013;
    ck_assert(hash_after(&def, 0.5) == seven);
}

/* With dt = 1/240 s a sixtieth of a second is four steps. The ends k/60 and 4k/240 differ by round-off; the
 * schedule recognizes them as the same time: the steps are the same, and the states equal to the last bit. */
TEST(one_advance_or_sixty)
{
    drape_sim_def def = sim_def();
    def.dt = 1.0 / 240;
    const uint64_t at_once = hash_after(&def, 1);
    scoped_scene s = hung("");
    drape_sim_destroy(&s.sim);
    scene_start(&s, &def);
    for (int k = 1; k <= 60; k++)
        scene_advance(&s, k / 60.0);
    ck_assert(drape_sim_time(s.sim) == 1);
    ck_assert(drape_sim_hash(s.sim) == at_once);
}
