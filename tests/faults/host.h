/* host.h: a hung sheet with a user-defined term that fails on demand, and the record of its attempts. */
#ifndef DRAPE_TESTS_FAULTS_HOST_H
#define DRAPE_TESTS_FAULTS_HOST_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drape/extend.h"
#include "support/suite.h"

/* ---- The term ---- */

typedef enum host_fault {
    HOST_NOTHING,
    HOST_NAN_FORCE,
    HOST_INFINITE_FORCE,
    HOST_NAN_HESSIAN,
    HOST_INFINITE_HESSIAN,
    HOST_SINGULAR /* cancels the inertia of a node if the step is host_step: its Jacobian rows are 0 */
} host_fault;

/* host_at: the evaluation that fails, counted from 1; of forces for faults of forces, otherwise of Hessians.
 * 0: none. host_always: all later ones fail too. One call is one evaluation, as a cloth here has at most 32
 * nodes. */
static host_fault host_fault_kind;
static long host_at, host_forces, host_hessians;
static bool host_always;
static double host_step; /* [s] */

static inline void host_break(host_fault kind, long at, bool always)
{
    host_fault_kind = kind;
    host_at = at;
    host_always = always;
    host_forces = host_hessians = 0;
}

/* Whether the fault has occurred. */
static inline bool host_has_broken(void)
{
    bool force = host_fault_kind == HOST_NAN_FORCE || host_fault_kind == HOST_INFINITE_FORCE;
    return (force ? host_forces : host_hessians) >= host_at;
}

static inline bool host_is_due(long evaluation)
{
    return host_at > 0 && (evaluation == host_at || (host_always && evaluation > host_at));
}

static inline drape_status host_build(const drape_cloth_view *cloth, const double *params,
                                      drape_term_builder *builder)
{
    (void)params;
    drape_status status = drape_term_reserve(builder, cloth->node_count, 1);
    for (int32_t i = 0; !status && i < cloth->node_count; i++)
        drape_term_set(builder, i, &i, &cloth->node_mass[i]);
    return status;
}

#define HOST_DT   (1.0 / 64)
#define HOST_NODE 7 /* the node with the fault */

/* Without a fault E = 0. */
static inline void host_energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                               const double *internal, double *e, double *g, double *hess)
{
    (void)x, (void)internal;
    bool force = host_fault_kind == HOST_NAN_FORCE || host_fault_kind == HOST_INFINITE_FORCE;
    bool due = hess ? host_is_due(++host_hessians) && !force : host_is_due(++host_forces) && force;
    size_t n = (size_t)count;
    if (e)
        memset(e, 0, n * sizeof *e);
    if (g)
        memset(g, 0, 3 * n * sizeof *g);
    if (hess)
        memset(hess, 0, 9 * n * sizeof *hess);
    if (!due || first > HOST_NODE)
        return;
    switch (host_fault_kind) {
    case HOST_NAN_FORCE:
    case HOST_INFINITE_FORCE:
        g[3 * HOST_NODE + 1] = host_fault_kind == HOST_NAN_FORCE ? NAN : -INFINITY;
        break;
    case HOST_NAN_HESSIAN:
    case HOST_INFINITE_HESSIAN:
        hess[9 * HOST_NODE + 4] = host_fault_kind == HOST_NAN_HESSIAN ? NAN : INFINITY;
        break;
    case HOST_SINGULAR:
        for (int32_t i = 0; i < count; i++)
            for (int k = 0; k < 9; k += 4)
                hess[9 * i + k] = -el->rest[first + i] * (1 / (host_step * host_step));
        break;
    case HOST_NOTHING:
        break;
    }
}

static const drape_term_ops host_term = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "host.break", .summary = "breaks on demand", .reference = "-"},
    .element_name = "node",
    .nodes = 1,
    .build = host_build,
    .energy = host_energy};

/* ---- The sim ---- */

typedef struct host_sim {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
    long attempts, rejected, unconverged, nonfinite; /* unconverged, nonfinite: accepted steps only */
    char last_reason[40];
    double last_h;
} host_sim;

static inline bool host_all_finite(const double *a, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(a[i]))
            return false;
    return true;
}

static inline drape_status host_observe(void *user, const drape_event *event)
{
    host_sim *s = user;
    const drape_attempt *a = event->attempt;
    size_t n = 3 * (size_t)drape_model_node_count(s->model);
    if (event->kind == DRAPE_EVENT_FRAME) {
        s->nonfinite += !host_all_finite(event->positions, n);
        return DRAPE_OK;
    }
    s->attempts++;
    s->rejected += !a->accepted;
    s->unconverged += a->accepted && (a->status != DRAPE_OK || !(a->residual <= a->tolerance));
    s->nonfinite += !host_all_finite(drape_sim_positions(s->sim), n);
    s->nonfinite += !host_all_finite(drape_sim_velocities(s->sim), n);
    snprintf(s->last_reason, sizeof s->last_reason, "%s", a->reason);
    s->last_h = a->h;
    return DRAPE_OK;
}

/* settings: members of "integrator" besides dt = 1/64 (whose powers are exact), beginning with a comma, and
 * further members of the scene. stretch: whether the cloth has springs; without them its free nodes fall
 * independently. */
static inline host_sim host_open(const char *integrator, const char *controller, bool stretch)
{
    char text[1024];
    host_sim s = {.attempts = 0};
    drape_scene *scene = NULL;
    host_break(HOST_NOTHING, 0, false);
    snprintf(text, sizeof text,
             "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 2, 'edge_length': 0.1},"
             " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
             " 'terms': [%s'host.break'], 'pins': [{'nodes': [0, 2]}]}],"
             " 'integrator': {'method': 'be', 'dt': 0.015625%s}, 'controller': {%s}, 'duration': 1}",
             stretch ? "'stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}, " : "",
             integrator, controller);
    quote(text);
    ck_assert_int_eq(drape_context_create(NULL, &s.ctx), DRAPE_OK);
    ck_assert_int_eq(drape_context_add_term(s.ctx, &host_term), DRAPE_OK);
    drape_status status = drape_scene_parse(s.ctx, text, "host", &scene);
    if (!status)
        status = drape_scene_compile(scene, &s.model);
    if (!status)
        status = drape_sim_create(s.ctx, s.model, NULL, &s.sim);
    assert_ok(s.ctx, status);
    drape_scene_destroy(&scene);
    return s;
}

/* s must not move in memory afterwards. */
static inline void host_watch(host_sim *s)
{
    ck_assert_int_eq(drape_sim_observe(s->sim, host_observe, s), DRAPE_OK);
}

static inline void host_close(host_sim *s)
{
    drape_sim_destroy(&s->sim);
    drape_model_destroy(&s->model);
    drape_context_destroy(&s->ctx);
}

/* A copy of the state of a sim, as its accessors give it. */
typedef struct host_copy {
    double t, x[96], v[96];
    uint64_t hash;
} host_copy;

static inline host_copy host_copy_state(const host_sim *s)
{
    host_copy copy = {.t = drape_sim_time(s->sim), .hash = drape_sim_hash(s->sim)};
    size_t bytes = 3 * (size_t)drape_model_node_count(s->model) * sizeof(double);
    ck_assert_uint_le(bytes, sizeof copy.x);
    memcpy(copy.x, drape_sim_positions(s->sim), bytes);
    memcpy(copy.v, drape_sim_velocities(s->sim), bytes);
    return copy;
}

static inline void host_check_state(const host_sim *s, const host_copy *expected)
{
    host_copy now = host_copy_state(s);
    ck_assert_double_eq(now.t, expected->t);
    ck_assert_uint_eq(now.hash, expected->hash);
    ck_assert_mem_eq(now.x, expected->x, sizeof now.x);
    ck_assert_mem_eq(now.v, expected->v, sizeof now.v);
}

/* The message is one line that begins with the time and contains the reason. */
static inline void host_check_message(const host_sim *s, const char *reason)
{
    char time[40];
    const char *message = drape_context_message(s->ctx);
    snprintf(time, sizeof time, "t=%.9g h=", drape_sim_time(s->sim));
    ck_assert_msg(strncmp(message, time, strlen(time)) == 0, "%s", message);
    ck_assert_msg(strstr(message, reason) && !strchr(message, '\n'), "%s is not in: %s", reason, message);
}

/* The settings of Newton's method that its reaction to faults depends on. The line search by work is not
 * among them: if a matrix is singular or not finite, it asks for another one and gets a good one. */
static const char *const host_settings[] = {", 'globalization': 'none'", ", 'globalization': 'line_search'",
                                            ", 'linear_solver': 'dense', 'globalization': 'none'"};
enum { HOST_SETTINGS = 3 };

#endif
