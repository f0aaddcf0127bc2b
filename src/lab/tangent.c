/* tangent.c: see tangent.h. */
#include "lab/tangent.h"

#include "base/finite.h"
#include "solvers/inertia.h"

#include <math.h>
#include <string.h>

/* The largest change of an edge, in parts of its length, between the two tangents of a difference and the
 * state. The error of the difference is of the order of its square; that of rounding, of 1e-16 over it. */
#define DIFFERENCE 1e-4
/* Relative to the largest diagonal entry: more than rounding, less than any load that follows the cloth. */
#define MAX_ASYMMETRY 1e-10

static drape_point point_at(const lab_tangent *t, const double *x)
{
    const drape_state *now = drape_sim_state(t->sim);
    return (drape_point){.x = x,
                         .v = t->zero,
                         .internal = now->internal,
                         .t = now->t,
                         .full = t->full,
                         .span = {now->t, now->t}};
}

/* values = K at nodes x and a factor of the loads: K without the loads, and the factor times the difference
 * that they make. */
static void evaluate(const lab_tangent *t, const double *x, double factor, double *values)
{
    const drape_point point = point_at(t, x);
    const size_t count = (size_t)t->pattern->nonzeros;
    drape_system_jacobian_without(t->system, &point, 0, 0, t->without, values);
    if (factor == 0 || t->linear)
        return;
    drape_system_jacobian_without(t->system, &point, 0, 0, t->dissipative, t->scratch);
    for (size_t i = 0; i < count; i++)
        values[i] += factor * (t->scratch[i] - values[i]);
}

static void take_free(const drape_model *m, const double *nodes, double *free)
{
    for (int32_t f = 0; f < m->free_count; f++)
        memcpy(free + 3 * (size_t)f, nodes + 3 * (size_t)m->node_of_free[f], 3 * sizeof *free);
}

static drape_status read_state(lab_tangent *t, bool needs_potential)
{
    drape_arena *arena = &t->arena;
    const drape_model *m = t->sim->model;
    const drape_state *now = drape_sim_state(t->sim);
    const drape_point point = point_at(t, now->x);
    bool changed;
    DRAPE_TRY(drape_system_begin_reading(t->system, now));
    DRAPE_TRY(drape_system_extend_pattern(t->system, &point, &changed));
    t->pattern = drape_system_pattern(t->system);
    const size_t count = (size_t)t->pattern->nonzeros, nodes = 3 * (size_t)m->node_count;
    double *force = drape_arena_take(arena, (size_t)t->pattern->n, sizeof *force);
    t->nodes = drape_arena_take(arena, 2 * nodes, sizeof *t->nodes);
    t->scratch = drape_arena_take(arena, count, sizeof *t->scratch);
    t->values = drape_arena_take(arena, count, sizeof *t->values);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    evaluate(t, now->x, t->factor, t->values);
    if (!drape_all_finite(t->values, count))
        return drape_fail(t->ctx, DRAPE_E_SOLVER, "the stiffness of this state is not finite");
    lab_tangent_evaluate(t, now->x, t->factor, force, NULL, NULL);
    for (int64_t i = 0; i < t->pattern->n; i++)
        t->force = fmax(t->force, fabs(force[i]));
    /* Friction is left out of K: where it sticks it has no stiffness, and where it slips none that is
     * symmetric. Other parts that are not symmetric, such as that of drag.wind in its own wind, do not belong
     * to K either. */
    if (drape_system_is_symmetric(t->system))
        lab_tangent_is_symmetric(t, t->values);
    else
        drape_system_symmetrize(t->system, &point, 0, t->values);
    if (!needs_potential || !t->follows)
        return DRAPE_OK;
    /* Refuses loads without a potential. The stiffness of these loads alone decides, because that of the
     * cloth may be symmetric all the same where the cloth is held, as under a pressure on cloth that is
     * pinned all round. */
    drape_system_jacobian_without(t->system, &point, 0, 0, t->potential, t->scratch);
    const double asymmetry = drape_pattern_asymmetry(t->pattern, t->scratch);
    return asymmetry > MAX_ASYMMETRY
               ? drape_fail(t->ctx, DRAPE_E_ARGUMENT,
                            "the stiffness of a load that follows the cloth is not symmetric, by %.2g of its "
                            "largest entry: modes are only computed of loads with a potential",
                            asymmetry)
               : DRAPE_OK;
}

drape_status lab_tangent_open(drape_sim *sim, double factor, bool needs_potential, lab_tangent *t)
{
    const drape_model *m = sim->model;
    *t = (lab_tangent){.ctx = sim->ctx, .sim = sim, .factor = factor, .arena = drape_arena_of(sim->ctx)};
    drape_arena *arena = &t->arena;
    if (m->free_count == 0)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "all nodes are pinned: there are no modes");
    if (m->has_kinetic)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "a term has an energy of motion, so that the mass matrix depends on the shape: "
                          "modes are only computed without");
    int32_t *same = drape_arena_take(arena, (size_t)m->collider_count, sizeof *same);
    t->zero = drape_arena_take(arena, 3 * (size_t)m->node_count, sizeof *t->zero);
    t->mass = drape_arena_take(arena, 3 * (size_t)m->free_count, sizeof *t->mass);
    t->dissipative = drape_arena_take(arena, (size_t)m->term_count, sizeof *t->dissipative);
    t->without = drape_arena_take(arena, (size_t)m->term_count, sizeof *t->without);
    t->potential = drape_arena_take(arena, (size_t)m->term_count, sizeof *t->potential);
    DRAPE_TRY(drape_arena_status(arena));
    for (int32_t c = 0; c < m->collider_count; c++)
        same[c] = c;
    t->full = drape_sim_state(sim)->t == 0;
    t->linear = true;
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_term_ops *ops = m->terms[i].ops;
        t->dissipative[i] = ops->dissipation && !ops->external;
        t->without[i] = ops->dissipation || ops->external;
        t->potential[i] = !(ops->dissipation && ops->external);
        t->follows = t->follows || !t->potential[i];
        t->linear = t->linear && (!ops->external || ops->linear);
    }
    for (int32_t i = 0; i < 3 * m->free_count; i++)
        t->mass[i] = m->mass[m->node_of_free[i / 3]];
    const int threads = drape_pool_threads(drape_system_pool(sim->system));
    DRAPE_TRY(drape_system_create(arena, m, threads, &t->system));
    if (drape_system_contact(sim->system))
        DRAPE_TRY(drape_system_add_contact(t->system));
    DRAPE_TRY(drape_system_continue(t->system, sim->system, same, drape_sim_state(sim)->t));
    drape_system_copy_wind(t->system, sim->system);
    DRAPE_TRY(read_state(t, needs_potential));
    t->solver = drape_linear_best(t->pattern->n);
    return t->solver->create(arena, t->pattern, &t->factors);
}

void lab_tangent_close(lab_tangent *t)
{
    if (t->solver)
        drape_linear_destroy(t->solver, &t->factors);
    drape_system_destroy(&t->system);
    drape_arena_free(&t->arena);
}

bool lab_tangent_is_symmetric(const lab_tangent *t, double *values)
{
    const bool symmetric = !(drape_pattern_asymmetry(t->pattern, values) > MAX_ASYMMETRY);
    if (symmetric)
        drape_pattern_symmetrize(t->pattern, values);
    return symmetric;
}

drape_status lab_tangent_factor_definite(const lab_tangent *t, const double *values, bool *definite)
{
    const drape_linear_ops *solver = t->solver;
    int64_t negative = 0;
    bool known = true;
    drape_status status = DRAPE_OK;
    if (!solver->factor_definite)
        status = drape_inertia(t->ctx, t->pattern, values, NULL, &negative, &known);
    *definite = known && negative == 0;
    if (!status && *definite)
        status = (solver->factor_definite ? solver->factor_definite : solver->factor)(t->factors, values);
    *definite = *definite && !status;
    return status < 0 ? status : DRAPE_OK;
}

drape_status lab_tangent_solve(const lab_tangent *t, double *b, double *x)
{
    return t->solver->solve(t->factors, b, x);
}

void lab_tangent_multiply(const lab_tangent *t, const double *values, const double *x, double *y)
{
    const drape_pattern *p = t->pattern;
    for (int64_t j = 0; j < p->n; j++) {
        double sum = 0;
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            sum += values[k] * x[drape_pattern_row(p, j, k)];
        y[j] = sum;
    }
}

void lab_tangent_shift(const lab_tangent *t, double share, const double *other, double *to)
{
    const drape_pattern *p = t->pattern;
    memcpy(to, t->values, (size_t)p->nonzeros * sizeof *to);
    for (int64_t i = 0; other && i < p->nonzeros; i++)
        to[i] += share * other[i];
    for (int32_t j = 0; !other && j < p->block_count; j++) {
        int64_t stride;
        double *block = drape_pattern_at(p, to, j, p->diagonal[j], &stride);
        for (int k = 0; k < 3; k++)
            block[k * stride + k] += share * t->mass[3 * j + k];
    }
}

double lab_tangent_evaluate(const lab_tangent *t, const double *x, double factor, double *force, double *load,
                            double *values)
{
    const drape_model *m = t->sim->model;
    const drape_point point = point_at(t, x);
    const size_t n = 3 * (size_t)m->node_count;
    double *g = t->nodes, *loads = t->nodes + n, largest = 0;
    if (values)
        evaluate(t, x, factor, values);
    if (!force && !load)
        return 0;
    drape_system_force_without(t->system, &point, t->without, g);
    drape_system_force_without(t->system, &point, t->dissipative, loads);
    for (size_t i = 0; i < n; i++) {
        largest = fmax(largest, fabs(g[i]));
        loads[i] -= g[i];
        g[i] += factor * loads[i];
    }
    if (load)
        take_free(m, loads, load);
    if (force)
        take_free(m, g, force);
    return largest;
}

drape_status lab_tangent_slope(lab_tangent *t, const double *u, double *values)
{
    const size_t count = (size_t)t->pattern->nonzeros;
    /* The largest change of an edge along u, in parts of its length: of its length or of its direction. */
    const drape_model *m = t->sim->model;
    const double *now = drape_sim_state(t->sim)->x;
    double change = 0;
    for (int32_t e = 0; e < m->edge_count; e++) {
        double moved = 0, length = 0;
        const int32_t a = m->edge[2 * e], b = m->edge[2 * e + 1];
        const int32_t fa = m->free_of_node[a], fb = m->free_of_node[b];
        for (int k = 0; k < 3; k++) {
            const double d = (fa < 0 ? 0 : u[3 * fa + k]) - (fb < 0 ? 0 : u[3 * fb + k]);
            const double l = now[3 * (size_t)a + (size_t)k] - now[3 * (size_t)b + (size_t)k];
            moved += d * d;
            length += l * l;
        }
        change = fmax(change, sqrt(moved / length));
    }
    double *x = drape_arena_take(&t->arena, 3 * (size_t)m->node_count, sizeof *x);
    double *before = drape_arena_take(&t->arena, count, sizeof *before);
    if (drape_arena_status(&t->arena))
        return DRAPE_E_MEMORY;
    if (!(change > 0) || !isfinite(change))
        return drape_fail(t->ctx, DRAPE_E_ARGUMENT,
                          "no load deforms the cloth: without loads there is no buckling load");
    const double h = DIFFERENCE / change;
    for (int side = -1; side <= 1; side += 2) {
        bool changed;
        memcpy(x, now, 3 * (size_t)m->node_count * sizeof *x);
        for (int32_t i = 0; i < 3 * m->free_count; i++)
            x[3 * (size_t)m->node_of_free[i / 3] + (size_t)(i % 3)] += side * h * u[i];
        const drape_point point = point_at(t, x);
        drape_status status = drape_system_extend_pattern(t->system, &point, &changed);
        if (status)
            return status;
        if (changed || drape_system_contact_energy(t->system, &point) > 0)
            return drape_fail(t->ctx, DRAPE_E_ARGUMENT,
                              "cloth is in contact: its stiffness is not smooth in the loads, so that "
                              "buckling loads cannot be extrapolated");
        evaluate(t, x, t->factor + side * h, side < 0 ? before : values);
    }
    for (size_t i = 0; i < count; i++)
        values[i] = (values[i] - before[i]) / (2 * h);
    drape_pattern_symmetrize(t->pattern, values);
    return DRAPE_OK;
}
