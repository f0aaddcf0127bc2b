/* block_lu.c: see block_lu.h. In the panels, the lower half has L below the diagonal tiles, which are the
 * factored diagonal blocks of U; the upper half has U' below them. */
#include "solvers/block_lu.h"

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
static bool factor_tile(const drape_block_lu *f, bool last, int32_t width, double *tile, int32_t at)
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
    const drape_block_lu *f = w->user;
    const int32_t first = strips->first, width = strips->width, diagonal = first / S;
    const int64_t strip = diagonal + 1 + task;
    double *row = drape_front_strip(w, DRAPE_LOWER, strip),
           *column = drape_front_strip(w, DRAPE_UPPER, strip);
    const double *diagonal_row = drape_front_strip(w, DRAPE_LOWER, diagonal),
                 *diagonal_column = drape_front_strip(w, DRAPE_UPPER, diagonal);
    drape_tile_multiply(row, diagonal_column, first, width, false, row + S * first);
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
    const drape_block_lu *lu = w->user;
    const drape_front *f = w->f;
    const int32_t c = (int32_t)task;
    for (int32_t p = 0; p < f->columns && !drape_fronts_cancelled(w->s); p += CHUNK) {
        const int depth = f->columns - p < CHUNK ? f->columns - p : CHUNK;
        for (int half = 0; half < (lu->symmetric ? 1 : 2); half++)
            for (int32_t r = c; r < f->row_strips; r++)
                drape_tile_multiply(drape_front_strip(w, half, f->column_strips + r) + S * p,
                                    drape_front_strip(w, !half, f->column_strips + c) + S * p, depth, S,
                                    p == 0, w->update[half] + drape_front_tile_at(f, r, c));
    }
}

static bool factor_front(drape_front_job *w)
{
    const drape_block_lu *lu = w->user;
    drape_front_assemble(w, DRAPE_LOWER);
    if (!lu->symmetric)
        drape_front_assemble(w, DRAPE_UPPER);
    const drape_front *f = w->f;
    for (int32_t first = 0; first < f->columns && !drape_fronts_cancelled(w->s); first += S) {
        const int32_t diagonal = first / S, width = f->columns - first < S ? f->columns - first : S;
        const strip_job strips = {w, first, width, 3 * w->s->e.first[w->index] + first};
        const bool last = f->rows == 0 && first + width == f->columns;
        double *tile = drape_front_strip(w, DRAPE_LOWER, diagonal) + S * first;
        fill_tile(w, lu->symmetric, first, width);
        drape_tile_multiply(drape_front_strip(w, DRAPE_LOWER, diagonal),
                            drape_front_strip(w, DRAPE_UPPER, diagonal), first, width, false, tile);
        if (lu->negative)
            lu->negative[w->index] += count_negative(tile, width);
        if (!factor_tile(lu, last, width, tile, strips.at))
            return false;
        drape_parallel(w->pool, f->column_strips + f->row_strips - diagonal - 1, finish_strip,
                       (void *)(uintptr_t)&strips);
    }
    drape_parallel(w->pool, w->f->row_strips, compute_update_column, w);
    drape_front_extend_add(w, DRAPE_LOWER);
    if (!lu->symmetric)
        drape_front_extend_add(w, DRAPE_UPPER);
    return true;
}

/* ---- All fronts ---- */

drape_status drape_block_lu_create(drape_arena *arena, drape_fronts *s, drape_block_lu *f)
{
    const size_t n = (size_t)s->pattern->n;
    *f = (drape_block_lu){.s = s};
    f->inverse = drape_arena_take(arena, n, sizeof *f->inverse);
    f->pivot = drape_arena_take(arena, n, sizeof *f->pivot);
    return drape_arena_status(arena);
}

drape_status drape_block_lu_factor(drape_block_lu *f)
{
    if (f->negative)
        memset(f->negative, 0, (size_t)f->s->e.count * sizeof *f->negative);
    return drape_fronts_factor(f->s, factor_front, f);
}

double drape_block_lu_smallest_pivot(const drape_block_lu *f)
{
    double largest = 0;
    for (int64_t k = 0; k < f->s->pattern->n; k++)
        largest = fmax(largest, fabs(f->inverse[k]));
    return 1 / largest;
}

static void solve_tile_backward(const drape_front_tile_solve *t, void *user)
{
    const drape_block_lu *f = user;
    drape_tile_lu_solve(t->width, t->tile, f->inverse + t->at, f->pivot + t->at, t->x);
}

void drape_block_lu_solve(void *factors, const double *b, double *x)
{
    drape_block_lu *f = factors;
    const drape_front_solver solver = {.back = DRAPE_UPPER, .backward = solve_tile_backward, .user = f};
    drape_fronts_solve(f->s, &solver, b, x);
}
