/* inertia.c: see inertia.h. The matrix is ordered by AMD and factored without pivoting by LDL (Davis 2005,
 * Algorithm 849). */
#include "solvers/inertia.h"

#include "base/arena.h"

#include <amd.h>
#include <ldl.h>

typedef SuiteSparse_long index_t;

typedef struct ldl_work {
    index_t *order, *inverse, *parent, *column_count, *flag, *pattern, *column; /* (n), column (n + 1) */
    double *d, *y;                                                              /* (n) */
    index_t *row;                                                               /* (entries of L) */
    double *value;
} ldl_work;

/* SuiteSparse takes index arrays without const, but does not write to them. */
static index_t *indices(const int64_t *array)
{
    return (index_t *)(uintptr_t)array;
}

static drape_status analyse(drape_arena *arena, const drape_pattern *p, ldl_work *w)
{
    const size_t n = (size_t)p->n;
    index_t **arrays[] = {&w->order, &w->inverse, &w->parent, &w->column_count,
                          &w->flag,  &w->pattern, &w->column};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = drape_arena_take(arena, n + 1, sizeof(index_t));
    w->d = drape_arena_take(arena, n, sizeof *w->d);
    w->y = drape_arena_take(arena, n, sizeof *w->y);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    if (amd_l_order(p->n, indices(p->column), indices(p->row), w->order, NULL, NULL) < AMD_OK)
        return drape_fail_memory(arena->ctx, (size_t)p->nonzeros * sizeof(index_t));
    ldl_l_symbolic(p->n, indices(p->column), indices(p->row), w->column, w->parent, w->column_count, w->flag,
                   w->order, w->inverse);
    w->row = drape_arena_take(arena, (size_t)w->column[p->n], sizeof *w->row);
    w->value = drape_arena_take(arena, (size_t)w->column[p->n], sizeof *w->value);
    return drape_arena_status(arena);
}

drape_status drape_inertia(drape_context *ctx, const drape_pattern *p, const double *values,
                           int64_t *negative, bool *known)
{
    ldl_work w = {0};
    drape_arena arena = drape_arena_of(ctx);
    *negative = 0;
    *known = false;
    drape_status status = analyse(&arena, p, &w);
    if (!status) {
        index_t done = ldl_l_numeric(p->n, indices(p->column), indices(p->row), (double *)(uintptr_t)values,
                                     w.column, w.parent, w.column_count, w.row, w.value, w.d, w.y, w.pattern,
                                     w.flag, w.order, w.inverse);
        *known = done == p->n;
        for (index_t i = 0; i < done; i++) {
            *negative += w.d[i] < 0;
            *known = *known && w.d[i] == w.d[i];
        }
    }
    drape_arena_free(&arena);
    return status;
}
