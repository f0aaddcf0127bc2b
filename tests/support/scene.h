/*
 * scene.h: for tests that run a scene. A scene is JSON text, in which apostrophes stand for quotation marks
 * so that it reads well in C, and printf conversions for numbers:
 *
 *     scene s = scene_open("{'drape': 1, ..., 'gravity': [0, %g, 0], 'duration': 1}", -9.81);
 *     scene_advance(&s, 1);
 *     scene_close(&s);
 *
 * Any failure fails the test with the library's message.
 */
#ifndef DRAPE_TESTS_SCENE_H
#define DRAPE_TESTS_SCENE_H

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "sim/sim.h"
#include "support/suite.h"

typedef struct scene {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
    double residual; /* [N] largest of all accepted attempts, in the norm of the integrator */
    long accepted, rejected;
    long unconverged; /* accepted attempts whose status is not 0 */
} scene;

static inline scene scene_empty(void)
{
    scene s = {0};
    ck_assert_int_eq(drape_context_create(NULL, &s.ctx), DRAPE_OK);
    return s;
}

static inline scene scene_vmodel(const char *format, va_list values)
{
    char text[8192];
    scene s = scene_empty();
    drape_scene *parsed = NULL;
    const int length = vsnprintf(text, sizeof text, format, values);
    ck_assert(length > 0 && length < (int)sizeof text);
    quote(text);
    drape_status status = drape_scene_parse(s.ctx, text, "test", &parsed);
    if (!status)
        status = drape_scene_compile(parsed, &s.model);
    ck_assert_msg(status == DRAPE_OK, "%s\n%s", drape_context_message(s.ctx), text);
    drape_scene_destroy(&parsed);
    return s;
}

/* The model only, without a sim. */
__attribute__((format(printf, 1, 2))) static inline scene scene_model(const char *format, ...)
{
    va_list values;
    va_start(values, format);
    scene s = scene_vmodel(format, values);
    va_end(values);
    return s;
}

/* Creates a sim of the scene's model; def NULL: as the scene says. */
static inline void scene_start(scene *s, const drape_sim_def *def)
{
    assert_ok(s->ctx, drape_sim_create(s->ctx, s->model, def, &s->sim));
}

/* Model and sim. */
__attribute__((format(printf, 1, 2))) static inline scene scene_open(const char *format, ...)
{
    va_list values;
    va_start(values, format);
    scene s = scene_vmodel(format, values);
    va_end(values);
    scene_start(&s, NULL);
    return s;
}

static inline void scene_close(scene *s)
{
    drape_sim_destroy(&s->sim);
    drape_model_destroy(&s->model);
    drape_context_destroy(&s->ctx);
}

#define scoped_scene SCOPED(scene_close) scene

/* The present state, which may be changed before the first step. */
static inline drape_state *scene_state(scene *s)
{
    return &s->sim->states[s->sim->now];
}

static inline drape_status scene_note(void *user, const drape_event *event)
{
    scene *s = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT)
        return DRAPE_OK;
    const drape_attempt *a = event->attempt;
    if (!a->accepted) {
        s->rejected++;
        return DRAPE_OK;
    }
    s->accepted++;
    s->unconverged += a->status != DRAPE_OK;
    s->residual = fmax(s->residual, a->residual);
    return DRAPE_OK;
}

/* From here on the scene counts attempts and keeps the largest residual. s must stay at its address. */
static inline void scene_watch(scene *s)
{
    ck_assert_int_eq(drape_sim_observe(s->sim, scene_note, s), DRAPE_OK);
}

static inline void scene_advance(scene *s, double t)
{
    assert_ok(s->ctx, drape_sim_advance(s->sim, t));
}

/* Every derivative of the scene's model agrees with differences at three random states, those of the whole
 * Jacobian among them. */
static inline void scene_check_derivatives(const scene *s)
{
    for (unsigned seed = 1; seed <= 3; seed++) {
        drape_check_result results[64];
        int32_t count = 0, assembled = 0;
        ck_assert_int_eq(drape_model_check_derivatives(s->model, seed, results, 64, &count), DRAPE_OK);
        ck_assert_int_le(count, 64);
        for (int32_t i = 0; i < count; i++) {
            ck_assert_msg(results[i].pass, "%s of %s is off by %g, limit %g", results[i].what,
                          results[i].term, results[i].error, results[i].limit);
            assembled += strcmp(results[i].term, "assembled") == 0;
        }
        ck_assert_int_gt(assembled, 0);
    }
}

static inline double scene_min_mass(const scene *s)
{
    double smallest = INFINITY;
    for (int32_t i = 0; i < s->model->node_count; i++)
        smallest = fmin(smallest, s->model->mass[i]);
    return smallest;
}

/* Round-off of the force on a node [N]. Coordinates of size `size` are rounded by DBL_EPSILON/2 of it, edge
 * vectors by twice that; a spring multiplies that by its constant, a lattice node has 6 springs of at most
 * `spring` [N/m], and the sum of 6 forces and the products in each add as much again. */
static inline double force_noise(double spring, double size)
{
    return 6 * 2 * spring * 2 * DBL_EPSILON * size;
}

/*
 * The largest distance [m] of a node from the exact solution of backward Euler after n steps whose
 * residuals were at most r [N] in every component. With K >= 0 the error obeys e_{n+1} = (1 + h^2 M^-1
 * K)^-1 (2 e_n - e_{n-1} + h^2 M^-1 r), which in the norm of M grows no faster than for K = 0: n (n + 1)/2
 * h^2 |M^-1/2 r|; and |e|_max <= |M^1/2 e|/sqrt(m_min), |M^-1/2 r| <= sqrt(3 nodes/m_min) r.
 */
static inline double drift_bound(const scene *s, double n, double h, double r)
{
    return n * (n + 1) / 2 * h * h * sqrt(3.0 * s->model->node_count) * r / scene_min_mass(s);
}

/* Prints the value and its bound: `tools/test` hides the line, the log of a failed test shows it. */
#define assert_below(value, bound)                                                                           \
    do {                                                                                                     \
        const double value_ = (value), bound_ = (bound);                                                     \
        printf("# %s: %s = %.3g, bound %.3g\n", __func__, #value, value_, bound_);                           \
        ck_assert_msg(value_ <= bound_, "%s = %.17g exceeds %.17g", #value, value_, bound_);                 \
    } while (0)

#endif
