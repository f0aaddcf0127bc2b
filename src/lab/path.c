/*
 * path.c: follows a path of equilibria F(x, f) = g(x) + f p(x) = 0, with g the gradient of the energy of the
 * cloth and f p that of its loads.
 *
 * A step begins along the tangent, K b = -p, dx = s b, df = s. A correction solves K dx' + p df' = -F with
 * one more equation, by the two solutions K a = -F and K b = -p:  dx' = a + df' b (Batoz & Dhatt 1979).
 *     load control     df' = 0
 *     arc length       dx . dx' = 0, with the step dx so far: the updated normal plane (Ramm 1981, Strategies
 *                      for tracing the nonlinear response near limit points)
 *     branch           u . dx' = 0, with the unstable mode u: the solution stays as far from the path
 *                      (Wagner & Wriggers 1988, A simple method for the calculation of postcritical branches)
 * Displacements are measured by |dx|^2 = sum m dx^2/sum m. The factor is not in the norm (Crisfield 1981), so
 * that nothing depends on the size of the loads. At a limit point K is singular, but the step has a direction
 * there: b dominates, and df = s |b|^-1.
 */
#include "base/def.h"
#include "base/finite.h"
#include "drape/lab.h"
#include "lab/eigen.h"
#include "lab/tangent.h"
#include "solvers/inertia.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define MAX_ITERATIONS  20
#define WANTED          6    /* iterations of a step that is neither shortened nor lengthened */
#define MAX_GROWTH      1.5  /* of the length of a step from one to the next */
#define MAX_CORRECTION  3.0  /* of a step: a larger one has left the path */
#define LEAST_COSINE    0.8  /* of the angle between a step and its prediction */
#define LEAST_STEP      1e-7 /* of the first step */
#define LONGEST         0.02 /* of the scene: the default of max_arc */
#define NEAR            1e-3 /* of a step: so near a bifurcation is found before its branch is sought */
#define MAX_BRANCH      12   /* trials of the first step on a branch */
#define MODE_ITERATIONS 12   /* of inverse iteration for the unstable mode */
#define ROUNDINGS       4.0  /* multiple of DBL_EPSILON in a force, in parts of stiffness times size */
#define MAX_ROUNDING    1e-4 /* of the loads: with more, an equilibrium is not known well enough */

typedef enum control { CONTROL_LOAD, CONTROL_ARC, CONTROL_BRANCH } control;

typedef struct follower {
    drape_context *ctx;
    drape_sim *sim;
    const drape_path_def *def;
    lab_tangent tangent; /* its arena has all arrays */
    size_t n, nodes;
    double mass;                  /* [kg] of all free nodes, once per coordinate */
    double *x;                    /* (nodes) a trial */
    double *still;                /* (nodes) velocities */
    double *force, *load, *a, *b; /* (n) */
    double *step, *before;        /* (n) the step so far; the last one that was accepted */
    double *ahead;                /* (n) the prediction */
    double *mode;                 /* (n) the unstable mode, |mode| = 1 */
    double change;                /* of the factor in the step so far */
    double change_before;         /* in the last accepted one */
    double direction;             /* of the factor along the tangent at the beginning of the step: its sign */
    double rounding;              /* [N] of a force */
    drape_path_point point;       /* the last one */
    bool moved;                   /* there is a step before */
} follower;

static double dot(const follower *p, const double *u, const double *v)
{
    double sum = 0;
    for (size_t i = 0; i < p->n; i++)
        sum += p->tangent.mass[i] * u[i] * v[i];
    return sum / p->mass;
}

static double norm(const follower *p, const double *u)
{
    return sqrt(dot(p, u, u));
}

static double largest(const double *u, size_t n)
{
    double most = 0;
    for (size_t i = 0; i < n; i++)
        most = fmax(most, fabs(u[i]));
    return most;
}

/* ---- Newton's method ---- */

/* Moves the trial to the end of the step so far. */
static void place(follower *p)
{
    const drape_model *m = p->sim->model;
    memcpy(p->x, drape_sim_state(p->sim)->x, p->nodes * sizeof *p->x);
    for (size_t i = 0; i < p->n; i++)
        p->x[3 * (size_t)m->node_of_free[i / 3] + i % 3] += p->step[i];
}

/* Factors K at the trial, and solves K b = -p. DRAPE_RETRY_* if that is not possible. */
static drape_status factor(follower *p)
{
    lab_tangent *t = &p->tangent;
    lab_tangent_evaluate(t, p->x, p->point.factor + p->change, NULL, p->load, t->values);
    if (!drape_all_finite(t->values, (size_t)t->pattern->nonzeros))
        return DRAPE_RETRY_NONFINITE;
    drape_status status = t->solver->factor(t->factors, t->values);
    for (size_t i = 0; i < p->n; i++)
        p->a[i] = -p->load[i];
    return status ? status : lab_tangent_solve(t, p->a, p->b);
}

/* Corrects the step so far until its end is an equilibrium. limit [m]: of a correction. DRAPE_RETRY_* if that
 * fails. */
static drape_status correct(follower *p, control by, double limit, drape_path_point *point)
{
    for (point->iterations = 0; point->iterations <= MAX_ITERATIONS; point->iterations++) {
        place(p);
        const double at = p->point.factor + p->change;
        const double forces = lab_tangent_evaluate(&p->tangent, p->x, at, p->force, p->load, NULL);
        const double loads = largest(p->load, p->n), scale = fmax(forces, fabs(at) * loads);
        const double rounding = fmin(p->rounding, MAX_ROUNDING * fmax(fabs(at), p->def->step) * loads);
        point->residual = drape_all_finite(p->force, p->n) ? largest(p->force, p->n) : INFINITY;
        if (point->residual <= fmax(p->def->tolerance * scale, rounding))
            return DRAPE_OK;
        if (!isfinite(point->residual))
            return DRAPE_RETRY_NONFINITE;
        drape_status status = drape_check_cancel(p->ctx);
        if (!status)
            status = factor(p);
        if (status)
            return status;
        for (size_t i = 0; i < p->n; i++)
            p->force[i] = -p->force[i];
        status = lab_tangent_solve(&p->tangent, p->force, p->a);
        if (status)
            return status;
        const double *normal = by == CONTROL_BRANCH ? p->mode : p->step;
        const double change = by == CONTROL_LOAD ? 0 : -dot(p, normal, p->a) / dot(p, normal, p->b);
        for (size_t i = 0; i < p->n; i++)
            p->a[i] += change * p->b[i];
        if (!(norm(p, p->a) <= limit) || !isfinite(change))
            return DRAPE_RETRY_NONLINEAR;
        for (size_t i = 0; i < p->n; i++)
            p->step[i] += p->a[i];
        p->change += change;
    }
    return DRAPE_RETRY_NONLINEAR;
}

/* ---- Points ---- */

static drape_status count_unstable(follower *p, double factor, int64_t *unstable)
{
    lab_tangent *t = &p->tangent;
    bool known;
    lab_tangent_evaluate(t, p->x, factor, NULL, NULL, t->values);
    *unstable = -1; /* of a load without a potential the signs of pivots say nothing */
    if (!lab_tangent_is_symmetric(t, t->values))
        return DRAPE_OK;
    *unstable = 0;
    drape_status status = lab_tangent_factor_definite(t, t->values, &known);
    if (status || known)
        return status;
    status = drape_inertia(p->ctx, t->pattern, t->values, NULL, unstable, &known);
    *unstable = known ? *unstable : -1;
    return status;
}

/* What the end of a converged step would be as a point. DRAPE_RETRY_DEGENERATE: it cannot
 * be one. */
static drape_status examine(follower *p, drape_path_point *point)
{
    const drape_state *now = drape_sim_state(p->sim);
    drape_reason reason;
    drape_diagnostic diagnostic;
    drape_status status =
        drape_system_check(p->tangent.system, p->x, now->x, now->internal, &reason, &diagnostic);
    point->factor = p->point.factor + p->change;
    point->arc = p->point.arc + norm(p, p->step);
    if (!status)
        status = count_unstable(p, point->factor, &point->unstable);
    point->number = p->point.number + 1;
    if (status)
        return status;
    /* Where the number of unstable modes changes, K was singular in between: at a limit point if the
     * factor rises along the tangent at one end of the step and falls at the other. Without that number, a
     * limit is noted when the factor has turned round, in this step or in the one before. */
    const bool known = p->point.unstable >= 0 && point->unstable >= 0;
    const bool turned = p->moved && p->change * p->change_before < 0;
    point->event = turned && p->point.event != DRAPE_PATH_LIMIT ? DRAPE_PATH_LIMIT : DRAPE_PATH_REGULAR;
    if (point->number == 0 || !known || p->point.unstable == point->unstable)
        return DRAPE_OK;
    status = factor(p);
    point->event = dot(p, p->step, p->b) * p->direction < 0 ? DRAPE_PATH_LIMIT : DRAPE_PATH_BIFURCATION;
    return status;
}

/* Makes the end of the step the state of the sim, and reports it. *ended: the observer wants no more. */
static drape_status accept(follower *p, drape_path_point point, bool *ended)
{
    DRAPE_TRY(drape_sim_set_state(p->sim, drape_sim_time(p->sim), p->x, p->still));
    const drape_state *now = drape_sim_state(p->sim);
    const drape_point at = {
        .x = now->x, .v = p->still, .internal = now->internal, .t = now->t, .full = p->tangent.full};
    drape_system_energy(p->tangent.system, &at, &point.elastic, &point.potential);
    point.potential *= point.factor;
    memcpy(p->before, p->step, p->n * sizeof *p->step);
    p->change_before = p->change;
    p->moved = point.number > 0;
    p->point = point;
    drape_status status = p->def->observer ? p->def->observer(p->def->user, p->sim, &p->point) : DRAPE_OK;
    *ended = status > 0;
    return status > 0 ? DRAPE_OK : status;
}

/* ---- Steps ---- */

/* K and b at the last point. */
static drape_status open_step(follower *p)
{
    memset(p->step, 0, p->n * sizeof *p->step);
    p->change = 0;
    place(p);
    return factor(p);
}

static double limit_of(const follower *p)
{
    return MAX_CORRECTION * norm(p, p->step);
}

/* Tries a step of that length from the last point. */
static drape_status attempt(follower *p, double length, drape_path_point *point)
{
    DRAPE_TRY(open_step(p));
    /* The prediction of a step of that length: of the factor under load control, else of the arc. It goes
     * on in the direction of the last step; the first one towards `to`. */
    double change = length;
    if (!p->def->load_control) {
        change /= norm(p, p->b);
        change *= (p->moved ? dot(p, p->before, p->b) : p->def->to - p->def->from) < 0 ? -1 : 1;
    } else if (p->def->to < p->def->from)
        change = -length;
    for (size_t i = 0; i < p->n; i++)
        p->step[i] = change * p->b[i];
    p->change = p->direction = change;
    memcpy(p->ahead, p->step, p->n * sizeof *p->step);
    drape_status status = correct(p, p->def->load_control ? CONTROL_LOAD : CONTROL_ARC, limit_of(p), point);
    /* A step that has left the direction of its prediction has found another part of the path, such as the
     * one that leads back. */
    if (!status && !p->def->load_control &&
        dot(p, p->step, p->ahead) < LEAST_COSINE * norm(p, p->step) * norm(p, p->ahead))
        return DRAPE_RETRY_NONLINEAR;
    return status ? status : examine(p, point);
}

/* ---- A branch ---- */

/* The mode of K at the last point whose eigenvalue is nearest to 0, by inverse iteration, in M. */
static drape_status find_mode(follower *p)
{
    drape_status status = open_step(p);
    lab_noise(1, p->mode, p->n);
    for (int k = 0; !status && k < MODE_ITERATIONS; k++) {
        for (size_t i = 0; i < p->n; i++)
            p->a[i] = p->tangent.mass[i] * p->mode[i];
        status = lab_tangent_solve(&p->tangent, p->a, p->mode);
        const double size = norm(p, p->mode);
        for (size_t i = 0; i < p->n; i++)
            p->mode[i] /= size;
    }
    /* Its sign: the component that is largest is positive. */
    size_t top = 0;
    for (size_t i = 0; i < p->n; i++)
        top = fabs(p->mode[i]) > fabs(p->mode[top]) * (1 + 1e-6) ? i : top;
    for (size_t i = 0; i < p->n; i++)
        p->a[i] = p->mode[top] < 0 ? -p->mode[i] : p->mode[i];
    memcpy(p->mode, p->a, p->n * sizeof *p->mode);
    return status;
}

/* Moves to where the number of unstable modes is about to change, within a small part of the step of that
 * length, which passed it. */
static drape_status approach(follower *p, double length)
{
    double left = length;
    bool ended = false;
    drape_status status = DRAPE_OK;
    while (status >= 0 && left > NEAR * length && !ended) {
        drape_path_point point = {0};
        left /= 2;
        status = attempt(p, left, &point);
        if (!status && point.unstable == p->point.unstable)
            status = accept(p, point, &ended);
    }
    return status < 0 ? status : DRAPE_OK;
}

/* Leaves the path along the mode, first by *length, which becomes the length of the step that was made. */
static drape_status leave(follower *p, double *length)
{
    drape_status status = find_mode(p);
    for (int k = 0; status >= 0 && k < MAX_BRANCH; k++, *length /= 2) {
        drape_path_point point = {0};
        bool ended;
        for (size_t i = 0; i < p->n; i++)
            p->step[i] = (p->def->branch < 0 ? -*length : *length) * p->mode[i];
        p->change = 0;
        status = correct(p, CONTROL_BRANCH, MAX_CORRECTION * *length, &point);
        if (!status)
            status = examine(p, &point);
        if (status)
            continue;
        point.event = DRAPE_PATH_SWITCHED;
        return accept(p, point, &ended);
    }
    return status < 0 ? status
                      : drape_fail(p->ctx, DRAPE_E_SOLVER,
                                   "factor %.9g: there is a bifurcation, but its branch was not found",
                                   p->point.factor);
}

/* ---- The path ---- */

/* The equilibrium at the first factor, from the present state. */
static drape_status begin(follower *p, bool *ended)
{
    drape_path_point point = {0};
    p->point = (drape_path_point){.number = -1, .factor = p->def->from};
    memset(p->step, 0, p->n * sizeof *p->step);
    drape_status status = correct(p, CONTROL_LOAD, p->sim->model->length, &point);
    if (!status)
        status = examine(p, &point);
    if (status > 0)
        return drape_fail(p->ctx, DRAPE_E_SOLVER,
                          "no equilibrium was found at the factor %.9g of the loads, from which the path "
                          "begins (%s); begin it at one that `static` has found",
                          p->def->from, drape_status_name(status));
    point.arc = 0;
    return status ? status : accept(p, point, ended);
}

static drape_status follow(follower *p)
{
    bool ended = false, switched = p->def->branch == 0;
    drape_status status = begin(p, &ended);
    if (!status && !ended)
        status = open_step(p);
    if (status > 0)
        return drape_fail(p->ctx, DRAPE_E_SOLVER, "the stiffness at the first point is singular");
    if (status || ended)
        return status;
    double length = p->def->step * (p->def->load_control ? 1 : norm(p, p->b));
    if (!(length > 0 && isfinite(length)))
        return drape_fail(p->ctx, DRAPE_E_ARGUMENT,
                          "no load deforms the cloth: a path needs loads, such as gravity");
    const double first = length;
    const double longest = p->def->load_control  ? INFINITY
                           : p->def->max_arc > 0 ? p->def->max_arc
                                                 : LONGEST * p->sim->model->length;
    length = fmin(length, longest);
    while (!status && !ended && p->point.number + 1 < p->def->max_points && p->point.factor != p->def->to) {
        drape_path_point point = {0};
        drape_status tried = attempt(p, length, &point);
        const double left = p->def->to - p->point.factor;
        const bool last = !tried && left != 0 && p->change * left > 0 && fabs(p->change) >= fabs(left);
        if (last) { /* the step so far is shortened to end at the last factor */
            const double share = left / p->change, limit = limit_of(p);
            for (size_t i = 0; i < p->n; i++)
                p->step[i] *= share;
            p->change = left;
            tried = correct(p, CONTROL_LOAD, limit, &point);
            if (!tried)
                tried = examine(p, &point);
        }
        if (tried < 0)
            return tried;
        if (tried) {
            length /= 2;
            if (!(length >= LEAST_STEP * fmin(first, longest)))
                return drape_fail(p->ctx, DRAPE_E_STEP_TOO_SMALL,
                                  "factor %.9g: steps along the path fail, however short (%s)%s",
                                  p->point.factor, drape_status_name(tried),
                                  p->def->load_control ? "; at a limit point, load control cannot go on"
                                                       : "");
            continue;
        }
        if (point.event == DRAPE_PATH_BIFURCATION && !switched) {
            switched = true;
            status = approach(p, length);
            length = longest; /* the steps before say nothing about the branch */
            if (!status)
                status = leave(p, &length);
            continue;
        }
        status = accept(p, point, &ended);
        if (!last)
            length *= fmin(MAX_GROWTH, sqrt((double)WANTED / fmax(1, point.iterations)));
        length = fmin(length, longest);
    }
    return status;
}

static drape_status open(follower *p)
{
    const drape_model *m = p->sim->model;
    if (m->collider_count > 0 || m->contact.self)
        return drape_fail(p->ctx, DRAPE_E_ARGUMENT,
                          "a path of equilibria is followed without contact: leave out colliders and "
                          "self_contact");
    DRAPE_TRY(lab_tangent_open(p->sim, p->def->from, false, &p->tangent));
    p->n = (size_t)p->tangent.pattern->n;
    p->nodes = 3 * (size_t)m->node_count;
    double **const arrays[] = {&p->force, &p->load, &p->a, &p->b, &p->step, &p->before, &p->ahead, &p->mode};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = drape_arena_take(&p->tangent.arena, p->n, sizeof **arrays[i]);
    p->x = drape_arena_take(&p->tangent.arena, p->nodes, sizeof *p->x);
    p->still = drape_arena_take(&p->tangent.arena, p->nodes, sizeof *p->still);
    if (drape_arena_status(&p->tangent.arena))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < p->n; i++)
        p->mass += p->tangent.mass[i] / 3;
    double stiffest = 0;
    for (int64_t j = 0; j < p->tangent.pattern->n; j++) {
        double sum = 0;
        for (int64_t k = p->tangent.pattern->column[j]; k < p->tangent.pattern->column[j + 1]; k++)
            sum += fabs(p->tangent.values[k]);
        stiffest = fmax(stiffest, sum);
    }
    p->rounding = ROUNDINGS * DBL_EPSILON * stiffest * m->length;
    /* Loads so small that rounding of the cloth's own forces hides them have no path. Those that are 0 are
     * found by what they do. */
    lab_tangent_evaluate(&p->tangent, drape_sim_state(p->sim)->x, 0, NULL, p->load, NULL);
    const double most = fmax(fabs(p->def->from), fabs(p->def->to)) * largest(p->load, p->n);
    return most > 0 && most < p->rounding
               ? drape_fail(
                     p->ctx, DRAPE_E_ARGUMENT,
                     "the loads are at most %.3g N on a node, less than rounding leaves of the cloth's "
                     "own forces, %.3g N: a path needs larger loads",
                     most, p->rounding)
               : DRAPE_OK;
}

void drape_path_def_init(drape_path_def *def, size_t struct_size)
{
    const drape_path_def defaults = {
        .struct_size = struct_size, .to = 1, .step = 0.05, .max_points = 1000, .tolerance = 1e-8};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

drape_status drape_sim_path(drape_sim *sim, const drape_path_def *given)
{
    drape_path_def def;
    DRAPE_TRY(sim ? drape_sim_guard(sim, "drape_sim_path") : DRAPE_E_ARGUMENT);
    drape_path_def_init(&def, sizeof def);
    if (given)
        memcpy(&def, given, given->struct_size < sizeof def ? given->struct_size : sizeof def);
    if (!(isfinite(def.from) && isfinite(def.to) && def.from != def.to && def.step > 0 &&
          isfinite(def.step) && def.max_arc >= 0 && isfinite(def.max_arc) && def.max_points >= 1 &&
          def.tolerance > 0 && def.tolerance < 1 && def.branch >= -1 && def.branch <= 1 &&
          !(def.branch && def.load_control)))
        return drape_fail(
            sim->ctx, DRAPE_E_ARGUMENT,
            "drape_sim_path: from and to are finite and differ, step > 0, max_arc >= 0, "
            "max_points >= 1, 0 < tolerance < 1, branch is -1, 0 or 1, and 0 with load_control");
    follower p = {.ctx = sim->ctx, .sim = sim, .def = &def};
    drape_status status = open(&p);
    if (!status)
        status = follow(&p);
    lab_tangent_close(&p.tangent);
    return status;
}
