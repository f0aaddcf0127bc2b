/*
 * inexact_newton.c: see inexact_newton.h. The stages of an iteration:
 *     correct   A p = -F by conjugate gradients, with A near J
 *     feasible  p shortened to its feasible fraction, on which nothing passes through anything
 *     advance   d + a p with a = 1, 1/2, 1/4 ..., until the residual at its end does little work along p
 */
#include "nonlinear/inexact_newton.h"

#include "base/clock.h"
#include "base/reason.h"
#include "nonlinear/approx_jacobian.h"

#include <math.h>
#include <string.h>

/* Fraction of the initial work along a correction that the residual may do beyond the minimum. */
#define WORK_FRACTION 0.5
#define MAX_HALVINGS  6 /* halvings of a correction; the last one is taken if F is finite there */

struct drape_inexact_newton {
    drape_step_equation *equation;
    drape_approx_jacobian *matrix; /* NULL without free nodes */
    double *p, *minus_f, *trial;   /* free DOFs */
};

drape_status drape_inexact_newton_create(drape_arena *arena, drape_step_equation *equation,
                                         int coarse_spacing, drape_inexact_newton **out)
{
    drape_inexact_newton *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->equation = equation;
    s->p = drape_arena_take(arena, equation->dofs, sizeof *s->p);
    s->minus_f = drape_arena_take(arena, equation->dofs, sizeof *s->minus_f);
    s->trial = drape_arena_take(arena, equation->dofs, sizeof *s->trial);
    if (drape_arena_status(arena) || equation->dofs == 0)
        return drape_arena_status(arena);
    return drape_approx_jacobian_create(arena, equation->system, coarse_spacing, &s->matrix);
}

void drape_inexact_newton_destroy(drape_inexact_newton **newton)
{
    if (*newton)
        drape_approx_jacobian_destroy(&(*newton)->matrix);
    *newton = NULL;
}

static drape_status correct(drape_inexact_newton *s, const drape_inexact_settings *settings)
{
    drape_step_equation *e = s->equation;
    drape_status status = drape_approx_jacobian_update(s->matrix, &e->point, e->mass_weight, &e->work);
    if (status)
        return status;
    double start = drape_clock_seconds();
    for (size_t i = 0; i < e->dofs; i++)
        s->minus_f[i] = -e->f[i];
    e->work.linear_iterations += drape_approx_jacobian_solve(
        s->matrix, s->minus_f, s->p, settings->linear_tolerance, settings->max_linear_iterations);
    e->work.solve_seconds += drape_clock_seconds() - start;
    return DRAPE_OK;
}

/* Returns false if F is finite at none of the step lengths. */
static bool advance(drape_inexact_newton *s, double *d)
{
    drape_step_equation *e = s->equation;
    double start = drape_step_equation_dot(e, e->f, s->p), a = 1, work;
    for (int k = 0; k <= MAX_HALVINGS; k++, a /= 2) {
        bool finite = drape_step_equation_try(e, d, a, s->p, s->trial, &work);
        if (finite && (k == MAX_HALVINGS || !(work > -WORK_FRACTION * start))) {
            memcpy(d, s->trial, e->dofs * sizeof *d);
            return true;
        }
    }
    return false;
}

/* A residual that does not fall may be the rounding error of its forces. */
static bool is_rounding(drape_step_equation *e, const double *d, drape_solve_report *report)
{
    const double residual = drape_step_equation_norm(e, DRAPE_NORM_MAX);
    if (!(residual <= drape_step_equation_rounding(e, d, DRAPE_NORM_MAX)))
        return false;
    report->reason = drape_reason_name(DRAPE_REASON_ROUNDING);
    return true;
}

static drape_status iterate(drape_inexact_newton *s, const drape_inexact_settings *settings, double *d,
                            drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    drape_step_equation_begin(e);
    drape_step_equation_make_feasible(e, d);
    if (!drape_step_equation_evaluate(e, d))
        return DRAPE_RETRY_NONFINITE;
    const double first = drape_step_equation_dot(e, e->f, e->f);
    for (int i = 0;; i++) {
        report->iterations = i;
        bool converged = drape_step_equation_norm(e, DRAPE_NORM_MAX) <= settings->tolerance;
        report->reason = drape_reason_name(converged ? DRAPE_REASON_CONVERGED : DRAPE_REASON_ITERATIONS);
        if (converged || (i >= settings->iterations && drape_step_equation_dot(e, e->f, e->f) < first))
            return DRAPE_OK;
        if (i >= settings->iterations && is_rounding(e, d, report))
            return DRAPE_OK;
        if (i >= settings->iterations + settings->rescue_iterations) {
            report->reason = drape_reason_name(DRAPE_REASON_RESIDUAL);
            return DRAPE_RETRY_NONLINEAR;
        }
        drape_status status = correct(s, settings);
        if (status) {
            report->reason = drape_reason_name(status < 0 ? DRAPE_REASON_MEMORY : DRAPE_REASON_SINGULAR);
            return status;
        }
        drape_step_equation_make_feasible(e, s->p);
        if (!advance(s, d))
            return DRAPE_RETRY_NONFINITE;
        e->work.newton_iterations++;
    }
}

drape_status drape_inexact_newton_solve(drape_inexact_newton *s, const drape_inexact_settings *settings,
                                        double *d, drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    *report = (drape_solve_report){.tolerance = NAN}; /* the residual is reported but not bounded */
    drape_status status = iterate(s, settings, d, report);
    report->residual = drape_step_equation_norm(e, DRAPE_NORM_MAX);
    report->diagnostic = drape_step_equation_diagnose(e, settings->tolerance);
    if (status == DRAPE_RETRY_NONFINITE) {
        report->reason = drape_reason_name(DRAPE_REASON_NONFINITE);
        return drape_step_equation_find_cause(e, status, report);
    }
    return status ? status : drape_system_status(e->system);
}

void drape_inexact_newton_archive(drape_inexact_newton *s, drape_archive *a)
{
    drape_archive_mark(a, "inexact newton");
    drape_work_archive(&s->equation->work, a);
    if (s->matrix)
        drape_approx_jacobian_archive(s->matrix, a);
}

size_t drape_inexact_newton_bytes(const drape_inexact_newton *s)
{
    return s->matrix ? drape_approx_jacobian_bytes(s->matrix) : 0;
}
