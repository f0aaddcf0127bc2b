/*
 * test_seed.c: the scenes of CS184 and Boson as their programs run them: the headline figures of a build of
 * each (docs/springs.md), and where they fail.
 *
 * Some properties of that build are not reproduced and affect the figures: its order of springs in the pass
 * of the limit, the points that its hash of boxes collects besides those of a point's own box, float or
 * double. The tolerances are twice the difference that the order of springs alone makes here, which is far
 * below the effect of a wrong rule: without the pass strains are 20 % at 30 substeps, without damping the
 * kinetic energy is 200 J.
 */
#include "support/scene.h"

#include "base/vec3.h"
#include "model/scene.h"

static scene load(const char *name, const char *pointer, const char *value)
{
    char path[1024];
    drape_scene *parsed = NULL;
    scene s = scene_empty();
    const char *root = getenv("DRAPE_SOURCE");
    snprintf(path, sizeof path, "%s/examples/scenes/%s.json", root ? root : ".", name);
    drape_status status = drape_scene_load(s.ctx, path, &parsed);
    if (!status && pointer)
        status = drape_scene_set(parsed, pointer, value);
    if (!status)
        status = drape_scene_compile(parsed, &s.model);
    assert_ok(s.ctx, status);
    drape_scene_destroy(&parsed);
    scene_start(&s, NULL);
    return s;
}

static double longest(const scene *s)
{
    const drape_model *m = s->model;
    double max = -1;
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t e = 0; m->terms[i].ops->pair && e < el->count; e++) {
            double d[3];
            vec3_sub(drape_sim_positions(s->sim) + 3 * (size_t)el->node[2 * e + 1],
                     drape_sim_positions(s->sim) + 3 * (size_t)el->node[2 * e], d);
            max = fmax(max, vec3_norm(d) / el->rest[el->count + e] - 1);
        }
    }
    return max;
}

static double lowest(const scene *s)
{
    double y = INFINITY;
    for (int32_t i = 0; i < s->model->node_count; i++)
        y = fmin(y, drape_sim_positions(s->sim)[3 * (size_t)i + 1]);
    return y;
}

static double fastest(const scene *s)
{
    double speed = 0;
    for (int32_t i = 0; i < s->model->node_count; i++)
        speed = fmax(speed, vec3_norm(drape_sim_velocities(s->sim) + 3 * (size_t)i));
    return speed;
}

/* Their program: 12.5 %, -0.083 m, 3.5e-4 J. */
TEST(pinned2_after_three_seconds)
{
    scoped_scene s = load("cs184_pinned2", NULL, NULL);
    scene_advance(&s, 3);
    printf("# strain %.4f, lowest %.5f m, kinetic %.3g J\n", longest(&s), lowest(&s),
           drape_sim_energy(s.sim).kinetic);
    ck_assert_double_eq_tol(longest(&s), 0.125, 0.003);
    ck_assert_double_eq_tol(lowest(&s), -0.083, 0.001);
    ck_assert_double_eq_tol(drape_sim_energy(s.sim).kinetic, 3.5e-4, 0.6e-4);
}

/* Their program: frame 14. The strain limit amplifies the growth, so the frame is random within a few. */
TEST(pinned2_blows_up_at_two_substeps)
{
    scoped_scene s = load("cs184_pinned2", "/integrator/substeps", "2");
    drape_status status = drape_sim_advance(s.sim, 3);
    ck_assert_int_eq(status, DRAPE_E_SOLVER);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "blow_up"));
    printf("# %s\n", drape_context_message(s.ctx));
    ck_assert_double_lt(drape_sim_time(s.sim), 30.0 / 90);
}

/* Their program: frame 160 at dt 0.06; at 0.04 all comes to rest, 0.3 to 0.4 m/s after 1500 frames. Here it
 * is checked after 300, at the end of the first swing. The predicted limit, 0.058 s, is in between. */
TEST(boson_blows_up_between)
{
    scoped_scene s = load("verlet_100", "/integrator/dt", "0.06");
    drape_stability found;
    s.sim->chosen.integrator->stability(s.sim->integrator, drape_sim_state(s.sim), 0.06, &found);
    ck_assert(found.limit < 0.06 && found.limit > 0.055);
    int frame = 0;
    while (frame < 300 && !drape_sim_advance(s.sim, ++frame * 0.06) && fastest(&s) < 1e4)
        ;
    printf("# dt 0.06: frame %d; limit %.4f s\n", frame, found.limit);
    ck_assert(frame > 100 && frame < 220);
    scene_close(&s);
    s = load("verlet_100", "/integrator/dt", "0.04");
    scene_advance(&s, 300 * 0.04);
    printf("# dt 0.04: %.3f m/s\n", fastest(&s));
    ck_assert_double_lt(fastest(&s), 50);
}
