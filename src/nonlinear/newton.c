/*
 * newton.c: see newton.h. A solve runs through these stages, whose functions follow in this order:
 *
 *     guess      the caller's d or, where pins jerk, that of the equation linearized at the start of the
 *                step; made feasible (guess.h)
 *     residual   F(d), and which islands of the cloth are done by it (stopping.h)
 *     matrix     A near J(d), in a pattern that includes the contacts there, and its factors (matrix.h);
 *                where it is indefinite, that with the positive parts of all elements
 *     correct    p = -A^-1 F, made a descent direction, shortened to its feasible fraction; stress and normal
 *                forces of contact predicted for the next A; p shortened or lengthened by the search
 *                (line_search.h); which islands are done by what it gained
 *     estimate   what is left at d + p, by one more correction with the same factors; made, where it ends the
 *                solve
 *     conclude   what KINSOL's return code means, and F at the final d, in the requested norm
 *
 * KINSOL calls the stages between guess and conclude in each iteration: residual as its system function,
 * matrix as its Jacobian function and the setup of its linear solver, correct and estimate as the solve of
 * that. It adds p to d, counts iterations, and ends the loop when the largest component of F is within its
 * bound (a guess: of 1 % of it), when p is too short to change anything, when p is at its size limit five
 * times in a row, or after max_iterations. An island that is done gives KINSOL an F of 0, which its own test
 * takes as converged, and which keeps the island in its place. With `globalization: line_search` KINSOL
 * shortens p itself, by the sum of squares of F.
 *
 * Contact and the default globalization, `work`, are implemented here, inside `correct`: the solution that
 * KINSOL gets from its linear solver is the step to be taken. KINSOL's own line search can neither stop at
 * contact nor ask for another matrix, and it measures progress by the sum of squares of F, in which stiff
 * stretching outweighs all other forces.
 *
 * A sheet that buckles crosses many states with an indefinite J. Once J was indefinite, the next matrices of
 * the solve have the positive parts without trying J, until a correction is short. Matrices with positive
 * parts have no coupling of friction with normal forces: corrections that are short because it is missing
 * would be made by such matrices for ever, so that with friction the exact matrix is tried again after a
 * short one.
 */
#include "nonlinear/newton.h"

#include "base/clock.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "nonlinear/exact_jacobian.h"
#include "nonlinear/guess.h"
#include "nonlinear/residual_bound.h"
#include "nonlinear/stopping.h"
#include "nonlinear/stress_predictor.h"
#include "solvers/sun_shell.h"
#include "solvers/vector.h"

#include <float.h>
#include <kinsol/kinsol.h>
#include <limits.h>
#include <math.h>
#include <string.h>

/* KINSOL's settings that no user should need. All are set; none is left to a default. */
#define SETUPS 1 /* iterations between Jacobians */
/* Fraction of the scene's size: a shorter correction changes nothing. */
#define STEP_TOLERANCE (4 * DBL_EPSILON)
#define SHORT_STEP     0.5  /* after a shorter step the next matrix is positive semidefinite */
#define SMALL_STEP     0.03 /* of an edge: after a shorter correction the exact matrix is tried again */
#define MAX_AHEAD      0.1  /* of an edge: pins further ahead of the guess pull it along */
#define MAX_CHORDS     2    /* simplified corrections after one correction, without contact */
#define MAX_PREDICTION 2    /* corrections in a solve, after which stress is no longer predicted */
#define STALLED        0.5  /* of the residual before: if no more is gained, it may be rounding */
/* Corrections that contract by less are taken to contract by so much: nine more like the last one follow. */
#define MAX_CONTRACTION 0.9
#define ESTIMATE        0.5 /* of the residual, that conjugate gradients leave in an estimate */
/* Corrections where cloth touches something, however little time there is: what fewer leave throws it about,
 * so that later steps need more (docs/realtime.md, "What is saved first"). */
#define MIN_IN_CONTACT 3
/* A solve is laborious after more iterations than the larger of these: a number, and a share of the most. */
#define EASY       10
#define EASY_SHARE 0.4

const char *const drape_newton_norms[] = {
    [DRAPE_NORM_MAX] = "max", [DRAPE_NORM_L1] = "l1", [DRAPE_NORM_L2] = "l2", NULL};
const char *const drape_newton_failures[] = {"reject", "accept", NULL};
const char *const drape_newton_globalizations[] = {"line_search", "none", "work", "auto", NULL};

const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT] = {DRAPE_NEWTON_PARAMS};

enum { USUAL, APPROXIMATE, MATRICES }; /* of drape_matrix_choose; the exact Jacobian is the usual one */

struct drape_newton {
    drape_step_equation *equation;
    double values[DRAPE_NEWTON_PARAM_COUNT];
    bool searches; /* globalization `work` */
    bool lenient;  /* states that have not converged are usable */
    bool friction; /* matrices with positive parts are others than without, in contact too */
    drape_matrix matrices[MATRICES]; /* those without ops are not there */
    const drape_matrix *matrix;      /* of this solve */
    SUNContext sun;
    void *kin;
    drape_sun_shell shell;
    N_Vector unknown, ones; /* unknown wraps the caller's d during a solve */
    N_Vector weights;       /* of the components of F in its norm */
    /* If it searches. */
    drape_islands islands;
    int64_t version; /* of the pattern that they are of */
    drape_stopping stopping;
    drape_line_search search;
    drape_stress_predictor predictor;
    double *step, *right; /* free DOFs: a step, and its right-hand side, that KINSOL does not ask for */

    double *fraction; /* nodes: scratch of feasibility, if there is contact */
    double edge;      /* [m] mean length of an edge */

    /* Kept between the iterations of one solve. */
    drape_newton_effort effort, own_effort; /* of this solve; where the caller has none */
    int corrections;
    double tolerance;    /* relative residual that iterative solvers leave */
    double rounding;     /* of F in its norm, as last estimated; INFINITY: it was not */
    double residual;     /* weighted, largest component, at the last iterate that KINSOL evaluated */
    double start, left;  /* [N2] |F|^2 at the guess, and where it was evaluated last; if the effort keeps */
    double first, error; /* [m] RMS of the first correction, and of the last one or its estimate */
    double begun, seconds,
        further;          /* [s] when the last iteration began, what it took, of those beyond the least */
    bool positive;        /* the present matrix has the positive parts; after a search, the next one has */
    bool indefinite;      /* the exact matrix was at the last iterate where it was tried */
    bool error_within;    /* the estimated error is within what the effort asks */
    drape_status failure; /* < 0: why a callback ended the solve, of which KINSOL keeps only the sign */
};

/* A callback's return value: KINSOL takes > 0 as recoverable and < 0 as fatal, as drape_status does. */
static int return_status(drape_newton *s, drape_status status)
{
    if (status < 0)
        s->failure = status;
    return status;
}

/* KINSOL compares the largest weighted component of F with this bound, which implies the tolerance in the
 * requested norm. */
static double max_norm_bound(const drape_newton *s)
{
    return drape_residual_component(s->values[DRAPE_NEWTON_TOLERANCE],
                                    (drape_norm)s->values[DRAPE_NEWTON_NORM], s->equation->all_dofs);
}

static bool is_in_contact(const drape_newton *s)
{
    return s->equation->has_contact &&
           drape_ranks_any(s->equation->ranks, drape_system_touches(s->equation->system));
}

/* RMS over all nodes; pinned ones do not move. */
static double rms(const drape_step_equation *e, const double *p)
{
    return sqrt(drape_step_equation_dot(e, p, p) / e->all_nodes);
}

/* ---- Matrix ---- */

/* Of the present pattern, to which contact may have added; other islands begin anew. */
static void find_islands(drape_newton *s)
{
    const drape_system *system = s->equation->system;
    if (s->version == drape_system_pattern_version(system))
        return;
    s->version = drape_system_pattern_version(system);
    if (drape_islands_find(&s->islands, drape_system_pattern(system)))
        drape_stopping_begin(&s->stopping);
}

static drape_status assemble(drape_newton *s, const double *d, bool positive)
{
    drape_step_equation *e = s->equation;
    s->search.evaluated = false;
    s->positive = positive;
    drape_step_equation_move(e, d);
    drape_point point = e->point;
    point.stress = drape_stress_predictor_stress(&s->predictor);
    return s->matrix->ops->assemble(s->matrix->self, &point, e->mass_weight, positive, &e->work);
}

static int jacobian(N_Vector d, N_Vector f, SUNMatrix matrix, void *user, N_Vector scratch1,
                    N_Vector scratch2)
{
    (void)f, (void)matrix, (void)scratch1, (void)scratch2;
    drape_newton *s = user;
    s->begun = s->effort.deadline == INFINITY ? 0 : drape_clock_seconds();
    const bool positive = s->positive || (s->searches && s->indefinite);
    return return_status(s, assemble(s, N_VGetArrayPointer(d), positive));
}

/* Factors the assembled matrix; definite: only if it is positive definite, else DRAPE_RETRY_LINEAR. */
static drape_status factor_matrix(drape_newton *s, bool definite)
{
    drape_step_equation *e = s->equation;
    drape_status status = s->matrix->ops->factor(s->matrix->self, definite, &e->work);
    if (status == DRAPE_E_STOPPED)
        drape_system_cancelled(e->system); /* so that the step ends as cancelled */
    return status;
}

/* Assembles and factors the matrix with the positive parts at the present iterate. */
static drape_status factor_positive(drape_newton *s)
{
    const drape_status status = assemble(s, N_VGetArrayPointer(s->unknown), true);
    s->indefinite = true;
    return status ? status : factor_matrix(s, false);
}

/* An indefinite matrix gives useless directions. Those of the matrix with the positive parts descend. */
static drape_status factor(drape_newton *s)
{
    const bool definite = s->searches && !s->positive;
    const drape_status status = factor_matrix(s, definite);
    return status == DRAPE_RETRY_LINEAR && definite ? factor_positive(s) : status;
}

static int setup(SUNLinearSolver solver, SUNMatrix matrix)
{
    (void)matrix;
    drape_newton *s = solver->content;
    return return_status(s, factor(s));
}

static drape_status solve(drape_newton *s, const double *b, double tolerance, double *x)
{
    bool definite;
    const drape_status status =
        s->matrix->ops->solve(s->matrix->self, b, tolerance, x, &definite, &s->equation->work);
    s->indefinite |= !definite;
    return status;
}

/* ---- Guess ---- */

static void begin(drape_newton *s)
{
    drape_step_equation *e = s->equation;
    drape_step_equation_begin(e);
    s->matrix = &s->matrices[s->effort.cheap && s->matrices[APPROXIMATE].ops ? APPROXIMATE : USUAL];
    if (s->matrix->ops && s->matrix->ops->begin)
        s->matrix->ops->begin(s->matrix->self, !s->effort.cheap, s->effort.linear_iterations);
    s->corrections = 0;
    s->residual = s->rounding = INFINITY;
    s->start = s->left = s->first = s->error = NAN;
    s->seconds = s->further = 0;
    s->positive = s->indefinite = s->error_within = false;
    s->failure = DRAPE_OK;
    drape_step_equation_predict_contact(e, NULL);
    if (!s->searches)
        return;
    s->search.evaluated = false;
    s->stopping.by_error = s->effort.by_error;
    s->stopping.strict = false;
    find_islands(s);
    drape_stopping_begin(&s->stopping);
    double clock = drape_system_clock(e->system);
    drape_point start = e->point;
    start.x = e->x_start;
    drape_stress_predictor_begin(&s->predictor,
                                 start.x && s->matrix->ops && s->matrix->ops->direct ? &start : NULL);
    e->work.jacobian_seconds += drape_system_clock(e->system) - clock;
}

/* Where a pin takes a sheet along, nodes that keep their velocity stay behind. The elements at the pin are
 * stretched by as much, and it takes many corrections until their forces have reached the rest of a stiff
 * sheet. The linearized equation takes the pull of the pins to all nodes at once: d = -A^-1 (F + dF/dpins
 * times their displacement), with F and A at the start of the step. A guess needs no exact derivative: the
 * pull is a difference. */
static drape_status guess_linearized(drape_newton *s, double *d)
{
    drape_step_equation *e = s->equation;
    /* Its solution knows of no contact to come. */
    if (!s->searches || e->has_contact || !e->x_start || !(e->pins_ahead > MAX_AHEAD * s->edge) ||
        !drape_step_equation_pins_move(e))
        return DRAPE_OK;
    N_VSetArrayPointer(s->search.trial, s->unknown);
    drape_step_equation_pull(e, s->search.trial, s->step);
    for (size_t i = 0; i < e->dofs; i++)
        s->right[i] = -s->step[i];
    drape_status status = assemble(s, s->search.trial, false);
    if (!status)
        status = factor(s);
    if (!status)
        status = solve(s, s->right, s->tolerance, s->step);
    if (!status && drape_step_equation_is_finite(e, s->step))
        memcpy(d, s->step, e->dofs * sizeof *d);
    s->positive = s->indefinite = false;
    drape_step_equation_begin(e);
    return status < 0 ? status : DRAPE_OK;
}

/* ---- Residual ---- */

/* Whether F has stopped falling because it is the rounding error of its forces. */
static bool has_stalled(drape_newton *s, const double *d, bool *finite)
{
    drape_step_equation *e = s->equation;
    const double before = s->residual;
    s->residual = drape_step_equation_norm(e, DRAPE_NORM_MAX);
    if (s->residual <= max_norm_bound(s) || !(s->residual > STALLED * before) || s->positive)
        return false;
    const bool rounding =
        drape_step_equation_is_rounding(e, d, (drape_norm)s->values[DRAPE_NEWTON_NORM], &s->rounding);
    *finite = !isnan(s->rounding);
    return rounding;
}

/* Which islands are done at the last evaluation of F; contact there may couple those that were to others. A
 * state that would be rejected for what has become of an element is solved to the residual. *done: all are.
 */
static drape_status judge_islands(drape_newton *s, bool *done)
{
    const drape_step_equation *e = s->equation;
    drape_reason reason;
    drape_diagnostic diagnostic;
    bool changed;
    const drape_status status =
        e->has_contact ? drape_system_extend_pattern(e->system, &e->point, &changed) : DRAPE_OK;
    find_islands(s);
    *done = !status && drape_stopping_test_residual(&s->stopping, max_norm_bound(s));
    if (*done && s->stopping.ended_by_error &&
        drape_system_check(e->system, e->x, e->x_start, e->point.internal, &reason, &diagnostic)) {
        drape_stopping_begin(&s->stopping);
        s->stopping.strict = true;
        *done = drape_stopping_test_residual(&s->stopping, max_norm_bound(s));
    }
    return status;
}

/* Whether there is no time for another iteration like the last one. */
static bool is_late(drape_newton *s)
{
    if (s->effort.deadline == INFINITY)
        return false;
    const double now = drape_clock_seconds();
    if (s->corrections > 0)
        s->seconds = now - s->begun;
    s->further += s->corrections > s->effort.least ? s->seconds : 0;
    const int least = s->effort.least;
    return s->corrections >= (is_in_contact(s) && least < MIN_IN_CONTACT ? MIN_IN_CONTACT : least) &&
           now + s->seconds > s->effort.deadline;
}

/* KINSOL must never get a NaN: its norms ignore it, so it would look like convergence. After a line search
 * F is known already. An F that is only rounding, or of islands that are done, is given to KINSOL as 0. */
static int residual(N_Vector d_vector, N_Vector f, void *user)
{
    drape_newton *s = user;
    drape_step_equation *e = s->equation;
    const double *d = N_VGetArrayPointer(d_vector);
    double *out = N_VGetArrayPointer(f);
    bool finite = true, done = false;
    const bool known = s->searches && drape_line_search_knows(&s->search, d);
    if (!drape_ranks_all(e->ranks, known)) {
        s->search.evaluated = false;
        finite = drape_step_equation_evaluate(e, d);
    }
    if (s->effort.keeps) {
        s->left = drape_step_equation_dot(e, e->f, e->f);
        s->start = isnan(s->start) ? s->left : s->start;
    }
    const drape_status status = s->searches && finite ? judge_islands(s, &done) : DRAPE_OK;
    done = done || (finite && (s->error_within || has_stalled(s, d, &finite)));
    const bool spent = finite && !done && is_late(s);
    for (size_t i = 0; i < e->dofs; i++)
        out[i] = done || spent || e->weight[i / 3] == 0 ? 0 : e->f[i];
    if (status || drape_system_status(e->system))
        return return_status(s, status < 0 ? status : -1);
    return finite ? 0 : 1;
}

/* ---- Correct ---- */

/* No solution or not a descent direction: the matrix is indefinite, which the factorisation, or an iterative
 * solver, did not detect. */
static drape_status ensure_descent(drape_newton *s, drape_status status, const double *minus_f, double *p)
{
    const bool descends = !status && drape_step_equation_dot(s->equation, minus_f, p) > 0;
    if (status < 0 || descends || s->positive)
        return status;
    status = factor_positive(s);
    return status ? status : solve(s, minus_f, s->tolerance, p);
}

/* The longest displacement of a node in p. */
static double longest(const drape_step_equation *e, const double *p)
{
    double squared = 0;
    for (size_t i = 0; i < e->dofs; i += 3)
        squared = fmax(squared, vec3_dot(p + i, p + i));
    return sqrt(drape_ranks_largest(e->ranks, squared));
}

/* ---- Estimate ---- */

/* p2 = -A^-1 F at d + p, where F is known, by the factors that gave p, into s->step; s->right: d + p. Sets
 * what p2 says of what p has left. False: there is none. */
static bool correct_again(drape_newton *s, const double *d, const double *p, double *length,
                          drape_status *status)
{
    drape_step_equation *e = s->equation;
    for (size_t i = 0; i < e->dofs; i++)
        s->right[i] = e->weight[i / 3] == 0 ? 0 : -e->f[i];
    const double tolerance = s->matrix->ops->direct ? s->tolerance : fmax(s->tolerance, ESTIMATE);
    *status = solve(s, s->right, tolerance, s->step);
    if (*status || !drape_step_equation_is_finite(e, s->step))
        return false;
    for (size_t i = 0; i < e->dofs; i++)
        s->right[i] = d[i] + p[i];
    drape_stopping_estimate(&s->stopping, s->right, s->step);
    const double before = *length;
    *length = rms(e, s->step);
    s->error = s->matrix->ops->direct ? *length / (1 - fmin(*length / before, MAX_CONTRACTION)) : *length;
    return true;
}

/* What p has left, by the simplified Newton correction (Deuflhard 2011, 2.1), which costs a tenth of an
 * iteration. Where it gains little beside the local error of the step, it ends the solve
 *     - if the matrix is exact, and nothing is in contact, whose forces change too much along it,
 *     - if it and those that would follow, by their contraction (Hairer & Wanner 1996, IV.8), are as short as
 *       an effort asks. (Conjugate gradients leave stiff directions, in which little length has much energy:
 *       by them the length alone counts.)
 * By the first of these islands end each by itself. Then it is made, as far as the search says, if it is
 * feasible, unless it took conjugate gradients. Where one or two of them are
 * likely to lower the residual below its bound they are made, too, and the residual decides. */
static drape_status estimate(drape_newton *s, const double *d, bool definite, double *p)
{
    drape_step_equation *e = s->equation;
    const drape_newton_effort *effort = &s->effort;
    const bool direct = s->matrix->ops->direct, may = s->corrections >= effort->least && !s->stopping.strict,
               by_gain = may && effort->by_error && definite && s->matrix->ops->exact && e->expected &&
                         !is_in_contact(s),
               by_error = may && effort->error > 0;
    const double bound = max_norm_bound(s);
    double before = s->residual, length = s->error;
    for (int more = e->has_contact ? 1 : MAX_CHORDS; more > 0; more--) {
        const double now = drape_step_equation_norm(e, DRAPE_NORM_MAX), ratio = now / before;
        const bool by_residual = direct && now * (more > 1 ? ratio * ratio : ratio) <= bound;
        drape_status status = DRAPE_OK;
        if (!(now > bound) || !(by_residual || by_gain || by_error) ||
            !correct_again(s, d, p, &length, &status))
            return status < 0 ? status : DRAPE_OK;
        const bool within =
            by_error && s->error <= effort->error && (drape_stopping_is_small(&s->stopping) || !direct);
        const bool made = direct && (within || by_residual ||
                                     (by_gain && drape_stopping_keep_small(&s->stopping, s->step)));
        s->error_within = within;
        if (by_gain)
            drape_stopping_finish_small(&s->stopping);
        if (!made || drape_step_equation_make_feasible(e, s->step) < 1)
            return DRAPE_OK;
        drape_line_search_along(&s->search, d, p, 1, s->step);
        for (size_t i = 0; i < e->dofs; i++)
            p[i] += s->step[i];
        if (!by_residual || within || !s->search.evaluated || s->search.shortest < 1)
            return DRAPE_OK;
        before = now;
    }
    return DRAPE_OK;
}

/* Takes the correction p, of which contact has left a fraction, from d as far as the search says. */
static drape_status advance(drape_newton *s, const double *d, double fraction, double *p)
{
    drape_step_equation *e = s->equation;
    const bool definite = !s->positive;
    const double longest = s->positive && !e->has_contact ? INFINITY : 1;
    /* Along the first corrections, which are long. If they have not led near a solution, the sheet may be
     * buckling: then forces extrapolated along a correction are meaningless, and the iteration may cycle. */
    double start = drape_system_clock(e->system);
    if (s->corrections <= MAX_PREDICTION)
        drape_stress_predictor_correct(&s->predictor, &e->point, p);
    else
        drape_stress_predictor_forget(&s->predictor);
    e->work.jacobian_seconds += drape_system_clock(e->system) - start;
    drape_line_search_along(&s->search, d, NULL, longest, p);
    const bool at_once = s->search.evaluated && s->search.shortest == 1 && s->search.longest == 1;
    drape_stopping_test_error(&s->stopping, s->search.lengths, d, p, definite && s->matrix->ops->exact,
                              fraction);
    s->positive = s->search.shortest < SHORT_STEP && !(s->friction && s->positive);
    if (s->search.shortest < 1 || s->search.longest > 1)
        drape_stress_predictor_forget(&s->predictor);
    return at_once ? estimate(s, d, definite, p) : DRAPE_OK;
}

/* Turns p into the step that is taken from the present iterate d. A p that is not finite is left to KINSOL,
 * whose evaluation then fails. */
static drape_status make_step(drape_newton *s, const double *minus_f, double *p)
{
    drape_step_equation *e = s->equation;
    drape_status status = solve(s, minus_f, s->tolerance, p);
    if (s->searches)
        status = ensure_descent(s, status, minus_f, p);
    if (status || !drape_step_equation_is_finite(e, p))
        return status;
    s->indefinite = s->indefinite && longest(e, p) > SMALL_STEP * s->edge;
    s->error = rms(e, p); /* of all of it, however far it is taken */
    if (s->corrections++ == 0)
        s->first = s->error;
    if (s->searches)
        drape_step_equation_predict_contact(e, p);
    const double fraction = drape_step_equation_make_feasible(e, p);
    return s->searches ? advance(s, N_VGetArrayPointer(s->unknown), fraction, p) : DRAPE_OK;
}

static int correct(SUNLinearSolver solver, SUNMatrix matrix, N_Vector p, N_Vector minus_f,
                   sunrealtype tolerance)
{
    (void)matrix, (void)tolerance;
    drape_newton *s = solver->content;
    return return_status(s, make_step(s, N_VGetArrayPointer(minus_f), N_VGetArrayPointer(p)));
}

/* ---- Conclude ---- */

/* The other codes are KIN_MEM_NULL, KIN_ILL_INPUT, KIN_NO_MALLOC, KIN_MEM_FAIL, KIN_LINIT_FAIL,
 * KIN_VECTOROP_ERR and the like. */
static const drape_solver_code codes[] = {
    {KIN_SUCCESS, DRAPE_REASON_CONVERGED},
    {KIN_INITIAL_GUESS_OK, DRAPE_REASON_CONVERGED},
    {KIN_STEP_LT_STPTOL, DRAPE_REASON_STAGNATION}, /* a positive code, but not converged */
    {KIN_MAXITER_REACHED, DRAPE_REASON_MAX_ITERATIONS},
    {KIN_LINESEARCH_NONCONV, DRAPE_REASON_LINE_SEARCH},
    {KIN_LINESEARCH_BCFAIL, DRAPE_REASON_LINE_SEARCH},
    {KIN_MXNEWT_5X_EXCEEDED, DRAPE_REASON_NEWTON_STEP},
    {KIN_LINSOLV_NO_RECOVERY, DRAPE_REASON_SINGULAR},
    {KIN_LSETUP_FAIL, DRAPE_REASON_SINGULAR},
    {KIN_LSOLVE_FAIL, DRAPE_REASON_SINGULAR},
    {KIN_SYSFUNC_FAIL, DRAPE_REASON_NONFINITE},
    {KIN_FIRST_SYSFUNC_ERR, DRAPE_REASON_NONFINITE},
    {KIN_REPTD_SYSFUNC_ERR, DRAPE_REASON_NONFINITE},
};

/* Whether F at d is small enough. If KINSOL converged, its last evaluation was at d; otherwise it may have
 * been at a trial point. */
static drape_status judge(drape_newton *s, drape_status status, const double *d, drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    drape_norm norm = (drape_norm)s->values[DRAPE_NEWTON_NORM];
    double tolerance = s->values[DRAPE_NEWTON_TOLERANCE];
    bool finite = !status || drape_step_equation_evaluate(e, d);
    if (s->effort.keeps)
        s->left = drape_step_equation_dot(e, e->f, e->f);
    report->tolerance = tolerance;
    report->residual = finite ? drape_step_equation_norm(e, norm) : NAN;
    report->diagnostic = drape_step_equation_diagnose(e, tolerance);
    /* What is left is less than the last correction, or what follows the estimate, where these contract;
     * without one it is less than if nothing but inertia resisted F. Pseudo-transient steps, which have no
     * start, are no motion. */
    double left;
    if (s->searches && e->x_start && !isnan(report->residual)) {
        report->own = drape_step_equation_local_error(e, d);
        report->error = drape_step_equation_inertial_error(e, &report->left);
        if (drape_stopping_left(&s->stopping, &left)) {
            report->error = fmin(report->error, s->error);
            report->left = fmin(report->left, left);
        }
    }
    if (report->residual <= tolerance) {
        report->reason = DRAPE_REASON_CONVERGED;
        return DRAPE_OK;
    }
    if (!status && (s->error_within || s->stopping.ended_by_error)) {
        report->reason = s->error_within ? DRAPE_REASON_CORRECTION : DRAPE_REASON_LOCAL_ERROR;
        report->tolerance = NAN; /* the residual has none */
        report->by_error = !s->error_within;
        return DRAPE_OK;
    }
    double rounding = finite ? drape_step_equation_rounding(e, d, norm) : NAN;
    if (report->residual <= rounding) {
        report->reason = DRAPE_REASON_ROUNDING;
        report->tolerance = rounding;
        return DRAPE_OK;
    }
    /* An effort that is spent has come nearer than the guess was, and not further off than the scene is
     * large. */
    if (finite && status >= 0 && s->effort.keeps && (s->left < s->start || s->error < s->first) &&
        !(s->error > e->model->length)) {
        report->reason = DRAPE_REASON_ITERATIONS;
        report->tolerance = NAN;
        report->solved = false;
        return DRAPE_OK;
    }
    if (!status || s->effort.keeps) { /* else unreachable if KINSOL tests what its documentation says */
        report->reason = DRAPE_REASON_RESIDUAL;
        status = status < 0 ? status : DRAPE_RETRY_NONLINEAR;
    }
    report->usable = report->lenient && finite && status > 0;
    return finite && status != DRAPE_RETRY_NONFINITE ? status
                                                     : drape_step_equation_find_cause(e, status, report);
}

static drape_status conclude(drape_newton *s, int code, const double *d, drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    long iterations = 0;
    report->reason = drape_solver_reason(codes, sizeof codes / sizeof *codes, code);
    drape_status status = drape_solver_status(report->reason);
    KINGetNumNonlinSolvIters(s->kin, &iterations); /* of this solve: KINSol resets its counters */
    report->iterations = (int)iterations;
    report->laborious = !s->effort.keeps && (double)iterations > fmax(EASY, EASY_SHARE * s->effort.most);
    e->work.newton_iterations += iterations;
    /* KINSOL could not go on because all that is left, besides islands that are done, is rounding. */
    const drape_norm norm = (drape_norm)s->values[DRAPE_NEWTON_NORM];
    if (s->searches && status > 0 && s->stopping.ended_by_error && drape_step_equation_evaluate(e, d) &&
        drape_step_equation_norm(e, norm) <= drape_step_equation_rounding(e, d, norm))
        status = DRAPE_OK;
    if (s->searches)
        drape_stopping_end(&s->stopping);
    if (drape_system_agree(e->system))
        return drape_system_status(e->system);
    if (s->failure) {
        report->reason = DRAPE_REASON_MEMORY;
        return s->failure;
    }
    report->further_seconds = s->further;
    report->solved = true;
    status = judge(s, status, d, report);
    report->solved &= !status;
    return status;
}

/* ---- A solve ---- */

drape_status drape_newton_solve(drape_newton *s, const drape_newton_effort *effort, double *d,
                                drape_solve_report *report)
{
    drape_step_equation *e = s->equation;
    *report = (drape_solve_report){
        .reason = DRAPE_REASON_CONVERGED, .error = NAN, .left = NAN, .own = NAN, .lenient = s->lenient};
    s->effort = effort ? *effort : s->own_effort;
    s->tolerance = s->effort.linear_tolerance;
    begin(s);
    if (e->dofs == 0) {
        drape_step_equation_evaluate(e, d);
        report->error = report->left = report->own = 0;
        report->solved = true;
        return DRAPE_OK;
    }
    drape_status status = guess_linearized(s, d);
    if (drape_system_agree(e->system))
        return drape_system_status(e->system);
    if (status) {
        report->reason = DRAPE_REASON_MEMORY;
        return status;
    }
    drape_guess_make_feasible(e, d, s->right, s->fraction);
    KINSetNumMaxIters(s->kin, s->effort.most);
    N_VSetArrayPointer(d, s->unknown);
    int strategy =
        s->values[DRAPE_NEWTON_GLOBALIZATION] == DRAPE_NEWTON_GLOBAL_LINE_SEARCH ? KIN_LINESEARCH : KIN_NONE;
    return conclude(s, KINSol(s->kin, s->unknown, strategy, s->ones, s->weights), d, report);
}

/* ---- Creation and destruction ---- */

/* Making a vector of ranks is collective, and copying it is not. */
static drape_status create_vectors(drape_arena *arena, drape_newton *s)
{
    const int64_t n = (int64_t)s->equation->dofs;
    const bool begun = !drape_sundials_context(arena->ctx, &s->sun) && (s->kin = KINCreate(s->sun));
    if (!drape_ranks_all(s->equation->ranks, begun) ||
        !(s->unknown = drape_vector_make(s->equation->ranks, n, s->equation->f, s->sun)) ||
        !(s->ones = N_VClone(s->unknown)) || !(s->weights = N_VClone(s->unknown)))
        return drape_fail_memory(arena->ctx, (size_t)n * sizeof(double));
    N_VConst(1, s->ones);
    for (int64_t i = 0; i < n; i++)
        N_VGetArrayPointer(s->weights)[i] = s->equation->weight[i / 3];
    return DRAPE_OK;
}

static drape_status create_solver(drape_arena *arena, drape_newton *s, double dt)
{
    drape_system *system = s->equation->system;
    drape_status status;
    if (dt > 0) {
        status = drape_matrix_choose(arena, system, dt, &s->matrices[USUAL], &s->matrices[APPROXIMATE]);
    } else {
        s->matrices[USUAL].ops = &drape_exact_jacobian_ops;
        status = drape_exact_jacobian_create(arena, system,
                                             drape_linear_of(s->equation->ranks,
                                                             (int)s->values[DRAPE_NEWTON_LINEAR_SOLVER],
                                                             (int64_t)s->equation->dofs),
                                             s->searches, (drape_exact_jacobian **)&s->matrices[USUAL].self);
    }
    if (!status)
        status = drape_sun_shell_create(arena->ctx, s->sun, s, setup, correct, &s->shell);
    if (status)
        return status;
    DRAPE_KINSOL_QUIET(s->kin);
    const bool set =
        !KINInit(s->kin, residual, s->unknown) && !KINSetUserData(s->kin, s) &&
        !KINSetLinearSolver(s->kin, s->shell.solver, s->shell.matrix) && !KINSetJacFn(s->kin, jacobian) &&
        !KINSetFuncNormTol(s->kin, max_norm_bound(s)) &&
        !KINSetScaledStepTol(s->kin, STEP_TOLERANCE * s->equation->model->length) &&
        !KINSetMaxNewtonStep(s->kin, DBL_MAX) && /* by default the size of the guess bounds corrections */
        !KINSetMaxSetupCalls(s->kin, SETUPS) && !KINSetNoResMon(s->kin, SUNTRUE) &&
        !KINSetMaxBetaFails(s->kin, LONG_MAX); /* of KINSOL's curvature condition: no limit */
    return set ? DRAPE_OK
               : drape_fail(arena->ctx, DRAPE_E_MEMORY,
                            "out of memory: KINSOL cannot be set up for %lld unknowns",
                            (long long)s->equation->dofs);
}

drape_status drape_newton_create(drape_arena *arena, drape_step_equation *equation, const double *values,
                                 double dt, drape_newton **out)
{
    drape_newton *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (drape_ranks_agree_memory(equation->ranks, arena->ctx, s))
        return DRAPE_E_MEMORY;
    s->equation = equation;
    s->version = -1;
    s->edge = drape_model_mean_edge(equation->model);
    memcpy(s->values, values, sizeof s->values);
    s->right = drape_arena_take(arena, equation->dofs, sizeof *s->right);
    if (equation->has_contact)
        s->fraction = drape_arena_take(arena, equation->nodes / 3, sizeof *s->fraction);
    if (s->values[DRAPE_NEWTON_GLOBALIZATION] == DRAPE_NEWTON_GLOBAL_AUTO)
        s->values[DRAPE_NEWTON_GLOBALIZATION] = DRAPE_NEWTON_GLOBAL_WORK;
    s->searches = s->values[DRAPE_NEWTON_GLOBALIZATION] == DRAPE_NEWTON_GLOBAL_WORK;
    s->friction = !drape_system_is_symmetric(equation->system);
    s->own_effort = (drape_newton_effort){.most = (int)values[DRAPE_NEWTON_MAX_ITERATIONS],
                                          .by_error = isnan(values[DRAPE_NEWTON_TOLERANCE]),
                                          .deadline = INFINITY,
                                          .linear_tolerance = DRAPE_LINEAR_TOLERANCE};
    drape_status status =
        drape_residual_bound_set(equation, (drape_norm)values[DRAPE_NEWTON_NORM],
                                 values[DRAPE_NEWTON_TOLERANCE], &s->values[DRAPE_NEWTON_TOLERANCE]);
    if (!status)
        status = drape_arena_status(arena);
    if (!status && s->searches) {
        s->step = drape_arena_take(arena, equation->dofs, sizeof *s->step);
        status = drape_islands_init(arena, equation->dofs / 3, &s->islands);
        if (!status)
            status = drape_line_search_init(arena, equation, &s->islands, &s->search);
        if (!status)
            status = drape_stopping_init(arena, equation, &s->islands, &s->stopping);
        if (!status)
            status = drape_stress_predictor_init(arena, equation->system, &s->predictor);
    }
    drape_reserve reserve = {.used = false};
    if (!status)
        status = drape_reserve_open(&reserve, arena->ctx, equation->dofs);
    status = drape_ranks_agree(equation->ranks, arena->ctx, status);
    if (!status)
        status = drape_ranks_agree(equation->ranks, arena->ctx, create_vectors(arena, s));
    if (!status && equation->dofs > 0)
        status = create_solver(arena, s, dt);
    return drape_reserve_close(&reserve, arena->ctx, status);
}

void drape_newton_destroy(drape_newton **newton)
{
    drape_newton *s = *newton;
    if (!s)
        return;
    KINFree(&s->kin);
    for (int k = 0; k < MATRICES; k++)
        if (s->matrices[k].ops)
            s->matrices[k].ops->destroy(s->matrices[k].self);
    drape_sun_shell_destroy(&s->shell);
    N_VDestroy(s->unknown);
    N_VDestroy(s->ones);
    N_VDestroy(s->weights);
    SUNContext_Free(&s->sun);
    *newton = NULL;
}

/* ---- For integrators ---- */

drape_status drape_newton_matrix(drape_newton *s, const drape_point *point, double mass_weight,
                                 const drape_pattern **pattern, const double **values)
{
    return drape_exact_jacobian_at(s->matrices[USUAL].self, point, mass_weight, pattern, values);
}

const double *drape_newton_values(const drape_newton *s)
{
    return s->values;
}

void drape_newton_set_lenient(drape_newton *s, bool lenient)
{
    s->lenient = lenient;
}

void drape_newton_set_tolerance(drape_newton *s, double tolerance)
{
    s->values[DRAPE_NEWTON_TOLERANCE] = tolerance;
    if (s->equation->dofs > 0)
        KINSetFuncNormTol(s->kin, max_norm_bound(s));
}

void drape_newton_archive(drape_newton *s, drape_archive *a)
{
    drape_archive_mark(a, "newton");
    drape_archive_doubles(a, s->equation->f, s->equation->dofs);
    drape_work_archive(&s->equation->work, a);
    for (int k = 0; k < MATRICES; k++)
        if (s->matrices[k].ops)
            s->matrices[k].ops->archive(s->matrices[k].self, a);
}

#define KINSOL_VECTORS 8 /* six of its own, and two of weights */

size_t drape_newton_bytes(const drape_newton *s)
{
    size_t bytes = KINSOL_VECTORS * s->equation->dofs * sizeof(double);
    for (int k = 0; k < MATRICES; k++)
        bytes += s->matrices[k].ops ? s->matrices[k].ops->bytes(s->matrices[k].self) : 0;
    return bytes;
}
