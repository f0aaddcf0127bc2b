/* tiles.c: see tiles.h. Every sum adds the same products in the same order on every processor. */
#include "solvers/tiles.h"

#include "base/lanes.h"

#define S     DRAPE_STRIP
#define PARTS (S / LANES)
#define WIDE  3 /* columns computed together */

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
