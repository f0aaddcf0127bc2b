/* front_factors.c: see front_factors.h. In the panels, the lower half has L below the diagonal tiles, which
 * are Cholesky factors or the factored diagonal blocks of U; the upper half has U' below them. A solution
 * goes from the branches to the top, and back; what a front passes to its parent is in `left`. */
#include "solvers/front_factors.h"

#include "base/lanes.h"
#include "solvers/rounding.h"
#include "sparse/project.h"

#include <math.h>
#include <string.h>

#define S DRAPE_STRIP
/* columns multiplied together: two strips of this length fit into the first-level cache */
#define CHUNK (10 * DRAPE_STRIP)

/* The columns being factored: argument of finish_strip. */
typedef struct strip_job {
    const drape_front_job *of;
    int32_t first, width, at; /* at: the first column, counted over all fronts */
} strip_job;

static bool is_cholesky(const drape_front_factors *f)
{
    return !f->pivot;
}

/* The half that the lower one is multiplied by. */
static drape_half other_half(const drape_front_factors *f)
{
    return is_cholesky(f) ? DRAPE_LOWER : DRAPE_UPPER;
}

/* ---- A diagonal tile ---- */

/* Completes the tile above its diagonal blocks, from the upper half. */
static void fill_tile(const drape_front_job *w, bool symmetric, int32_t first, int32_t width)
{
    double *tile = drape_front_strip(w, DRAPE_LOWER, first / S) + S * first;
    const double *other =
        symmetric ? tile : drape_front_strip(w, DRAPE_UPPER, first / S) + (int64_t)S * first;
    for (int32_t c = 3; c < width; c++)
        for (int32_t r = 0; r < c - c % 3; r++)
            tile[S * c + r] = other[S * r + c];
}

static int32_t count_negative(const double *tile, int32_t n)
{
    double a[S * S], v[S * S];
    int32_t count = 0;
    for (int32_t c = 0; c < n; c++)
        memcpy(a + n * c, tile + S * c, (size_t)n * sizeof *a);
    for (int32_t c = 0; c < n; c++) /* its two triangles differ by rounding errors */
        for (int32_t r = 0; r < c; r++)
            a[n * c + r] = a[n * r + c];
    drape_diagonalise(n, a, v);
    for (int32_t k = 0; k < n; k++)
        count += a[(n + 1) * k] < 0;
    return count;
}

/* A shift that leaves a pivot too small, because it meets an eigenvalue, is enlarged, up to the size of
 * the scaled matrix. */
static bool factor_tile(const drape_front_factors *f, bool last, int32_t width, double *tile, int32_t at)
{
    double kept[DRAPE_TILE];
    double least = f->shift > 0 && !last ? f->shift : DRAPE_SINGULAR;
    const size_t size = (size_t)(S * width) * sizeof *tile; /* the last tile of a panel ends there */
    memcpy(kept, tile, size);
    double smallest = drape_tile_lu(width, tile, f->inverse + at, f->pivot + at);
    for (double shift = 2 * f->shift; shift > 0 && shift < 1 && !last && !(smallest > least); shift *= 4) {
        memcpy(tile, kept, size);
        for (int32_t c = 0; c < width; c++)
            tile[(S + 1) * c] += shift;
        smallest = drape_tile_lu(width, tile, f->inverse + at, f->pivot + at);
    }
    return smallest > least;
}

/* ---- A front ---- */

/* Finishes the columns being factored in one strip below their diagonal tile: subtracts the products with
 * the earlier columns, then divides the lower half by the diagonal tile. */
static void finish_strip(void *user, int64_t task)
{
    const strip_job *strips = user;
    const drape_front_job *w = strips->of;
    const drape_front_factors *f = w->user;
    const int32_t first = strips->first, width = strips->width, diagonal = first / S;
    const int64_t strip = diagonal + 1 + task;
    const double *diagonal_row = drape_front_strip(w, DRAPE_LOWER, diagonal);
    double *row = drape_front_strip(w, DRAPE_LOWER, strip);
    drape_tile_multiply(row, drape_front_strip(w, other_half(f), diagonal), first, width, false,
                        row + S * first);
    if (is_cholesky(f)) {
        drape_tile_divide(width, diagonal_row + S * first, f->inverse + strips->at, row + S * first);
        return;
    }
    double *column = drape_front_strip(w, DRAPE_UPPER, strip);
    if (f->symmetric)
        memcpy(column + S * first, row + S * first, (size_t)(S * width) * sizeof *column);
    else
        drape_tile_multiply(column, diagonal_row, first, width, false, column + S * first);
    drape_tile_lu_divide(width, diagonal_row + S * first, f->inverse + strips->at, f->pivot + strips->at,
                         row + S * first);
}

/* Computes one column of tiles of the update, over chunks of the factored columns. */
static void compute_update_column(void *user, int64_t task)
{
    const drape_front_job *w = user;
    const drape_front_factors *factors = w->user;
    const drape_front *f = w->f;
    const int32_t c = (int32_t)task;
    for (int32_t p = 0; p < f->columns && !drape_fronts_cancelled(w->s); p += CHUNK) {
        const int depth = f->columns - p < CHUNK ? f->columns - p : CHUNK;
        for (int half = 0; half < (factors->symmetric ? 1 : 2); half++) {
            const drape_half other = half == DRAPE_LOWER ? other_half(factors) : DRAPE_LOWER;
            for (int32_t r = c; r < f->row_strips; r++)
                drape_tile_multiply(drape_front_strip(w, half, f->column_strips + r) + S * p,
                                    drape_front_strip(w, other, f->column_strips + c) + S * p, depth, S,
                                    p == 0, w->update[half] + drape_front_tile_at(f, r, c));
        }
    }
}

static bool factor_front(drape_front_job *w)
{
    const drape_front_factors *factors = w->user;
    drape_front_assemble(w, DRAPE_LOWER);
    if (!factors->symmetric)
        drape_front_assemble(w, DRAPE_UPPER);
    const drape_front *f = w->f;
    for (int32_t first = 0; first < f->columns && !drape_fronts_cancelled(w->s); first += S) {
        const int32_t diagonal = first / S, width = f->columns - first < S ? f->columns - first : S;
        const strip_job strips = {w, first, width, 3 * w->s->e.first[w->index] + first};
        const bool last = f->rows == 0 && first + width == f->columns;
        double *row = drape_front_strip(w, DRAPE_LOWER, diagonal), *tile = row + S * first;
        if (!is_cholesky(factors))
            fill_tile(w, factors->symmetric, first, width);
        drape_tile_multiply(row, drape_front_strip(w, other_half(factors), diagonal), first, width, false,
                            tile);
        if (factors->negative)
            factors->negative[w->index] += count_negative(tile, width);
        if (!(is_cholesky(factors) ? drape_tile_factor(width, tile, factors->inverse + strips.at)
                                   : factor_tile(factors, last, width, tile, strips.at)))
            return false;
        drape_parallel(w->pool, f->column_strips + f->row_strips - diagonal - 1, finish_strip,
                       (void *)(uintptr_t)&strips);
    }
    drape_parallel(w->pool, w->f->row_strips, compute_update_column, w);
    drape_front_extend_add(w, DRAPE_LOWER);
    if (!factors->symmetric)
        drape_front_extend_add(w, DRAPE_UPPER);
    return true;
}

/* ---- All fronts ---- */

drape_status drape_front_factors_create(drape_arena *arena, drape_fronts *s, bool cholesky,
                                        drape_front_factors *f)
{
    const size_t n = (size_t)s->pattern->n;
    *f = (drape_front_factors){.s = s, .symmetric = cholesky};
    f->inverse = drape_arena_take(arena, n, sizeof *f->inverse);
    if (!cholesky)
        f->pivot = drape_arena_take(arena, n, sizeof *f->pivot);
    return drape_arena_status(arena);
}

drape_status drape_front_factors_make(drape_front_factors *f)
{
    if (f->negative)
        memset(f->negative, 0, (size_t)f->s->e.count * sizeof *f->negative);
    return drape_fronts_factor(f->s, factor_front, f);
}

void drape_front_factors_range(const drape_front_factors *f, double *low, double *high)
{
    *low = INFINITY;
    *high = 0;
    for (int64_t k = 0; k < f->s->pattern->n; k++) {
        *low = fmin(*low, fabs(f->inverse[k]));
        *high = fmax(*high, fabs(f->inverse[k]));
    }
}

/* ---- Solution ---- */

/* A front and the parts of the solution that it works on. */
typedef struct part {
    const drape_front *f;
    int32_t at; /* its first column, counted over all fronts */
    const double *panel[DRAPE_HALVES];
    const int32_t *row;   /* (f->rows / 3) */
    double *left;         /* (f->rows) what it passes to its parent */
    double *x, *y, *sums; /* of its columns; of its rows; four partial sums for each column */
} part;

/* The scratch belongs to the front's branch, or to the top. */
static part part_of(drape_fronts *s, int32_t i)
{
    const drape_front *f = &s->front[i];
    const int32_t place = f->branch < 0 ? s->branch_count : f->branch;
    double *x = s->scratch + (int64_t)place * drape_fronts_scratch(s), *y = x + s->widest,
           *sums = y + s->tallest;
    memset(x, 0, (size_t)S * (size_t)f->column_strips * sizeof *x);
    memcpy(x, s->work + 3 * s->e.first[i], (size_t)f->columns * sizeof *x);
    memset(y, 0, (size_t)S * (size_t)f->row_strips * sizeof *y);
    return (part){.f = f,
                  .at = 3 * s->e.first[i],
                  .panel = {s->panels[DRAPE_LOWER] + f->panel,
                            s->panels[DRAPE_UPPER] ? s->panels[DRAPE_UPPER] + f->panel : NULL},
                  .row = s->e.row + s->e.row_start[i],
                  .left = s->left + 3 * s->e.row_start[i],
                  .x = x,
                  .y = y,
                  .sums = sums};
}

/* A strip from column p on. */
static const double *strip_from(const part *w, drape_half half, int64_t strip, int32_t p)
{
    return w->panel[half] + (strip * w->f->columns + p) * S;
}

/* The columns of a diagonal tile. */
static int32_t width_of(const part *w, int32_t strip)
{
    const int32_t rest = w->f->columns - S * strip;
    return rest < S ? rest : S;
}

static void solve_forward(const drape_front_factors *factors, int32_t i)
{
    drape_fronts *s = factors->s;
    const part w = part_of(s, i);
    const drape_front *f = w.f;
    /* Adds what the children passed on to the front's columns and rows. */
    const int32_t columns = w.f->columns / 3;
    for (int32_t child = w.f->first_child; child >= 0; child = s->front[child].sibling)
        for (int64_t k = s->e.row_start[child]; k < s->e.row_start[child + 1]; k++) {
            const int32_t at = s->e.in_parent[k];
            double *to = at < columns ? w.x + 3 * at : w.y + 3 * (at - columns);
            for (int c = 0; c < 3; c++)
                to[c] += s->left[3 * k + c];
        }
    for (int32_t d = 0; d < f->column_strips; d++) {
        double *x = w.x + S * d;
        if (is_cholesky(factors)) /* else L has unit blocks */
            drape_tile_solve(width_of(&w, d), strip_from(&w, DRAPE_LOWER, d, S * d),
                             factors->inverse + w.at + S * d, x);
        for (int32_t k = d + 1; k < f->column_strips; k++)
            drape_strip_times(width_of(&w, d), strip_from(&w, DRAPE_LOWER, k, S * d), x, w.x + S * k);
    }
    memcpy(s->work + w.at, w.x, (size_t)f->columns * sizeof *w.x);
    for (int32_t k = 0; k < f->row_strips; k++)
        drape_strip_times(f->columns, strip_from(&w, DRAPE_LOWER, f->column_strips + k, 0), w.x, w.y + S * k);
    memcpy(w.left, w.y, (size_t)f->rows * sizeof *w.y);
}

static void solve_backward(const drape_front_factors *factors, int32_t i)
{
    drape_fronts *s = factors->s;
    const part w = part_of(s, i);
    const drape_front *f = w.f;
    const drape_half back = other_half(factors);
    for (int32_t k = 0; k < f->rows; k++)
        w.y[k] = s->work[3 * w.row[k / 3] + k % 3];
    memset(w.sums, 0, (size_t)LANES * (size_t)f->columns * sizeof *w.sums);
    for (int32_t k = 0; k < f->row_strips; k++)
        drape_strip_transposed_times(f->columns, strip_from(&w, back, f->column_strips + k, 0), w.y + S * k,
                                     w.sums);
    for (int32_t d = f->column_strips - 1; d >= 0; d--) {
        const int32_t width = width_of(&w, d), at = w.at + S * d;
        const double *tile = strip_from(&w, DRAPE_LOWER, d, S * d);
        double *x = w.x + S * d, *sums = w.sums + LANES * S * d;
        for (int32_t k = d + 1; k < f->column_strips; k++)
            drape_strip_transposed_times(width, strip_from(&w, back, k, S * d), w.x + S * k, sums);
        for (int p = 0; p < width; p++)
            x[p] -= (sums[LANES * p] + sums[LANES * p + 1]) + (sums[LANES * p + 2] + sums[LANES * p + 3]);
        if (is_cholesky(factors))
            drape_tile_solve_transposed(width, tile, factors->inverse + at, x);
        else
            drape_tile_lu_solve(width, tile, factors->inverse + at, factors->pivot + at, x);
    }
    memcpy(s->work + w.at, w.x, (size_t)f->columns * sizeof *w.x);
}

static void forward_branch(void *user, int64_t task)
{
    const drape_front_factors *f = user;
    const int32_t *branch = f->s->branch + 2 * task;
    for (int32_t i = branch[0]; i <= branch[1]; i++)
        solve_forward(f, i);
}

static void backward_branch(void *user, int64_t task)
{
    const drape_front_factors *f = user;
    const int32_t *branch = f->s->branch + 2 * task;
    for (int32_t i = branch[1]; i >= branch[0]; i--)
        solve_backward(f, i);
}

void drape_front_factors_solve(void *factors, const double *b, double *x)
{
    drape_front_factors *f = factors;
    drape_fronts *s = f->s;
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(s->work + 3 * (size_t)k, b + 3 * (size_t)s->e.order[k], 3 * sizeof *b);
    drape_parallel(s->pool, s->branch_count, forward_branch, f);
    for (int32_t k = 0; k < s->top_count; k++)
        solve_forward(f, s->top[k]);
    for (int32_t k = s->top_count - 1; k >= 0; k--)
        solve_backward(f, s->top[k]);
    drape_parallel(s->pool, s->branch_count, backward_branch, f);
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(x + 3 * (size_t)s->e.order[k], s->work + 3 * (size_t)k, 3 * sizeof *x);
}
