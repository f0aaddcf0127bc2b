/*
 * rosenbrock: a linearly implicit Runge-Kutta method (Rosenbrock-Wanner) with local error control: no Newton
 * iteration, one matrix and one factorisation a step. With y = (x, v) of the free nodes, y' = f(t, y), J =
 * df/dy and f_t = df/dt at the start of the step, stage i solves
 *     (1/(gamma h) - J) u_i = f(t0 + alpha_i h, y0 + sum a_ij u_j) + sum c_ij/h u_j + gamma_i h f_t
 * and y1 = y0 + sum m_i u_i, with the error estimate sum e_i u_i. Hairer & Wanner 1996, IV.7, (7.25).
 *
 * Here f = (v, -M^-1 g(x, v, t)) and u = (ux, uv). With w = 1/(gamma h), rx and M rv the two halves of the
 * right-hand side, the first half of the rows is uv = w ux - rx, and what remains is
 *     (w^2 M + w D + K) ux = M rv + (w M + D) rx,  K = dg/dx, D = dg/dv:
 * the matrix of a backward Euler step of size gamma h, as in ida. It is exact, so where friction or dashpots
 * make it nonsymmetric it is factored by LU. f_t is the change of the forces by what moves by itself: pins,
 * colliders, wind. It is taken by differences of second order.
 *
 * The method is stiffly accurate and L-stable. Contact is part of f: a stage that passes through something,
 * or comes too near, ends the attempt, and the next one is half as long.
 */
#include "integrators/rosenbrock.h"

#include "base/finite.h"
#include "base/reason.h"
#include "integrators/implicit.h"
#include "integrators/instant.h"
#include "integrators/local_error.h"

#include <math.h>
#include <string.h>

enum { PARAM_LINEAR_SOLVER = DRAPE_LOCAL_ERROR_PARAM_COUNT, PARAM_COUNT };

/* Of the step: the interval of the differences for f_t. Their truncation error is its square times the third
 * derivative, their rounding error 1e-16 over it: 1e-8 and 1e-12 of what the term adds. */
#define DIFFERENCE 1e-4
/* Of the stages, which are short beside positions: the step along them for the derivative of the power. */
#define ALONG 1e-6

#define DRIVERS DRAPE_BY_HOST /* pins and colliders, which come first */

/* RODAS of order 4 with an embedded solution of order 3, Hairer & Wanner 1996, VI.4. Of order 3, RODAS3
 * (Sandu et al. 1997) and ROS34PW2 (Rang & Angermann 2005) took about as long for an error of 1e-3 of the
 * size of a sheet, and 1.2 to 2 times as long for 1e-4 and less. */
const drape_rosenbrock_scheme drape_rosenbrock_rodas = {
    .stages = 6,
    .order = 4,
    .gamma = 0.25,
    .a = {{0},
          {1.544},
          {0.9466785280815826, 0.2557011698983284},
          {3.314825187068521, 2.896124015972201, 0.9986419139977817},
          {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
          {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1}},
    .c = {{0},
          {-5.6688},
          {-2.430093356833875, -0.2063599157091915},
          {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
          {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
          {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}},
    .m = {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1, 1},
    .e = {0, 0, 0, 0, 0, 1},
    .b = {0.34844427128605154, 0.2130136219118987, -0.15410253266231846, 0.4713207793914958,
          -0.12867613992712837, 0.25},
    .d2 = {10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662},
    .d3 = {-0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872},
    .alpha = {0, 0.386, 0.21, 0.63, 1, 1},
    .gammas = {0.25, -0.1043, 0.1035, -0.0362, 0, 0}};

static const drape_param params[PARAM_COUNT] = {
    DRAPE_LOCAL_ERROR_PARAMS,
    [PARAM_LINEAR_SOLVER] = DRAPE_CHOICE("linear_solver", 0, drape_linears_names, "name of a linear solver",
                                         .aliases = drape_linears_aliases),
};

typedef struct rosenbrock_state {
    drape_implicit common; /* its equation is not solved; its arrays, and the account of work, are used */
    drape_local_error control;
    drape_system_matrix *linear;                                       /* and D; NULL without free nodes */
    double *ux[DRAPE_ROSENBROCK_STAGES], *uv[DRAPE_ROSENBROCK_STAGES]; /* free DOFs */
    double *g0;                                                        /* nodes: at the start of the step */
    double *change;                                                    /* free DOFs: g_t [N/s] */
    double *rx, *right;                                                /* free DOFs: of the present stage */
    bool moved;                                                        /* g depends on t */
    double start_power[DRIVERS];                                       /* [W] P at the start of the step */
    double power[DRIVERS]; /* [W] sum b_i P_i of the stages so far */
} rosenbrock_state;

/* ---- Work ----
 *
 * That of pins and colliders: as if the work z were another component of y, z' = P(t, y), with the power P of
 * what moves them. Its stages are those of the rest, with P' in place of J, which sums up to
 *     z1 = z0 + h (sum b_i P_i + P'(y0) sum b_i u_i + h P_t sum b_i gamma_i),
 * so only one derivative along one direction is needed. Sums of powers at the ends of a step would count the
 * force of a dashpot at a jump of a pin's velocity for a large part of the step. */

/* Adds P where the forces g were evaluated last, times a factor. */
static void add_power(const rosenbrock_state *s, const double *g, double factor, double *to)
{
    drape_instant_driving(s->common.equation.system, &s->common.equation.point, g, factor, to);
}

/* ---- Forces ---- */

/* Pins at time t, in x and v of the equation. */
static void place_pins(const rosenbrock_state *s, double t)
{
    const drape_step_equation *e = &s->common.equation;
    drape_instant_place_pins(s->common.motion, t, e->point.span, e->x, e->v);
}

/* g at x, v of the equation and time t. */
static drape_status evaluate(rosenbrock_state *s, double t, double *g, drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    const double start = drape_system_clock(e->system);
    e->point.t = t;
    drape_system_force(e->system, &e->point, g);
    e->work.residuals++;
    e->work.residual_seconds += drape_system_clock(e->system) - start;
    if (drape_system_status(e->system))
        return drape_system_status(e->system);
    if (drape_all_finite(g, e->nodes))
        return DRAPE_OK;
    info->reason = DRAPE_REASON_NONFINITE;
    drape_instant_diagnose(e->system, e->x, e->point.internal, g, s->right, info);
    return DRAPE_RETRY_NONFINITE;
}

/* The start of the step, at which forces are smooth up to `stop`. */
static drape_status evaluate_start(rosenbrock_state *s, const drape_state *in, double stop,
                                   drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    e->point.internal = in->internal;
    e->point.history = NULL;
    e->point.span[0] = in->t;
    e->point.span[1] = stop;
    e->point.instant = true;
    memcpy(e->x, in->x, e->nodes * sizeof *e->x);
    memset(e->v, 0, e->nodes * sizeof *e->v);
    for (size_t i = 0; i < e->dofs; i++)
        e->v[drape_step_equation_at(e, i)] = in->v[drape_step_equation_at(e, i)];
    place_pins(s, in->t);
    memset(s->start_power, 0, sizeof s->start_power);
    const drape_status status = evaluate(s, in->t, s->g0, info);
    if (!status)
        add_power(s, s->g0, 1, s->start_power);
    return status;
}

/* g_t = (-3 g(t) + 4 g(t + d) - g(t + 2 d))/(2 d), with the free nodes as they are. */
static drape_status evaluate_change(rosenbrock_state *s, double t, double h, drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    const double d = DIFFERENCE * h;
    for (size_t i = 0; i < e->dofs; i++)
        s->change[i] = -3 * s->g0[drape_step_equation_at(e, i)];
    for (int k = 1; k <= 2; k++) {
        place_pins(s, t + k * d);
        drape_status status = evaluate(s, t + k * d, e->g, info);
        if (status)
            return status;
        for (size_t i = 0; i < e->dofs; i++)
            s->change[i] += (k == 1 ? 4 : -1) * e->g[drape_step_equation_at(e, i)];
    }
    for (size_t i = 0; i < e->dofs; i++)
        s->change[i] /= 2 * d;
    place_pins(s, t);
    e->point.t = t;
    return DRAPE_OK;
}

/* ---- The matrix ---- */

/* Assembles and factors w^2 M + w D + K at the start of the step. */
static drape_status factor(rosenbrock_state *s, double w, drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    drape_system_matrix *m = s->linear;
    const double start = drape_system_matrix_clock(m);
    e->point.weight = w;
    e->point.contact = DRAPE_CONTACT_EXACT;
    drape_status status = drape_system_matrix_follow(m, &e->point);
    if (status)
        return status;
    drape_system_jacobian(e->system, &e->point, w * w, 0, m->values);
    if (m->more[0])
        drape_system_damping(e->system, &e->point, m->more[0]);
    e->work.jacobians++;
    e->work.jacobian_seconds += drape_system_matrix_clock(m) - start;
    info->reason = DRAPE_REASON_SINGULAR;
    return drape_system_matrix_factor(m, false);
}

/* ---- Stages ---- */

/* x, v of the equation, and pins, at a sum of stages. */
static void move_to(rosenbrock_state *s, const drape_state *in, const double *weights, int stages, double t)
{
    drape_step_equation *e = &s->common.equation;
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        double dx = 0, dv = 0;
        for (int j = 0; j < stages; j++) {
            dx += weights[j] * s->ux[j][i];
            dv += weights[j] * s->uv[j][i];
        }
        e->x[at] = in->x[at] + dx;
        e->v[at] = in->v[at] + dv;
    }
    place_pins(s, t);
}

/* The forces of a stage, in *g: those of the start of the step in a stage that is evaluated there. */
static drape_status stage_forces(rosenbrock_state *s, const drape_state *in, double h, int i,
                                 const double **g, drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    const drape_rosenbrock_scheme *scheme = &drape_rosenbrock_rodas;
    const double t = in->t + scheme->alpha[i] * h;
    move_to(s, in, scheme->a[i], i, t);
    *g = scheme->alpha[i] == 0 ? s->g0 : e->g;
    if (*g == s->g0) {
        for (int k = 0; k < DRIVERS; k++)
            s->power[k] += scheme->b[i] * s->start_power[k];
        return DRAPE_OK;
    }
    if (drape_system_crosses(e->system, e->x, t, &info->reason, &info->diagnostic))
        return DRAPE_RETRY_REJECTED;
    const drape_status status = evaluate(s, t, e->g, info);
    if (!status)
        add_power(s, e->g, scheme->b[i], s->power);
    return status;
}

static drape_status solve_stage(rosenbrock_state *s, const drape_state *in, double h, int i,
                                drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    const drape_rosenbrock_scheme *scheme = &drape_rosenbrock_rodas;
    const double w = 1 / (scheme->gamma * h), *g = NULL;
    drape_status status = stage_forces(s, in, h, i, &g, info);
    if (status)
        return status;
    for (size_t k = 0; k < e->dofs; k++) {
        const size_t at = drape_step_equation_at(e, k);
        const double mass = e->model->mass[at / 3];
        double cx = 0, cv = 0;
        for (int j = 0; j < i; j++) {
            cx += scheme->c[i][j] * s->ux[j][k];
            cv += scheme->c[i][j] * s->uv[j][k];
        }
        s->rx[k] = e->v[at] + cx / h;
        s->right[k] = mass * (cv / h + w * s->rx[k]) - g[at];
        if (s->moved)
            s->right[k] -= scheme->gammas[i] * h * s->change[k];
    }
    const drape_pattern *p = drape_system_pattern(e->system);
    const double *damping = s->linear->more[0];
    for (int64_t j = 0; damping && j < p->n; j++)
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            s->right[drape_pattern_row(p, j, k)] += damping[k] * s->rx[j];
    info->reason = DRAPE_REASON_SINGULAR;
    status = drape_system_matrix_solve(s->linear, s->right, s->ux[i]);
    for (size_t k = 0; k < e->dofs; k++)
        s->uv[i][k] = w * s->ux[i][k] - s->rx[k];
    return status;
}

/* The estimate, into rx and right. */
static void estimate(rosenbrock_state *s)
{
    for (size_t k = 0; k < s->common.equation.dofs; k++) {
        s->rx[k] = s->right[k] = 0;
        for (int j = 0; j < drape_rosenbrock_rodas.stages; j++) {
            s->rx[k] += drape_rosenbrock_rodas.e[j] * s->ux[j][k];
            s->right[k] += drape_rosenbrock_rodas.e[j] * s->uv[j][k];
        }
    }
}

/* Adds what is dissipated in a step of size h, by the midpoint rule on its halves, which does not see the
 * short force of a dashpot at a jump of a pin's velocity. The middle is that of the interpolation of order 3
 * that belongs to the method,
 *     y(s) = (1 - s) y0 + s (y1 + (1 - s) (sum d2_i u_i + s sum d3_i u_i)):
 * a cubic through the velocities at both ends would have nodes swing about a jump. */
static void add_dissipated(rosenbrock_state *s, const drape_state *in, const drape_state *out, double h,
                           drape_step_info *info)
{
    const drape_step_equation *e = &s->common.equation;
    double *middle = e->probe;
    if (!s->common.dissipated)
        return;
    memcpy(middle, in->x, e->nodes * sizeof *middle);
    drape_motion_place_pins(s->common.motion, in->t + h / 2, middle);
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        double bend = 0;
        for (int j = 0; j < drape_rosenbrock_rodas.stages; j++)
            bend += (drape_rosenbrock_rodas.d2[j] + drape_rosenbrock_rodas.d3[j] / 2) * s->ux[j][i];
        middle[at] = (in->x[at] + out->x[at] + bend / 2) / 2;
    }
    drape_implicit_audit_dissipation(&s->common, in->x, middle, in->t, h / 2, info);
    drape_implicit_audit_dissipation(&s->common, middle, out->x, in->t + h / 2, h / 2, info);
}

/* Adds the work of pins and colliders; where all nodes are pinned there are no stages, and it is that of the
 * midpoint rule. */
static drape_status add_moved(rosenbrock_state *s, const drape_state *in, double h, drape_step_info *info)
{
    const drape_rosenbrock_scheme *scheme = &drape_rosenbrock_rodas;
    const bool alone = s->common.equation.dofs == 0;
    double weights[DRAPE_ROSENBROCK_STAGES] = {0}, ahead = alone ? h / 2 : 0;
    if (!drape_system_is_driven(s->common.equation.system))
        return DRAPE_OK;
    for (int i = 0; i < scheme->stages && !alone; i++) {
        weights[i] = ALONG * scheme->b[i];
        ahead += weights[i] * scheme->gammas[i] * h;
    }
    move_to(s, in, weights, alone ? 0 : scheme->stages, in->t + ahead);
    const drape_status status = evaluate(s, in->t + ahead, s->common.equation.g, info);
    double powers[DRIVERS] = {0}, *work = drape_system_work(s->common.equation.system);
    if (!status)
        add_power(s, s->common.equation.g, 1, powers);
    for (int k = 0; k < DRIVERS && !status; k++)
        work[k] += h * (alone ? powers[k] : s->power[k] + (powers[k] - s->start_power[k]) / ALONG);
    return status;
}

/* ---- A step ---- */

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    rosenbrock_state *s = state;
    drape_step_equation *e = &s->common.equation;
    drape_local_attempt attempt = {
        .stop = drape_local_error_stop(&s->control, in, out->t), .end = out->t, .bound = h};
    info->tolerance = info->residual = NAN; /* errors are bounded, not residuals */
    drape_status status = evaluate_start(s, in, attempt.stop, info);
    if (!status)
        status = drape_local_error_begin(&s->control, in, s->g0, &attempt, info);
    memset(s->power, 0, sizeof s->power);
    if (!status && e->dofs > 0) {
        /* What the forces depend on besides the state of the free nodes. */
        const drape_motion *m = s->common.motion;
        s->moved = m->moved_count > 0 || m->model->supports_move || drape_system_has_wind(e->system) ||
                   drape_system_is_timed(e->system);
        for (int32_t c = 0; !s->moved && c < m->model->collider_count; c++)
            s->moved = drape_motion_moves_collider(m, c);
        if (s->moved)
            status = evaluate_change(s, in->t, attempt.h, info);
        if (!status)
            status = factor(s, 1 / (drape_rosenbrock_rodas.gamma * attempt.h), info);
        for (int i = 0; !status && i < drape_rosenbrock_rodas.stages; i++)
            status = solve_stage(s, in, attempt.h, i, info);
    }
    if (status)
        return status;
    move_to(s, in, drape_rosenbrock_rodas.m, e->dofs > 0 ? drape_rosenbrock_rodas.stages : 0, attempt.t1);
    memcpy(out->x, e->x, e->nodes * sizeof *out->x);
    memcpy(out->v, e->v, e->nodes * sizeof *out->v);
    out->t = attempt.t1;
    estimate(s);
    status = drape_local_error_test(&s->control, &attempt, s->rx, s->right, info);
    if (!status)
        status = add_moved(s, in, attempt.h, info);
    if (!status)
        add_dissipated(s, in, out, attempt.h, info);
    return status;
}

static void restart(void *state, const drape_state *from)
{
    (void)from;
    drape_local_error_restart(&((rosenbrock_state *)state)->control);
}

/* ---- Creation and destruction ---- */

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    rosenbrock_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = drape_implicit_init(arena, system, &s->common);
    drape_local_error_init(system, values, drape_rosenbrock_rodas.order, &s->control);
    const drape_step_equation *e = &s->common.equation;
    for (int i = 0; i < drape_rosenbrock_rodas.stages; i++) {
        s->ux[i] = drape_arena_take(arena, e->dofs, sizeof *s->ux[i]);
        s->uv[i] = drape_arena_take(arena, e->dofs, sizeof *s->uv[i]);
    }
    s->g0 = drape_arena_take(arena, e->nodes, sizeof *s->g0);
    s->change = drape_arena_take(arena, e->dofs, sizeof *s->change);
    s->rx = drape_arena_take(arena, e->dofs, sizeof *s->rx);
    s->right = drape_arena_take(arena, e->dofs, sizeof *s->right);
    if (!status)
        status = drape_arena_status(arena);
    if (status || s->common.equation.dofs == 0)
        return status;
    return drape_system_matrix_create(
        arena, system,
        drape_linear_of(NULL, (int)values[PARAM_LINEAR_SOLVER], (int64_t)s->common.equation.dofs),
        s->common.dissipated != NULL, 0, &s->linear);
}

static void destroy(void **state)
{
    rosenbrock_state *s = *state;
    if (s)
        drape_system_matrix_destroy(&s->linear);
    *state = NULL;
}

/* ---- For the table ---- */

static drape_work work(const void *state)
{
    const rosenbrock_state *s = state;
    return drape_work_with_linear(s->common.equation.work, s->linear);
}

/* Each step has its own factors. */
static void archive(void *state, drape_archive *a)
{
    rosenbrock_state *s = state;
    drape_local_error_archive(&s->control, a);
    drape_work_archive(&s->common.equation.work, a);
    if (!s->linear)
        return;
    if (drape_archive_has_read(a))
        drape_archive_note(a, drape_system_matrix_renew(s->linear));
    drape_system_matrix_archive(s->linear, a, false);
}

static size_t bytes(const void *state)
{
    const rosenbrock_state *s = state;
    return drape_system_matrix_bytes(s->linear);
}

const drape_integrator_ops drape_integrator_rosenbrock = {
    .entry = {.name = "rosenbrock",
              .summary = "linearly implicit Runge-Kutta with local error control: one matrix a step, no "
                         "Newton; L-stable",
              .reference = "Hairer & Wanner 1996, Solving Ordinary Differential Equations II, IV.7 and VI.4",
              DRAPE_PARAMS(params)},
    .order = 4,
    .create = create,
    .own_steps = true,
    .gain = DRAPE_LOCAL_ERROR_GAIN,
    .step = step,
    .restart = restart,
    .work = work,
    .archive = archive,
    .bytes = bytes,
    .destroy = destroy,
};
