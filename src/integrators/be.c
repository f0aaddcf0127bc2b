/*
 * be: backward Euler, v1 = (x1 - x0)/h, M (v1 - v0)/h + g(x1, v1) = 0. First order, L-stable: it damps what
 * it cannot resolve, an oscillator's energy by the factor 1/(1 + (w h)^2) a step. Baraff & Witkin 1998,
 * solved to a tolerance and not by one linear solve.
 */
#include "integrators/newton.h"

#include <string.h>

typedef struct be_state {
    drape_context *ctx;
    drape_system *system;
    const drape_model *model;
    drape_newton *newton;
    bool inertial_guess;
    double *x_base, *v_base; /* nodes */
    double *inertia, *d;     /* free DOFs */
    double *history;         /* measures; NULL where no law wants rates */
    double *dissipated;      /* nodes; NULL where nothing dissipates */
} be_state;

static void destroy(void **state)
{
    be_state *s = *state;
    if (!s)
        return;
    drape_newton_destroy(&s->newton);
    drape_free(s->ctx, s->x_base);
    drape_free(s->ctx, s->v_base);
    drape_free(s->ctx, s->inertia);
    drape_free(s->ctx, s->d);
    drape_free(s->ctx, s->history);
    drape_free(s->ctx, s->dissipated);
    drape_free(s->ctx, s);
    *state = NULL;
}

static bool create_arrays(be_state *s)
{
    size_t nodes = 3 * (size_t)s->model->node_count, dofs = 3 * (size_t)s->model->free_count;
    s->x_base = drape_alloc(s->ctx, nodes, sizeof(double));
    s->v_base = drape_alloc(s->ctx, nodes, sizeof(double));
    s->inertia = drape_alloc(s->ctx, dofs, sizeof(double));
    s->d = drape_alloc(s->ctx, dofs, sizeof(double));
    if (s->model->has_laws)
        s->history = drape_alloc(s->ctx, (size_t)s->model->measure_count, sizeof(double));
    if (s->model->has_dissipation)
        s->dissipated = drape_alloc(s->ctx, nodes, sizeof(double));
    return s->x_base && s->v_base && s->inertia && s->d && (s->history || !s->model->has_laws) &&
           (s->dissipated || !s->model->has_dissipation);
}

static drape_status create(drape_context *ctx, drape_system *system, const double *values, void **state)
{
    be_state *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    s->ctx = ctx;
    s->system = system;
    s->model = drape_system_model(system);
    s->inertial_guess = values[DRAPE_NEWTON_PREDICTOR] == 0;
    drape_status status = create_arrays(s) ? DRAPE_OK : DRAPE_E_MEMORY;
    if (!status)
        status = drape_newton_create(ctx, system, values, &s->newton);
    if (status)
        destroy(state);
    return status;
}

/* Free nodes stand where they were, pinned ones where they will be. */
static void set_base(be_state *s, const drape_state *in, double t1, double h)
{
    const drape_model *m = s->model;
    size_t nodes = 3 * (size_t)m->node_count;
    memcpy(s->x_base, in->x, nodes * sizeof *s->x_base);
    memset(s->v_base, 0, nodes * sizeof *s->v_base);
    drape_model_place_pins(m, t1, s->x_base);
    for (int32_t i = 0; i < m->moved_count; i++)
        for (int k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)m->moved_node[i] + (size_t)k;
            s->v_base[at] = (s->x_base[at] - in->x[at]) / h;
        }
}

static void set_guess(be_state *s, const drape_state *in, double h)
{
    const drape_model *m = s->model;
    for (int64_t i = 0; i < 3 * (int64_t)m->free_count; i++) {
        s->inertia[i] = h * in->v[3 * (int64_t)m->node_of_free[i / 3] + i % 3];
        s->d[i] = s->inertial_guess ? s->inertia[i] : 0;
    }
}

/* q' = (q(x1) - q(x0))/h */
static void set_history(be_state *s, const drape_state *in, double h)
{
    if (!s->history)
        return;
    drape_system_measures(s->system, &(drape_point){.x = in->x, .internal = in->internal}, s->history);
    for (int64_t i = 0; i < s->model->measure_count; i++)
        s->history[i] /= -h;
}

static void write_state(const be_state *s, double h, drape_state *out)
{
    const drape_model *m = s->model;
    size_t nodes = 3 * (size_t)m->node_count;
    memcpy(out->x, s->x_base, nodes * sizeof *out->x);
    memcpy(out->v, s->v_base, nodes * sizeof *out->v);
    for (int64_t i = 0; i < 3 * (int64_t)m->free_count; i++) {
        int64_t at = 3 * (int64_t)m->node_of_free[i / 3] + i % 3;
        out->x[at] += s->d[i];
        out->v[at] = s->d[i] / h;
    }
}

/* Work over the step: of dissipative forces on all nodes, and of the pins, whose force is what M a + g lacks.
 */
static void audit(be_state *s, const drape_state *in, const drape_state *out, double h, drape_step_info *info)
{
    const drape_model *m = s->model;
    const double *g = drape_newton_force(s->newton);
    for (int32_t i = 0; i < m->moved_count; i++)
        for (int k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)m->moved_node[i] + (size_t)k;
            double reaction = m->mass[m->moved_node[i]] * (out->v[at] - in->v[at]) / h + g[at];
            info->pin_work += reaction * (out->x[at] - in->x[at]);
        }
    if (!s->dissipated)
        return;
    drape_system_dissipation(s->system, drape_newton_point(s->newton), s->dissipated);
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
        info->dissipated += s->dissipated[i] * (out->x[i] - in->x[i]);
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    be_state *s = state;
    set_base(s, in, out->t, h);
    set_guess(s, in, h);
    set_history(s, in, h);
    const drape_newton_problem problem = {.x_base = s->x_base,
                                          .v_base = s->v_base,
                                          .weight = 1 / h,
                                          .mass_weight = 1 / (h * h),
                                          .inertia = s->inertia,
                                          .internal = in->internal,
                                          .history = s->history};
    drape_status status = drape_newton_solve(s->newton, &problem, s->d, info);
    if (status && !info->usable)
        return status;
    write_state(s, h, out);
    audit(s, in, out, h, info);
    return status;
}

static void restart(void *state, const drape_state *from)
{
    (void)from; /* one-step: nothing of the past is kept but factors */
    be_state *s = state;
    drape_newton_forget_factors(s->newton);
}

static drape_work work(const void *state)
{
    return drape_newton_work(((const be_state *)state)->newton);
}

static size_t bytes(const void *state)
{
    const be_state *s = state;
    size_t nodes = 3 * (size_t)s->model->node_count, dofs = 3 * (size_t)s->model->free_count;
    size_t doubles = 2 * nodes + 2 * dofs + (s->history ? (size_t)s->model->measure_count : 0) +
                     (s->dissipated ? nodes : 0);
    return doubles * sizeof(double) + drape_newton_bytes(s->newton);
}

const drape_integrator_ops drape_integrator_be = {
    .name = "be",
    .summary = "backward Euler by Newton: fixed step, first order, L-stable",
    .reference = "Baraff & Witkin 1998, solved to a tolerance",
    .order = 1,
    .params = drape_newton_params,
    .param_count = DRAPE_NEWTON_PARAM_COUNT,
    .create = create,
    .step = step,
    .restart = restart,
    .work = work,
    .bytes = bytes,
    .destroy = destroy,
};
