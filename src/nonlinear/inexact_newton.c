/*
 * inexact_newton.c: see inexact_newton.h. The stages of an iteration:
 *     correct   A p = -F with A near J: by conjugate gradients, or with factors and predicted stress
 *     feasible  p shortened where pieces meet, until nothing passes through anything
 *     advance   d + a p, with the length a of the line search (line_search.h)
 *     estimate  the distance to the solution, from one more p or by the contraction of an earlier step
 */
#include "nonlinear/inexact_newton.h"

#include "base/clock.h"
#include "base/elementary.h"
#include "base/finite.h"
#include "base/reason.h"
#include "nonlinear/approx_jacobian.h"
#include "nonlinear/factored_jacobian.h"
#include "nonlinear/line_search.h"
#include "nonlinear/stress_predictor.h"

#include <math.h>
#include <string.h>

#define WORK_FRACTION 0.5 /* of its initial work along an estimate, that the residual may do at its end */
#define SHORT_STEP    0.5 /* after a shorter step the next matrix has all of the positive parts */
#define SMALL_STEP                                                                                           \
    0.01 /* of an edge: after a shorter one, RMS, the exact matrix is tried again, without contact */
#define MAX_PREDICTION 8 /* corrections in a solve, after which stress is not predicted, as in newton.c */
/* Of the residual of the guess, that further iterations aim at with factors or contact: with more, stiff
 * elements and barriers that are not yet balanced throw cloth back in the next step. */
#define MAX_LEFT 0.1
/* In edges: how far the residual that is left would move nodes in the step if nothing but inertia resisted
 * it. With more, stiff cloth in contact is thrown back and heats up: a sheet of E h 1e5 N/m that is pulled
 * over an edge was .32 m off after 0.5 s with 25, .003 m with 5 and .005 m with 1. */
#define MAX_DRIFT 2
/* Up to so many, the guess is shortened node by node. Four iterations are then .046 m off on a strip set
 * down upright, for .16 of the time of be, instead of .066 m for .39, though .031 instead of .022 m on a
 * ball. Eight are .036 and .035 m off, instead of .039 and .022 m. */
#define FEW_ITERATIONS 4
/* Iterations where cloth touches something, however little time there is. */
#define MIN_IN_CONTACT 3
/* Of the residual of the guess: one iteration less is enough where less is left and the last one would not
 * end in time. Three capes of 900 nodes on a body that walks, 4 s each of three runs, had 349 late frames of
 * 1923 and 9 rejected attempts with it, 558 and 14 without. */
#define ENOUGH 0.6
/* Of the residual before: one that has fallen further is not the rounding error of its forces. */
#define STALLED 0.5
/* In edges: by how much pins may be ahead before the step begins with the linearized equation. */
#define MAX_AHEAD 0.1
/* Without contact, in sizes of the scene: how far nodes would move in a step with the energy that is left,
 * at most sqrt(error x inertial error). A tenth of it costs a third more iterations and is hardly nearer;
 * with ten times as much stiff sheets heat up. */
#define MAX_JUMP 1e-2
/* Errors further above the bound are not estimated, where the last two corrections tell them. */
#define FAR_ABOVE 3
/* Of the bound, that conjugate gradients without contact go on to, because their iterations are cheap: seven
 * swung sheets of fabrics, 30 nodes a side, came to 36 to 74 instead of 45 to 90 mm of 1 m from the converged
 * run, for 0.03 to 0.07 instead of 0.03 to 0.05 of its time. */
#define CHEAP_SHARE 0.5
/* Of the bound: an error that is only expected, from an earlier step, must be below. It is measured again
 * after so many steps. */
#define MAX_EXPECTED 0.33
#define MAX_STEPS    3
/* Limits of the share m in the estimate of the error: beyond them forces are far from linear along p. */
#define MIN_SHARE 0.05
#define MAX_SHARE 4
/* Of corrections that hardly contract: nine more like the last one are expected. Five took a tenth fewer
 * iterations, and 66 stiff or swung sheets were a sixth further off. */
#define MAX_CONTRACTION 0.9
#define STEPS_KEPT      4
/* Power of the error if nothing but inertia resisted it, and with contact, whose matrix is stiffer. */
#define INERTIAL         0.08
#define INERTIAL_CONTACT 0.2
/* Conjugate gradients for the p of an estimate: relative residual, and iterations at most. With as many as a
 * correction has, the estimate cost as much as the step. */
#define ESTIMATE_TOLERANCE  0.5
#define ESTIMATE_ITERATIONS 4
/* Of these tolerances with factors that lump bending: sheets that hang by two corners are 0.5 to 7 mm of 1 m
 * from the converged step with all of it, and 0.4 to 0.7 mm with 0.01, as with factors of the whole matrix,
 * for one or two iterations more in each solution. */
#define LUMPED_TOLERANCE 0.01

/* What the first correction of a step leaves as error, as a share of itself, when that was measured last. Not
 * in a step that begins with the linearized equation, a guess of another kind. */
typedef struct contraction {
    double share;       /* 0: not known */
    double along;       /* [m] RMS of that correction */
    double mass_weight; /* of the step */
    int32_t steps;      /* that were judged by it since */
} contraction;

struct drape_inexact_newton {
    drape_step_equation *equation;
    /* One of them, or both; both NULL without free nodes. */
    drape_approx_jacobian *approximate;
    drape_factored_jacobian *factors;
    drape_factored_jacobian *factored; /* the factors in solves that use them, NULL in others */
    bool cheap;                        /* of the settings */
    drape_stress_predictor predictor;  /* with factors */
    bool positive;                     /* the next matrix has the positive parts; with factors */
    bool lengthens;                    /* corrections by the last one are lengthened */
    bool indefinite;                   /* the last one that was tried without positive parts */
    bool linearized;                   /* this solve began with the linearized equation */
    bool unstable;                     /* the last matrix of this solve was, as far as it was tried */
    bool shortened;                    /* a correction of this solve was, by the line search */
    drape_islands islands;
    drape_line_search search;
    bool friction;           /* the matrices of this solve have that of friction */
    double friction_seconds; /* of the last iteration with it; not archived: with a deadline alone it matters,
                                and then results depend on the clock */
    double rounding;         /* [N] error of forces as estimated last in this solve; INFINITY */
    double edge;             /* [m] mean length of an edge */
    contraction first;       /* of the first correction */
    bool nonlinear;          /* forces are, along the correction of the last estimate */
    double *p, *minus_f, *trial; /* free DOFs; trial: of the search, or scratch */
    double *fraction;            /* nodes; NULL without contact */
    double *f, *g;               /* free DOFs, nodes: kept while F is evaluated elsewhere */
};

/* Conjugate gradients leave a part of the stretch of a correction, which predicted stress would not see. */
static drape_status create_factored(drape_arena *arena, drape_inexact_newton *s, double dt)
{
    drape_status status = drape_stress_predictor_init(arena, s->equation->system, &s->predictor);
    return status ? status : drape_factored_jacobian_create(arena, s->equation->system, dt, &s->factors);
}

drape_status drape_inexact_newton_create(drape_arena *arena, drape_step_equation *equation,
                                         drape_inexact_matrix matrix, double dt, int coarse_spacing,
                                         drape_inexact_newton **out)
{
    drape_inexact_newton *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    const drape_model *m = equation->model;
    s->equation = equation;
    for (int32_t i = 0; i < m->edge_count; i++)
        s->edge += m->edge_length[i] / m->edge_count;
    s->p = drape_arena_take(arena, equation->dofs, sizeof *s->p);
    s->minus_f = drape_arena_take(arena, equation->dofs, sizeof *s->minus_f);
    s->f = drape_arena_take(arena, equation->dofs, sizeof *s->f);
    s->g = drape_arena_take(arena, equation->nodes, sizeof *s->g);
    if (equation->x_ahead)
        s->fraction = drape_arena_take(arena, equation->nodes / 3, sizeof *s->fraction);
    drape_status status = drape_islands_init(arena, equation->dofs / 3, &s->islands);
    if (!status)
        status = drape_line_search_init(arena, equation, &s->islands, &s->search);
    s->trial = s->search.trial;
    if (status || drape_arena_status(arena) || equation->dofs == 0)
        return status ? status : drape_arena_status(arena);
    drape_islands_find(&s->islands, drape_system_pattern(equation->system)); /* contact alone changes it */
    bool factored = matrix == DRAPE_INEXACT_FACTORED, only = true;
    if (matrix == DRAPE_INEXACT_AUTO)
        status = drape_factored_jacobian_is_better(equation->system, dt, &factored, &only);
    only |= !equation->x_ahead;
    if (!status && factored)
        status = create_factored(arena, s, dt);
    if (!status && !(factored && only))
        status = drape_approx_jacobian_create(arena, equation->system, coarse_spacing, &s->approximate);
    return status;
}

void drape_inexact_newton_destroy(drape_inexact_newton **newton)
{
    if (*newton) {
        drape_approx_jacobian_destroy(&(*newton)->approximate);
        drape_factored_jacobian_destroy(&(*newton)->factors);
    }
    *newton = NULL;
}

/* ---- Guess ---- */

/* Stiff elements are left with more stress than the solution has: little displacement, but far more force
 * than the inertia of light cloth balances. In the first matrix it would make cloth soft or hard at random.
 * The stress that was predicted along the last correction of the step before is free of that. */
static void begin(drape_inexact_newton *s, bool follows, bool cheap)
{
    drape_step_equation *e = s->equation;
    s->factored = cheap && s->approximate ? NULL : s->factors;
    s->cheap = cheap;
    drape_step_equation_begin(e);
    if (s->approximate)
        drape_approx_jacobian_begin(s->approximate);
    s->rounding = INFINITY;
    s->positive = true;
    if (!follows || s->first.mass_weight != e->mass_weight)
        s->first = (contraction){0};
    s->indefinite = s->unstable = s->shortened = s->linearized = false;
    drape_step_equation_predict_contact(e, NULL);
    if (!s->factored || (follows && s->predictor.valid))
        return;
    const double clock = drape_system_clock(e->system);
    drape_point start = e->point;
    start.x = e->x_start;
    drape_stress_predictor_begin(&s->predictor, &start);
    e->work.jacobian_seconds += drape_system_clock(e->system) - clock;
}

/* ---- Correct ---- */

/* p = -A^-1 F, with the last matrix. */
static drape_status solve(drape_inexact_newton *s, double tolerance, int max_iterations)
{
    drape_step_equation *e = s->equation;
    const double start = drape_clock_seconds();
    drape_status status = DRAPE_OK;
    int iterations = 1;
    bool definite = true;
    for (size_t i = 0; i < e->dofs; i++)
        s->minus_f[i] = -e->f[i];
    if (s->factored)
        status = drape_factored_jacobian_solve(s->factored, s->minus_f, LUMPED_TOLERANCE * tolerance, s->p,
                                               &iterations, &definite);
    else
        iterations = drape_approx_jacobian_solve(s->approximate, s->minus_f, s->p, tolerance, max_iterations);
    s->unstable |= !definite;
    e->work.linear_iterations += iterations;
    e->work.solve_seconds += drape_clock_seconds() - start;
    return status;
}

static drape_status update_factored(drape_inexact_newton *s, bool positive)
{
    drape_step_equation *e = s->equation;
    drape_point point = e->point;
    point.stress = drape_stress_predictor_stress(&s->predictor);
    drape_status status =
        drape_factored_jacobian_update(s->factored, &point, e->mass_weight, positive ? 1 : 0, &e->work);
    if (status == DRAPE_E_STOPPED)
        drape_system_cancelled(e->system); /* so that the step ends as cancelled */
    s->lengthens = positive;
    return status;
}

/* The first matrix of a solve has the positive parts, the others only where they are not definite without, as
 * in newton.c. */
static drape_status update_definite(drape_inexact_newton *s)
{
    const bool positive = s->positive || s->indefinite;
    s->positive = false;
    if (positive)
        return update_factored(s, true);
    drape_status status = update_factored(s, false);
    s->unstable = s->indefinite = status == DRAPE_RETRY_LINEAR;
    return s->unstable ? update_factored(s, true) : status;
}

/* Whether an iteration that only reduces the error is expected to end in time. */
static bool has_time(const drape_inexact_settings *settings, double seconds)
{
    return settings->deadline == INFINITY || drape_clock_seconds() + seconds <= settings->deadline;
}

static bool is_in_contact(const drape_inexact_newton *s)
{
    double gap;
    return s->fraction && drape_contact_active(drape_system_contact(s->equation->system), &gap) > 0;
}

/* With a deadline, a step in contact may have more effort than there is time for: it has no matrix of
 * friction if the iterations that are made in any case, and the estimate, are not expected to end in time
 * with it. */
static drape_status correct(drape_inexact_newton *s, const drape_inexact_settings *settings, int iteration)
{
    drape_step_equation *e = s->equation;
    if (iteration == 0)
        s->friction = !s->cheap && has_time(settings, (MIN_IN_CONTACT + 1) * s->friction_seconds);
    drape_status status = s->factored ? update_definite(s)
                                      : drape_approx_jacobian_update(s->approximate, &e->point,
                                                                     e->mass_weight, s->friction, &e->work);
    return status ? status : solve(s, settings->linear_tolerance, settings->max_linear_iterations);
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

typedef void change_positions(drape_system *system, double t, double *x);

/* Changes the positions at d. */
static void change(drape_inexact_newton *s, change_positions *how, double *d)
{
    drape_step_equation *e = s->equation;
    memcpy(e->x_ahead, e->x_base, e->nodes * sizeof *e->x_ahead);
    for (size_t i = 0; i < e->dofs; i++)
        e->x_ahead[drape_step_equation_at(e, i)] += d[i];
    how(e->system, e->point.t, e->x_ahead);
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        if (e->x_ahead[at] != e->x_base[at] + d[i])
            d[i] = e->x_ahead[at] - e->x_base[at];
    }
    drape_system_project_free(e->system, d);
}

/* Lets the nodes that moving colliders reach slide on these. */
static void clear_colliders(drape_inexact_newton *s, double *d)
{
    change(s, drape_system_sweep, d);
}

/* Where a pin takes a sheet along, nodes that keep their motion stay behind, and it takes many corrections
 * until the forces of the elements at the pin have reached the others. The equation linearized at the start
 * of the step takes the pull of pins to all nodes at once, as in newton.c, but knows of no contact. */
static drape_status guess_linearized(drape_inexact_newton *s, const drape_inexact_settings *settings,
                                     double *d)
{
    drape_step_equation *e = s->equation;
    if (s->fraction || !(settings->pins_ahead > MAX_AHEAD * s->edge) || !drape_step_equation_pins_move(e))
        return DRAPE_OK;
    drape_step_equation_pull(e, s->trial, s->f);
    memcpy(e->f, s->f, e->dofs * sizeof *e->f);
    s->positive = false;
    drape_status status = correct(s, settings, 0);
    if (!status && drape_all_finite(s->p, e->dofs))
        memcpy(d, s->p, e->dofs * sizeof *d);
    s->linearized = true;
    s->positive = true;
    s->indefinite = s->unstable = false;
    drape_step_equation_begin(e);
    return status < 0 ? status : DRAPE_OK;
}

/* Whether something is passed on the straight path from the start of the step to d, pins moving along. */
static bool crosses(drape_inexact_newton *s, const double *d)
{
    drape_step_equation *e = s->equation;
    const char *reason;
    drape_diagnostic diagnostic;
    drape_step_equation_move(e, d);
    return drape_system_crosses(e->system, e->x, e->point.t, &reason, &diagnostic);
}

/* Where the path of the guess begins: at the start of the step, aside from moving colliders, with the layers
 * that lie on what these push.
 *
 * Pins are at the end of the step already. Where they have gone through cloth by then, all of it goes
 * along with their mean displacement, or it would end on their wrong side. */
static void start_aside(drape_inexact_newton *s, double *aside)
{
    drape_step_equation *e = s->equation;
    memset(aside, 0, e->dofs * sizeof *aside);
    clear_colliders(s, aside);
    if (!e->model->contact.self)
        return;
    if (drape_step_equation_pins_move(e) && crosses(s, aside)) {
        drape_step_equation_follow_pins(e, aside);
        clear_colliders(s, aside);
        if (!crosses(s, aside))
            return;
        memset(aside, 0, e->dofs * sizeof *aside);
        clear_colliders(s, aside);
    }
    change(s, drape_system_carry_layers, aside);
}

/* A guess that is shortened at some nodes has kinks, which become wrinkles that take many iterations to
 * vanish. It is nearer to the solution nevertheless where few iterations follow.
 *
 * What is shortened is the path from where moving colliders have put the nodes at the start of the step:
 * from the start itself, which may lie inside a collider at the end of the step, a part of the path may end
 * inside, too. */
static void make_guess_feasible(drape_inexact_newton *s, int iterations, double *d)
{
    drape_step_equation *e = s->equation;
    double *aside = s->trial;
    if (!s->fraction)
        return;
    clear_colliders(s, d);
    start_aside(s, aside);
    drape_step_equation_move(e, aside);
    for (size_t i = 0; i < e->dofs; i++)
        d[i] -= aside[i];
    if (iterations > FEW_ITERATIONS || !drape_step_equation_shorten_nodes(e, d, s->fraction))
        drape_step_equation_make_feasible(e, d);
    for (size_t i = 0; i < e->dofs; i++)
        d[i] += aside[i];
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

/* Takes p, or as much of it as the search says. Positive parts make the matrix too stiff: its corrections
 * are lengthened, but not with contact, to which that might lead. Returns false if F is not finite there.
 * Stress was predicted for the whole of p. */
static bool advance(drape_inexact_newton *s, double *d)
{
    drape_step_equation *e = s->equation;
    const bool lengthens = s->factored && s->lengthens && !s->fraction;
    drape_line_search_along(&s->search, d, lengthens ? INFINITY : 1, s->p);
    for (size_t i = 0; i < e->dofs; i++)
        d[i] += s->p[i];
    s->shortened |= s->search.shortest < 1;
    s->positive = s->search.shortest < SHORT_STEP;
    if (s->search.shortest < 1 || s->search.longest > 1)
        drape_stress_predictor_forget(&s->predictor);
    return drape_line_search_knows(&s->search, d) || drape_step_equation_evaluate(e, d);
}

/* ---- Estimate ---- */

/* RMS over all nodes; pinned ones do not move. */
static double rms(const drape_step_equation *e, const double *p)
{
    return sqrt(3 * drape_step_equation_dot(e, p, p) / (double)e->nodes);
}

/* Returns to d from another point, as if F had been evaluated there last. Contact keeps forces of its own. */
static void return_to(drape_inexact_newton *s, const double *d)
{
    drape_step_equation *e = s->equation;
    if (s->fraction) {
        drape_step_equation_evaluate(e, d);
        return;
    }
    drape_step_equation_move(e, d);
    memcpy(e->f, s->f, e->dofs * sizeof *e->f);
    memcpy(e->g, s->g, e->nodes * sizeof *e->g);
}

/* p . (F(d + p) - F(d)) / p . A p for p = -A^-1 F, within its limits. *adds: p may be added to d; on return,
 * whether it was, because that leaves less residual. */
static double stiffness_share(drape_inexact_newton *s, double *d, bool *adds)
{
    drape_step_equation *e = s->equation;
    const double start = drape_step_equation_dot(e, e->f, s->p),
                 left = drape_step_equation_dot(e, e->f, e->f);
    double work;
    memcpy(s->f, e->f, e->dofs * sizeof *s->f);
    memcpy(s->g, e->g, e->nodes * sizeof *s->g);
    const bool falls = drape_step_equation_try(e, d, 1, s->p, s->trial, &work) && start < 0;
    *adds &= falls && fabs(work) <= -WORK_FRACTION * start && drape_step_equation_dot(e, e->f, e->f) < left;
    if (*adds)
        memcpy(d, s->trial, e->dofs * sizeof *d);
    else
        return_to(s, d);
    const double share = falls ? 1 - work / start : 1;
    s->nonlinear = share > MAX_SHARE;
    return fmin(fmax(share, MIN_SHARE), MAX_SHARE);
}

/* The estimated distance from d to the solution. F was evaluated last at d, as it is on return. corrected:
 * there is a matrix of this solve. Overwrites p.
 *
 * With contact, where returning to d would take another evaluation, p is added to d if it can be: 32 random
 * scenes of cloth on balls and floors came a sixth nearer at the same cost, 16 others did not. Without
 * contact it gained nothing. */
static double estimate_error(drape_inexact_newton *s, double *d, bool corrected, double *left)
{
    drape_step_equation *e = s->equation;
    double inertial = drape_step_equation_inertial_error(e, left), share = 1;
    s->nonlinear = false;
    if (!corrected || !(inertial > 0) || solve(s, ESTIMATE_TOLERANCE, ESTIMATE_ITERATIONS))
        return inertial;
    double along = rms(e, s->p), gain = -drape_step_equation_dot(e, e->f, s->p);
    if (s->factored) {
        bool adds = s->fraction;
        make_correction_feasible(s);
        share = stiffness_share(s, d, &adds);
        if (adds && !solve(s, ESTIMATE_TOLERANCE, ESTIMATE_ITERATIONS)) {
            along = rms(e, s->p);
            gain = -drape_step_equation_dot(e, e->f, s->p);
            inertial = drape_step_equation_inertial_error(e, left);
        }
    }
    along /= share;
    *left = gain > 0 ? fmin(gain / share, *left) : *left;
    const double power = s->fraction ? INERTIAL_CONTACT : INERTIAL;
    return along > 0 && along < inertial ? along * drape_pow(inertial / along, power) : inertial;
}

/* ---- Iterate ---- */

/* A residual that does not fall may be the rounding error of its forces. */
static bool is_rounding(drape_inexact_newton *s, const double *d, drape_solve_report *report)
{
    if (!drape_step_equation_is_rounding(s->equation, d, DRAPE_NORM_MAX, &s->rounding))
        return false;
    report->reason = drape_reason_name(DRAPE_REASON_ROUNDING);
    return true;
}

/* Where cloth touches something, so many iterations are made whatever the time, unless fewer meet the bound:
 * what one leaves throws the cloth about, so that later steps need more (docs/realtime.md, "What is saved
 * first"). */
static int least_iterations(const drape_inexact_newton *s)
{
    return is_in_contact(s) ? MIN_IN_CONTACT : 0;
}

/* Of one solve. */
typedef struct progress {
    int iteration;
    double start, bound;     /* |F|^2 of the guess, and what it must fall below */
    double left;             /* |F|^2 before the last iteration */
    double first, last;      /* [m] RMS of the first and of the last correction */
    double ratio;            /* of the last one to the one before */
    double step[STEPS_KEPT]; /* [m] RMS of the last corrections as they were made, the last one first */
    double near;             /* [m] last estimate from one more correction */
    double seconds;          /* of the last iteration and the last estimate */
    double estimating;       /* [s] of the last estimate */
} progress;

/* Whether the last iteration that a step in contact makes whatever the time is left out. */
static bool is_enough(const drape_inexact_newton *s, const drape_inexact_settings *settings,
                      const progress *p, double left)
{
    return p->iteration >= MIN_IN_CONTACT - 1 && left < ENOUGH * ENOUGH * p->start &&
           !has_time(settings, p->seconds) && is_in_contact(s);
}

/* Without contact, factors leave so little that the error alone tells whether to go on. */
static bool goes_by_error(const drape_inexact_newton *s)
{
    return s->factored && !s->fraction;
}

/* The error where corrections contract slowly: 0 if there is no sign of it. A sheet that buckles, or that
 * turns by more than its stiff elements let one correction turn it, comes nearer by many small corrections of
 * nearly the same length, each of which is a small part of the error. The line search shortens some of them.
 * The contraction is taken over pairs, because the lengths alternate. The first correction of a guess by the
 * linearized equation, in which cloth may be compressed, tells nothing of it either.
 *
 * Where the exact matrix is indefinite there is no solution near: corrections become short near a saddle, and
 * then longer again. Nothing tells how far that leads. */
static double slow_error(const drape_inexact_newton *s, const progress *p)
{
    const double *step = p->step;
    double share = MAX_CONTRACTION;
    if (!goes_by_error(s) || p->iteration == 0 || !(s->shortened || s->unstable || s->linearized))
        return 0;
    if (!s->unstable && p->iteration == 2)
        share = step[0] / step[1];
    if (!s->unstable && p->iteration == 3)
        share = sqrt(step[0] / step[2]);
    if (!s->unstable && p->iteration > 3)
        share = sqrt((step[0] + step[1]) / (step[2] + step[3]));
    share = fmin(share, MAX_CONTRACTION);
    return step[0] * share / (1 - share);
}

/* Whether so little is left, or so little time, that the error is worth an estimate. */
static bool has_fallen(const drape_inexact_newton *s, const drape_inexact_settings *settings,
                       const progress *p, double left)
{
    if (p->iteration < settings->iterations)
        return false;
    if (goes_by_error(s)) {
        const bool near = p->iteration == 1 || fmin(1, p->ratio) * p->last < FAR_ABOVE * settings->error;
        return (near && slow_error(s, p) <= settings->error) || !has_time(settings, p->seconds);
    }
    return left < p->bound &&
           (!s->factored || drape_step_equation_inertial_error(s->equation, NULL) <= MAX_DRIFT * s->edge);
}

static bool is_quiet(const drape_inexact_newton *s, double error)
{
    const drape_step_equation *e = s->equation;
    return !goes_by_error(s) ||
           sqrt(error * drape_step_equation_inertial_error(e, NULL)) <= MAX_JUMP * e->model->length;
}

static void measure_contraction(drape_inexact_newton *s, double error, double first)
{
    if (s->linearized)
        s->first = (contraction){0};
    else if (first > 0)
        s->first = (contraction){error / first, first, s->equation->mass_weight, 0};
}

/* The error after the first correction by the contraction of an earlier step, as Hairer & Wanner 1996,
 * section IV.8, end iterations after the first; INFINITY if that is not known well enough. A longer
 * correction is expected to converge more slowly in proportion. */
static double expected_error(const drape_inexact_newton *s, const progress *p)
{
    const contraction *c = &s->first;
    if (p->iteration != 1 || s->linearized || s->fraction || slow_error(s, p) > 0 || !(c->share > 0) ||
        c->steps >= MAX_STEPS)
        return INFINITY;
    return c->share * p->first * fmax(1, p->first / c->along);
}

/* A correction, and what it tells of the convergence. */
static drape_status make_iteration(drape_inexact_newton *s, const drape_inexact_settings *settings,
                                   progress *p, double *d, drape_solve_report *report)
{
    const drape_status status = correct(s, settings, p->iteration);
    if (status) {
        report->reason = drape_reason_name(status < 0 ? DRAPE_REASON_MEMORY : DRAPE_REASON_SINGULAR);
        return status;
    }
    const double now = rms(s->equation, s->p);
    if (p->iteration == 0)
        p->first = now;
    if (p->iteration == 1)
        measure_contraction(s, now, p->first);
    s->indefinite &= !goes_by_error(s) || now > SMALL_STEP * s->edge;
    p->ratio = p->iteration > 0 ? now / p->last : 1;
    p->last = now;
    drape_step_equation_predict_contact(s->equation, s->p);
    make_correction_feasible(s);
    predict_stress(s, p->iteration < MAX_PREDICTION);
    if (!advance(s, d))
        return DRAPE_RETRY_NONFINITE;
    memmove(p->step + 1, p->step, (STEPS_KEPT - 1) * sizeof *p->step);
    p->step[0] = rms(s->equation, s->p);
    return DRAPE_OK;
}

/* An iteration, and how long the next one is expected to take, with the estimate of its error; fell: it is
 * one that only the error asks for. */
static drape_status make_timed_iteration(drape_inexact_newton *s, const drape_inexact_settings *settings,
                                         progress *p, bool fell, double *d, drape_solve_report *report)
{
    const double start = drape_clock_seconds();
    const drape_status status = make_iteration(s, settings, p, d, report);
    if (status)
        return status;
    p->seconds = drape_clock_seconds() - start;
    report->further_seconds += fell ? p->seconds : 0;
    p->seconds += p->estimating;
    if (s->friction && !s->factored && is_in_contact(s))
        s->friction_seconds = p->seconds;
    return DRAPE_OK;
}

static void update_estimate(drape_inexact_newton *s, double *d, progress *p, drape_solve_report *report)
{
    const double start = drape_clock_seconds();
    p->near = estimate_error(s, d, p->iteration > 0, &report->left);
    report->error = fmax(p->near, slow_error(s, p));
    const double took = drape_clock_seconds() - start;
    p->seconds += took - p->estimating;
    p->estimating = took;
}

static drape_status iterate(drape_inexact_newton *s, const drape_inexact_settings *settings, double *d,
                            drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    begin(s, settings->follows, settings->cheap);
    drape_status status = guess_linearized(s, settings, d);
    if (status) {
        report->reason = drape_reason_name(DRAPE_REASON_MEMORY);
        return status;
    }
    make_guess_feasible(s, settings->iterations, d);
    if (!drape_step_equation_evaluate(e, d))
        return DRAPE_RETRY_NONFINITE;
    const double fall = s->fraction || s->factored ? MAX_LEFT : 1;
    progress p = {.start = drape_step_equation_dot(e, e->f, e->f)};
    p.bound = fall * fall * p.start;
    for (;; p.iteration++) {
        const double left = drape_step_equation_dot(e, e->f, e->f);
        const bool least = p.iteration >= settings->iterations,
                   most = p.iteration >= settings->iterations + settings->rescue_iterations ||
                          (least && p.iteration >= least_iterations(s) && !has_time(settings, 0)) ||
                          (least && is_enough(s, settings, &p, left));
        report->iterations = p.iteration;
        bool converged = drape_step_equation_norm(e, DRAPE_NORM_MAX) <= settings->tolerance;
        report->reason = drape_reason_name(converged ? DRAPE_REASON_CONVERGED : DRAPE_REASON_ITERATIONS);
        converged |=
            least && left >= p.bound && left > STALLED * STALLED * p.left && is_rounding(s, d, report);
        p.left = left;
        const bool fell = converged || has_fallen(s, settings, &p, left);
        const double expected = expected_error(s, &p);
        if (fell && expected <= MAX_EXPECTED * settings->error && is_quiet(s, expected)) {
            report->error = expected;
            s->first.steps++;
            return DRAPE_OK;
        }
        if (fell || most)
            update_estimate(s, d, &p, report);
        if (p.iteration == 1 && fell)
            measure_contraction(s, report->error, p.first);
        const bool lost = report->error > e->model->length; /* nowhere near the solution */
        const bool measures = s->nonlinear && p.iteration == 1 && goes_by_error(s);
        const double aim = (s->factored || s->fraction ? 1 : CHEAP_SHARE) * settings->error;
        const bool ends = most || (report->error <= aim && !measures) ||
                          (p.iteration >= least_iterations(s) && !has_time(settings, p.seconds));
        report->solved = converged;
        if (converged || (fell && !lost && ends && is_quiet(s, report->error)))
            return DRAPE_OK;
        if (most) {
            if (!lost && (left < p.start || p.near < p.first))
                return DRAPE_OK;
            report->reason = drape_reason_name(DRAPE_REASON_RESIDUAL);
            return DRAPE_RETRY_NONLINEAR;
        }
        status = make_timed_iteration(s, settings, &p, fell, d, report);
        if (status)
            return status;
        e->work.newton_iterations++;
    }
}

drape_status drape_inexact_newton_solve(drape_inexact_newton *s, const drape_inexact_settings *settings,
                                        double *d, drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    /* the residual is reported but not bounded */
    *report = (drape_solve_report){.tolerance = NAN, .error = NAN, .left = NAN, .own = NAN};
    if (e->dofs == 0) {
        begin(s, settings->follows, settings->cheap);
        drape_step_equation_evaluate(e, d);
        report->reason = drape_reason_name(DRAPE_REASON_CONVERGED);
        report->error = report->residual = report->left = report->own = 0;
        report->solved = true;
        return drape_system_status(e->system);
    }
    drape_status status = iterate(s, settings, d, report);
    report->residual = drape_step_equation_norm(e, DRAPE_NORM_MAX);
    report->diagnostic = drape_step_equation_diagnose(e, settings->tolerance);
    report->own = drape_step_equation_local_error(e, d);
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
    drape_archive_double(a, &s->first.share);
    drape_archive_double(a, &s->first.along);
    drape_archive_double(a, &s->first.mass_weight);
    drape_archive_int32(a, &s->first.steps);
    if (s->approximate)
        drape_approx_jacobian_archive(s->approximate, a);
    if (!s->factors)
        return;
    drape_stress_predictor_archive(&s->predictor, a);
    drape_factored_jacobian_archive(s->factors, a);
}

size_t drape_inexact_newton_bytes(const drape_inexact_newton *s)
{
    return (s->approximate ? drape_approx_jacobian_bytes(s->approximate) : 0) +
           (s->factors ? drape_factored_jacobian_bytes(s->factors) : 0);
}
