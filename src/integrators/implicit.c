/* implicit.c: see implicit.h. */
#include "integrators/implicit.h"

#include <string.h>

static bool create_arrays(drape_implicit *s)
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

drape_status drape_implicit_init_arrays(drape_context *ctx, drape_system *system, drape_implicit *s)
{
    *s = (drape_implicit){.ctx = ctx,
                          .system = system,
                          .model = drape_system_model(system),
                          .motion = drape_system_motion(system)};
    return create_arrays(s) ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_implicit_init(drape_arena *arena, drape_system *system, const double *values,
                                 drape_implicit *s)
{
    drape_context *ctx = arena->ctx;
    drape_status status = drape_implicit_init_arrays(ctx, system, s);
    s->inertial_guess = values[DRAPE_NEWTON_PREDICTOR] == 0;
    return status ? status : drape_newton_create(arena, system, values, &s->newton);
}

void drape_implicit_free(drape_implicit *s)
{
    drape_newton_destroy(&s->newton);
    drape_free(s->ctx, s->x_base);
    drape_free(s->ctx, s->v_base);
    drape_free(s->ctx, s->inertia);
    drape_free(s->ctx, s->d);
    drape_free(s->ctx, s->history);
    drape_free(s->ctx, s->dissipated);
}

void drape_implicit_base(drape_implicit *s, const drape_state *in, double t, double span)
{
    const drape_model *m = s->model;
    size_t nodes = 3 * (size_t)m->node_count;
    s->t = s->span[1] = t;
    s->span[0] = in->t;
    s->x_start = in->x;
    memcpy(s->x_base, in->x, nodes * sizeof *s->x_base);
    memset(s->v_base, 0, nodes * sizeof *s->v_base);
    drape_motion_place_pins(s->motion, t, s->x_base);
    for (int32_t i = 0; i < s->motion->moved_count; i++)
        for (int k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)s->motion->moved_node[i] + (size_t)k;
            s->v_base[at] = (s->x_base[at] - in->x[at]) / span;
        }
}

void drape_implicit_measure(drape_implicit *s, const drape_state *state, double *q)
{
    if (s->history)
        drape_system_measures(s->system, &(drape_point){.x = state->x, .internal = state->internal}, q);
}

drape_status drape_implicit_solve(drape_implicit *s, const double *internal, const double *history,
                                  double weight, double mass_weight, drape_step_info *info)
{
    const drape_newton_problem problem = {.x_base = s->x_base,
                                          .v_base = s->v_base,
                                          .x_start = s->x_start,
                                          .weight = weight,
                                          .mass_weight = mass_weight,
                                          .inertia = s->inertia,
                                          .internal = internal,
                                          .history = history,
                                          .t = s->t,
                                          .span = {s->span[0], s->span[1]}};
    for (size_t i = 0; i < 3 * (size_t)s->model->free_count; i++)
        s->d[i] = s->inertial_guess ? s->inertia[i] : 0;
    return drape_newton_solve(s->newton, &problem, s->d, info);
}

double drape_implicit_collider_work(const drape_implicit *s, double t0, double t1)
{
    const drape_model *m = s->model;
    const double *force = drape_system_on_colliders(s->system);
    double work = 0;
    for (int32_t c = 0; force && c < m->collider_count; c++) {
        double before[3], after[3];
        if (!drape_motion_moves_collider(s->motion, c))
            continue;
        drape_motion_collider(s->motion, c, t0, before);
        drape_motion_collider(s->motion, c, t1, after);
        for (int k = 0; k < 3; k++)
            work += force[3 * c + k] * (after[k] - before[k]);
    }
    return work;
}

static double pin_work(const drape_implicit *s, const double *g, const drape_state *in,
                       const drape_state *out)
{
    double work = 0;
    for (int32_t i = 0; i < s->motion->moved_count; i++)
        for (int k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)s->motion->moved_node[i] + (size_t)k;
            work += g[at] * (out->x[at] - in->x[at]);
        }
    return work;
}

/* The forces on colliders are those of the last residual, which was at the solution. */
void drape_implicit_audit_at(drape_implicit *s, const drape_point *point, const double *g,
                             const drape_state *in, const drape_state *out, drape_step_info *info)
{
    info->pin_work += pin_work(s, g, in, out) + drape_implicit_collider_work(s, in->t, out->t);
    if (!s->dissipated)
        return;
    drape_system_dissipation(s->system, point, s->dissipated);
    for (size_t i = 0; i < 3 * (size_t)s->model->node_count; i++)
        info->dissipated += s->dissipated[i] * (out->x[i] - in->x[i]);
    info->dissipated += drape_implicit_collider_work(s, in->t, out->t);
}

void drape_implicit_audit(drape_implicit *s, const drape_state *in, const drape_state *out,
                          drape_step_info *info)
{
    drape_implicit_audit_at(s, drape_newton_point(s->newton), drape_newton_force(s->newton), in, out, info);
}

void drape_implicit_destroy(void **state)
{
    drape_implicit *s = *state;
    if (!s)
        return;
    drape_implicit_free(s);
    drape_free(s->ctx, s);
    *state = NULL;
}

drape_status drape_implicit_create(drape_arena *arena, drape_system *system, const double *values,
                                   void **state)
{
    drape_context *ctx = arena->ctx;
    *state = drape_alloc(ctx, 1, sizeof(drape_implicit));
    if (!*state)
        return DRAPE_E_MEMORY;
    drape_status status = drape_implicit_init(arena, system, values, *state);
    if (status)
        drape_implicit_destroy(state);
    return status;
}

/* One-step rows keep nothing of the past but factors. */
void drape_implicit_restart(void *state, const drape_state *from)
{
    (void)from;
    drape_newton_forget_factors(((drape_implicit *)state)->newton);
}

const double *drape_implicit_residual(const void *state)
{
    return drape_newton_residual(((const drape_implicit *)state)->newton);
}

void drape_implicit_archive(void *state, drape_archive *a)
{
    drape_newton_archive(((drape_implicit *)state)->newton, a);
}

drape_work drape_implicit_work(const void *state)
{
    return drape_newton_work(((const drape_implicit *)state)->newton);
}

size_t drape_implicit_array_bytes(const drape_implicit *s)
{
    size_t nodes = 3 * (size_t)s->model->node_count, dofs = 3 * (size_t)s->model->free_count;
    size_t doubles = 2 * nodes + 2 * dofs + (s->history ? (size_t)s->model->measure_count : 0) +
                     (s->dissipated ? nodes : 0);
    return doubles * sizeof(double);
}

size_t drape_implicit_bytes(const void *state)
{
    const drape_implicit *s = state;
    return drape_implicit_array_bytes(s) + drape_newton_bytes(s->newton);
}
