/*
 * modes.c: eigenfrequencies and linear buckling loads of a sim's present state.
 *
 * Vibrations: K u = l M u. With S = K - s M positive definite, that is with a shift s below all eigenvalues,
 * OP = S^-1 M has the eigenvalues 1/(l - s), of which the largest belong to the lowest l.
 *
 * Buckling: K depends on the factor f of the loads, and is singular where the cloth buckles. To first order
 * along the path of equilibria dx/df = u1 = -K^-1 (loads), so that (K + (f - f0) K') u = 0 with K' = dK/df
 * (Bathe 1996, Finite element procedures, 6.8.2). K' is a derivative along the path, by differences of
 * the exact K, and not the matrix of the initial stress alone: it is the same for a flat sheet under loads
 * in its plane, holds for every term, and contains what loads that follow the cloth do to K. With K positive
 * definite, OP = -K^-1 K', symmetric in the inner product of K, has the eigenvalues 1/(f - f0): the largest
 * belong to the lowest loads above f0.
 *
 * Lanczos' method may miss an eigenvector of a repeated eigenvalue. By Sylvester's law of inertia the number
 * of eigenvalues below a value is that of the negative pivots of K - value M, or K + (value - f0) K'. What is
 * missing is searched for among vectors orthogonal to what was found.
 */
#include "base/def.h"
#include "base/elementary.h"
#include "base/pi.h"
#include "drape/lab.h"
#include "lab/eigen.h"
#include "lab/tangent.h"
#include "solvers/inertia.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* The shift, in parts of the largest diagonal entry of M^-1 K: far enough from 0 that the rigid motions of a
 * free sheet leave S regular, near enough that they are distinct from the slowest bending. */
#define SHIFT      1e-11
#define SHIFT_STEP 8.0 /* while it is not below all eigenvalues */
#define MAX_SHIFTS 16
#define SPARE      4    /* modes beyond those asked for, to find a gap behind them */
#define RIGID      6    /* motions of a rigid body, which have no stiffness */
#define MAX_SEARCH 8    /* searches for what is missing */
#define LEAST_GAP  1e-7 /* relative; a narrower one may be rounding between repeated eigenvalues */
#define MAX_ERROR  1e-6 /* relative, of a mode that counts as converged */
#define ROUNDINGS  4.0  /* multiple of DBL_EPSILON in the entries of K, of several elements each */

/* A pair, as it was found: 1/op is l - s or f - f0. */
typedef struct eigenpair {
    double op;
    int32_t vector; /* its number among the vectors */
} eigenpair;

typedef struct problem {
    drape_context *ctx;
    lab_tangent tangent; /* its arena has all arrays */
    bool buckling;
    int64_t n;
    double shift;        /* s [1/s2]; f0 */
    double *slope;       /* K'; NULL: vibrations */
    double *shifted;     /* S, or K */
    double *scratch;     /* (n) */
    double stiffest;     /* [1/s2] the largest diagonal entry of M^-1 K */
    int32_t count, room; /* pairs; room for them */
    eigenpair *pairs;    /* in descending order of op, that is ascending order of the value */
    double *vector;      /* (room x n) */
    double *product;     /* (room x n) their products with B */
} problem;

/* ---- The operator ---- */

static void multiply_masses(const problem *p, const double *x, double *y)
{
    for (int64_t i = 0; i < p->n; i++)
        y[i] = p->tangent.mass[i] * x[i];
}

static void inner(void *user, const double *x, double *y)
{
    const problem *p = user;
    if (p->buckling)
        lab_tangent_multiply(&p->tangent, p->shifted, x, y);
    else
        multiply_masses(p, x, y);
}

static drape_status apply(void *user, const double *x, double *y)
{
    problem *p = user;
    if (p->buckling) {
        lab_tangent_multiply(&p->tangent, p->slope, x, p->scratch);
        for (int64_t i = 0; i < p->n; i++)
            p->scratch[i] = -p->scratch[i];
    } else
        multiply_masses(p, x, p->scratch);
    if (drape_check_cancel(p->ctx))
        return DRAPE_E_STOPPED;
    return lab_tangent_solve(&p->tangent, p->scratch, y)
               ? drape_fail(p->ctx, DRAPE_E_SOLVER, "a shifted stiffness cannot be solved with")
               : DRAPE_OK;
}

/* ---- Factors ---- */

/* Lowers the shift until it is below all eigenvalues, so that none of them is passed by. */
static drape_status factor_below_all(problem *p)
{
    bool definite = false;
    drape_status status = DRAPE_OK;
    p->shift = -SHIFT * p->stiffest;
    for (int i = 0; !status && !definite && i < MAX_SHIFTS; i++) {
        p->shift *= i > 0 ? SHIFT_STEP : 1;
        lab_tangent_shift(&p->tangent, -p->shift, NULL, p->shifted);
        status = lab_tangent_factor_definite(&p->tangent, p->shifted, &definite);
    }
    return status || definite
               ? status
               : drape_fail(p->ctx, DRAPE_E_SOLVER, "no shift is below all eigenvalues of the stiffness");
}

static drape_status prepare_buckling(problem *p)
{
    const size_t n = (size_t)p->n;
    int64_t negative;
    bool definite = false, known;
    double *load = drape_arena_take(&p->tangent.arena, n, sizeof *load);
    double *u = drape_arena_take(&p->tangent.arena, n, sizeof *u);
    p->slope = drape_arena_take(&p->tangent.arena, (size_t)p->tangent.pattern->nonzeros, sizeof *p->slope);
    if (drape_arena_status(&p->tangent.arena))
        return DRAPE_E_MEMORY;
    p->shift = p->tangent.factor;
    lab_tangent_shift(&p->tangent, 0, NULL, p->shifted);
    drape_status status = lab_tangent_factor_definite(&p->tangent, p->shifted, &definite);
    if (!status && !definite)
        status = drape_inertia(p->ctx, p->tangent.pattern, p->shifted, NULL, &negative, &known);
    if (status)
        return status;
    if (!definite)
        return drape_fail(
            p->ctx, DRAPE_E_ARGUMENT,
            known ? "the state has %lld unstable modes: it has buckled already; buckling loads are "
                    "those of a stable state, such as the start without loads"
                  : "the stiffness of the state is singular: buckling loads need a cloth that is "
                    "held and has a stiffness against every motion (%lld negative pivots)",
            (long long)negative);
    lab_tangent_evaluate(&p->tangent, drape_sim_state(p->tangent.sim)->x, p->shift, NULL, load, NULL);
    if (lab_tangent_solve(&p->tangent, load, u))
        return drape_fail(p->ctx, DRAPE_E_SOLVER, "the stiffness cannot be solved with");
    for (size_t i = 0; i < n; i++)
        u[i] = -u[i];
    return lab_tangent_slope(&p->tangent, u, p->slope);
}

/* ---- Search ---- */

/* Searches for more pairs, and inserts them into those that were found before. In buckling, pairs with op <=
 * 0 belong to loads in the other direction, and are left out. */
static drape_status search(problem *p, int32_t wanted)
{
    const lab_operator op = {.n = p->n, .user = p, .apply = apply, .inner = inner};
    int32_t found = 0;
    if (wanted > p->n - 1 - p->count)
        wanted = (int32_t)(p->n - 1 - p->count);
    if (wanted < 1)
        return DRAPE_OK;
    const size_t n = (size_t)p->n, room = (size_t)(p->count + wanted);
    if (p->room < (int32_t)room) {
        p->vector = drape_arena_resize(&p->tangent.arena, p->vector, room * n, sizeof *p->vector);
        p->product = drape_arena_resize(&p->tangent.arena, p->product, room * n, sizeof *p->product);
        p->pairs = drape_arena_resize(&p->tangent.arena, p->pairs, room, sizeof *p->pairs);
        p->room = (int32_t)room;
    }
    double *value = drape_arena_take(&p->tangent.arena, (size_t)wanted, sizeof *value);
    DRAPE_TRY(drape_arena_status(&p->tangent.arena));
    const lab_known known = {p->count, p->vector, p->product};
    drape_status status =
        lab_eigen(p->ctx, &op, &known, wanted, &found, value, p->vector + (int64_t)p->count * p->n);
    for (int32_t k = 0; !status && k < found; k++) {
        int32_t at = p->count;
        if (!(value[k] > 0))
            break;
        inner(p, p->vector + (int64_t)p->count * p->n, p->product + (int64_t)p->count * p->n);
        for (; at > 0 && p->pairs[at - 1].op < value[k]; at--)
            p->pairs[at] = p->pairs[at - 1];
        p->pairs[at] = (eigenpair){value[k], p->count};
        p->count++;
    }
    drape_arena_release(&p->tangent.arena, value);
    return status;
}

/* Counts all eigenvalues up to a gap behind the wanted ones, and those missing among the pairs; *missing -1:
 * it is not known here. */
static drape_status find_missing(const problem *p, int32_t wanted, int64_t *missing, int64_t *below)
{
    int64_t negative;
    bool known;
    /* The widest gap behind the wanted pairs, relative to the distance from the shift, and how many are
     * before it; 0: there is none. */
    double gap = 0;
    int32_t behind = 0;
    for (int32_t k = wanted; k < p->count; k++) {
        const double width = p->pairs[k - 1].op / p->pairs[k].op - 1;
        behind = width > gap ? k : behind;
        gap = fmax(gap, width);
    }
    *missing = -1;
    if (p->count < wanted) {
        *missing = wanted - p->count;
        return DRAPE_OK;
    }
    /* All eigenvectors but one may have been found: then there is no gap to look at. */
    const bool at_end = p->count >= p->n - 1;
    if (gap < LEAST_GAP && !at_end)
        return DRAPE_OK;
    const double distance = at_end && gap < LEAST_GAP ? (1 + LEAST_GAP) / p->pairs[p->count - 1].op
                                                      : 0.5 / p->pairs[behind - 1].op +
                                                            0.5 / p->pairs[behind].op; /* from the shift */
    const int32_t expected = at_end && gap < LEAST_GAP ? p->count : behind;
    if (p->buckling)
        lab_tangent_shift(&p->tangent, distance, p->slope, p->shifted);
    else
        lab_tangent_shift(&p->tangent, -(p->shift + distance), NULL, p->shifted);
    drape_status status = drape_inertia(p->ctx, p->tangent.pattern, p->shifted, NULL, &negative, &known);
    /* The operator's own again. */
    lab_tangent_shift(&p->tangent, p->buckling ? 0 : -p->shift, NULL, p->shifted);
    if (status || !known)
        return status;
    *below = negative;
    *missing = negative - expected;
    return *missing >= 0
               ? DRAPE_OK
               : drape_fail(p->ctx, DRAPE_E_SOLVER, "the eigensolver found %d modes where there are %lld",
                            (int)expected, (long long)negative);
}

static drape_status search_all(problem *p, int32_t wanted, int64_t *below)
{
    int64_t missing = wanted;
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && i < MAX_SEARCH && missing != 0; i++) {
        const int32_t before = p->count;
        const int64_t sought = i == 0 && missing <= RIGID - SPARE ? RIGID + 1 - SPARE : missing;
        status = search(p, (int32_t)(sought > 0 ? sought : 0) + SPARE);
        if (!status)
            status = find_missing(p, wanted, &missing, below);
        if (p->buckling && p->count == before && p->count < wanted)
            break; /* there are no more */
    }
    if (status || missing == 0)
        return status;
    if (missing > 0 && p->buckling && p->count < wanted)
        return drape_fail(
            p->ctx, DRAPE_E_SOLVER,
            "only %d of %d buckling loads were found; with loads in this direction there may be no more",
            (int)p->count, (int)wanted);
    return missing < 0 ? drape_fail(p->ctx, DRAPE_E_SOLVER,
                                    "%d modes were found, but whether these are all up to there is not known",
                                    (int)p->count)
                       : drape_fail(p->ctx, DRAPE_E_SOLVER, "%lld of the lowest %d modes did not converge",
                                    (long long)missing, (int)wanted);
}

/* ---- Results ---- */

static double absolute(const drape_pattern *pattern, const double *values, int64_t j, const double *x)
{
    double sum = 0;
    for (int64_t k = pattern->column[j]; k < pattern->column[j + 1]; k++)
        sum += fabs(values[k] * x[drape_pattern_row(pattern, j, k)]);
    return sum;
}

/* |A u| over its terms' magnitudes, for A = K - value M or K + (value - f0) K'. */
static double backward_error(problem *p, double value, const double *u)
{
    double largest = 0, scale = 0;
    const lab_tangent *t = &p->tangent;
    double *y = p->scratch;
    lab_tangent_multiply(t, t->values, u, y);
    for (int64_t j = 0; j < p->n; j++) {
        double sum = y[j], size = absolute(t->pattern, t->values, j, u);
        if (p->buckling) {
            for (int64_t k = t->pattern->column[j]; k < t->pattern->column[j + 1]; k++)
                sum += (value - p->shift) * p->slope[k] * u[drape_pattern_row(t->pattern, j, k)];
            size += fabs(value - p->shift) * absolute(t->pattern, p->slope, j, u);
        } else {
            sum -= value * t->mass[j] * u[j];
            size += fabs(value * t->mass[j] * u[j]);
        }
        largest = fmax(largest, fabs(sum));
        scale = fmax(scale, size);
    }
    return scale > 0 ? largest / scale : INFINITY;
}

/* The nodes of a shape, with a largest displacement of 1 whose largest component is positive; returns the
 * scale. */
static double fill_shape(const problem *p, const double *u, double *shape)
{
    const drape_model *m = p->tangent.sim->model;
    double largest = 0, sign = 1;
    for (int64_t i = 0; i < p->n; i += 3) {
        const double size = drape_hypot(drape_hypot(u[i], u[i + 1]), u[i + 2]);
        /* Of nodes that move alike, the first decides, whatever rounding does. */
        if (size <= largest * (1 + 1e-6))
            continue;
        int64_t k = i;
        for (int64_t j = i; j < i + 3; j++)
            k = fabs(u[j]) > fabs(u[k]) * (1 + 1e-6) ? j : k;
        largest = size;
        sign = u[k] < 0 ? -1 : 1;
    }
    const double scale = sign / largest;
    for (int32_t f = 0; f < m->free_count; f++)
        for (size_t k = 0; k < 3; k++)
            shape[3 * (size_t)m->node_of_free[f] + k] = scale * u[3 * (size_t)f + k];
    return scale;
}

/* DRAPE_E_SOLVER: it has not converged; its kind is filled in nevertheless. */
static drape_status fill_mode(problem *p, const eigenpair *pair, double *shape, drape_mode *mode)
{
    const double *u = p->vector + (int64_t)pair->vector * p->n;
    double inverse = 0, mass = 0;
    mode->value = p->shift + 1 / pair->op;
    /* For OP symmetric in B there is an eigenvalue within |OP u - op u| of op, in the norm of B with |u| = 1;
     * inverse: relative to op. */
    double *y = drape_arena_take(&p->tangent.arena, 2 * (size_t)p->n, sizeof *y), sum = 0;
    drape_status status = y ? apply(p, u, y) : DRAPE_E_MEMORY;
    if (!status) {
        for (int64_t i = 0; i < p->n; i++)
            y[i] -= pair->op * u[i];
        inner(p, y, y + p->n);
        for (int64_t i = 0; i < p->n; i++)
            sum += y[i] * y[p->n + i];
        inverse = sqrt(fmax(0, sum)) / pair->op;
    }
    drape_arena_release(&p->tangent.arena, y);
    if (status)
        return status;
    for (int64_t i = 0; i < p->n; i++)
        mass += p->tangent.mass[i] * u[i] * u[i];
    const double scale = fill_shape(p, u, shape);
    mode->mass = mass * scale * scale;
    mode->residual = backward_error(p, mode->value, u);
    mode->shape = shape;
    /* Rounding of K changes u'K u by so much in parts of u'M u, which is 1 in vibrations; in buckling, u'K u
     * is. */
    const double rounding =
        ROUNDINGS * DBL_EPSILON * p->stiffest * (p->buckling ? mass * fabs(mode->value - p->shift) : 1);
    const double distance = fabs(mode->value - p->shift) * inverse + rounding;
    mode->error = distance / fabs(mode->value);
    mode->kind = p->buckling                     ? DRAPE_MODE_BUCKLING
                 : distance >= fabs(mode->value) ? DRAPE_MODE_ZERO
                 : mode->value > 0               ? DRAPE_MODE_VIBRATION
                                                 : DRAPE_MODE_UNSTABLE;
    mode->error = mode->kind == DRAPE_MODE_ZERO ? INFINITY : mode->error;
    mode->frequency = mode->kind == DRAPE_MODE_VIBRATION ? sqrt(mode->value) / (2 * DRAPE_PI) : 0;
    return inverse <= MAX_ERROR
               ? DRAPE_OK
               : drape_fail(p->ctx, DRAPE_E_SOLVER,
                            "a mode with the value %.9g did not converge: the residual of the inverted "
                            "problem is %.3g of it",
                            mode->value, inverse);
}

/* Refuses modes without stiffness that are an arbitrary choice: if more motions than those of a rigid body
 * have no stiffness within rounding, and not all of them are among the modes, any others of their space would
 * do as well. */
static drape_status refuse_part_of_slack(problem *p, int32_t count, const drape_modes *found, double *scratch)
{
    drape_mode next = {.kind = DRAPE_MODE_ZERO};
    drape_status status = DRAPE_OK;
    int32_t k = count;
    if (p->buckling || found->modes[count - 1].kind != DRAPE_MODE_ZERO)
        return DRAPE_OK;
    for (; !status && next.kind == DRAPE_MODE_ZERO && k < p->count; k++)
        status = fill_mode(p, &p->pairs[k], scratch, &next);
    if (status == DRAPE_E_SOLVER) /* one that did not converge was not asked for either */
        status = DRAPE_OK;
    if (status || k == count || k - (next.kind != DRAPE_MODE_ZERO) <= (count > RIGID ? count : RIGID))
        return status;
    return drape_fail(p->ctx, DRAPE_E_SOLVER,
                      "more than %d motions have no stiffness within rounding, as of slack cloth without "
                      "bending: of these, modes cannot be separated; ask for more, or give the cloth tension "
                      "or bending",
                      (int)count);
}

static drape_status fill(problem *p, int32_t count, int64_t below, drape_modes *out)
{
    const size_t nodes = 3 * (size_t)p->tangent.sim->model->node_count;
    drape_arena *own = drape_arena_create(p->ctx);
    out->own = own;
    if (!own)
        return DRAPE_E_MEMORY;
    out->modes = drape_arena_take(own, (size_t)count, sizeof *out->modes);
    double *shapes = drape_arena_take(own, (size_t)(count + 1) * nodes, sizeof *shapes);
    drape_status status = drape_arena_status(own);
    for (int32_t k = 0; !status && k < count; k++)
        status = fill_mode(p, &p->pairs[k], shapes + (size_t)k * nodes, &out->modes[k]);
    if (!status)
        status = refuse_part_of_slack(p, count, out, shapes + (size_t)count * nodes);
    out->count = count;
    out->below = below;
    out->force = p->tangent.force;
    return status;
}

/* ---- The driver ---- */

static drape_status compute(problem *p, drape_sim *sim, const drape_modes_def *def, drape_modes *out)
{
    int64_t below = 0;
    DRAPE_TRY(lab_tangent_open(sim, def->buckling ? def->load_factor : 1, true, &p->tangent));
    p->n = p->tangent.pattern->n;
    if (def->count > p->n - 1)
        return drape_fail(p->ctx, DRAPE_E_ARGUMENT,
                          "count = %d; with %lld degrees of freedom there are at most %lld modes to find",
                          (int)def->count, (long long)p->n, (long long)p->n - 1);
    p->shifted =
        drape_arena_take(&p->tangent.arena, (size_t)p->tangent.pattern->nonzeros, sizeof *p->shifted);
    p->scratch = drape_arena_take(&p->tangent.arena, (size_t)p->n, sizeof *p->scratch);
    if (drape_arena_status(&p->tangent.arena))
        return DRAPE_E_MEMORY;
    const drape_pattern *pattern = p->tangent.pattern;
    for (int32_t j = 0; j < pattern->block_count; j++) {
        int64_t stride;
        const double *block = drape_pattern_at(pattern, p->tangent.values, j, pattern->diagonal[j], &stride);
        for (int k = 0; k < 3; k++)
            p->stiffest = fmax(p->stiffest, fabs(block[k * stride + k]) / p->tangent.mass[3 * j + k]);
    }
    if (!(p->stiffest > 0))
        return drape_fail(p->ctx, DRAPE_E_ARGUMENT, "nothing in this scene has a stiffness");
    DRAPE_TRY(p->buckling ? prepare_buckling(p) : factor_below_all(p));
    DRAPE_TRY(search_all(p, def->count, &below));
    return fill(p, def->count, below, out);
}

void drape_modes_def_init(drape_modes_def *def, size_t struct_size)
{
    const drape_modes_def defaults = {.struct_size = struct_size, .count = 6, .load_factor = 1};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

drape_status drape_sim_modes(drape_sim *sim, const drape_modes_def *given, drape_modes *out)
{
    drape_modes_def def;
    if (out)
        *out = (drape_modes){0};
    if (!sim || !out)
        return DRAPE_E_ARGUMENT;
    drape_modes_def_init(&def, sizeof def);
    if (given)
        memcpy(&def, given, given->struct_size < sizeof def ? given->struct_size : sizeof def);
    if (!(def.count >= 1 && isfinite(def.load_factor) && def.load_factor >= 0))
        return drape_fail(
            sim->ctx, DRAPE_E_ARGUMENT,
            "drape_sim_modes: count = %d and load_factor = %g; they are at least 1 and at least 0",
            (int)def.count, def.load_factor);
    problem p = {.ctx = sim->ctx, .buckling = def.buckling};
    drape_status status = compute(&p, sim, &def, out);
    lab_tangent_close(&p.tangent);
    if (status)
        drape_modes_free(out);
    return status;
}

void drape_modes_free(drape_modes *modes)
{
    drape_arena *own = modes ? modes->own : NULL;
    drape_arena_destroy(&own);
    if (modes)
        *modes = (drape_modes){0};
}
