/*
 * test_relaxation.c: relax.maxwell: the coefficients of its steps, the relaxed limit, what it dissipates, and
 * that checkpoints and new models carry the branches. Relaxation and creep under fixed steps are references
 * of `drape validate`: stress_relaxation, creep.
 */
#include "model/relaxation.h"
#include "support/resume.h"

#define SIDE    0.1
#define NODES   16
#define STRAIN  0.02
#define MAXWELL "{'type': 'relax.maxwell', 'fraction_1': 0.3, 'time_1': 0.1, 'fraction_2': 0.2, 'time_2': 2}"

/* A sheet of 3 x 3 cells without lateral contraction; pins and members of the scene follow. */
static scene sheet(const char *terms, const char *pins, const char *members)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': %g, "
        "'height': %g}, 'material': {'young_modulus': 1e6, 'poisson_ratio': 0, 'thickness': 5e-4, "
        "'areal_density': 0.15}, 'terms': ['stretch.cst', 'bend.midedge', %s], 'pins': [%s]}], %s}",
        SIDE, SIDE, terms, pins, members);
}

static scene held(const char *integrator)
{
    char members[256];
    snprintf(members, sizeof members, "'gravity': [0, 0, 0], 'integrator': %s, 'duration': 100", integrator);
    return sheet(MAXWELL, "{'edge': 'left'}, {'edge': 'right', 'track': [[0, [0.002, 0, 0]]]}", members);
}

/* Strains the sheet along x, in no time. */
static void stretch(scene *s, double strain)
{
    static const double still[3 * NODES];
    double x[3 * NODES];
    for (size_t i = 0; i < 3 * NODES; i++)
        x[i] = s->model->rest[i] * (i % 3 == 0 ? 1 + strain : 1);
    assert_ok(s->ctx, drape_sim_set_state(s->sim, drape_sim_time(s->sim), x, still));
}

static double pull_of(const scene *s)
{
    double reactions[3 * NODES], sum = 0;
    ck_assert_int_eq(drape_sim_reactions(s->sim, reactions), DRAPE_OK);
    for (size_t i = 0; i < NODES; i++)
        sum += s->model->rest[3 * i] > 0.99 * SIDE ? reactions[3 * i] : 0;
    return sum;
}

/* The coefficients of a step agree with the functions of the C library, on both sides of where the series
 * ends, and at both ends. The error of those is a rounding over z or z^2. */
TEST(coefficients_of_a_step)
{
    static const double z[] = {1e-3, 0.1, 0.499999, 0.5, 2, 30};
    for (size_t i = 0; i < sizeof z / sizeof *z; i++) {
        const drape_decay d = drape_decay_over(2, 2 * z[i]);
        const double follows = -expm1(-z[i]) / z[i];
        assert_below(fabs(d.keeps - exp(-z[i])), 1e-14 * exp(-z[i]));
        assert_below(fabs(d.follows - follows), 1e-15);
        assert_below(fabs(d.mean - (1 - follows) / z[i]), 1e-15 + 2 * DBL_EPSILON / z[i]);
        /* two halves of a step at a steady rate are the whole one */
        const drape_decay half = drape_decay_over(2, z[i]);
        assert_below(fabs(drape_decay_extension(&half, drape_decay_extension(&half, 0.7, 0.15), 0.15) -
                          drape_decay_extension(&d, 0.7, 0.3)),
                     4e-16);
        assert_below(fabs(drape_decay_loss(&half, 0.7, 0.15) +
                          drape_decay_loss(&half, drape_decay_extension(&half, 0.7, 0.15), 0.15) -
                          drape_decay_loss(&d, 0.7, 0.3)),
                     4e-16);
    }
    const drape_decay instant = drape_decay_over(2, 0), back = drape_decay_over(2, -1),
                      relaxed = drape_decay_over(2, INFINITY);
    ck_assert(instant.keeps == 1 && instant.follows == 1 && instant.constant == 1 && back.keeps == 1);
    ck_assert(relaxed.keeps == 0 && relaxed.follows == 0 && relaxed.constant == 0 && relaxed.mean == 0);
    ck_assert_double_eq(drape_decay_loss(&instant, 0.7, 0.3), 0);
    ck_assert_double_eq(drape_decay_loss(&relaxed, 0.7, 0.3), 0.5 * 0.7 * 0.7);
}

/* "static" finds the equilibrium after an infinite time, and leaves the branches without force. */
TEST(equilibria_are_relaxed)
{
    scoped_scene s = held("{'method': 'static', 'tolerance': 1e-10}");
    stretch(&s, STRAIN);
    const double at_once = pull_of(&s), energy = drape_sim_energy(s.sim).elastic;
    scene_advance(&s, 1);
    assert_below(fabs(pull_of(&s) / at_once - 0.5), 1e-9);
    assert_below(fabs(drape_sim_energy(s.sim).dissipated / energy - 0.5), 1e-9);
}

#define FALLING "'gravity': [0, -9.81, 0], 'integrator': %s, 'duration': 10"

static scene falling(const char *integrator)
{
    char members[256];
    snprintf(members, sizeof members, FALLING, integrator);
    return sheet("{'type': 'relax.maxwell', 'fraction_1': 0.4, 'time_1': 0.02}",
                 "{'edge': 'left', 'clamp': true}", members);
}

/* A flap that swings: methods of the second order agree on what dashpots take, and their balance closes, both
 * the better the smaller their steps. The midpoint rule, which conserves energy else, is the reference. */
TEST(losses_are_in_the_balance)
{
    static const char *const methods[] = {"{'method': 'midpoint', 'dt': 5e-4}",
                                          "{'method': 'trbdf2', 'dt': 1e-3}",
                                          "{'method': 'verlet', 'dt': 1e-3}"};
    double first = 0;
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
        scoped_scene s = falling(methods[i]);
        scene_advance(&s, 0.15);
        const drape_energy e = drape_sim_energy(s.sim);
        first = i == 0 ? e.dissipated : first;
        ck_assert_double_gt(e.dissipated, 0.005 * e.kinetic);
        ck_assert_msg(fabs(e.numerical) < 0.02 * e.dissipated && fabs(e.dissipated - first) < 0.01 * first,
                      "%s: %g J lost, not %g J; %g J unexplained", methods[i], e.dissipated, first,
                      e.numerical);
    }
}

/* A run that goes on from a checkpoint has the bits of one that was not interrupted. */
TEST(checkpoints_keep_branches)
{
    static const char *const methods[] = {
        "{'method': 'be', 'dt': 0.01}",     "{'method': 'bdf2', 'dt': 0.01}",
        "{'method': 'trbdf2', 'dt': 0.01}", "{'method': 'newton_k', 'dt': 0.01}",
        "{'method': 'verlet', 'dt': 0.01}", "{'method': 'static'}"};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
        scene_resumes(falling(methods[i]), falling(methods[i]), 0.06, 0.1, methods[i]);
}

/* Another model of the same cloth goes on with the branches of the one before. */
TEST(a_new_model_keeps_branches)
{
    scene s = falling("{'method': 'be', 'dt': 0.01}"), other = falling("{'method': 'be', 'dt': 0.01}");
    const drape_term *bending = &s.model->terms[1];
    const size_t size = (size_t)drape_term_branch_numbers(bending) * sizeof(double);
    scene_advance(&s, 0.1);
    double *kept = malloc(size);
    ck_assert_ptr_nonnull(kept);
    memcpy(kept, drape_sim_state(s.sim)->internal + bending->first_branch, size);
    ck_assert_double_eq(kept[0], drape_sim_time(s.sim));
    other.model->gravity[1] = -1;
    ck_assert_int_eq(drape_sim_change_model(s.sim, other.model), DRAPE_OK);
    ck_assert_mem_eq(drape_sim_state(s.sim)->internal + other.model->terms[1].first_branch, kept, size);
    free(kept);
    scene_close(&s), scene_close(&other);
}

/* A sim goes on with no model that its integrator refuses. */
TEST(a_new_model_is_refused_as_a_first_one)
{
    scene s = sheet("{'type': 'damp.kelvin_voigt', 'beta': 0.001}", "{'edge': 'left'}",
                    "'integrator': {'method': 'ida'}, 'duration': 1"),
          other = falling("{'method': 'be'}");
    ck_assert_int_eq(drape_sim_change_model(s.sim, other.model), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "over which Maxwell branches"));
    scene_advance(&s, 0.01);
    scene_close(&s), scene_close(&other);
}

/* Every derivative, at a random state a part of a time after the last one. */
TEST(derivatives_agree_with_differences)
{
    scoped_scene s = scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 5, 'rows': 5, 'width': 0.2, "
        "'height': 0.2}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.2}, "
        "'terms': ['stretch.curve', 'stretch.edge', 'bend.midedge', "
        "'bend.hinge', " MAXWELL "]}], 'duration': 1}");
    scene_check_derivatives(&s);
}

/* Where a part lasts, however small; of nothing that lasts there is none (tests/bad). */
TEST(equilibria_need_a_lasting_part)
{
    scoped_scene s = sheet("{'type': 'relax.maxwell', 'fraction_1': 0.999999, 'time_1': 0.1}",
                           "{'edge': 'left'}", "'integrator': {'method': 'static'}, 'duration': 1");
}
