/* tiles.c: see tiles.h. Every sum adds the same products in the same order on every processor. */
#include "solvers/tiles.h"

#define S     DRAPE_STRIP
#define PARTS (S / LANES)
#define WIDE  PARTS /* columns computed together, whose sums fit into the registers */

LANES_INLINE void multiply_columns(const double *a, const double *b, int depth, bool fresh, double *to)
{
    lanes sum[WIDE][PARTS] = {{{0}}};
    for (int p = 0; p < depth; p++, a += S, b += S) {
        const lanes a0 = lanes_load(a), a1 = lanes_load(a + LANES), a2 = lanes_load(a + 2 * LANES);
#pragma GCC unroll 3
        for (int j = 0; j < WIDE; j++) {
            sum[j][0] += a0 * b[j];
            sum[j][1] += a1 * b[j];
            sum[j][2] += a2 * b[j];
        }
    }
#pragma GCC unroll 3
    for (int j = 0; j < WIDE; j++)
#pragma GCC unroll 3
        for (int i = 0; i < PARTS; i++)
            lanes_store(to + S * j + LANES * i,
                        (fresh ? (lanes){0} : lanes_load(to + S * j + LANES * i)) - sum[j][i]);
}
_Static_assert(PARTS == 3, "a column of a strip is three vectors");

LANES_DISPATCH void drape_tile_multiply(const double *a, const double *b, int depth, int columns, bool fresh,
                                        double *to)
{
    for (int j = 0; j < columns; j += WIDE)
        multiply_columns(a, b + j, depth, fresh, to + S * j);
}

LANES_DISPATCH bool drape_tile_factor(int n, double *tile, double *inverse)
{
    for (int j = 0; j < n; j++) {
        double *column = tile + S * j;
        lanes c[PARTS];
        for (int k = 0; k < PARTS; k++)
            c[k] = lanes_load(column + LANES * k);
        for (int p = 0; p < j; p++)
            for (int k = 0; k < PARTS; k++)
                c[k] -= lanes_load(tile + S * p + LANES * k) * tile[S * p + j];
        for (int k = 0; k < PARTS; k++)
            lanes_store(column + LANES * k, c[k]);
        if (!(column[j] > 0))
            return false;
        inverse[j] = 1 / sqrt(column[j]);
        for (int k = 0; k < PARTS; k++)
            lanes_store(column + LANES * k, c[k] * inverse[j]);
    }
    return true;
}

LANES_DISPATCH void drape_tile_divide(int n, const double *tile, const double *inverse, double *strip)
{
    for (int j = 0; j < n; j++) {
        lanes x0 = lanes_load(strip + S * j), x1 = lanes_load(strip + S * j + LANES),
              x2 = lanes_load(strip + S * j + 2 * LANES);
        for (int p = 0; p < j; p++) {
            const double l = tile[S * p + j];
            x0 -= lanes_load(strip + S * p) * l;
            x1 -= lanes_load(strip + S * p + LANES) * l;
            x2 -= lanes_load(strip + S * p + 2 * LANES) * l;
        }
        lanes_store(strip + S * j, x0 * inverse[j]);
        lanes_store(strip + S * j + LANES, x1 * inverse[j]);
        lanes_store(strip + S * j + 2 * LANES, x2 * inverse[j]);
    }
}

void drape_tile_solve(int n, const double *tile, const double *inverse, double *x)
{
    for (int p = 0; p < n; p++) {
        x[p] *= inverse[p];
        for (int q = p + 1; q < n; q++)
            x[q] -= tile[S * p + q] * x[p];
    }
}

void drape_tile_solve_transposed(int n, const double *tile, const double *inverse, double *x)
{
    for (int p = n - 1; p >= 0; p--) {
        for (int q = p + 1; q < n; q++)
            x[p] -= tile[S * p + q] * x[q];
        x[p] *= inverse[p];
    }
}

/* Column by column, from the left: the multipliers above a pivot are zero. */
LANES_DISPATCH double drape_tile_lu(int n, double *tile, double *inverse, int32_t *pivot)
{
    double smallest = INFINITY;
    for (int j = 0; j < n; j++) {
        double *column = tile + S * j, multiplier[S] = {0};
        int k = j;
        for (int i = j + 1; i < n; i++)
            k = fabs(column[i]) > fabs(column[k]) ? i : k;
        pivot[j] = k;
        for (int p = 0; p < n && k != j; p++) {
            const double kept = tile[S * p + j];
            tile[S * p + j] = tile[S * p + k];
            tile[S * p + k] = kept;
        }
        smallest = fabs(column[j]) < smallest ? fabs(column[j]) : smallest;
        inverse[j] = 1 / column[j];
        for (int i = j + 1; i < n; i++)
            column[i] = multiplier[i] = column[i] * inverse[j];
        const lanes m0 = lanes_load(multiplier), m1 = lanes_load(multiplier + LANES),
                    m2 = lanes_load(multiplier + 2 * LANES);
        for (int p = j + 1; p < n; p++) {
            double *to = tile + S * p;
            const double u = to[j];
            lanes_store(to, lanes_load(to) - m0 * u);
            lanes_store(to + LANES, lanes_load(to + LANES) - m1 * u);
            lanes_store(to + 2 * LANES, lanes_load(to + 2 * LANES) - m2 * u);
        }
    }
    return smallest;
}

/* Subtracts columns [begin, end) of a strip, each times its number in column j of the tile, from column j. */
LANES_INLINE void eliminate_column(const double *tile, int j, int begin, int end, double *strip,
                                   double factor)
{
    double *to = strip + S * j;
    lanes x0 = lanes_load(to), x1 = lanes_load(to + LANES), x2 = lanes_load(to + 2 * LANES);
    for (int p = begin; p < end; p++) {
        const double u = tile[S * j + p];
        x0 -= lanes_load(strip + S * p) * u;
        x1 -= lanes_load(strip + S * p + LANES) * u;
        x2 -= lanes_load(strip + S * p + 2 * LANES) * u;
    }
    lanes_store(to, x0 * factor);
    lanes_store(to + LANES, x1 * factor);
    lanes_store(to + 2 * LANES, x2 * factor);
}

LANES_DISPATCH void drape_tile_lu_divide(int n, const double *tile, const double *inverse,
                                         const int32_t *pivot, double *strip)
{
    for (int j = 0; j < n; j++)
        eliminate_column(tile, j, 0, j, strip, inverse[j]);
    for (int j = n - 2; j >= 0; j--)
        eliminate_column(tile, j, j + 1, n, strip, 1);
    for (int j = n - 1; j >= 0; j--)
        for (int i = 0; i < S && pivot[j] != j; i++) {
            const double kept = strip[S * j + i];
            strip[S * j + i] = strip[S * pivot[j] + i];
            strip[S * pivot[j] + i] = kept;
        }
}

void drape_tile_lu_solve(int n, const double *tile, const double *inverse, const int32_t *pivot, double *x)
{
    for (int j = 0; j < n; j++) {
        const double kept = x[j];
        x[j] = x[pivot[j]];
        x[pivot[j]] = kept;
    }
    for (int j = 0; j < n; j++)
        for (int i = j + 1; i < n; i++)
            x[i] -= tile[S * j + i] * x[j];
    for (int j = n - 1; j >= 0; j--) {
        x[j] *= inverse[j];
        for (int i = 0; i < j; i++)
            x[i] -= tile[S * j + i] * x[j];
    }
}

LANES_DISPATCH void drape_strip_times(int n, const double *strip, const double *x, double *y)
{
    lanes y0 = lanes_load(y), y1 = lanes_load(y + LANES), y2 = lanes_load(y + 2 * LANES);
    for (int p = 0; p < n; p++, strip += S) {
        y0 -= lanes_load(strip) * x[p];
        y1 -= lanes_load(strip + LANES) * x[p];
        y2 -= lanes_load(strip + 2 * LANES) * x[p];
    }
    lanes_store(y, y0);
    lanes_store(y + LANES, y1);
    lanes_store(y + 2 * LANES, y2);
}

LANES_DISPATCH void drape_strip_transposed_times(int n, const double *strip, const double *y, double *sums)
{
    const lanes y0 = lanes_load(y), y1 = lanes_load(y + LANES), y2 = lanes_load(y + 2 * LANES);
    for (int p = 0; p < n; p++, strip += S)
        lanes_store(sums + LANES * p, lanes_load(sums + LANES * p) + lanes_load(strip) * y0 +
                                          lanes_load(strip + LANES) * y1 +
                                          lanes_load(strip + 2 * LANES) * y2);
}
