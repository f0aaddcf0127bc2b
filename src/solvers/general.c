/* general.c: see general.h. */
#include "solvers/general.h"

#include "base/finite.h"
#include "solvers/linear.h"
#include "solvers/rounding.h"
#include "sparse/pattern.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* A pivot of a scaled matrix lets rounding errors grow by at most its inverse: those below the root of the
 * rounding error take more than half of the digits. Factors with smaller ones are tried before they are
 * accepted; their tiles are shifted by as much, so that neither the shift nor the growth prevents
 * refinement; and the inertia is that of the matrix if its factors solve to this without refinement. */
#define ROOT     sqrt(DBL_EPSILON)
#define KLU_MOST 15000 /* [unknowns] about 1 s, which cannot be cancelled; larger matrices go without it */

extern const drape_linear_ops drape_linear_klu;

/* ---- Scaling ---- */

/* Sets each step to a power of 2 near the inverse root of the largest magnitude, and multiplies the factors
 * by it. False if one is zero; *done stays true if all steps are 1. */
static bool take_roots(int64_t n, const double *largest, double *step, double *factor, bool *done)
{
    for (int64_t i = 0; i < n; i++) {
        int exponent;
        if (!(largest[i] > 0))
            return false;
        frexp(largest[i], &exponent);
        *done &= exponent / 2 == 0;
        step[i] = ldexp(1, -(exponent / 2));
        factor[i] *= step[i];
    }
    return true;
}

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
    drape_status status = drape_front_factors_create(arena, g->fronts, false, &g->lu);
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
    if (drape_refine_solve(&g->refine, drape_front_factors_solve, &g->lu, g->scaled, g->b, g->x))
        return false;
    for (int64_t i = 0; i < n; i++)
        if (!(fabs(g->x[i]) * DRAPE_SINGULAR < 1))
            return false;
    return true;
}

static drape_status factor_scaled(drape_general *g, double shift)
{
    double low, high;
    g->lu.shift = shift;
    const drape_status status = drape_front_factors_make(&g->lu);
    if (status)
        return status;
    drape_front_factors_range(&g->lu, &low, &high);
    return 1 / high > ROOT || is_solvable(g) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

/* Scales the rows and columns of a matrix so that the largest magnitude of each is about 1 (Ruiz 2001, A
 * scaling algorithm to equilibrate both rows and columns norms in matrices). All factors are powers of 2, so
 * nothing is rounded. The vectors of `refine` are the workspace. */
static bool scale(drape_general *g, const double *values, bool symmetric)
{
    g->lu.symmetric = symmetric;
    g->fronts->values = g->scaled;
    /* g->scaled (nonzeros) = R A C; g->row and g->column (n) are the diagonals of R and C, equal if the
     * matrix is symmetric. False if a row or a column is zero: the matrix is singular. */
    const drape_pattern *p = g->fronts->pattern;
    const size_t n = (size_t)p->n;
    double *scaled = g->scaled, *work = g->refine.basis, *row_step = work, *column_step = work + n,
           *row_largest = work + 2 * n, *column_largest = work + 3 * n;
    bool done = false, regular = true;
    memcpy(scaled, values, (size_t)p->nonzeros * sizeof *scaled);
    for (size_t i = 0; i < n; i++)
        g->row[i] = g->column[i] = row_step[i] = column_step[i] = 1;
    /* each pass halves the exponents; the largest then are between 1/4 and 2 */
    for (int range = DBL_MAX_EXP - DBL_MIN_EXP; regular && !done && range > 0; range /= 2) {
        /* Multiplies by the factors, and finds the largest magnitude of each row and column. */
        memset(row_largest, 0, (size_t)p->n * sizeof *row_largest);
        for (int64_t j = 0; j < p->n; j++) {
            double most = 0;
            for (int64_t k = p->column[j]; k < p->column[j + 1]; k++) {
                const int64_t i = drape_pattern_row(p, j, k);
                scaled[k] *= row_step[i] * column_step[j];
                const double size = fabs(scaled[k]);
                most = size > most ? size : most;
                row_largest[i] = size > row_largest[i] ? size : row_largest[i];
            }
            column_largest[j] = most;
        }
        done = true;
        regular = take_roots(p->n, symmetric ? column_largest : row_largest, row_step, g->row, &done) &&
                  take_roots(p->n, column_largest, column_step, g->column, &done);
    }
    return regular;
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
        status = drape_refine_solve(&g->refine, drape_front_factors_solve, &g->lu, g->scaled, g->b, g->x);
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
