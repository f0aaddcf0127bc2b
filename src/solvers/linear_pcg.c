/*
 * pcg: conjugate gradients for a symmetric positive definite matrix, preconditioned by algebraic multigrid
 * (multigrid.h). The matrix itself is not factored: memory and the time of an iteration grow with the
 * nonzeros, and the number of iterations hardly grows. Callers that need no exact solution ask for a looser
 * tolerance.
 *
 * A matrix that is not symmetric, or not positive definite, which the iteration notices at the latest, goes
 * to the fallback (the direct solver `multifrontal`), unless it is too large for that in one process.
 */
#include "base/finite.h"
#include "solvers/linear.h"
#include "solvers/multigrid.h"
#include "solvers/pcg.h"
#include "solvers/rounding.h"

#include <inttypes.h>
#include <string.h>

#define MAX_ITERATIONS 2000 /* a matrix that needs more goes to the fallback */

/* ---- The fallback ---- */

/* The direct solver `multifrontal`, or that of the ranks that share the matrix, gets the matrices that cannot
 * be solved here, unchanged. It is created for the first such matrix, because most scenes have none. */

typedef struct fallback {
    const drape_linear_ops *ops;
    const drape_pattern *pattern;
    drape_arena arena; /* holds the solver */
    void *solver;      /* NULL before the first such matrix */
    drape_pool *pool;  /* of the solver, as in drape_linear_ops, and its flag */
    const atomic_bool *const *cancel;
    bool active;   /* the last matrix was factored here */
    int64_t count; /* matrices passed to it */
} fallback;

extern const drape_linear_ops drape_linear_multifrontal;

/* Passes the threads and the flag on to the solver, if there is one. */
static void attach_fallback(const fallback *f)
{
    if (f->solver && f->ops->use_threads)
        f->ops->use_threads(f->solver, f->pool);
    if (f->solver && f->ops->watch)
        f->ops->watch(f->solver, f->cancel);
}

static drape_status create_fallback(fallback *f)
{
    const drape_status status = f->ops->create(&f->arena, f->pattern, &f->solver);
    if (status)
        drape_arena_free(&f->arena);
    attach_fallback(f);
    return status;
}

typedef struct pcg_state {
    drape_arena *arena;
    const drape_pattern *pattern;
    const double *values; /* (nonzeros) of the last factor call: the caller's */
    double *positions;    /* (n) of the nodes at the next factor call [m] */
    double *diagonal;     /* (n) entries of the matrix */
    drape_multigrid *multigrid;
    drape_pcg pcg;
    fallback fallback;
    bool factored; /* by this solver or by the fallback */
    bool definite; /* a symmetric matrix that turns out not to be positive definite is refused */
} pcg_state;

static void multiply(const void *owner, const double *x, double *y)
{
    drape_multigrid_multiply(((const pcg_state *)owner)->multigrid, x, y);
}

static void precondition(const void *owner, const double *r, double *z)
{
    drape_multigrid_apply(((const pcg_state *)owner)->multigrid, r, z);
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    const size_t n = (size_t)pattern->n;
    pcg_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (drape_ranks_agree_memory(pattern->ranks, arena->ctx, s))
        return DRAPE_E_MEMORY;
    s->arena = arena;
    s->pattern = pattern;
    s->fallback = (fallback){.ops = pattern->ranks ? pattern->ranks->direct : &drape_linear_multifrontal,
                             .pattern = pattern,
                             .arena = drape_arena_within(arena)};
    s->positions = drape_arena_take(arena, n, sizeof *s->positions);
    s->diagonal = drape_arena_take(arena, n, sizeof *s->diagonal);
    s->pcg = drape_pcg_of(arena, drape_pattern_own(pattern), s, multiply, precondition);
    s->pcg.ranks = pattern->ranks;
    drape_status status = drape_ranks_agree(pattern->ranks, arena->ctx, drape_arena_status(arena));
    if (!status)
        status = drape_multigrid_create(arena, pattern, &s->multigrid);
    if (!status)
        *state = s;
    return status;
}

static void destroy(void **state)
{
    fallback *f = &((pcg_state *)*state)->fallback;
    drape_linear_destroy(f->ops, &f->solver);
    drape_arena_free(&f->arena);
}

/* ---- Values ---- */

static bool is_finite(const pcg_state *s, const double *values, int64_t n)
{
    return drape_ranks_all(s->pattern->ranks, drape_all_finite(values, (size_t)n));
}

static drape_status factor_general(pcg_state *s)
{
    s->factored = false;
    if (!s->pattern->ranks && s->pattern->n > DRAPE_MOST_FACTORED) {
        drape_log(s->arena->ctx, DRAPE_LOG_WARNING,
                  "pcg: the matrix of %" PRId64
                  " unknowns is not symmetric positive definite, and too large for "
                  "multifrontal, which is used up to %d",
                  s->pattern->n, DRAPE_MOST_FACTORED);
        return DRAPE_RETRY_LINEAR;
    }
    fallback *f = &s->fallback;
    f->count++;
    drape_status status = f->solver ? DRAPE_OK : create_fallback(f);
    if (!status)
        status = f->ops->factor(f->solver, s->values);
    f->active = !status;
    s->factored = !status;
    return status;
}

static void use_threads(void *state, drape_pool *pool)
{
    fallback *f = &((pcg_state *)state)->fallback;
    f->pool = pool;
    attach_fallback(f);
}

static void watch(void *state, const atomic_bool *const *cancel)
{
    fallback *f = &((pcg_state *)state)->fallback;
    f->cancel = cancel;
    attach_fallback(f);
}

static void set_positions(void *state, const double *x)
{
    pcg_state *s = state;
    memcpy(s->positions, x, (size_t)s->pattern->n * sizeof *x);
}

static drape_status factor_any(pcg_state *s, const double *values, bool definite)
{
    s->fallback.active = s->factored = false;
    if (!is_finite(s, values, s->pattern->nonzeros))
        return DRAPE_RETRY_LINEAR;
    s->values = values;
    const bool symmetric = drape_pattern_is_symmetric(s->pattern, values, s->diagonal);
    s->definite = definite && symmetric;
    s->factored = symmetric && !drape_multigrid_factor(s->multigrid, s->values, s->positions);
    if (s->factored)
        return DRAPE_OK;
    return s->definite ? DRAPE_RETRY_LINEAR : factor_general(s);
}

static drape_status factor(void *state, const double *values)
{
    return factor_any(state, values, false);
}

static drape_status factor_definite(void *state, const double *values)
{
    return factor_any(state, values, true);
}

static drape_status solve_inexact(void *state, const double *b, double *x, double tolerance,
                                  int64_t *iterations)
{
    pcg_state *s = state;
    *iterations = 0;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    if (!s->fallback.active) {
        drape_pcg_solve(&s->pcg, b, x, tolerance, MAX_ITERATIONS);
        *iterations = s->pcg.iterations;
        if (s->pcg.definite && s->pcg.converged && is_finite(s, x, s->pcg.n))
            return DRAPE_OK;
        drape_status status = s->definite ? DRAPE_RETRY_LINEAR : factor_general(s);
        if (status)
            return status;
    }
    return s->fallback.ops->solve(s->fallback.solver, b, x);
}

static drape_status solve(void *state, const double *b, double *x)
{
    int64_t iterations;
    return solve_inexact(state, b, x, DRAPE_EXACT, &iterations);
}

static void archive(void *state, drape_archive *a, const double *values)
{
    pcg_state *s = state;
    fallback *f = &s->fallback;
    bool there = f->solver != NULL;
    drape_archive_int64(a, &f->count);
    drape_archive_bool(a, &f->active);
    drape_archive_bool(a, &s->factored);
    drape_archive_bool(a, &there);
    if (drape_archive_has_read(a) && there && !f->solver)
        drape_archive_note(a, create_fallback(f));
    if (drape_archive_good(a) && there)
        drape_linear_archive(f->ops, f->solver, a, f->active ? values : NULL);
    drape_archive_bool(a, &s->definite);
    if (!values)
        return;
    drape_archive_doubles(a, s->positions, (size_t)s->pattern->n);
    if (!drape_archive_has_read(a))
        return;
    s->values = values;
    if (s->factored && !s->fallback.active)
        drape_multigrid_factor(s->multigrid, s->values, s->positions);
}

static size_t bytes(const void *state)
{
    const fallback *f = &((const pcg_state *)state)->fallback;
    return f->solver ? drape_linear_bytes(f->ops, f->solver) : 0;
}

static void report(const void *state, drape_linear_report *out)
{
    const fallback *f = &((const pcg_state *)state)->fallback;
    *out = (drape_linear_report){.fallbacks = f->count, .fallback = f->solver ? f->ops : NULL};
}

const drape_linear_ops drape_linear_pcg = {
    .entry =
        {.name = "pcg",
         .summary =
             "conjugate gradients preconditioned by algebraic multigrid, no factors of the matrix; a "
             "matrix that is not symmetric positive definite is given to multifrontal, up to 1e6 unknowns",
         .reference = "Hestenes & Stiefel 1952; Vanek, Mandel & Brezina 1996"},
    .best_from = 1000000, /* faster from 3e5 on, but not where a stiff cloth buckles: bench/large */
    .borrows_heap = true, /* for the fallback */
    .create = create,
    .use_threads = use_threads,
    .watch = watch,
    .set_positions = set_positions,
    .factor = factor,
    .factor_definite = factor_definite,
    .solve = solve,
    .solve_inexact = solve_inexact,
    .archive = archive,
    .destroy = destroy,
    .bytes = bytes,
    .report = report,
};
