/* implicit.c: see implicit.h. */
#include "integrators/implicit.h"

#include <math.h>
#include <string.h>

/* ---- Creation and destruction ---- */

drape_status drape_implicit_init(drape_arena *arena, drape_system *system, drape_implicit *s)
{
    const drape_model *m = drape_system_model(system);
    *s = (drape_implicit){.motion = drape_system_motion(system), .hit_end = NAN, .made_end = NAN};
    drape_status status = drape_step_equation_init(arena, system, &s->equation);
    s->d = drape_arena_take(arena, 3 * (size_t)m->free_count, sizeof *s->d);
    s->carried = drape_arena_take(arena, 3 * (size_t)m->free_count, sizeof *s->carried);
    if (m->has_laws)
        s->history = drape_arena_take(arena, (size_t)m->measure_count, sizeof *s->history);
    if (m->has_dissipation)
        s->dissipated = drape_arena_take(arena, 3 * (size_t)m->node_count, sizeof *s->dissipated);
    for (int k = 0; m->has_kinetic && k < 2; k++)
        s->momentum[k] = drape_arena_take(arena, 3 * (size_t)m->node_count, sizeof(double));
    return status ? status : drape_arena_status(arena);
}

drape_status drape_implicit_init_newton(drape_arena *arena, drape_system *system, const double *values,
                                        drape_implicit *s)
{
    drape_status status = drape_ranks_agree(drape_model_ranks(drape_system_model(system)), arena->ctx,
                                            drape_implicit_init(arena, system, s));
    return status ? status : drape_newton_create(arena, &s->equation, values, 0, &s->newton);
}

drape_status drape_implicit_create(drape_arena *arena, drape_system *system, const double *values,
                                   void **state)
{
    drape_implicit *s = *state = drape_arena_take(arena, 1, sizeof *s);
    const drape_status status =
        drape_ranks_agree_memory(drape_model_ranks(drape_system_model(system)), arena->ctx, s);
    return status ? status : drape_implicit_init_newton(arena, system, values, s);
}

void drape_implicit_destroy(void **state)
{
    drape_implicit *s = *state;
    if (s)
        drape_newton_destroy(&s->newton);
    *state = NULL;
}

/* ---- The equation ---- */

void drape_implicit_place(const drape_implicit *s, const drape_state *in, double t, double span, double *x,
                          double *v)
{
    memcpy(x, in->x, s->equation.nodes * sizeof *x);
    memset(v, 0, s->equation.nodes * sizeof *v);
    drape_motion_place_pins(s->motion, t, x);
    for (int32_t i = 0; i < s->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)s->motion->moved_node[i] + k;
            v[at] = (x[at] - in->x[at]) / span;
        }
}

void drape_implicit_base(drape_implicit *s, const drape_state *in, double t, double span)
{
    drape_step_equation *e = &s->equation;
    e->point.internal = in->internal;
    e->point.history = NULL;
    e->expected = e->carried = NULL;
    e->pins_ahead = 0;
    e->point.t = e->point.span[1] = t;
    e->point.span[0] = in->t;
    e->x_start = in->x;
    drape_implicit_place(s, in, t, span, e->x_base, e->v_base);
}

void drape_implicit_begin_euler(drape_implicit *s, const drape_state *in, double t, double h)
{
    drape_step_equation *e = &s->equation;
    drape_implicit_base(s, in, t, h);
    s->made_end = NAN;
    e->point.weight = 1 / h;
    e->mass_weight = 1 / h * (1 / h);
    e->expected = e->inertia;
    e->error_share = 0.5; /* the local error is h^2 a / 2, and d - h v0 is h^2 a */
    for (size_t i = 0; i < e->dofs; i++)
        e->inertia[i] = h * in->v[drape_step_equation_at(e, i)];
    drape_implicit_carry(s, in, h, NULL, h);
    drape_implicit_momentum(s, in->t, in->x, in->v, s->momentum[0]);
    drape_implicit_set_momenta(s, 1 / h, 1, s->momentum[0], 0, NULL);
    e->point.history = s->history;
    if (!s->history)
        return;
    drape_implicit_measure(s, in->t, in->x, s->history);
    for (int64_t i = 0; i < e->model->measure_count; i++)
        s->history[i] /= -h;
}

/* Whether something that touches where the equation was evaluated last was hit in a step of h. */
static bool hits(const drape_step_equation *e, const drape_state *in, double h)
{
    const drape_contact *contact = drape_system_contact(e->system);
    return contact && drape_contact_impacts(contact, h, in->v);
}

void drape_implicit_end_euler(drape_implicit *s, const drape_state *in, drape_state *out, double h,
                              drape_step_info *info)
{
    const drape_step_equation *e = &s->equation;
    memcpy(out->x, e->x, e->nodes * sizeof *out->x);
    memcpy(out->v, e->v_base, e->nodes * sizeof *out->v);
    for (size_t i = 0; i < e->dofs; i++)
        out->v[drape_step_equation_at(e, i)] = s->d[i] / h;
    if (hits(e, in, h)) {
        s->made_end = out->t;
        drape_contact_rebound(drape_system_contact(e->system), h, in->v, out->v);
    }
    drape_ranks_fetch(e->ranks, out->v);
    drape_implicit_audit(s, in, out, info);
}

drape_status drape_implicit_euler(drape_implicit *s, const drape_state *in, drape_state *out, double h,
                                  drape_step_info *info)
{
    info->error = info->left = NAN; /* of another equation that was solved before */
    info->by_error = false;
    drape_implicit_begin_euler(s, in, out->t, h);
    s->equation.pins_ahead =
        drape_implicit_pins_ahead(s, in, h); /* trbdf2 and midpoint took longer with it */
    const drape_status status = drape_implicit_solve(s, info);
    if (!status || info->usable)
        drape_implicit_end_euler(s, in, out, h, info);
    return status;
}

bool drape_implicit_follows_impact(drape_implicit *s, const drape_state *in)
{
    if (s->made_end == in->t) /* the last attempt was accepted */
        s->hit_end = in->t;
    s->made_end = NAN;
    return s->hit_end == in->t;
}

bool drape_implicit_hits(const drape_implicit *s, const drape_state *in, double h, drape_status status)
{
    return status >= 0 && hits(&s->equation, in, h);
}

/* How far the moved pins among so many nodes, from `first` on, get ahead, in the mean. */
static void mean_ahead(const drape_implicit *s, int32_t first, int32_t nodes, const drape_state *in, double h,
                       const double *dv, double before, double mean[3])
{
    const drape_step_equation *e = &s->equation;
    double count = 0, sum[3] = {0};
    for (int32_t i = 0; i < s->motion->moved_count; i++) {
        const int32_t node = s->motion->moved_node[i] - first;
        if (node < 0 || node >= nodes || (e->model->part && !e->model->part->own[node]))
            continue;
        count++;
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)s->motion->moved_node[i] + k;
            sum[k] += e->x_base[at] - in->x[at] - h * in->v[at] - (dv ? h * h / 2 * dv[at] / before : 0);
        }
    }
    count = drape_ranks_sum(e->ranks, count);
    for (int k = 0; k < 3; k++)
        mean[k] = count > 0 ? drape_ranks_sum(e->ranks, sum[k]) / count : 0;
}

void drape_implicit_carry(drape_implicit *s, const drape_state *in, double h, const double *dv, double before)
{
    drape_step_equation *e = &s->equation;
    const drape_model *m = e->model;
    e->carried = drape_ranks_any(e->ranks, s->motion->moved_count > 0) ? s->carried : NULL;
    for (int32_t c = 0; e->carried && c < m->cloth_count; c++) {
        /* a rank has a part of the nodes, and copies of others, which come after its own free ones */
        const int32_t first = m->part ? 0 : m->cloths[c].first_node,
                      nodes = m->part ? m->node_count : m->cloths[c].mesh.node_count;
        double mean[3];
        mean_ahead(s, first, nodes, in, h, dv, before, mean);
        for (int32_t i = 0; i < nodes; i++) {
            const int32_t free = m->free_of_node[first + i];
            for (size_t k = 0; free >= 0 && free < m->free_count && k < 3; k++)
                s->carried[3 * (size_t)free + k] = e->expected[3 * (size_t)free + k] + mean[k];
        }
    }
}

double drape_implicit_pins_ahead(const drape_implicit *s, const drape_state *in, double h)
{
    const drape_step_equation *e = &s->equation;
    double most = 0;
    for (int32_t i = 0; i < s->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)s->motion->moved_node[i] + k;
            most = fmax(most, fabs(e->x_base[at] - in->x[at] - h * in->v[at]));
        }
    return drape_ranks_largest(e->ranks, most);
}

void drape_implicit_force_at_start(const drape_implicit *s, const drape_state *in, double *v, double *g)
{
    const drape_step_equation *e = &s->equation;
    for (size_t i = 0; i < e->dofs; i++)
        v[drape_step_equation_at(e, i)] = in->v[drape_step_equation_at(e, i)];
    const drape_point start = {.x = in->x,
                               .v = v,
                               .internal = in->internal,
                               .t = in->t,
                               .span = {e->point.span[0], e->point.span[1]},
                               .instant = true};
    drape_system_force(e->system, &start, g);
}

void drape_implicit_momentum(const drape_implicit *s, double t, const double *x, const double *v, double *p)
{
    const drape_point point = {.x = x, .v = v, .internal = s->equation.point.internal, .t = t};
    if (s->equation.momentum)
        drape_system_momentum(s->equation.system, &point, p);
}

void drape_implicit_set_momenta(drape_implicit *s, double rate, double a, const double *p_a, double b,
                                const double *p_b)
{
    drape_step_equation *e = &s->equation;
    e->point.momentum = e->momentum ? rate : 0;
    for (size_t i = 0; e->momentum && i < e->nodes; i++)
        e->momentum[i] = -rate * (a * p_a[i] + (p_b ? b * p_b[i] : 0));
}

void drape_implicit_measure(const drape_implicit *s, double t, const double *x, double *q)
{
    const drape_point point = {.x = x, .internal = s->equation.point.internal, .t = t};
    if (s->history)
        drape_system_measures(s->equation.system, &point, q);
}

drape_status drape_implicit_solve(drape_implicit *s, drape_step_info *info)
{
    memcpy(s->d, s->equation.inertia, s->equation.dofs * sizeof *s->d);
    return drape_implicit_solve_from(s, info);
}

drape_status drape_implicit_solve_from(drape_implicit *s, drape_step_info *info)
{
    drape_solve_report report;
    drape_status status = drape_newton_solve(s->newton, NULL, s->d, &report);
    drape_implicit_report(&report, info);
    return status;
}

void drape_implicit_report(const drape_solve_report *report, drape_step_info *info)
{
    info->reason = report->reason;
    info->iterations += report->iterations;
    info->laborious |= report->laborious;
    info->residual = report->residual;
    info->tolerance = report->tolerance;
    info->error = fmax(info->error, report->error); /* of several stages; NaN at first */
    info->left = fmax(info->left, report->left);
    info->own = report->own;
    info->solved = report->solved;
    info->by_error |= report->by_error;
    info->further_seconds += report->further_seconds;
    info->lenient = report->lenient;
    info->usable = report->usable;
    info->diagnostic = report->diagnostic;
}

/* ---- Work ---- */

double drape_implicit_collider_work(const drape_implicit *s, double t0, double t1)
{
    const double work =
        drape_motion_collider_work(s->motion, drape_system_on_colliders(s->equation.system), t0, t1);
    return drape_ranks_sum(s->equation.ranks, work);
}

void drape_implicit_audit(drape_implicit *s, const drape_state *in, const drape_state *out,
                          drape_step_info *info)
{
    drape_step_equation *e = &s->equation;
    double pin_work = 0, *work = drape_system_work(e->system);
    for (int32_t i = 0; i < s->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)s->motion->moved_node[i] + k;
            if (drape_model_owns(e->model, s->motion->moved_node[i]))
                pin_work += e->g[at] * (out->x[at] - in->x[at]);
        }
    pin_work = drape_ranks_sum(e->ranks, pin_work);
    pin_work += drape_system_support_work(e->system, NULL, in->t, out->t);
    work[DRAPE_BY_PINS] += pin_work;
    work[DRAPE_BY_COLLIDERS] += drape_implicit_collider_work(s, in->t, out->t);
    info->residual_work += fmax(drape_step_equation_dot(e, e->f, s->d), 0);
    if (!s->dissipated)
        return;
    /* From here on the forces on colliders, whose work was added above, are their dissipative part. */
    info->dissipated += drape_system_dissipation(e->system, &e->point, out->t - in->t, s->dissipated);
    info->dissipated += drape_implicit_collider_work(s, in->t, out->t);
}

/* The middle of a stage, with the mean velocity; in the base of the equation. */
static drape_point middle_of(drape_step_equation *e, const double *from, const double *to, double t,
                             double span)
{
    for (size_t i = 0; i < e->nodes; i++) {
        e->x_base[i] = (from[i] + to[i]) / 2;
        e->v_base[i] = (to[i] - from[i]) / span;
    }
    return (drape_point){.x = e->x_base,
                         .v = e->v_base,
                         .internal = e->point.internal,
                         .t = t + span / 2,
                         .span = {t, t + span}};
}

void drape_implicit_audit_stage(drape_implicit *s, const double *from, const double *to, double t,
                                double span, double *g, drape_step_info *info)
{
    drape_step_equation *e = &s->equation;
    const drape_point middle = middle_of(e, from, to, t, span);
    double *work = drape_system_work(e->system);
    if (drape_system_is_driven(e->system))
        drape_system_force(e->system, &middle, g);
    work[DRAPE_BY_PINS] += drape_system_support_work(e->system, NULL, t, t + span);
    work[DRAPE_BY_COLLIDERS] += drape_implicit_collider_work(s, t, t + span);
    for (int32_t i = 0; i < s->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)s->motion->moved_node[i] + k;
            const double gained = s->momentum[0] ? s->momentum[1][at] - s->momentum[0][at] : 0;
            work[DRAPE_BY_PINS] += (g[at] + gained / span) * (to[at] - from[at]);
        }
    drape_implicit_audit_dissipation(s, from, to, t, span, info);
}

void drape_implicit_audit_dissipation(drape_implicit *s, const double *from, const double *to, double t,
                                      double span, drape_step_info *info)
{
    drape_step_equation *e = &s->equation;
    if (!s->dissipated)
        return;
    const drape_point middle = middle_of(e, from, to, t, span);
    info->dissipated += drape_system_dissipation(e->system, &middle, span, s->dissipated);
    info->dissipated += drape_implicit_collider_work(s, t, t + span);
}

/* ---- For the table ---- */

void drape_implicit_restart(void *state, const drape_state *from)
{
    drape_implicit *s = state;
    (void)from;
    s->hit_end = s->made_end = NAN;
}

const double *drape_implicit_residual(const void *state)
{
    return ((const drape_implicit *)state)->equation.f;
}

double drape_implicit_tolerance(const void *state)
{
    return drape_newton_values(((const drape_implicit *)state)->newton)[DRAPE_NEWTON_TOLERANCE];
}

void drape_implicit_archive(void *state, drape_archive *a)
{
    drape_implicit *s = state;
    drape_archive_double(a, &s->hit_end);
    drape_archive_double(a, &s->made_end);
    drape_newton_archive(s->newton, a);
}

drape_work drape_implicit_work(const void *state)
{
    return ((const drape_implicit *)state)->equation.work;
}

size_t drape_implicit_bytes(const void *state)
{
    return drape_newton_bytes(((const drape_implicit *)state)->newton);
}
