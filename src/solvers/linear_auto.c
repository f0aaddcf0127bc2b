/*
 * auto: picks the solver that was measured to be the fastest at this number of unknowns (bench/linears),
 * among those in this build: each names the number from which on it is the fastest (best_from).
 */
#include "solvers/linear.h"

#include <inttypes.h>
#include <stdio.h>

typedef struct auto_state {
    const drape_linear_ops *ops;
    int64_t n;
    void *solver;
} auto_state;

static void destroy(void **state)
{
    auto_state *s = *state;
    drape_linear_destroy(s->ops, &s->solver);
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    auto_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (auto_state){.ops = drape_linear_best(pattern->n), .n = pattern->n};
    drape_status status = s->ops->create(arena, pattern, &s->solver);
    if (!status)
        *state = s;
    return status;
}

static void use_threads(void *state, drape_pool *pool)
{
    auto_state *s = state;
    if (s->ops->use_threads)
        s->ops->use_threads(s->solver, pool);
}

static void watch(void *state, const atomic_bool *const *cancel)
{
    auto_state *s = state;
    if (s->ops->watch)
        s->ops->watch(s->solver, cancel);
}

static void set_positions(void *state, const double *x)
{
    auto_state *s = state;
    if (s->ops->set_positions)
        s->ops->set_positions(s->solver, x);
}

static drape_status factor(void *state, const double *values)
{
    auto_state *s = state;
    return s->ops->factor(s->solver, values);
}

static drape_status factor_definite(void *state, const double *values)
{
    auto_state *s = state;
    return (s->ops->factor_definite ? s->ops->factor_definite : s->ops->factor)(s->solver, values);
}

static drape_status solve(void *state, const double *b, double *x)
{
    auto_state *s = state;
    return s->ops->solve(s->solver, b, x);
}

static drape_status solve_inexact(void *state, const double *b, double *x, double tolerance,
                                  int64_t *iterations)
{
    auto_state *s = state;
    *iterations = 1;
    return s->ops->solve_inexact ? s->ops->solve_inexact(s->solver, b, x, tolerance, iterations)
                                 : s->ops->solve(s->solver, b, x);
}

static void archive(void *state, drape_archive *a, const double *values)
{
    auto_state *s = state;
    drape_linear_archive(s->ops, s->solver, a, values);
}

static size_t bytes(const void *state)
{
    const auto_state *s = state;
    return drape_linear_bytes(s->ops, s->solver);
}

static void report(const void *state, drape_linear_report *out)
{
    const auto_state *s = state;
    /* The solver that is picked at the next larger sizes; NULL: none. */
    const drape_linear_ops *next = NULL;
    for (int i = 0; drape_linears[i]; i++)
        if (drape_linears[i]->best_from > s->ops->best_from &&
            (!next || drape_linears[i]->best_from < next->best_from))
            next = drape_linears[i];
    *out = (drape_linear_report){.ops = s->ops};
    if (s->ops->report)
        s->ops->report(s->solver, out);
    const char *name = next ? next->entry.name : s->ops->entry.name;
    int64_t from = next ? next->best_from : s->ops->best_from;
    if (from > 1)
        snprintf(out->why, sizeof out->why, "%" PRId64 " unknowns; %s from %" PRId64 " on", s->n, name, from);
    else
        snprintf(out->why, sizeof out->why, "the only one for all sizes in this build");
}

const drape_linear_ops drape_linear_auto = {
    .entry = {.name = "auto",
              .summary = "the fastest solver of this build for the number of unknowns",
              .reference = "bench/linears"},
    .pick = drape_linear_best,
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

/* ---- The fastest solver for a number of unknowns, and what is the same for all solvers ---- */

/* CHOLMOD and UMFPACK served definite and other matrices of scenes that name them. */
const char *const drape_linears_aliases[] = {"cholmod", "multifrontal", "umfpack", "multifrontal", NULL};

/* Whether a solver is better than the best so far: among those whose size is at most n the largest, otherwise
 * the smallest. */
static bool is_better(int64_t from, int64_t best, int64_t n)
{
    if (from <= 0)
        return false;
    if (best <= 0)
        return true;
    return best > n ? from < best : from <= n && from > best;
}

const drape_linear_ops *drape_linear_best(int64_t n)
{
    const drape_linear_ops *best = NULL;
    for (int i = 0; drape_linears[i]; i++)
        if (is_better(drape_linears[i]->best_from, best ? best->best_from : 0, n))
            best = drape_linears[i];
    return best;
}

const drape_linear_ops *drape_linear_of(const drape_ranks *ranks, int number)
{
    const drape_linear_ops *ops = drape_linears[number];
    if (!ranks)
        return ops;
    if (ops->pick)
        ops = ops->pick(3 * ranks->all_blocks);
    return ops->solve_inexact ? ops : ranks->direct;
}

void drape_linear_archive(const drape_linear_ops *ops, void *state, drape_archive *a, const double *values)
{
    bool factored = values != NULL;
    drape_archive_bool(a, &factored);
    if (ops->archive)
        ops->archive(state, a, values);
    else if (drape_archive_has_read(a) && values && ops->factor(state, values))
        drape_archive_fail(a, DRAPE_E_SOLVER, "a matrix of the checkpoint has no factors by \"%s\" here",
                           ops->entry.name);
}

void drape_linear_destroy(const drape_linear_ops *ops, void **state)
{
    if (*state && ops->destroy)
        ops->destroy(state);
    *state = NULL;
}

size_t drape_linear_bytes(const drape_linear_ops *ops, const void *state)
{
    return ops->bytes ? ops->bytes(state) : 0;
}
