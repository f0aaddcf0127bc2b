/* general.c: see general.h. */
#include "solvers/general.h"

#include "base/finite.h"
#include "solvers/equilibrate.h"
#include "solvers/linear.h"
#include "solvers/rounding.h"

#include <float.h>
#include <math.h>

/* A pivot of a scaled matrix lets rounding errors grow by at most its inverse: those below the root of the
 * rounding error take more than half of the digits. Factors with smaller ones are tried before they are
 * accepted; their tiles are shifted by as much, so that neither the shift nor the growth prevents
 * refinement; and the inertia is that of the matrix if its factors solve to this without refinement. */
#define ROOT     sqrt(DBL_EPSILON)
#define KLU_MOST 15000 /* [unknowns] about 1 s, which cannot be cancelled; larger matrices go without it */

extern const drape_linear_ops drape_linear_klu;

/* ---- The last resort ---- */

static void discard_klu(drape_general *g)
{
    drape_linear_destroy(&drape_linear_klu, &g->klu);
    drape_arena_free(&g->klu_arena);
}

/* Factors the matrix by KLU, whose pivots are chosen among all rows of a column, unless it has. */
static drape_status factor_by_klu(drape_general *g)
{
    if (g->klu)
        return DRAPE_OK;
    if (g->fronts->pattern->n > KLU_MOST)
        return DRAPE_RETRY_LINEAR;
    drape_status status = drape_linear_klu.create(&g->klu_arena, g->fronts->pattern, &g->klu);
    if (!status)
        status = drape_linear_klu.factor(g->klu, g->scaled);
    if (status)
        discard_klu(g);
    g->klu_count += !status;
    return status;
}

/* x is checked by the caller. */
static void solve_by_klu(void *factors, const double *b, double *x)
{
    (void)drape_linear_klu.solve(factors, b, x);
}

/* ---- Memory ---- */

drape_general drape_general_of(drape_arena *arena, drape_fronts *fronts)
{
    return (drape_general){
        .arena = drape_arena_within(arena), .klu_arena = drape_arena_within(arena), .fronts = fronts};
}

void drape_general_destroy(drape_general *g)
{
    drape_fronts *s = g->fronts;
    discard_klu(g);
    drape_arena_free(&g->arena);
    s->panels[DRAPE_UPPER] = s->updates[DRAPE_UPPER] = NULL;
    s->source[DRAPE_UPPER] = NULL;
    g->scaled = NULL;
}

static drape_status take(drape_general *g)
{
    const drape_pattern *p = g->fronts->pattern;
    const size_t n = (size_t)p->n;
    drape_arena *arena = &g->arena;
    drape_status status = drape_block_lu_create(arena, g->fronts, &g->lu);
    if (!status)
        status = drape_refine_create(arena, p, &g->refine);
    if (!status)
        status = drape_fronts_take_upper_panels(arena, g->fronts);
    double **vectors[] = {&g->row, &g->column, &g->b, &g->x};
    for (int k = 0; !status && k < 4; k++)
        *vectors[k] = drape_arena_take(arena, n, sizeof(double));
    if (!status)
        g->scaled = drape_arena_take(arena, (size_t)p->nonzeros, sizeof *g->scaled);
    return status ? status : drape_arena_status(arena);
}

/* Takes what is missing for a matrix of this kind. */
static drape_status prepare(drape_general *g, bool symmetric)
{
    drape_status status = g->scaled ? DRAPE_OK : take(g);
    if (!status && !symmetric && !g->fronts->updates[DRAPE_UPPER])
        status = drape_fronts_take_upper_updates(&g->arena, g->fronts);
    if (status)
        drape_general_destroy(g);
    return status;
}

/* ---- Factors ---- */

/* Solves with a right-hand side that has a part in any direction. */
static bool is_solvable(drape_general *g)
{
    const int64_t n = g->fronts->pattern->n;
    for (int64_t i = 0; i < n; i++)
        g->b[i] = (double)((uint32_t)i * UINT32_C(2654435769) >> 16) / 32768 - 1;
    if (drape_refine_solve(&g->refine, drape_block_lu_solve, &g->lu, g->scaled, g->b, g->x))
        return false;
    for (int64_t i = 0; i < n; i++)
        if (!(fabs(g->x[i]) * DRAPE_SINGULAR < 1))
            return false;
    return true;
}

static drape_status factor_scaled(drape_general *g, double shift)
{
    g->lu.shift = shift;
    drape_status status = drape_block_lu_factor(&g->lu);
    if (!status && !(drape_block_lu_smallest_pivot(&g->lu) > ROOT) && !is_solvable(g))
        status = DRAPE_RETRY_LINEAR;
    return status;
}

/* The vectors of `refine` are the workspace. */
static bool scale(drape_general *g, const double *values, bool symmetric)
{
    g->lu.symmetric = symmetric;
    g->fronts->values = g->scaled;
    return drape_equilibrate(g->fronts->pattern, values, symmetric, g->row, g->column, g->scaled,
                             g->refine.basis);
}

drape_status drape_general_factor(drape_general *g, const double *values, bool symmetric)
{
    drape_status status = prepare(g, symmetric);
    if (status)
        return status;
    discard_klu(g);
    if (!scale(g, values, symmetric))
        return DRAPE_RETRY_LINEAR;
    status = factor_scaled(g, 0);
    if (status == DRAPE_RETRY_LINEAR)
        status = factor_scaled(g, ROOT);
    g->factored = !status;
    return status == DRAPE_RETRY_LINEAR ? factor_by_klu(g) : status;
}

/* The result depends on the matrix and on b alone: KLU serves no b that the factors can serve. */
drape_status drape_general_solve(drape_general *g, const double *b, double *x)
{
    const int64_t n = g->fronts->pattern->n;
    drape_status status = DRAPE_RETRY_LINEAR;
    for (int64_t i = 0; i < n; i++)
        g->b[i] = g->row[i] * b[i];
    if (!drape_all_finite(g->b, (size_t)n))
        return status;
    if (g->factored)
        status = drape_refine_solve(&g->refine, drape_block_lu_solve, &g->lu, g->scaled, g->b, g->x);
    if (status == DRAPE_RETRY_LINEAR) {
        status = factor_by_klu(g);
        if (!status)
            status = drape_refine_solve(&g->refine, solve_by_klu, g->klu, g->scaled, g->b, g->x);
    }
    for (int64_t i = 0; i < n; i++)
        x[i] = g->column[i] * g->x[i];
    return status;
}

/* By Sylvester's law, A has as many negative eigenvalues as the diagonal blocks of its factors. */
drape_status drape_general_inertia(drape_general *g, const double *values, int64_t *negative, bool *known)
{
    const size_t count = (size_t)g->fronts->e.count;
    *negative = 0;
    *known = false;
    drape_status status = prepare(g, true);
    g->lu.negative = status ? NULL : drape_arena_take(&g->arena, count, sizeof *g->lu.negative);
    if (status || !g->lu.negative)
        return DRAPE_E_MEMORY;
    if (!scale(g, values, true))
        return DRAPE_OK;
    status = factor_scaled(g, 0);
    if (status < 0)
        return status;
    *known = !status && is_solvable(g) && g->refine.first_error < ROOT;
    for (size_t i = 0; i < count; i++)
        *negative += g->lu.negative[i];
    return DRAPE_OK;
}
