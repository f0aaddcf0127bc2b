/*
 * radau: Radau IIA of order 5, three stages, with local error control: the implicit Runge-Kutta method of
 * RADAU5 (Hairer & Wanner 1996, Solving ODEs II, IV.8; the numbers in brackets are its equations). With
 *     x' = v,  M v' = -g(x, v, t),  stages at t + c_i h, c_3 = 1,
 *     V_i = v0 + h sum_j a_ij V'_j,  Z_i = X_i - x0 = h sum_j a_ij V_j
 * the unknowns are the velocities' deviations V_i - v0, and the positions follow from them exactly, so that
 * the equations are three of n rows,
 *     F_i = M/h sum_j (A^-1)_ij (V_j - v0) + g(x0 + Z_i, V_i, t + c_i h) = 0,
 * and the correction of simplified Newton, with the stiffness K and the damping D at one point, is
 *     (M A^-2/h^2 + D A^-1/h + K) dZ = -F,  dV = A^-1 dZ/h.
 * radau_matrix.h solves it in the basis of A^-1's eigenvectors. The new state is that of the third stage.
 *
 * The method is L-stable and algebraically stable: without loads the energy of a linear problem never grows.
 * One step needs nothing of the step before but guesses, so a kink, an impact or the end of an advance costs
 * nothing besides the step that it cuts.
 *
 * Error, convergence and step sizes follow RADAU5:
 *   - the error is that of a formula of order 3 in the same stages, filtered by P^-1, which takes out of it
 *     what stiff components contribute [8.19]; twice at first and after a rejection [8.20]. Its bound is
 *     raised to 0.1 rtol^(2/3): the error of the result, of order 5, then follows rtol;
 *   - the iteration has converged when theta/(1 - theta) |dZ|, theta the rate of convergence, is below a
 *     share of the error's bound [8.10]; it is given up when that is not to be expected [8.11];
 *   - K and D are kept while theta is small, and factors while h stays the same, for which h does not grow by
 *     little; h follows Gustafsson's predictive controller (local_error.h) [8.25];
 *   - the guess is the last step's polynomial, extrapolated [8.5].
 * Different are
 *   - the place of K and D, the extrapolated middle of the step instead of its beginning: a sheet of 13 x 13
 *     nodes and E h = 1e5 N/m takes half of the iterations;
 *   - a limit to the next step by the rate of convergence (Gustafsson & Soederlind 1997, Control strategies
 *     for the iterative solution of nonlinear equations in ODE solvers): where cloth swings fast, the
 *     iteration bounds the steps, not the error; and after a failure of the iteration, steps grow slowly;
 *   - in contact, K and D of the present state, in every step, and the present velocities as a guess. Where
 *     the iteration fails with them, it begins anew with an upper bound of friction in D, which does not
 *     change at the kink where a slip ends, as in sun_newton.h; only where this fails, too, is h smaller. A
 *     sheet of 20 x 20 nodes that falls on a ball with friction takes 146 attempts instead of 527.
 *
 * The energy account integrates the powers by the quadrature of the stages.
 */
#include "base/elementary.h"
#include "base/finite.h"
#include "base/reason.h"
#include "integrators/instant.h"
#include "integrators/local_error.h"
#include "integrators/radau_matrix.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { PARAM_NEWTON_SHARE = DRAPE_LOCAL_ERROR_PARAM_COUNT, PARAM_LINEAR_SOLVER, PARAM_COUNT };
enum { STAGES = 3 };

#define ERROR_POWER 4 /* the error of the embedded formula is O(h^4) */
/* Of Newton's iteration. */
#define MAX_ITERATIONS 10
#define FAST                                                                                                 \
    1e-2        /* K and D are kept after a step whose iteration converged at this rate: that
                               which LINEAR_TOLERANCE allows; never in contact */
#define AIM 0.3 /* rate for which the next step is made short enough */
/* Extrapolation, in steps of the last size: one that was cut by the end of an advance may be tiny. */
#define FARTHEST 8.0
/* Where the iteration failed, the next step is at most this much of that, and from step to step the limit is
 * relaxed by a factor. With contact this saves a third of the time. */
#define CEILING      0.5
#define RELAXATION   1.2
#define NEWTON_SHARE 0.03 /* of the error's bound: error that the iteration may leave */
/* Residual of the complex system, relative. 1e-3 takes a third more solves and saves a fiftieth of the
 * iterations; 0.1 takes up to twice as many. */
#define LINEAR_TOLERANCE DRAPE_LINEAR_TOLERANCE

static const double fraction[STAGES] = {0.1550510257216821902, 0.6449489742783178098, 1};
static const double quadrature[STAGES] = {0.3764030627004672751, 0.5124858261884216138,
                                          0.1111111111111111111};
static const double coefficients[STAGES][STAGES] = {
    {0.1968154772236604259, -0.06553542585019838811, 0.02377097434822015242},
    {0.3944243147390872770, 0.2920734116652284630, -0.04154875212599793020},
    {0.3764030627004672751, 0.5124858261884216138, 0.1111111111111111111}};
static const double inverse[STAGES][STAGES] = {
    {3.224744871391589049, 1.167840084690405495, -0.2531972647421808262},
    {-3.567840084690405495, 0.7752551286084109509, 1.053197264742180826},
    {5.531972647421808262, -7.531972647421808262, 5}};
/* A^-1 = T [gamma 0 0; 0 alpha -beta; 0 beta alpha] T^-1 */
static const double eigenvectors[STAGES][STAGES] = {
    {0.09443876248897524149, -0.1412552950209542084, -0.03002919410514742449},
    {0.2502131229653333114, 0.2041293522937999320, 0.3829421127572619378},
    {1, 1, 0}};
static const double to_eigenvectors[STAGES][STAGES] = {
    {4.178718591551904727, 0.3276828207610623871, 0.5233764454994495480},
    {-4.178718591551904727, -0.3276828207610623871, 0.4766235545005504520},
    {-0.5028726349457868760, 2.571926949855605429, -0.5960392048282249250}};
/* The embedded formula: its error is (gamma/h - J)^-1 (f(y0) + sum e_i (Y_i - y0)/h) [8.16, 8.19]. */
static const double embedded[STAGES] = {-10.04880939982741556, 1.382142733160748896, -0.3333333333333333333};

static const drape_param params[PARAM_COUNT] = {
    DRAPE_LOCAL_ERROR_PARAMS,
    [PARAM_NEWTON_SHARE] =
        DRAPE_NUMBER("newton_share", "1", DRAPE_DERIVED("0.03, at rtol below 1e-3 less"), DRAPE_ABOVE(0), 1,
                     "error that the iteration may leave, relative to the bound of the error test"),
    [PARAM_LINEAR_SOLVER] = DRAPE_CHOICE("linear_solver", 0, drape_linears_names, "name of a linear solver",
                                         .aliases = drape_linears_aliases),
};

/* The polynomial of a step: v through v0 and the stages, x its integral. */
typedef struct polynomial {
    double t, h;                   /* [s] its beginning; 0: there is none */
    double *x, *v, *stage[STAGES]; /* (n) at its beginning; V_i */
} polynomial;

typedef struct radau_state {
    drape_arena *arena;
    drape_system *system;
    const drape_model *model;
    const drape_motion *motion;
    drape_local_error control;
    double newton_bound; /* of the iteration's error, in its norm */
    int64_t n;           /* free DOFs */
    drape_radau_matrix matrix;
    double *x, *v, *g;                /* nodes: where the forces were evaluated last; g there */
    double *z[STAGES], *rate[STAGES]; /* (n) Z_i, V_i */
    double *force[STAGES];            /* (n) -F_i, then the correction of Z_i */
    double *rhs, *correction;         /* (3 n) in the basis of the eigenvectors */
    double *g0;                       /* (n) at the beginning of the step */
    double *error_x, *error_v;        /* (n) */
    double *dissipated;               /* nodes; NULL if nothing dissipates */
    const double *internal;           /* of the last accepted state */
    double span[2];                   /* [s] interval without a kink in the motion of pins and colliders */

    /* Kept between steps. */
    polynomial last, next; /* of the last accepted step; of the one being made */
    double reached;        /* [s] where the last step ended; NAN: the next one starts anew */
    double ceiling;        /* [s] of the next step; INFINITY: the iteration has not failed lately */
    double hardest;        /* largest rate of the last iteration, of those that mattered */
    double theta;          /* rate of convergence of the last iteration */
    double left;           /* theta/(1 - theta) */
    bool current;          /* K and D are of the present state */
    bool have_matrix;
    drape_work work;

    bool touches; /* there is contact at the beginning of the step */
    bool bounds;  /* the matrix has upper bounds of friction */

    /* Why the last evaluation failed. */
    bool nonfinite, crossing;
    drape_reason crossing_reason;
    drape_diagnostic crossing_pair;
} radau_state;

/* ---- Between vectors and nodes ---- */

static size_t node_at(const radau_state *s, int64_t i)
{
    return 3 * (size_t)s->model->node_of_free[i / 3] + (size_t)(i % 3);
}

/* The point at x0 + z (z NULL: x0) and v. */
static drape_point place(radau_state *s, double time, const double *x0, const double *z, const double *v)
{
    drape_instant_place_pins(s->motion, time, s->span, s->x, s->v);
    for (int64_t i = 0; i < s->n; i++) {
        s->x[node_at(s, i)] = z ? x0[i] + z[i] : x0[i];
        s->v[node_at(s, i)] = v[i];
    }
    return (drape_point){.x = s->x,
                         .v = s->v,
                         .internal = s->internal,
                         .t = time,
                         .span = {s->span[0], s->span[1]},
                         .instant = true};
}

/* out_i = sum_j matrix_ij in_j over the stages */
static void combine(int64_t n, const double matrix[STAGES][STAGES], double factor, double *const in[STAGES],
                    double *const out[STAGES])
{
    for (int64_t k = 0; k < n; k++) {
        const double from[STAGES] = {in[0][k], in[1][k], in[2][k]};
        for (int i = 0; i < STAGES; i++)
            out[i][k] = factor * (matrix[i][0] * from[0] + matrix[i][1] * from[1] + matrix[i][2] * from[2]);
    }
}

/* ---- The polynomial of a step ---- */

/* At the fraction p of the step: the weights by which v is a combination of v0 and the stages. */
static void weights_of_velocity(double p, double w[STAGES + 1])
{
    const double at[STAGES + 1] = {0, fraction[0], fraction[1], fraction[2]};
    for (int i = 0; i <= STAGES; i++) {
        w[i] = 1;
        for (int j = 0; j <= STAGES; j++)
            w[i] *= j == i ? 1 : (p - at[j]) / (at[i] - at[j]);
    }
}

/* The integrals of these weights from 0 to p, by the rule of Gauss with two points, which is exact. */
static void weights_of_position(double p, double w[STAGES + 1])
{
    const double offset = sqrt(3) / 6;
    double left[STAGES + 1], right[STAGES + 1];
    weights_of_velocity(p * (0.5 - offset), left);
    weights_of_velocity(p * (0.5 + offset), right);
    for (int i = 0; i <= STAGES; i++)
        w[i] = p / 2 * (left[i] + right[i]);
}

/* The velocity of a free DOF, by these weights. */
static double velocity_at(const polynomial *p, const double w[STAGES + 1], int64_t k)
{
    return w[0] * p->v[k] + w[1] * p->stage[0][k] + w[2] * p->stage[1][k] + w[3] * p->stage[2][k];
}

/* Whether the last polynomial says something about a step of size h. In contact its extrapolation costs more
 * iterations than it saves. */
static bool extrapolates(const radau_state *s, double h)
{
    return s->last.h > 0 && h <= FARTHEST * s->last.h && !s->touches;
}

static void interpolate(void *state, double time, double *x)
{
    radau_state *s = state;
    const polynomial *p = &s->last;
    double w[STAGES + 1];
    drape_motion_place_pins(s->motion, time, x);
    if (s->n == 0 || p->h == 0)
        return;
    weights_of_position((time - p->t) / p->h, w);
    for (int64_t i = 0; i < s->n; i++)
        x[node_at(s, i)] = p->x[i] + p->h * velocity_at(p, w, i);
}

static void interpolate_velocities(void *state, double time, double *v)
{
    radau_state *s = state;
    const polynomial *p = &s->last;
    double w[STAGES + 1];
    if (s->n == 0 || p->h == 0)
        return;
    weights_of_velocity((time - p->t) / p->h, w);
    for (int64_t i = 0; i < s->n; i++)
        v[node_at(s, i)] = velocity_at(p, w, i);
}

/* ---- Forces ---- */

/* g at a point; 0, or why it cannot be used. */
static drape_status evaluate(radau_state *s, const drape_point *point)
{
    const double start = drape_system_clock(s->system);
    drape_system_force(s->system, point, s->g);
    s->nonfinite = !drape_all_finite(s->g, 3 * (size_t)s->model->node_count);
    s->crossing = !s->nonfinite &&
                  drape_system_crosses(s->system, s->x, point->t, &s->crossing_reason, &s->crossing_pair);
    s->work.residuals++;
    s->work.residual_seconds += drape_system_clock(s->system) - start;
    if (drape_system_status(s->system))
        return drape_system_status(s->system);
    return s->nonfinite ? DRAPE_RETRY_NONFINITE : s->crossing ? DRAPE_RETRY_NONLINEAR : DRAPE_OK;
}

/* -F of all stages. */
static drape_status evaluate_stages(radau_state *s, double h)
{
    const polynomial *p = &s->next;
    const double *mass = s->matrix.mass;
    for (int i = 0; i < STAGES; i++) {
        const drape_point point = place(s, p->t + fraction[i] * h, p->x, s->z[i], s->rate[i]);
        drape_status status = evaluate(s, &point);
        if (status)
            return status;
        for (int64_t k = 0; k < s->n; k++) {
            double acceleration = 0;
            for (int j = 0; j < STAGES; j++)
                acceleration += inverse[i][j] * (s->rate[j][k] - p->v[k]);
            s->force[i][k] = -(mass[k] * acceleration / h + s->g[node_at(s, k)]);
        }
    }
    return DRAPE_OK;
}

/* Where K and D are evaluated: at the last polynomial's extrapolation to the middle of the step, as K at the
 * beginning is twice as far from K at the end; but at the beginning if there is none, or if it crosses
 * something. */
static drape_point choose_matrix_point(radau_state *s, double h)
{
    const polynomial *p = &s->next, *last = &s->last;
    if (extrapolates(s, h)) {
        double of_x[STAGES + 1], of_v[STAGES + 1], *z = s->rhs, *v = s->correction;
        weights_of_position(1 + h / (2 * last->h), of_x);
        weights_of_velocity(1 + h / (2 * last->h), of_v);
        for (int64_t k = 0; k < s->n; k++) {
            const double from[STAGES + 1] = {last->v[k], last->stage[0][k], last->stage[1][k],
                                             last->stage[2][k]};
            z[k] = v[k] = 0;
            for (int i = 0; i <= STAGES; i++) {
                z[k] += last->h * of_x[i] * from[i];
                v[k] += of_v[i] * from[i];
            }
        }
        const drape_point point = place(s, p->t + h / 2, last->x, z, v);
        drape_reason reason;
        drape_diagnostic pair;
        if (!drape_system_crosses(s->system, s->x, point.t, &reason, &pair))
            return point;
    }
    return place(s, p->t, p->x, NULL, p->v);
}

/* K and D, unless they are kept, and factors for h. */
static drape_status prepare_matrix(radau_state *s, double h)
{
    const double start = drape_system_matrix_clock(s->matrix.linear);
    if (!s->have_matrix) {
        drape_point point = choose_matrix_point(s, h);
        if (s->bounds)
            point.contact = DRAPE_CONTACT_GAUSS_NEWTON;
        drape_status status = drape_radau_matrix_evaluate(&s->matrix, &point);
        s->work.jacobians++;
        s->work.jacobian_seconds += drape_system_matrix_clock(s->matrix.linear) - start;
        if (status)
            return status;
        s->have_matrix = s->current = true;
    }
    return drape_radau_matrix_factor(&s->matrix, h);
}

/* ---- Newton's iteration ---- */

typedef enum guess { EXTRAPOLATED, UNIFORM, REST, GUESSES } guess;

/* Finds a guess in which nothing passes through anything else, and -F there. */
static drape_status guess_stages(radau_state *s, double h)
{
    drape_status status = DRAPE_RETRY_NONLINEAR;
    for (int kind = extrapolates(s, h) ? EXTRAPOLATED : UNIFORM; status > 0 && kind < GUESSES; kind++) {
        /* The stages' first velocities, and positions that belong to them. */
        const polynomial *p = &s->next, *last = &s->last;
        for (int i = 0; i < STAGES; i++) {
            double w[STAGES + 1];
            if (kind == EXTRAPOLATED)
                weights_of_velocity(1 + fraction[i] * h / last->h, w);
            for (int64_t k = 0; k < s->n; k++)
                s->rate[i][k] = kind == EXTRAPOLATED ? velocity_at(last, w, k)
                                : kind == UNIFORM    ? p->v[k]
                                                     : 0;
        }
        combine(s->n, coefficients, h, s->rate, s->z);
        status = evaluate_stages(s, h);
    }
    return status;
}

/* Moves the stages by the corrections; the norm of these. */
static double move(radau_state *s, double h)
{
    double sum = 0;
    for (int i = 0; i < STAGES; i++)
        for (int64_t k = 0; k < s->n; k++)
            s->z[i][k] += s->force[i][k];
    double *const change[STAGES] = {s->rhs, s->rhs + s->n, s->rhs + 2 * s->n};
    combine(s->n, inverse, 1 / h, s->force, change);
    for (int i = 0; i < STAGES; i++) {
        for (int64_t k = 0; k < s->n; k++)
            s->rate[i][k] += change[i][k];
        const double norm = drape_local_error_norm(&s->control, s->force[i], change[i], NULL);
        sum += norm * norm;
    }
    return sqrt(sum / STAGES);
}

/* Solves for the stages. */
static drape_status solve(radau_state *s, double h, drape_step_info *info)
{
    double before = 0, rate_before = 0;
    info->reason = DRAPE_REASON_NEWTON;
    s->left = drape_pow(fmax(s->left, DBL_EPSILON), 0.8);
    s->theta = FAST;
    s->hardest = 0;
    drape_status status = guess_stages(s, h);
    for (int k = 1; !status && k <= MAX_ITERATIONS; k++) {
        info->iterations++;
        s->work.newton_iterations++;
        /* The corrections of Z take the place of -F in `force`; DRAPE_RETRY_LINEAR without factors. */
        const int64_t n = s->n;
        double *const rhs[STAGES] = {s->rhs, s->rhs + n, s->rhs + 2 * n};
        double *const solution[STAGES] = {s->correction, s->correction + n, s->correction + 2 * n};
        combine(n, to_eigenvectors, 1, s->force, rhs);
        status = drape_radau_matrix_solve(&s->matrix, rhs[0], solution[0]);
        if (!status)
            status = drape_radau_matrix_solve_complex(&s->matrix, rhs[1], LINEAR_TOLERANCE, solution[1]);
        combine(n, eigenvectors, 1, solution, s->force);
        if (status)
            break;
        const double norm = move(s, h);
        if (!isfinite(norm))
            return DRAPE_RETRY_NONLINEAR;
        if (k > 1) {
            const double rate = norm / before;
            s->theta = k == 2 ? rate : sqrt(rate * rate_before);
            rate_before = rate;
            if (norm > s->newton_bound)
                s->hardest = fmax(s->hardest, rate);
            if (!(s->theta < 1))
                return DRAPE_RETRY_NONLINEAR;
            s->left = s->theta / (1 - s->theta);
        }
        if (s->left * norm <= s->newton_bound)
            return DRAPE_OK;
        if (k > 1 && k < MAX_ITERATIONS) {
            const int remaining = MAX_ITERATIONS - 1 - k;
            double expected = s->left * norm / s->newton_bound;
            for (int i = 0; i < remaining; i++)
                expected *= s->theta;
            if (expected >= 1) {
                info->retry = 0.8 * h * drape_pow(fmax(1e-4, fmin(20, expected)), -1.0 / (4 + remaining));
                return DRAPE_RETRY_NONLINEAR;
            }
        }
        before = fmax(norm, DBL_EPSILON);
        status = evaluate_stages(s, h);
    }
    if (status == DRAPE_RETRY_LINEAR)
        info->reason = DRAPE_REASON_SINGULAR;
    if (s->nonfinite)
        info->reason = DRAPE_REASON_NONFINITE;
    if (s->crossing)
        info->reason = s->crossing_reason;
    return status ? status : DRAPE_RETRY_NONLINEAR;
}

/* ---- Error ---- */

/* The error from g at the beginning, in error_x and error_v. Its equation with P is that of IDA's
 * corrections (ida.c): P dx = r2 + (D + w M) r1, dv = w dx - r1, w = gamma/h, with r1 and r2 those of x' = v
 * and of M v' = -g. */
static drape_status solve_error(radau_state *s, double h, const double *g)
{
    const polynomial *p = &s->next;
    const double w = DRAPE_RADAU_GAMMA / h, *mass = s->matrix.mass;
    double *r1 = s->correction, *r2 = s->rhs;
    for (int64_t k = 0; k < s->n; k++) {
        double x = 0, v = 0;
        for (int i = 0; i < STAGES; i++) {
            x += embedded[i] * s->z[i][k];
            v += embedded[i] * (s->rate[i][k] - p->v[k]);
        }
        r1[k] = x / h + (g == s->g0 ? p->v[k] : p->v[k] + s->error_v[k]);
        r2[k] = mass[k] * (v / h + w * r1[k]) - g[k];
    }
    drape_radau_matrix_add_damping(&s->matrix, r1, r2);
    drape_status status = drape_radau_matrix_solve(&s->matrix, r2, s->error_x);
    for (int64_t k = 0; k < s->n; k++)
        s->error_v[k] = w * s->error_x[k] - r1[k];
    return status;
}

/* The same; at the start and after a rejection, where a stiff component may be far from its equilibrium, it
 * is filtered twice unless it is small enough. */
static drape_status estimate_error(radau_state *s, const drape_local_attempt *a)
{
    const polynomial *p = &s->next;
    drape_status status = solve_error(s, a->h, s->g0);
    if (status || (s->last.h > 0 && !a->again) ||
        drape_local_error_norm(&s->control, s->error_x, s->error_v, NULL) <= 1)
        return status;
    double *v = s->correction + s->n, *g = s->correction + 2 * s->n;
    for (int64_t k = 0; k < s->n; k++)
        v[k] = p->v[k] + s->error_v[k];
    const drape_point point = place(s, p->t, p->x, s->error_x, v);
    status = evaluate(s, &point);
    if (status)
        return status > 0 ? DRAPE_OK : status; /* the first estimate rejects the step */
    for (int64_t k = 0; k < s->n; k++)
        g[k] = s->g[node_at(s, k)];
    return solve_error(s, a->h, g);
}

/* ---- A step ---- */

/* After a failure, reports the degenerate element or the node whose force is not finite, or the pair that
 * crossed. */
static void diagnose(radau_state *s, drape_step_info *info)
{
    if (s->crossing)
        info->diagnostic = s->crossing_pair;
    if (!s->nonfinite)
        return;
    info->reason = DRAPE_REASON_NONFINITE;
    drape_instant_diagnose(s->system, s->x, s->internal, s->g, s->rhs, info);
}

/* The state at the beginning, and g there. Pinned nodes that do not move keep their positions, and zero
 * velocity, in s->x and s->v for the whole step. */
static drape_status begin(radau_state *s, const drape_state *in, double stop)
{
    const size_t nodes = 3 * (size_t)s->model->node_count;
    polynomial *p = &s->next;
    memcpy(s->x, in->x, nodes * sizeof *s->x);
    memcpy(s->v, in->v, nodes * sizeof *s->v);
    s->internal = in->internal;
    s->span[0] = p->t = in->t;
    s->span[1] = stop;
    s->nonfinite = s->crossing = s->current = false;
    for (int64_t k = 0; k < s->n; k++) {
        p->x[k] = in->x[node_at(s, k)];
        p->v[k] = in->v[node_at(s, k)];
    }
    if (s->reached != in->t || drape_motion_at_kink(s->motion, in->t)) {
        s->last.h = 0;
        s->left = 1;
    }
    const drape_point point = place(s, in->t, p->x, NULL, p->v);
    drape_system_force(s->system, &point, s->g);
    s->work.residuals++;
    s->nonfinite = !drape_all_finite(s->g, nodes);
    s->touches = drape_system_touches(s->system);
    for (int64_t k = 0; k < s->n; k++)
        s->g0[k] = s->g[node_at(s, k)];
    if (drape_system_status(s->system))
        return drape_system_status(s->system);
    return s->nonfinite ? DRAPE_RETRY_NONFINITE : DRAPE_OK;
}

/* The stages of a step of size h; with new K and D where those of an earlier step fail, and in contact with
 * bounds of friction where new ones fail. */
static drape_status find_stages(radau_state *s, double h, drape_step_info *info)
{
    drape_status status;
    s->bounds = false;
    do {
        const bool kept = s->have_matrix && !s->current;
        info->reason = DRAPE_REASON_SINGULAR;
        status = prepare_matrix(s, h);
        if (!status)
            status = solve(s, h, info);
        s->have_matrix &= !s->bounds;
        if (status <= 0 || s->bounds || (!kept && !s->touches))
            return status;
        s->bounds = !kept;
        s->have_matrix = false;
    } while (true);
}

/* Solves the stages and tests the error. */
static drape_status attempt(radau_state *s, const drape_local_attempt *a, drape_step_info *info)
{
    drape_status status = find_stages(s, a->h, info);
    if (!status)
        status = estimate_error(s, a);
    if (status) {
        info->retry = info->retry > 0 ? info->retry : a->h / 2;
        s->ceiling = CEILING * a->h;
        diagnose(s, info);
        return status;
    }
    status = drape_local_error_test(&s->control, a, s->error_x, s->error_v, info);
    s->have_matrix &= status ? s->current : s->theta <= FAST && !s->touches;
    if (!status) {
        /* What the error test proposed is bounded by what the iteration is likely to manage. */
        double *proposed = &s->control.made.proposed;
        if (s->hardest > 0)
            *proposed = fmin(*proposed, a->h * AIM / s->hardest);
        *proposed = fmin(*proposed, s->ceiling);
        s->ceiling *= RELAXATION;
    }
    return status;
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    radau_state *s = state;
    const size_t nodes = 3 * (size_t)s->model->node_count;
    const double stop = drape_local_error_stop(&s->control, in, out->t);
    drape_local_attempt a = {.h = stop - in->t, .t1 = stop, .stop = stop, .end = out->t, .bound = h};
    info->tolerance = info->residual = NAN; /* errors are bounded, not residuals */
    drape_status status = begin(s, in, stop);
    if (status) {
        diagnose(s, info);
        return status;
    }
    if (s->n > 0)
        status = drape_local_error_begin(&s->control, in, s->g, &a, info);
    if (!status && s->n > 0)
        status = attempt(s, &a, info);
    if (status)
        return status;
    /* The work; the end of the step is left in s->x and s->v. */
    for (int i = 0; i < STAGES; i++) {
        const double time = i == STAGES - 1 ? a.t1 : s->span[0] + fraction[i] * a.h;
        const drape_point point = place(s, time, s->next.x, s->z[i], s->rate[i]);
        const double weight = quadrature[i] * a.h;
        if (s->dissipated)
            info->dissipated += drape_instant_dissipation(s->system, &point, weight, s->dissipated);
        if (drape_system_is_driven(s->system)) {
            drape_system_force(s->system, &point, s->g);
            drape_instant_driving(s->system, &point, s->g, weight, drape_system_work(s->system));
        }
    }
    memcpy(out->x, s->x, nodes * sizeof *out->x);
    memcpy(out->v, s->v, nodes * sizeof *out->v);
    /* The stages become the polynomial of the last step. */
    const polynomial kept = s->last;
    for (int i = 0; i < STAGES; i++) {
        double *stage = s->next.stage[i];
        s->next.stage[i] = s->rate[i];
        s->rate[i] = stage;
    }
    s->next.h = a.h;
    s->last = s->next;
    s->next = kept;
    out->t = s->reached = a.t1;
    info->h = a.h;
    info->reason = DRAPE_REASON_CONVERGED;
    return DRAPE_OK;
}

static void restart(void *state, const drape_state *from)
{
    (void)from;
    radau_state *s = state;
    s->reached = NAN;
    s->ceiling = INFINITY;
    s->have_matrix = false;
    drape_local_error_restart(&s->control);
}

/* ---- Creation and destruction ---- */

static void take_polynomial(drape_arena *arena, size_t n, polynomial *p)
{
    p->x = drape_arena_take(arena, n, sizeof *p->x);
    p->v = drape_arena_take(arena, n, sizeof *p->v);
    for (int i = 0; i < STAGES; i++)
        p->stage[i] = drape_arena_take(arena, n, sizeof *p->stage[i]);
}

/* 0.1 r^(2/3) for a bound of r relative to the scene. */
static double raise_bound(double bound, double size)
{
    return 0.1 * size * drape_pow(bound / size, 2.0 / 3);
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    radau_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (radau_state){.arena = arena,
                       .system = system,
                       .model = drape_system_model(system),
                       .motion = drape_system_motion(system)};
    s->n = 3 * (int64_t)s->model->free_count;
    const size_t nodes = 3 * (size_t)s->model->node_count, n = (size_t)s->n;
    double **const of_nodes[] = {&s->x, &s->v, &s->g}, **const of_dofs[] = {&s->g0, &s->error_x, &s->error_v};
    for (int i = 0; i < 3; i++) {
        *of_nodes[i] = drape_arena_take(s->arena, nodes, sizeof(double));
        *of_dofs[i] = drape_arena_take(s->arena, n, sizeof(double));
        s->z[i] = drape_arena_take(s->arena, n, sizeof(double));
        s->rate[i] = drape_arena_take(s->arena, n, sizeof(double));
        s->force[i] = drape_arena_take(s->arena, n, sizeof(double));
    }
    s->rhs = drape_arena_take(s->arena, n, STAGES * sizeof(double));
    s->correction = drape_arena_take(s->arena, n, STAGES * sizeof(double));
    take_polynomial(s->arena, n, &s->last);
    take_polynomial(s->arena, n, &s->next);
    if (s->model->has_dissipation)
        s->dissipated = drape_arena_take(s->arena, nodes, sizeof *s->dissipated);
    drape_local_error *control = &s->control;
    drape_local_error_init(s->system, values, ERROR_POWER, control);
    control->kept_growth = DRAPE_STEP_KEPT;
    control->atol_x = raise_bound(control->atol_x, control->size);
    control->atol_v = raise_bound(control->atol_v, control->speed);
    const double bound = fmin(control->atol_x / control->size, control->atol_v / control->speed);
    const double share = values[PARAM_NEWTON_SHARE];
    s->newton_bound = fmax(10 * DBL_EPSILON / bound, /* RADAU5: no smaller error can be asked for */
                           isnan(share) ? fmin(NEWTON_SHARE, sqrt(bound)) : share);
    restart(s, NULL);
    drape_status status = drape_arena_status(arena);
    if (status || s->n == 0)
        return status;
    return drape_radau_matrix_create(
        arena, system, drape_linear_of(NULL, (int)values[PARAM_LINEAR_SOLVER], s->n), &s->matrix);
}

static void destroy(void **state)
{
    radau_state *s = *state;
    if (s && s->matrix.system)
        drape_radau_matrix_destroy(&s->matrix);
    *state = NULL;
}

/* ---- For the table ---- */

static drape_work work(const void *state)
{
    const radau_state *s = state;
    return drape_work_with_linear(s->work, s->matrix.linear);
}

static void archive(void *state, drape_archive *a)
{
    radau_state *s = state;
    drape_local_error_archive(&s->control, a);
    drape_archive_double(a, &s->reached);
    drape_archive_double(a, &s->ceiling);
    drape_archive_double(a, &s->theta);
    drape_archive_double(a, &s->left);
    drape_archive_bool(a, &s->have_matrix);
    drape_work_archive(&s->work, a);
    if (s->n == 0)
        return;
    drape_archive_double(a, &s->last.t);
    drape_archive_double(a, &s->last.h);
    drape_archive_doubles(a, s->last.x, (size_t)s->n);
    drape_archive_doubles(a, s->last.v, (size_t)s->n);
    for (int i = 0; i < STAGES; i++)
        drape_archive_doubles(a, s->last.stage[i], (size_t)s->n);
    drape_radau_matrix_archive(&s->matrix, a);
}

static size_t bytes(const void *state)
{
    return drape_radau_matrix_bytes(&((const radau_state *)state)->matrix);
}

const drape_integrator_ops drape_integrator_radau = {
    .entry = {.name = "radau",
              .summary = "Radau IIA of order 5 with local error control: L-stable, one-step",
              .reference = "Hairer & Wanner 1996, Solving Ordinary Differential Equations II, IV.8 (RADAU5)",
              DRAPE_PARAMS(params)},
    .order = 5,
    .create = create,
    .own_steps = true,
    .step = step,
    .interpolate = interpolate,
    .interpolate_velocities = interpolate_velocities,
    .restart = restart,
    .work = work,
    .archive = archive,
    .bytes = bytes,
    .destroy = destroy,
};
