/*
 * auto: picks the solver that was measured to be the fastest at this number of unknowns (bench/linears),
 * among those in this build: each names the number from which on it is the fastest (best_from).
 */
#include "solvers/linear.h"

#include <inttypes.h>
#include <stdio.h>

const drape_linear_ops drape_linear_auto = {
    .entry = {.name = "auto",
              .summary = "the fastest solver of this build for the number of unknowns",
              .reference = "bench/linears"},
    .pick = drape_linear_best,
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

void drape_linear_explain(int64_t n, char why[DRAPE_LINEAR_WHY])
{
    const drape_linear_ops *best = drape_linear_best(n), *next = NULL; /* that of larger sizes */
    for (int i = 0; drape_linears[i]; i++)
        if (drape_linears[i]->best_from > best->best_from &&
            (!next || drape_linears[i]->best_from < next->best_from))
            next = drape_linears[i];
    next = next ? next : best;
    if (next->best_from > 1)
        snprintf(why, DRAPE_LINEAR_WHY, "%" PRId64 " unknowns; %s from %" PRId64 " on", n, next->entry.name,
                 next->best_from);
    else
        snprintf(why, DRAPE_LINEAR_WHY, "the only one for all sizes in this build");
}

const drape_linear_ops *drape_linear_of(const drape_ranks *ranks, int number, int64_t n)
{
    const drape_linear_ops *ops = drape_linears[number];
    if (ops->pick)
        ops = ops->pick(ranks ? 3 * ranks->all_blocks : n);
    return ranks && !ops->solve_inexact ? ranks->direct : ops;
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
