/* pick.c: the fastest solver in this build for a number of unknowns, by best_from or general_from; and what
 * is the same for all solvers when they are archived, destroyed and measured. */
#include "solvers/linear.h"

static int64_t best_from(const drape_linear_ops *ops)
{
    return ops->best_from;
}

static int64_t general_from(const drape_linear_ops *ops)
{
    return ops->general_from;
}

/* If n is below the smallest size of all solvers, the solver with the smallest. */
static const drape_linear_ops *pick(int64_t n, int64_t (*from_of)(const drape_linear_ops *ops))
{
    const drape_linear_ops *best = NULL;
    for (int i = 0; drape_linears[i]; i++) {
        int64_t from = from_of(drape_linears[i]), kept = best ? from_of(best) : 0;
        if (from > 0 && (!best || (from <= n && from > kept) || kept > n))
            best = drape_linears[i];
    }
    return best;
}

const drape_linear_ops *drape_linear_best(int64_t n)
{
    return pick(n, best_from);
}

const drape_linear_ops *drape_linear_general(int64_t n)
{
    return pick(n, general_from);
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
