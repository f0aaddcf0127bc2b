/* step_equation.c: see step_equation.h. */
#include "nonlinear/step_equation.h"

#include "base/finite.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define FAR_FROM_ROUNDING 1e3  /* times the last estimate of a solve */
#define PROBED            1e-6 /* of the displacement of pins: their pull is a difference over that much */
#define MAX_PASSES        3    /* of shortening a displacement at nodes */

drape_status drape_step_equation_init(drape_arena *arena, drape_system *system, drape_step_equation *s)
{
    const drape_model *model = drape_system_model(system);
    *s = (drape_step_equation){.system = system,
                               .model = model,
                               .ranks = drape_model_ranks(model),
                               .nodes = 3 * (size_t)model->node_count,
                               .dofs = 3 * (size_t)model->free_count,
                               .all_dofs = 3 * (double)drape_model_all_free(model),
                               .all_nodes = (double)drape_model_whole(model)->node_count};
    s->x_base = drape_arena_take(arena, s->nodes, sizeof *s->x_base);
    s->v_base = drape_arena_take(arena, s->nodes, sizeof *s->v_base);
    s->inertia = drape_arena_take(arena, s->dofs, sizeof *s->inertia);
    s->x = drape_arena_take(arena, s->nodes, sizeof *s->x);
    s->v = drape_arena_take(arena, s->nodes, sizeof *s->v);
    s->g = drape_arena_take(arena, s->nodes, sizeof *s->g);
    s->f = drape_arena_take(arena, s->dofs, sizeof *s->f);
    s->weight = drape_arena_take(arena, s->dofs / 3, sizeof *s->weight);
    s->probe = drape_arena_take(arena, s->nodes, sizeof *s->probe);
    for (size_t i = 0; s->weight && i < s->dofs / 3; i++)
        s->weight[i] = 1;
    s->max_residual = INFINITY;
    if (model->has_kinetic)
        s->momentum = drape_arena_take(arena, s->nodes, sizeof *s->momentum);
    s->has_contact = drape_system_contact(system) != NULL;
    if (s->has_contact)
        s->x_ahead = drape_arena_take(arena, s->nodes, sizeof *s->x_ahead);
    s->point = (drape_point){.x = s->x, .v = s->v};
    return drape_arena_status(arena);
}

void drape_step_equation_begin(drape_step_equation *s)
{
    memcpy(s->x, s->x_base, s->nodes * sizeof *s->x);
    memcpy(s->v, s->v_base, s->nodes * sizeof *s->v);
}

void drape_step_equation_move(drape_step_equation *s, const double *d)
{
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_step_equation_at(s, i);
        s->x[at] = s->x_base[at] + d[i];
        s->v[at] = s->v_base[at] + s->point.weight * d[i];
    }
    if (s->ranks)
        s->ranks->fetch(s->ranks, (double *[]){s->x, s->v}, 2);
}

bool drape_step_equation_is_finite(const drape_step_equation *s, const double *a)
{
    return drape_ranks_all(s->ranks, drape_all_finite(a, s->dofs));
}

/* g at the point. */
static void evaluate_forces(drape_step_equation *s, double *g)
{
    drape_system_force(s->system, &s->point, g);
    for (size_t i = 0; s->momentum && i < s->nodes; i++)
        g[i] += s->momentum[i];
}

bool drape_step_equation_evaluate(drape_step_equation *s, const double *d)
{
    double start = drape_system_clock(s->system);
    drape_step_equation_move(s, d);
    evaluate_forces(s, s->g);
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_step_equation_at(s, i);
        s->f[i] = s->mass_weight * s->model->mass[at / 3] * (d[i] - s->inertia[i]) + s->g[at];
    }
    s->work.residuals++;
    s->work.residual_seconds += drape_system_clock(s->system) - start;
    return drape_system_agree_finite(s->system, s->f, s->dofs);
}

/* x_ahead: the end of the step p from the last point. */
static void look_ahead(drape_step_equation *s, const double *p)
{
    memcpy(s->x_ahead, s->x, s->nodes * sizeof *s->x_ahead);
    for (size_t i = 0; i < s->dofs; i++)
        s->x_ahead[drape_step_equation_at(s, i)] += p[i];
    drape_ranks_fetch(s->ranks, s->x_ahead);
}

double drape_step_equation_make_feasible(drape_step_equation *s, double *p)
{
    if (!s->has_contact)
        return 1;
    look_ahead(s, p);
    double fraction = drape_system_step_fraction(s->system, s->x, s->x_ahead, s->point.t, false, NULL);
    for (size_t i = 0; fraction < 1 && i < s->dofs; i++)
        p[i] *= fraction;
    return fraction;
}

bool drape_step_equation_shorten_nodes(drape_step_equation *s, double *p, double *fraction)
{
    for (int pass = 0; pass < MAX_PASSES; pass++) {
        look_ahead(s, p);
        if (drape_system_step_fraction(s->system, s->x, s->x_ahead, s->point.t, pass > 0, fraction) == 1)
            return true;
        for (size_t i = 0; i < s->dofs; i++)
            p[i] *= fraction[drape_step_equation_at(s, i) / 3];
    }
    return false;
}

void drape_step_equation_predict_contact(drape_step_equation *s, const double *p)
{
    if (!s->has_contact)
        return;
    memset(s->x_ahead, 0, s->nodes * sizeof *s->x_ahead);
    for (size_t i = 0; p && i < s->dofs; i++)
        s->x_ahead[drape_step_equation_at(s, i)] = p[i];
    drape_ranks_fetch(s->ranks, s->x_ahead);
    drape_system_predict_contact(s->system, p ? s->x_ahead : NULL, s->point.weight, s->mass_weight);
}

/* ---- Pins that move ---- */

bool drape_step_equation_pins_move(const drape_step_equation *s)
{
    const drape_motion *motion = drape_system_motion(s->system);
    bool move = false;
    for (int32_t i = 0; i < motion->moved_count && !move; i++) {
        const size_t at = 3 * (size_t)motion->moved_node[i];
        move = memcmp(s->x_base + at, s->x_start + at, 3 * sizeof *s->x_base) != 0;
    }
    return drape_ranks_any(s->ranks, move);
}

void drape_step_equation_follow_pins(const drape_step_equation *s, double *d)
{
    const drape_motion *motion = drape_system_motion(s->system);
    double mean[3] = {0};
    for (int32_t i = 0; i < motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)motion->moved_node[i] + k;
            mean[k] += (s->x_base[at] - s->x_start[at]) / motion->moved_count;
        }
    for (size_t i = 0; i < s->dofs; i++)
        d[i] = mean[drape_step_equation_at(s, i) % 3];
}

/* F at d = 0 with the pins where a share of their displacement takes them. */
static void evaluate_with_pins(drape_step_equation *s, const double *zero, double share)
{
    const drape_motion *motion = drape_system_motion(s->system);
    for (int32_t i = 0; i < motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)motion->moved_node[i] + k;
            s->x[at] = s->x_start[at] + share * (s->x_base[at] - s->x_start[at]);
            s->v[at] = share * s->v_base[at];
        }
    drape_step_equation_evaluate(s, zero);
}

void drape_step_equation_pull(drape_step_equation *s, double *zero, double *f)
{
    memset(zero, 0, s->dofs * sizeof *zero);
    evaluate_with_pins(s, zero, PROBED);
    memcpy(f, s->f, s->dofs * sizeof *f);
    evaluate_with_pins(s, zero, 0);
    for (size_t i = 0; i < s->dofs; i++)
        f[i] = s->f[i] + (f[i] - s->f[i]) / PROBED;
}

typedef struct norms {
    double max, l1, squares;
} norms;

static void add_entry(norms *sum, double f)
{
    sum->max = fabs(f) > sum->max ? fabs(f) : sum->max;
    sum->l1 += fabs(f);
    sum->squares += f * f;
}

static double choose(const drape_step_equation *s, const norms *sum, drape_norm norm)
{
    return norm == DRAPE_NORM_MAX  ? drape_ranks_largest(s->ranks, sum->max)
           : norm == DRAPE_NORM_L1 ? drape_ranks_sum(s->ranks, sum->l1)
                                   : sqrt(drape_ranks_sum(s->ranks, sum->squares));
}

double drape_step_equation_norm(const drape_step_equation *s, drape_norm norm)
{
    norms sum = {0};
    for (size_t i = 0; i < s->dofs; i++)
        add_entry(&sum, s->weight[i / 3] * s->f[i]);
    return choose(s, &sum, norm);
}

void drape_step_equation_shift(double *nodes, size_t n)
{
    for (size_t i = 0; i < n; i += 3) {
        const double size = fmax(fabs(nodes[i]), fmax(fabs(nodes[i + 1]), fabs(nodes[i + 2])));
        for (size_t k = i; k < i + 3; k++) {
            /* signs without a pattern that a mesh could have: bits of the multiples of the golden ratio */
            const bool up = (uint32_t)k * 2654435769u >> 31;
            nodes[k] += up ? DBL_EPSILON * size : -DBL_EPSILON * size;
        }
    }
}

/* The rounding error of a term is some DBL_EPSILON times the term. At small h the inertia of a node in
 * flight, M |v|/h, is more than 1e16 times a tight tolerance, and halving h doubles it. Internal forces have
 * that of their stiffness times the positions, which is far above that of their sum in a stiff sheet at
 * rest. */
double drape_step_equation_rounding(drape_step_equation *s, const double *d, drape_norm norm)
{
    norms sum = {0};
    drape_step_equation_shift(s->x, s->nodes);
    drape_step_equation_shift(s->v, s->nodes);
    evaluate_forces(s, s->probe);
    drape_step_equation_begin(s);
    drape_step_equation_move(s, d);
    if (!drape_ranks_all(s->ranks, drape_all_finite(s->probe, s->nodes)))
        return NAN;
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_step_equation_at(s, i);
        double inertia = s->mass_weight * s->model->mass[at / 3] * (fabs(d[i]) + fabs(s->inertia[i]));
        double error = fabs(s->probe[at] - s->g[at]) + DBL_EPSILON * (inertia + fabs(s->g[at]));
        add_entry(&sum, DRAPE_ROUNDINGS * s->weight[i / 3] * error);
    }
    return choose(s, &sum, norm);
}

bool drape_step_equation_is_rounding(drape_step_equation *s, const double *d, drape_norm norm,
                                     double *rounding)
{
    const double size = drape_step_equation_norm(s, norm);
    if (size > FAR_FROM_ROUNDING * *rounding)
        return false;
    *rounding = drape_step_equation_rounding(s, d, norm);
    return size <= *rounding;
}

double drape_step_equation_inertial_error(const drape_step_equation *s, double *left)
{
    double squares = 0, work = 0;
    for (size_t i = 0; i < s->dofs; i++) {
        const double p = s->f[i] / (s->mass_weight * s->model->mass[drape_step_equation_at(s, i) / 3]);
        squares += p * p;
        work += p * s->f[i];
    }
    if (left)
        *left = drape_ranks_sum(s->ranks, work);
    return sqrt(drape_ranks_sum(s->ranks, squares) / s->all_nodes);
}

double drape_step_equation_local_error(const drape_step_equation *s, const double *d)
{
    double sum[2] = {0, 0};
    for (size_t i = 0; i < s->dofs; i++)
        drape_step_equation_add_own_error(s, i, d[i], sum);
    const double expected = drape_ranks_sum(s->ranks, sum[0]), carried = drape_ranks_sum(s->ranks, sum[1]);
    return s->expected ? fmin(expected, carried) : NAN;
}

drape_diagnostic drape_step_equation_diagnose(const drape_step_equation *s, double tolerance)
{
    for (size_t i = 0; i < s->dofs; i++)
        s->probe[i] = s->weight[i / 3] * s->f[i];
    return drape_system_diagnose_dof(s->system, s->probe, "residual [N]", tolerance);
}

drape_status drape_step_equation_find_cause(const drape_step_equation *s, drape_status status,
                                            drape_solve_report *report)
{
    drape_status degenerate =
        drape_system_check(s->system, s->x, NULL, s->point.internal, &report->reason, &report->diagnostic);
    return degenerate ? degenerate : status;
}
