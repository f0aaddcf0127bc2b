/*
 * test_pleiades.c: seven stars in a plane, by the same drivers as cloth. The problem is that of Hairer,
 * Norsett & Wanner 1993, II.10, and of the Test Set for IVP Solvers (Mazzia & Magherini 2008), whose digits
 * at t = 3 are below: masses i, E = -m_i m_j / r, close encounters for which steps of a fixed size must be
 * small throughout. GSL's Runge-Kutta of order 8 integrates the same equations, implemented separately, as
 * a check of those digits.
 *
 * A star is a node, a pair of stars an element of a user-defined term. The masses of nodes would be those
 * of a sheet, so the test sets them in its model.
 */
#include "drape/extend.h"
#include "support/scene.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#define STARS 7
#define END   3.0

static const double start_x[STARS] = {3, 3, -1, -3, 2, -2, 2}, start_y[STARS] = {3, -3, 2, 0, 0, -4, 4};
static const double start_u[STARS] = {0, 0, 0, 0, 0, 1.75, -1.5}, start_v[STARS] = {0, 0, 0, -1.25, 1, 0, 0};
static const double end_x[STARS] = {0.3706139143970502, 3.237284092057233,  -3.222559032418324,
                                    0.6597091455775310, 0.3425581707156584, 1.562172101400631,
                                    -0.7003092922212495};
static const double end_y[STARS] = {-3.943437585517392, -3.271380973972550, 5.225081843456543,
                                    -2.590612434977470, 1.198213693392275,  -0.2429682344935824,
                                    1.091449240428980};

/* ---- As a term ---- */

static drape_status build(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder)
{
    (void)cloth, (void)params;
    int32_t e = 0;
    drape_status status = drape_term_reserve(builder, STARS * (STARS - 1) / 2, 1);
    for (int32_t i = 0; i < STARS && !status; i++)
        for (int32_t j = i + 1; j < STARS; j++) {
            const int32_t pair[] = {i, j};
            const double masses = (i + 1) * (j + 1);
            drape_term_set(builder, e++, pair, &masses);
        }
    return status;
}

/* -k/r: dq = k d/r^3, ddq = k (I/r^3 - 3 d d'/r^5) in d = x1 - x0. */
static void one(const drape_elements *el, int32_t element, const double *x, double *e, double *g, double *h)
{
    const double k = el->rest[element], d[3] = {x[3] - x[0], x[4] - x[1], x[5] - x[2]};
    const double r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), r3 = r * r * r;
    if (e)
        *e = -k / r;
    for (int i = 0; g && i < 6; i++)
        g[i] = (i < 3 ? -1 : 1) * k * d[i % 3] / r3;
    for (int i = 0; h && i < 6; i++)
        for (int j = 0; j < 6; j++)
            h[6 * i + j] = (i / 3 == j / 3 ? 1 : -1) * k *
                           ((i % 3 == j % 3) / r3 - 3 * d[i % 3] * d[j % 3] / (r3 * r * r));
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *h)
{
    (void)internal;
    drape_energy_range(el, first, count, x, e, g, h, one);
}

static const drape_term_ops newton = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "test.newton", .summary = "stars that attract each other", .reference = "Newton 1687"},
    .element_name = "pair",
    .nodes = 2,
    .build = build,
    .energy = energy};

/* A fan of triangles around the fifth star; only the mesh needs it. */
static scene stars(const char *integrator, const drape_setting *settings, size_t count)
{
    static const int32_t triangles[] = {0, 6, 4, 6, 2, 4, 2, 3, 4, 3, 5, 4, 5, 1, 4};
    static const drape_setting material[] = {
        {"young_modulus", 1, NULL}, {"density", 1, NULL}, {"thickness", 1, NULL}};
    static const drape_entry_def terms[] = {{"test.newton", NULL, 0}};
    double x[3 * STARS] = {0}, v[3 * STARS] = {0};
    drape_cloth_def cloth;
    drape_scene_def def;
    drape_sim_def sim;
    scene s = scene_empty();
    for (int i = 0; i < STARS; i++) {
        x[3 * i] = start_x[i];
        x[3 * i + 1] = start_y[i];
        v[3 * i] = start_u[i];
        v[3 * i + 1] = start_v[i];
    }
    ck_assert_int_eq(drape_context_add_term(s.ctx, &newton), DRAPE_OK);
    drape_cloth_def_init(&cloth, sizeof cloth);
    cloth.mesh.positions = x;
    cloth.mesh.triangles = triangles;
    cloth.mesh.node_count = STARS;
    cloth.mesh.triangle_count = 5;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = terms;
    cloth.term_count = 1;
    drape_scene_def_init(&def, sizeof def);
    def.cloths = &cloth;
    def.cloth_count = 1;
    def.gravity[1] = 0;
    ck_assert_msg(!drape_model_create(s.ctx, &def, &s.model), "%s", drape_context_message(s.ctx));
    for (int i = 0; i < STARS; i++)
        s.model->mass[i] = i + 1;
    drape_sim_def_init(&sim, sizeof sim);
    sim.integrator = integrator;
    sim.integrator_settings = settings;
    sim.integrator_setting_count = count;
    sim.controller = "fixed";
    scene_start(&s, &sim);
    ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
    return s;
}

/* Largest difference of a coordinate from the published one. */
static double error_at_end(const double *x, const double *y, int stride)
{
    double error = 0;
    for (int i = 0; i < STARS; i++)
        error = fmax(error, fmax(fabs(x[stride * i] - end_x[i]), fabs(y[stride * i] - end_y[i])));
    return error;
}

static double error_of(const char *integrator, const drape_setting *settings, size_t count)
{
    scene s = stars(integrator, settings, count);
    scene_advance(&s, END);
    const double *x = drape_sim_positions(s.sim);
    double error = error_at_end(x, x + 1, 3);
    printf("# %s, %s %g: error %.3g, %lld steps\n", integrator, settings[0].name, settings[0].number, error,
           (long long)drape_sim_statistics(s.sim).steps_accepted);
    scene_close(&s);
    return error;
}

/* ---- The same by GSL ---- */

static int right_side(double t, const double y[], double dy[], void *unused)
{
    (void)t, (void)unused;
    for (int i = 0; i < STARS; i++) {
        dy[i] = y[2 * STARS + i];
        dy[STARS + i] = y[3 * STARS + i];
        dy[2 * STARS + i] = dy[3 * STARS + i] = 0;
        for (int j = 0; j < STARS; j++) {
            double dx = y[j] - y[i], dz = y[STARS + j] - y[STARS + i];
            double r3 = i == j ? 1 : pow(dx * dx + dz * dz, 1.5);
            dy[2 * STARS + i] += (j + 1) * dx / r3;
            dy[3 * STARS + i] += (j + 1) * dz / r3;
        }
    }
    return GSL_SUCCESS;
}

/* The encounters amplify an error by about 1e4: 1e-14 a step becomes at most 1e-9 at the end. */
START_TEST(published_digits_are_those_of_gsl)
{
    gsl_odeiv2_system system = {right_side, NULL, 4 * STARS, NULL};
    gsl_odeiv2_driver *driver =
        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, 1e-6, 1e-14, 1e-14);
    double y[4 * STARS], t = 0;
    memcpy(y, start_x, sizeof start_x);
    memcpy(y + STARS, start_y, sizeof start_y);
    memcpy(y + 2 * STARS, start_u, sizeof start_u);
    memcpy(y + 3 * STARS, start_v, sizeof start_v);
    ck_assert_int_eq(gsl_odeiv2_driver_apply(driver, &t, END, y), GSL_SUCCESS);
    printf("# rk8pd: %.3g\n", error_at_end(y, y + STARS, 1));
    ck_assert_double_lt(error_at_end(y, y + STARS, 1), 1e-9);
    gsl_odeiv2_driver_free(driver);
}
END_TEST

/* The errors of IDA fall with rtol. Its weights are rtol L with L = 10, and the encounters amplify earlier
 * errors by 1e4: rtol 1e-9 may leave 1e-9 10 1e4 = 1e-4. */
START_TEST(ida_comes_to_the_published_end)
{
    double before = INFINITY;
    for (double rtol = 1e-6; rtol > 5e-11; rtol *= 0.1) {
        const drape_setting settings[] = {{"rtol", rtol, NULL}, {"max_order", 5, NULL}};
        double error = error_of("ida", settings, 2);
        ck_assert_double_lt(error, before);
        before = error;
    }
    ck_assert_double_lt(before, 1e-4);
}
END_TEST

/* The order of a method with fixed steps, at the last of two halvings. Steps of 0.05 ms resolve the closest
 * encounter (0.06 apart at a speed of 15: 4 ms) in 80: the next term of the error is (1/80) of the leading
 * one times some number; the bound is 0.2. */
static void check_order(const char *method, int order, const drape_setting *more, size_t count)
{
    double before = NAN, slope = NAN;
    for (double dt = 2e-4; dt > 0.4e-4; dt /= 2) {
        drape_setting settings[4] = {{"dt", dt, NULL}};
        memcpy(settings + 1, more, count * sizeof *more);
        double error = error_of(method, settings, count + 1);
        slope = log2(before / error);
        before = error;
    }
    ck_assert_msg(fabs(slope - order) < 0.2, "%s: slope %g, order %d", method, slope, order);
}

START_TEST(fixed_steps_have_their_order)
{
    const drape_setting implicit[] = {{"tolerance", 1e-9, NULL}}, explicit[] = {{"substeps", 1, NULL}};
    check_order("bdf2", 2, implicit, 1);
    check_order("trbdf2", 2, implicit, 1);
    check_order("midpoint", 2, implicit, 1);
    check_order("verlet", 2, explicit, 1);
}
END_TEST

SUITE("pleiades", published_digits_are_those_of_gsl, ida_comes_to_the_published_end,
      fixed_steps_have_their_order)
