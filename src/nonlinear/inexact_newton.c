/*
 * inexact_newton.c: see inexact_newton.h. The stages of an iteration:
 *     correct   A p = -F with A near J: by conjugate gradients, or with factors and predicted stress
 *     feasible  p shortened where pieces meet, until nothing passes through anything
 *     advance   d + a p with a = 1, 1/2, 1/4 ..., until the residual at its end does little work along p
 */
#include "nonlinear/inexact_newton.h"

#include "base/clock.h"
#include "base/reason.h"
#include "nonlinear/approx_jacobian.h"
#include "nonlinear/factored_jacobian.h"
#include "nonlinear/stress_predictor.h"

#include <math.h>
#include <string.h>

/* Fraction of the initial work along a correction that the residual may do beyond the minimum. */
#define WORK_FRACTION  0.5
#define MAX_HALVINGS   6 /* halvings of a correction; the last one is taken if F is finite there */
#define MAX_PREDICTION 8 /* corrections in a solve, after which stress is not predicted, as in newton.c */
/* Of the residual of the guess, that further iterations aim at with factors or contact: with more, stiff
 * elements and barriers that are not yet balanced throw cloth back in the next step. */
#define MAX_LEFT 0.1
/* Up to so many, the guess is shortened node by node. Four iterations are then .046 m off on a strip set
 * down upright, for .16 of the time of be, instead of .066 m for .39, though .031 instead of .022 m on a
 * ball. Eight are .036 and .035 m off, instead of .039 and .022 m. */
#define FEW_ITERATIONS 4

struct drape_inexact_newton {
    drape_step_equation *equation;
    /* One of them; both NULL without free nodes. */
    drape_approx_jacobian *approximate;
    drape_factored_jacobian *factored;
    drape_stress_predictor predictor; /* with factors */
    double *p, *minus_f, *trial;      /* free DOFs */
    double *fraction;                 /* nodes; NULL without contact */
};

/* Conjugate gradients leave a part of the stretch of a correction, which predicted stress would not see. */
static drape_status create_factored(drape_arena *arena, drape_inexact_newton *s)
{
    drape_status status = drape_stress_predictor_init(arena, s->equation->system, &s->predictor);
    return status ? status : drape_factored_jacobian_create(arena, s->equation->system, &s->factored);
}

drape_status drape_inexact_newton_create(drape_arena *arena, drape_step_equation *equation,
                                         drape_inexact_matrix matrix, double dt, int coarse_spacing,
                                         drape_inexact_newton **out)
{
    drape_inexact_newton *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->equation = equation;
    s->p = drape_arena_take(arena, equation->dofs, sizeof *s->p);
    s->minus_f = drape_arena_take(arena, equation->dofs, sizeof *s->minus_f);
    s->trial = drape_arena_take(arena, equation->dofs, sizeof *s->trial);
    if (equation->x_ahead)
        s->fraction = drape_arena_take(arena, equation->nodes / 3, sizeof *s->fraction);
    if (drape_arena_status(arena) || equation->dofs == 0)
        return drape_arena_status(arena);
    bool factored = matrix == DRAPE_INEXACT_FACTORED;
    if (matrix == DRAPE_INEXACT_AUTO) {
        drape_status status = drape_factored_jacobian_is_better(equation->system, dt, &factored);
        if (status)
            return status;
    }
    return factored ? create_factored(arena, s)
                    : drape_approx_jacobian_create(arena, equation->system, coarse_spacing, &s->approximate);
}

void drape_inexact_newton_destroy(drape_inexact_newton **newton)
{
    if (*newton) {
        drape_approx_jacobian_destroy(&(*newton)->approximate);
        drape_factored_jacobian_destroy(&(*newton)->factored);
    }
    *newton = NULL;
}

/* ---- Guess ---- */

static void begin(drape_inexact_newton *s)
{
    drape_step_equation *e = s->equation;
    drape_step_equation_begin(e);
    if (!s->factored)
        return;
    const double clock = drape_system_clock(e->system);
    drape_point start = e->point;
    start.x = e->x_start;
    drape_stress_predictor_begin(&s->predictor, &start);
    e->work.jacobian_seconds += drape_system_clock(e->system) - clock;
}

/* ---- Correct ---- */

static drape_status correct_factored(drape_inexact_newton *s)
{
    drape_step_equation *e = s->equation;
    drape_point point = e->point;
    point.stress = drape_stress_predictor_stress(&s->predictor);
    drape_status status = drape_factored_jacobian_update(s->factored, &point, e->mass_weight, &e->work);
    if (status == DRAPE_E_STOPPED)
        drape_system_cancelled(e->system); /* so that the step ends as cancelled */
    if (status)
        return status;
    const double start = drape_clock_seconds();
    status = drape_factored_jacobian_solve(s->factored, s->minus_f, s->p);
    e->work.linear_iterations++;
    e->work.solve_seconds += drape_clock_seconds() - start;
    return status;
}

static drape_status correct_approximate(drape_inexact_newton *s, const drape_inexact_settings *settings)
{
    drape_step_equation *e = s->equation;
    drape_status status = drape_approx_jacobian_update(s->approximate, &e->point, e->mass_weight, &e->work);
    if (status)
        return status;
    const double start = drape_clock_seconds();
    e->work.linear_iterations += drape_approx_jacobian_solve(
        s->approximate, s->minus_f, s->p, settings->linear_tolerance, settings->max_linear_iterations);
    e->work.solve_seconds += drape_clock_seconds() - start;
    return DRAPE_OK;
}

static drape_status correct(drape_inexact_newton *s, const drape_inexact_settings *settings)
{
    drape_step_equation *e = s->equation;
    for (size_t i = 0; i < e->dofs; i++)
        s->minus_f[i] = -e->f[i];
    return s->factored ? correct_factored(s) : correct_approximate(s, settings);
}

/* Predicts stress for the matrix of a next iteration. */
static void predict_stress(drape_inexact_newton *s, bool next)
{
    drape_step_equation *e = s->equation;
    const double start = drape_system_clock(e->system);
    if (s->factored && next)
        drape_stress_predictor_correct(&s->predictor, &e->point, s->p);
    else
        drape_stress_predictor_forget(&s->predictor);
    e->work.jacobian_seconds += drape_system_clock(e->system) - start;
}

/* ---- Feasible ---- */

/* A guess that is shortened at some nodes has kinks, which become wrinkles that take many iterations to
 * vanish. It is nearer to the solution nevertheless where few iterations follow. */
static void make_guess_feasible(drape_inexact_newton *s, int iterations, double *d)
{
    if (s->fraction &&
        (iterations > FEW_ITERATIONS || !drape_step_equation_shorten_nodes(s->equation, d, s->fraction)))
        drape_step_equation_make_feasible(s->equation, d);
}

/* A correction that is shortened at some nodes may no longer be a descent direction. Then all of it is
 * shortened alike. */
static void make_correction_feasible(drape_inexact_newton *s)
{
    drape_step_equation *e = s->equation;
    if (!s->fraction)
        return;
    memcpy(s->trial, s->p, e->dofs * sizeof *s->trial);
    if (!drape_step_equation_shorten_nodes(e, s->p, s->fraction))
        drape_step_equation_make_feasible(e, s->p);
    if (drape_step_equation_dot(e, s->p, e->f) < 0)
        return;
    memcpy(s->p, s->trial, e->dofs * sizeof *s->p);
    drape_step_equation_make_feasible(e, s->p);
}

/* ---- Advance ---- */

/* Returns false if F is finite at none of the step lengths. Stress was predicted for the whole correction. */
static bool advance(drape_inexact_newton *s, double *d)
{
    drape_step_equation *e = s->equation;
    double start = drape_step_equation_dot(e, e->f, s->p), a = 1, work;
    for (int k = 0; k <= MAX_HALVINGS; k++, a /= 2) {
        bool finite = drape_step_equation_try(e, d, a, s->p, s->trial, &work);
        if (finite && (k == MAX_HALVINGS || !(work > -WORK_FRACTION * start))) {
            memcpy(d, s->trial, e->dofs * sizeof *d);
            if (k > 0)
                drape_stress_predictor_forget(&s->predictor);
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
    begin(s);
    make_guess_feasible(s, settings->iterations, d);
    if (!drape_step_equation_evaluate(e, d))
        return DRAPE_RETRY_NONFINITE;
    const double fall = s->fraction || s->factored ? MAX_LEFT : 1;
    const double first = drape_step_equation_dot(e, e->f, e->f), bound = fall * fall * first;
    for (int i = 0;; i++) {
        report->iterations = i;
        bool converged = drape_step_equation_norm(e, DRAPE_NORM_MAX) <= settings->tolerance;
        report->reason = drape_reason_name(converged ? DRAPE_REASON_CONVERGED : DRAPE_REASON_ITERATIONS);
        if (converged || (i >= settings->iterations && drape_step_equation_dot(e, e->f, e->f) < bound))
            return DRAPE_OK;
        if (i >= settings->iterations && is_rounding(e, d, report))
            return DRAPE_OK;
        if (i >= settings->iterations + settings->rescue_iterations) {
            if (drape_step_equation_dot(e, e->f, e->f) < first)
                return DRAPE_OK;
            report->reason = drape_reason_name(DRAPE_REASON_RESIDUAL);
            return DRAPE_RETRY_NONLINEAR;
        }
        drape_status status = correct(s, settings);
        if (status) {
            report->reason = drape_reason_name(status < 0 ? DRAPE_REASON_MEMORY : DRAPE_REASON_SINGULAR);
            return status;
        }
        make_correction_feasible(s);
        predict_stress(s, i + 1 < settings->iterations && i < MAX_PREDICTION);
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
    if (s->approximate)
        drape_approx_jacobian_archive(s->approximate, a);
    if (s->factored)
        drape_factored_jacobian_archive(s->factored, a);
}

size_t drape_inexact_newton_bytes(const drape_inexact_newton *s)
{
    return (s->approximate ? drape_approx_jacobian_bytes(s->approximate) : 0) +
           (s->factored ? drape_factored_jacobian_bytes(s->factored) : 0);
}
