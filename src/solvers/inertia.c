/* inertia.c: see inertia.h. AMD orders, LDL (Davis 2005, Algorithm 849) factors without pivoting. */
#include "solvers/inertia.h"

#include <amd.h>
#include <ldl.h>

typedef SuiteSparse_long index_t;

typedef struct ldl_work {
    index_t *order, *inverse, *parent, *column_count, *flag, *pattern, *column; /* (n), column (n + 1) */
    double *d, *y;                                                              /* (n) */
    index_t *row;                                                               /* (entries of L) */
    double *value;
} ldl_work;

/* SuiteSparse takes its index arrays without const and does not write them. */
static index_t *indices(const int64_t *array)
{
    return (index_t *)(uintptr_t)array;
}

static void free_work(drape_context *ctx, ldl_work *w)
{
    void *all[] = {w->order,  w->inverse, w->parent, w->column_count, w->flag, w->pattern,
                   w->column, w->d,       w->y,      w->row,          w->value};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(ctx, all[i]);
}

static bool allocate(drape_context *ctx, size_t n, ldl_work *w)
{
    index_t **arrays[] = {&w->order, &w->inverse, &w->parent, &w->column_count,
                          &w->flag,  &w->pattern, &w->column};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        if (!(*arrays[i] = drape_alloc(ctx, n + 1, sizeof(index_t))))
            return false;
    w->d = drape_alloc(ctx, n, sizeof *w->d);
    w->y = drape_alloc(ctx, n, sizeof *w->y);
    return w->d && w->y;
}

static drape_status analyse(drape_context *ctx, const drape_pattern *p, ldl_work *w)
{
    if (!allocate(ctx, (size_t)p->n, w))
        return DRAPE_E_MEMORY;
    if (amd_l_order(p->n, indices(p->column), indices(p->row), w->order, NULL, NULL) < AMD_OK)
        return drape_fail_memory(ctx, (size_t)p->nonzeros * sizeof(index_t));
    ldl_l_symbolic(p->n, indices(p->column), indices(p->row), w->column, w->parent, w->column_count, w->flag,
                   w->order, w->inverse);
    w->row = drape_alloc(ctx, (size_t)w->column[p->n], sizeof *w->row);
    w->value = drape_alloc(ctx, (size_t)w->column[p->n], sizeof *w->value);
    return w->row && w->value ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_inertia(drape_context *ctx, const drape_pattern *p, const double *values,
                           int64_t *negative, bool *known)
{
    ldl_work w = {0};
    *negative = 0;
    *known = false;
    drape_status status = analyse(ctx, p, &w);
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
    free_work(ctx, &w);
    return status;
}
