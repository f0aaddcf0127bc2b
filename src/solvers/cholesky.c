/* cholesky.c: see cholesky.h. */
#include "solvers/cholesky.h"

#include "solvers/rounding.h"

#include <math.h>

#define S DRAPE_STRIP
/* columns multiplied together: two strips of this length fit into the first-level cache */
#define CHUNK (10 * DRAPE_STRIP)

/* The columns being factored: argument of finish_strip. */
typedef struct strip_job {
    const drape_front_job *of;
    const double *inverse;
    int32_t first, width;
} strip_job;

static double *strip_of(const drape_front_job *w, int64_t strip)
{
    return drape_front_strip(w, DRAPE_LOWER, strip);
}

/* Finishes the columns being factored in one strip below their diagonal tile: subtracts the products with
 * the earlier columns, then divides by the diagonal tile. */
static void finish_strip(void *user, int64_t task)
{
    const strip_job *strips = user;
    const drape_front_job *w = strips->of;
    const int32_t diagonal = strips->first / S;
    const int64_t strip = diagonal + 1 + task;
    double *to = strip_of(w, strip) + S * strips->first;
    drape_tile_multiply(strip_of(w, strip), strip_of(w, diagonal), strips->first, strips->width, false, to);
    drape_tile_divide(strips->width, strip_of(w, diagonal) + S * strips->first, strips->inverse, to);
}

/* Computes one column of tiles of the update, over chunks of the factored columns. */
static void compute_update_column(void *user, int64_t task)
{
    const drape_front_job *w = user;
    const drape_front *f = w->f;
    const int32_t c = (int32_t)task;
    for (int32_t p = 0; p < f->columns && !drape_fronts_cancelled(w->s); p += CHUNK) {
        const int depth = f->columns - p < CHUNK ? f->columns - p : CHUNK;
        for (int32_t r = c; r < f->row_strips; r++)
            drape_tile_multiply(strip_of(w, f->column_strips + r) + S * p,
                                strip_of(w, f->column_strips + c) + S * p, depth, S, p == 0,
                                w->update[DRAPE_LOWER] + drape_front_tile_at(f, r, c));
    }
}

static bool factor_front(drape_front_job *w)
{
    drape_front_assemble(w, DRAPE_LOWER);
    const drape_front *f = w->f;
    for (int32_t first = 0; first < f->columns && !drape_fronts_cancelled(w->s); first += S) {
        const int32_t diagonal = first / S, width = f->columns - first < S ? f->columns - first : S;
        double *tile = strip_of(w, diagonal) + S * first,
               *inverse = (double *)w->user + 3 * w->s->e.first[w->index] + first;
        drape_tile_multiply(strip_of(w, diagonal), strip_of(w, diagonal), first, width, false, tile);
        if (!drape_tile_factor(width, tile, inverse))
            return false;
        strip_job strips = {.of = w, .inverse = inverse, .first = first, .width = width};
        drape_parallel(w->pool, f->column_strips + f->row_strips - diagonal - 1, finish_strip, &strips);
    }
    drape_parallel(w->pool, w->f->row_strips, compute_update_column, w);
    drape_front_extend_add(w, DRAPE_LOWER);
    return true;
}

/* The ratio of the extreme pivots is a lower bound of the condition number. */
static bool is_well_conditioned(int64_t n, const double *inverse)
{
    double low = INFINITY, high = 0;
    for (int64_t k = 0; k < n; k++) {
        low = fmin(low, inverse[k]);
        high = fmax(high, inverse[k]);
    }
    return n == 0 || (low / high) * (low / high) > DRAPE_SINGULAR;
}

drape_status drape_cholesky_factor(drape_fronts *s, double *inverse)
{
    drape_status status = drape_fronts_factor(s, factor_front, inverse);
    return !status && !is_well_conditioned(s->pattern->n, inverse) ? DRAPE_RETRY_LINEAR : status;
}

static void solve_tile_forward(const drape_front_tile_solve *t, void *user)
{
    const double *inverse = (const double *)user + t->at;
    for (int p = 0; p < t->width; p++) {
        t->x[p] *= inverse[p];
        for (int q = p + 1; q < t->width; q++)
            t->x[q] -= t->tile[S * p + q] * t->x[p];
    }
}

static void solve_tile_backward(const drape_front_tile_solve *t, void *user)
{
    const double *inverse = (const double *)user + t->at;
    for (int p = t->width - 1; p >= 0; p--) {
        for (int q = p + 1; q < t->width; q++)
            t->x[p] -= t->tile[S * p + q] * t->x[q];
        t->x[p] *= inverse[p];
    }
}

void drape_cholesky_solve(drape_fronts *s, double *inverse, const double *b, double *x)
{
    const drape_front_solver solver = {
        .back = DRAPE_LOWER, .forward = solve_tile_forward, .backward = solve_tile_backward, .user = inverse};
    drape_fronts_solve(s, &solver, b, x);
}
