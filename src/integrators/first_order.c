/* first_order.c: see first_order.h. The callbacks of a solver follow in the order in which it calls them,
 * then the stages of a step around it. */
#include "integrators/first_order.h"

#include "base/finite.h"
#include "base/reason.h"
#include "integrators/instant.h"
#include "solvers/vector.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { MATRIX_AUTO, MATRIX_SYMMETRIC, MATRIX_EXACT };

#define MAX_EXACT_SPAN 64 /* maximum number of exact matrices in a row if symmetric ones keep failing */
/* Fraction of the time: steps whose sum ends this near to the end of an advance end there. What is left is
 * the sum's rounding error, which the schedule does not step over. */
#define LANDED (1e3 * DBL_EPSILON)
/* Relative residual of iterative linear solvers. IDA allows them 0.05 of the bound of the Newton iteration,
 * here 0.1 of the error tolerance. With this, corrections of up to 50 tolerances are within that; a larger
 * one does not end the iteration. */
#define LINEAR_TOLERANCE DRAPE_LINEAR_TIGHT
/* Times that a prediction is shortened: nodes of a pair that are shortened by different fractions may meet on
 * other paths. */
#define MAX_RETREATS 4
/* Large steps of a stiff sheet, which the error would allow, need several new matrices in each stage; more
 * steps of half the size need fewer. Above one matrix a stage steps shrink by EFFORT_SHRINK, above half of
 * one they do not grow. At a tolerance of 1e-2 this saves a quarter to half of the time. Where contact is as
 * costly in steps of any size, they stay above EFFORT_LEAST of what the error allows. */
#define EFFORT        1.0
#define EFFORT_SHRINK 0.7
#define EFFORT_LEAST  0.06

const char *const drape_first_order_matrices[] = {
    [MATRIX_AUTO] = "auto", [MATRIX_SYMMETRIC] = "symmetric", [MATRIX_EXACT] = "exact", NULL};
/* ---- Between vectors and nodes ---- */

/* s->x, s->v at time t. */
static drape_point point_at(const drape_first_order *s, double t)
{
    return (drape_point){.x = s->x,
                         .v = s->v,
                         .internal = s->internal,
                         .t = t,
                         .span = {s->span[0], s->span[1]},
                         .instant = true};
}

static drape_point place(drape_first_order *s, double t, const double *y)
{
    drape_instant_place_pins(s->motion, t, s->span, s->x, s->v);
    for (int64_t i = 0; i < s->n; i++) {
        s->x[drape_first_order_at(s, i)] = y[i];
        s->v[drape_first_order_at(s, i)] = y[s->n + i];
    }
    if (s->ranks)
        s->ranks->fetch(s->ranks, (double *[]){s->x, s->v}, 2);
    return point_at(s, t);
}

/* ---- Residual ---- */

void drape_first_order_force(drape_first_order *s, double t, const double *y)
{
    const drape_point point = place(s, t, y);
    s->t = t;
    drape_system_force(s->system, &point, s->g);
}

/* The path of the prediction begins where moving pins and colliders have put the nodes at its time. */
bool drape_first_order_retreat(void *user, N_Vector y)
{
    drape_first_order *s = user;
    double *from = s->g, *correction = N_VGetArrayPointer(y);
    if (!s->crossing)
        return false;
    memcpy(from, s->before, 3 * (size_t)s->model->node_count * sizeof *from);
    drape_motion_place_pins(s->motion, s->t, from);
    drape_system_sweep(s->system, s->t, from);
    for (int pass = 0; pass < MAX_RETREATS; pass++) {
        if (drape_system_step_fraction(s->system, from, s->x, s->t, pass > 0, s->fraction) == 1)
            return true;
        for (int64_t i = 0; i < s->n; i++) {
            const size_t at = drape_first_order_at(s, i);
            const double back = (s->fraction[at / 3] - 1) * (s->x[at] - from[at]);
            correction[i] += back;
            s->x[at] += back;
        }
        drape_ranks_fetch(s->ranks, s->x);
    }
    return true;
}

int drape_first_order_judge(drape_first_order *s, double t, const double *out, double start)
{
    s->nonfinite = !drape_system_agree_finite(s->system, out, 2 * (size_t)s->n);
    s->crossing =
        !s->nonfinite && drape_system_crosses(s->system, s->x, t, &s->crossing_reason, &s->crossing_pair);
    s->crossed |= s->crossing;
    s->work.residuals++;
    s->work.residual_seconds += drape_system_clock(s->system) - start;
    return drape_system_status(s->system) ? -1 : s->nonfinite || s->crossing ? 1 : 0;
}

double drape_first_order_limit(const drape_first_order *s, int stages, int due, double growth)
{
    const double effort = (double)(s->linear->factorizations - s->matrices - due) / stages;
    if (effort > EFFORT)
        return fmax(EFFORT_LEAST * growth, fmin(growth, EFFORT_SHRINK));
    return effort > EFFORT / 2 ? fmin(growth, 1) : growth;
}

int drape_first_order_rhs(sunrealtype t, N_Vector y, N_Vector rate, void *user)
{
    drape_first_order *s = user;
    const double start = drape_system_clock(s->system), *v = N_VGetArrayPointer(y) + s->n;
    double *out = N_VGetArrayPointer(rate);
    drape_first_order_force(s, t, N_VGetArrayPointer(y));
    for (int64_t i = 0; i < s->n; i++) {
        out[i] = v[i];
        out[s->n + i] = -s->g[drape_first_order_at(s, i)] / s->mass[i];
    }
    return drape_first_order_judge(s, t, out, start);
}

double drape_first_order_norm(const drape_first_order *s, N_Vector vector)
{
    const double *a = N_VGetArrayPointer(vector), *w = N_VGetArrayPointer(s->weights);
    double sum = 0;
    for (int64_t i = 0; i < 2 * s->n; i++)
        sum += a[i] / w[i] * (a[i] / w[i]);
    return sqrt(drape_ranks_sum(s->ranks, sum) / (6 * (double)drape_model_all_free(s->model)));
}

/* ---- Jacobian ---- */

/* D (nonzeros); NULL if nothing dissipates. */
static double *damping_of(const drape_first_order *s)
{
    return s->linear->more[0];
}

/* Whether the next matrix is the symmetric part. If the iteration failed with a new symmetric matrix, exact
 * ones are used for a while: twice as many as the last time, or half as many after each symmetric one that
 * converged. */
static bool choose_symmetric(drape_first_order *s)
{
    const bool failed = s->symmetric && s->newton.failed;
    if (s->values[DRAPE_FIRST_ORDER_MATRIX] != MATRIX_AUTO)
        return s->values[DRAPE_FIRST_ORDER_MATRIX] == MATRIX_SYMMETRIC;
    if (failed)
        s->exact_remaining = s->exact_span =
            s->exact_span < MAX_EXACT_SPAN ? 2 * s->exact_span : MAX_EXACT_SPAN;
    else if (s->exact_remaining > 0)
        s->exact_remaining--;
    else if (s->exact_span > 1)
        s->exact_span /= 2;
    return s->exact_remaining == 0;
}

int drape_first_order_jacobian(drape_first_order *s, double t, double cj, const double *y)
{
    const double start = drape_system_matrix_clock(s->linear);
    drape_point point = place(s, t, y);
    point.weight = cj;
    point.contact = s->newton.bounds ? DRAPE_CONTACT_GAUSS_NEWTON : DRAPE_CONTACT_EXACT;
    s->failure = drape_system_matrix_follow(s->linear, &point);
    if (s->failure) {
        s->factored_cj = 0;
        return -1;
    }
    drape_system_jacobian(s->system, &point, cj * cj, 0, s->linear->values);
    if (!s->newton.bounds)
        s->symmetric = choose_symmetric(s);
    if (s->newton.bounds || s->symmetric)
        drape_pattern_symmetrize(drape_system_pattern(s->system), s->linear->values);
    if (damping_of(s))
        drape_system_damping(s->system, &point, damping_of(s));
    s->factored_cj = cj;
    drape_sun_newton_forget(&s->newton);
    s->work.jacobians++;
    s->work.jacobian_seconds += drape_system_matrix_clock(s->linear) - start;
    return 0;
}

/* ---- Factor and solve ---- */

/* reduced += D r */
static void add_damping(const drape_first_order *s, const double *r)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    const double *damping = damping_of(s);
    const size_t own = (size_t)s->n * sizeof *r;
    if (!damping)
        return;
    const double *from = s->ranks ? s->with_copies[0] : r;
    double *to = s->ranks ? s->with_copies[1] : s->reduced;
    if (s->ranks) {
        memcpy(s->with_copies[0], r, own);
        s->ranks->fetch_blocks(s->ranks, s->with_copies[0]);
        memcpy(to, s->reduced, own);
    }
    for (int64_t j = 0; j < p->n; j++)
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            to[drape_pattern_row(p, j, k)] += damping[k] * from[j];
    if (s->ranks)
        memcpy(s->reduced, to, own);
}

static int factor(SUNLinearSolver solver, SUNMatrix matrix)
{
    (void)matrix;
    const drape_first_order *s = solver->content;
    return drape_system_matrix_factor(s->linear, false);
}

/* With r2 + c_j M r1 in `reduced`. r1 and dv may be the same. */
static int solve_reduced(drape_first_order *s, const double *r1, double *dx, double *dv)
{
    add_damping(s, r1);
    drape_status status = drape_system_matrix_solve(s->linear, s->reduced, dx);
    for (int64_t i = 0; i < s->n; i++)
        dv[i] = s->factored_cj * dx[i] - r1[i];
    return status;
}

int drape_first_order_solve(SUNLinearSolver solver, SUNMatrix matrix, N_Vector out, N_Vector in,
                            sunrealtype tolerance)
{
    (void)matrix, (void)tolerance;
    drape_first_order *s = solver->content;
    const double *r1 = N_VGetArrayPointer(in), *r2 = r1 + s->n;
    double *dx = N_VGetArrayPointer(out), *dv = dx + s->n;
    for (int64_t i = 0; i < s->n; i++)
        s->reduced[i] = r2[i] + s->factored_cj * s->mass[i] * r1[i];
    return solve_reduced(s, r1, dx, dv);
}

/* r1 = c_j b1, r2 = c_j M b2 */
int drape_first_order_solve_rhs(SUNLinearSolver solver, SUNMatrix matrix, N_Vector out, N_Vector in,
                                sunrealtype tolerance)
{
    (void)matrix, (void)tolerance;
    drape_first_order *s = solver->content;
    const double *b1 = N_VGetArrayPointer(in), *b2 = b1 + s->n, cj = s->factored_cj;
    double *dx = N_VGetArrayPointer(out), *dv = dx + s->n;
    for (int64_t i = 0; i < s->n; i++) {
        dv[i] = cj * b1[i];
        s->reduced[i] = cj * s->mass[i] * (b2[i] + dv[i]);
    }
    return solve_reduced(s, dv, dx, dv);
}

/* ---- Work of dissipation, pins and colliders ---- */

/* Powers at the state in s->x, s->v at time t. */
static void measure_powers(drape_first_order *s, double t, double *powers)
{
    const drape_point point = point_at(s, t);
    const size_t works = drape_system_work_count(s->system);
    drape_system_begin_work(s->system);
    powers[works] = s->dissipated ? drape_instant_dissipation(s->system, &point, 1, s->dissipated) : 0;
    memcpy(powers, drape_system_work(s->system), works * sizeof *powers);
    if (drape_system_is_driven(s->system)) {
        drape_system_force(s->system, &point, s->g);
        drape_instant_driving(s->system, &point, s->g, 1, powers);
    }
    if (s->ranks)
        s->ranks->sum(s->ranks, powers, DRAPE_BY_TERMS);
}

/* ---- A step ---- */

/* After a failure, reports the degenerate element or the node whose force is not finite; otherwise the node
 * with the largest weighted error. */
static void diagnose(drape_first_order *s, drape_step_info *info)
{
    if (s->n == 0)
        return;
    if (s->nonfinite) {
        drape_instant_diagnose(s->system, s->x, s->internal, s->g, s->reduced, info);
        return;
    }
    if (s->crossing) {
        info->diagnostic = s->crossing_pair;
        return;
    }
    if (s->solver->errors(s, s->between))
        return;
    const double *e = N_VGetArrayPointer(s->between), *w = N_VGetArrayPointer(s->weights);
    for (int64_t i = 0; i < s->n; i++)
        s->reduced[i] = fmax(fabs(e[i]) / w[i], fabs(e[s->n + i]) / w[s->n + i]);
    info->diagnostic = drape_system_diagnose_dof(s->system, s->reduced, "local error / tolerance", 1);
}

/* Restarts with a first step of at most h, or of a size that the solver chooses, for 0. Consistent initial
 * values need no solve: x' = v, v' = -M^-1 g. */
static drape_status start(drape_first_order *s, const drape_state *in, double h, drape_step_info *info)
{
    double *y = N_VGetArrayPointer(s->y), *rate = N_VGetArrayPointer(s->rate);
    for (int64_t i = 0; i < s->n; i++) {
        y[i] = in->x[drape_first_order_at(s, i)];
        y[s->n + i] = rate[i] = in->v[drape_first_order_at(s, i)];
    }
    drape_point point = place(s, in->t, y);
    drape_system_force(s->system, &point, s->g);
    s->work.residuals++;
    for (int64_t i = 0; i < s->n; i++)
        rate[s->n + i] = -s->g[drape_first_order_at(s, i)] / s->mass[i];
    s->counted = 0;
    info->reason = DRAPE_REASON_NONFINITE;
    if (!drape_ranks_all(
            s->ranks,
            drape_all_finite(rate + s->n, (size_t)s->n))) /* the solver would cut its step ten times for it */
        return DRAPE_RETRY_NONFINITE;
    info->reason = DRAPE_REASON_SOLVER;
    return s->solver->begin(s, in->t, h) ? DRAPE_OK : DRAPE_E_SOLVER;
}

/* Continues from `in` if that is the solver's state; otherwise restarts, with a first step of at most h
 * if the attempt before was rejected. *t: the next kink or the end, whichever comes first; a scene
 * without free nodes advances to there. Pinned nodes that do not move keep their positions, and zero
 * velocity, in s->x and s->v for the whole step. */
static drape_status prepare(drape_first_order *s, const drape_state *in, double end, double h, double *t,
                            drape_step_info *info)
{
    const size_t nodes = 3 * (size_t)s->model->node_count;
    double stop = drape_motion_next_kink(s->motion, in->t, end);
    memcpy(s->x, in->x, nodes * sizeof *s->x);
    memcpy(s->v, in->v, nodes * sizeof *s->v);
    s->before = in->x;
    s->internal = in->internal;
    s->span[0] = in->t;
    s->span[1] = stop;
    *t = h < end - in->t ? fmin(stop, in->t + h) : stop;
    if (s->n == 0) {
        const double most = s->values[DRAPE_FIRST_ORDER_MAX_STEP];
        *t = fmin(*t, in->t + (isnan(most) ? s->model->duration / DRAPE_STEPS_WITHOUT_UNKNOWNS : most));
        drape_instant_place_pins(s->motion, in->t, s->span, s->x, s->v);
        measure_powers(s, in->t, s->powers[0]);
        return DRAPE_OK;
    }
    if (s->reached != in->t || drape_motion_at_kink(s->motion, in->t)) {
        drape_status status = start(s, in, h < end - in->t ? h : 0, info);
        if (status)
            return status;
        measure_powers(s, in->t, s->powers[0]);
    }
    return DRAPE_OK;
}

/* Makes one step of the solver, at most to `end`; *t: the time that it reached. */
static drape_status solve(drape_first_order *s, double end, double h, double *t, drape_step_info *info)
{
    long iterations = 0;
    s->crossing = s->crossed = s->nonfinite = false;
    s->failure = DRAPE_OK;
    s->matrices = s->linear->factorizations;
    drape_reason reason = s->solver->step(s, end, t);
    if (reason == DRAPE_REASON_NEWTON && s->nonfinite)
        reason = DRAPE_REASON_NONFINITE;
    drape_status status = drape_solver_status(reason);
    info->reason = reason;
    if (status > 0 && s->crossing)
        info->reason = s->crossing_reason;
    if (drape_system_agree(s->system))
        status = drape_system_status(s->system);
    if (s->failure < 0 || s->linear->status < 0)
        status = s->failure < 0 ? s->failure : s->linear->status;
    s->solver->iterations(s->memory, &iterations);
    info->iterations = (int)(iterations - s->counted);
    s->work.newton_iterations += iterations - s->counted;
    s->counted = iterations;
    if (status)
        s->solver->current_step(s->memory, &info->h);
    /* That may belong to an earlier attempt: half of that would not be a smaller step. */
    info->h = fmin(info->h, h);
    return status;
}

drape_status drape_first_order_step(void *state, const drape_state *in, drape_state *out, double h,
                                    drape_step_info *info)
{
    drape_first_order *s = state;
    const size_t nodes = 3 * (size_t)s->model->node_count;
    double end = out->t, t = end;
    info->tolerance = info->residual = NAN; /* it bounds errors, not residuals */
    if (drape_steps_exhausted(in->t, s->values[DRAPE_FIRST_ORDER_MAX_STEPS], true, &s->second, &s->steps)) {
        info->reason = DRAPE_REASON_MAX_STEPS;
        if (s->n > 0)
            s->solver->last_step(s->memory, &info->h);
        diagnose(s, info);
        return DRAPE_E_STEP_TOO_SMALL;
    }
    /* The sim rejected the last step, which the solver had accepted: mostly because of its energy. */
    if (in->t == s->from)
        s->newton.strict = true;
    s->from = NAN;
    info->reason = DRAPE_REASON_SOLVER;
    drape_status status = prepare(s, in, end, h, &t, info);
    if (!status && s->n > 0)
        status = solve(s, end, h, &t, info);
    /* A run ends whose steps have become so small that it no longer moves, as where nothing can yield. */
    if (!status && !drape_step_moves(t - in->t, s->size, s->speed, t == s->span[1] || t == end, &s->tiny)) {
        info->h = t - in->t;
        s->crossing = s->crossed;
        info->reason = s->crossing ? s->crossing_reason : DRAPE_REASON_ERROR_TEST;
        status = DRAPE_E_STEP_TOO_SMALL;
    }
    if (end - t <= LANDED * fabs(end))
        t = end;
    s->reached = NAN;
    if (status) {
        diagnose(s, info);
        return status;
    }
    place(s, t, s->n > 0 ? N_VGetArrayPointer(s->y) : NULL);
    memcpy(out->x, s->x, nodes * sizeof *out->x);
    memcpy(out->v, s->v, nodes * sizeof *out->v);
    out->t = t;
    info->h = t - in->t;
    info->reason = DRAPE_REASON_CONVERGED;
    /* The work, by the trapezoidal rule. */
    double *before = s->powers[0], *after = s->powers[1];
    const size_t works = drape_system_work_count(s->system);
    measure_powers(s, out->t, after);
    for (size_t i = 0; i < works; i++)
        drape_system_work(s->system)[i] = 0.5 * (out->t - in->t) * (before[i] + after[i]);
    info->dissipated = 0.5 * (out->t - in->t) * (before[works] + after[works]);
    s->powers[0] = after;
    s->powers[1] = before;
    status = drape_system_agree(s->system);
    if (status)
        return status;
    s->from = in->t;
    s->reached = t;
    s->steps -= t == end;
    return DRAPE_OK;
}

void drape_first_order_interpolate(void *state, double t, double *x)
{
    drape_first_order *s = state;
    drape_motion_place_pins(s->motion, t, x);
    if (s->n == 0 || s->solver->dense(s, t, s->between))
        return;
    const double *y = N_VGetArrayPointer(s->between);
    for (int64_t i = 0; i < s->n; i++)
        x[drape_first_order_at(s, i)] = y[i];
    drape_ranks_fetch(s->ranks, x);
}

void drape_first_order_interpolate_velocities(void *state, double t, double *v)
{
    drape_first_order *s = state;
    if (s->n == 0 || s->solver->dense(s, t, s->between))
        return;
    const double *y = N_VGetArrayPointer(s->between);
    for (int64_t i = 0; i < s->n; i++)
        v[drape_first_order_at(s, i)] = y[s->n + i];
    drape_ranks_fetch(s->ranks, v);
}

void drape_first_order_restart(void *state, const drape_state *from)
{
    (void)from;
    drape_first_order *s = state;
    s->reached = s->from = NAN;
    s->newton.strict = s->newton.failed = s->symmetric = false;
    s->exact_remaining = 0;
    s->exact_span = 1;
    drape_sun_newton_forget(&s->newton);
}

/* ---- Creation and destruction ---- */

static drape_status create_vectors(drape_first_order *s)
{
    s->y = drape_vector_new(s->ranks, 2 * s->n, s->sun);
    s->rate = drape_vector_new(s->ranks, 2 * s->n, s->sun);
    s->weights = drape_vector_new(s->ranks, 2 * s->n, s->sun);
    s->between = drape_vector_new(s->ranks, 2 * s->n, s->sun);
    if (!s->y || !s->rate || !s->weights || !s->between)
        return drape_fail_memory(s->arena->ctx, 2 * (size_t)s->n * sizeof(double));
    N_VConst(0, s->y);
    N_VConst(0, s->rate);
    return DRAPE_OK;
}

drape_status drape_first_order_create(const drape_first_order_solver *solver, drape_arena *arena,
                                      drape_system *system, const double *values, void **state)
{
    drape_context *ctx = arena->ctx;
    drape_first_order *s = *state = drape_arena_take(arena, 1, solver->state_size);
    if (drape_ranks_agree_memory(drape_model_ranks(drape_system_model(system)), ctx, s))
        return DRAPE_E_MEMORY;
    s->solver = solver;
    s->arena = arena;
    s->system = system;
    s->model = drape_system_model(system);
    s->ranks = drape_model_ranks(s->model);
    s->motion = drape_system_motion(system);
    s->exact_span = 1;
    s->reached = s->from = NAN;
    s->n = 3 * (int64_t)s->model->free_count;
    memcpy(s->values, values, (size_t)solver->param_count * sizeof *values);
    size_t nodes = 3 * (size_t)s->model->node_count;
    s->x = drape_arena_take(s->arena, nodes, sizeof *s->x);
    s->v = drape_arena_take(s->arena, nodes, sizeof *s->v);
    s->g = drape_arena_take(s->arena, nodes, sizeof *s->g);
    s->fraction = drape_arena_take(s->arena, nodes / 3, sizeof *s->fraction);
    s->reduced = drape_arena_take(s->arena, (size_t)s->n, sizeof *s->reduced);
    s->mass = drape_arena_take(s->arena, (size_t)s->n, sizeof *s->mass);
    for (int64_t i = 0; s->mass && i < s->n; i++)
        s->mass[i] = s->model->mass[s->model->node_of_free[i / 3]];
    for (int k = 0; s->ranks && k < 2; k++)
        s->with_copies[k] = drape_arena_take(s->arena, (size_t)s->model->block_count, 3 * sizeof(double));
    for (int k = 0; k < 2; k++)
        s->powers[k] = drape_arena_take(s->arena, drape_system_work_count(s->system) + 1, sizeof(double));
    if (s->model->has_dissipation)
        s->dissipated = drape_arena_take(s->arena, nodes, sizeof *s->dissipated);
    drape_reserve reserve = {.used = false};
    drape_status status = drape_arena_status(arena);
    if (!status)
        status = drape_reserve_open(&reserve, ctx, 2 * (size_t)s->n);
    if (!status)
        status = drape_sundials_context(ctx, &s->sun);
    status = drape_ranks_agree(s->ranks, ctx, status);
    if (!status && s->n > 0)
        status = create_vectors(s);
    status = drape_ranks_agree(s->ranks, ctx, status);
    if (!status && s->n > 0) {
        /* Derived defaults, and the weights that follow from them. */
        const double rtol = s->values[DRAPE_FIRST_ORDER_RTOL];
        drape_derive_tolerances(s->model, rtol, &s->values[DRAPE_FIRST_ORDER_ATOL_X],
                                &s->values[DRAPE_FIRST_ORDER_ATOL_V]);
        s->size = s->speed = NAN;
        drape_derive_tolerances(s->model, 1, &s->size, &s->speed);
        if (isnan(s->values[DRAPE_FIRST_ORDER_ORDER]))
            s->values[DRAPE_FIRST_ORDER_ORDER] =
                rtol >= DRAPE_FIRST_ORDER_TIGHT ? s->solver->loose_order : s->solver->tight_order;
        double *w = N_VGetArrayPointer(s->weights);
        for (int64_t i = 0; i < s->n; i++) {
            w[i] = s->values[DRAPE_FIRST_ORDER_ATOL_X];
            w[s->n + i] = s->values[DRAPE_FIRST_ORDER_ATOL_V];
        }
    }
    if (!status && s->n > 0)
        status = drape_system_matrix_create(
            arena, system, drape_linear_of(s->ranks, (int)values[DRAPE_FIRST_ORDER_LINEAR_SOLVER], s->n),
            s->model->has_dissipation, 0, &s->linear);
    if (!status && s->n > 0)
        status = drape_ranks_agree(
            s->ranks, ctx, drape_sun_shell_create(ctx, s->sun, s, factor, solver->correct, &s->shell));
    if (!status && s->n > 0) {
        s->linear->tolerance = LINEAR_TOLERANCE;
        bool created = drape_sun_newton_create(&s->newton, s->y, 2 * s->n, s->ranks, s->sun);
        created = drape_ranks_all(s->ranks, created) && solver->create(s);
        if (!created)
            status = drape_fail(ctx, DRAPE_E_MEMORY, "out of memory: %s cannot be set up for %lld unknowns",
                                solver->name, (long long)(2 * s->n));
    }
    return drape_reserve_close(&reserve, ctx, status);
}

void drape_first_order_destroy(void **state)
{
    drape_first_order *s = *state;
    if (!s)
        return;
    if (s->solver)
        s->solver->free(&s->memory);
    if (s->solver && s->solver->destroy_vectors)
        s->solver->destroy_vectors(s);
    drape_sun_newton_free(&s->newton);
    drape_sun_shell_destroy(&s->shell);
    drape_system_matrix_destroy(&s->linear);
    N_VDestroy(s->y);
    N_VDestroy(s->rate);
    N_VDestroy(s->weights);
    N_VDestroy(s->between);
    SUNContext_Free(&s->sun);
    *state = NULL;
}

/* ---- For the table ---- */

drape_work drape_first_order_work(const void *state)
{
    const drape_first_order *s = state;
    return drape_work_with_linear(s->work, s->linear);
}

/* Its factors are kept between steps, with c_j and D. */
static void archive_factors(drape_first_order *s, drape_archive *a)
{
    if (drape_archive_has_read(a))
        drape_archive_note(a, drape_system_matrix_renew(s->linear));
    drape_archive_double(a, &s->factored_cj);
    drape_archive_bool(a, &s->symmetric);
    drape_archive_int64(a, &s->exact_remaining);
    drape_archive_int64(a, &s->exact_span);
    if (a->reading && !(s->exact_span >= 1 && s->exact_span <= MAX_EXACT_SPAN && s->exact_remaining >= 0 &&
                        s->exact_remaining <= s->exact_span))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an impossible number of exact matrices");
    if (s->factored_cj != 0 && damping_of(s) && drape_archive_good(a))
        drape_archive_doubles(a, damping_of(s), (size_t)s->linear->pattern->nonzeros);
    drape_system_matrix_archive(s->linear, a, s->factored_cj != 0);
}

void drape_first_order_archive(void *state, drape_archive *a)
{
    drape_first_order *s = state;
    int64_t counted = s->counted;
    drape_archive_double(a, &s->reached);
    drape_archive_double(a, &s->from);
    drape_sun_newton_archive(&s->newton, a);
    drape_archive_doubles(a, s->powers[0], drape_system_work_count(s->system) + 1);
    drape_archive_double(a, &s->second);
    drape_archive_int64(a, &s->tiny);
    drape_archive_int64(a, &s->steps);
    drape_archive_int64(a, &counted);
    if (a->reading && !(counted >= 0 && s->tiny >= 0 && s->tiny <= DRAPE_MAX_TINY_STEPS && s->steps >= 0 &&
                        (double)s->steps <= s->values[DRAPE_FIRST_ORDER_MAX_STEPS]))
        drape_archive_fail(a, DRAPE_E_PARSE,
                           "the checkpoint has an impossible number of steps or iterations");
    s->counted = (long)counted;
    drape_work_archive(&s->work, a);
    if (s->n == 0)
        return;
    archive_factors(s, a);
    if ((s->ranks || !s->solver->archive(s, a)) && a->reading)
        drape_first_order_restart(s, NULL);
}

size_t drape_first_order_bytes(const void *state)
{
    const drape_first_order *s = state;
    if (s->n == 0)
        return 0;
    const size_t vectors = 8 + (size_t)s->solver->vectors(s); /* allocated here; by the library */
    return 2 * (size_t)s->n * vectors * sizeof(double) + drape_system_matrix_bytes(s->linear);
}
