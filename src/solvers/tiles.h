/*
 * tiles.h: the dense arithmetic of the factors of a front. Rows are stored in strips of
 * DRAPE_STRIP: number i of column p of a strip is at [DRAPE_STRIP p + i], so that a strip is read
 * contiguously and is multiplied without a copy. A tile is a strip with as many columns as rows. Unused
 * rows are zero.
 */
#ifndef DRAPE_SOLVERS_TILES_H
#define DRAPE_SOLVERS_TILES_H

#include "base/lanes.h"

#include <stdbool.h>
#include <stdint.h>

/* 4 blocks; three columns of it are nine vectors, which fit into the registers */
#define DRAPE_STRIP (3 * LANES)
#define DRAPE_TILE  (DRAPE_STRIP * DRAPE_STRIP)

/* to -= A B' over the first `depth` columns of the strips a and b, for `columns` columns of to, a multiple
 * of 3. fresh: to counts as 0, whatever it contains. */
void drape_tile_multiply(const double *a, const double *b, int depth, int columns, bool fresh, double *to);

/* Replaces the lower triangle of the first n rows and columns of a tile by its Cholesky factor; inverse (n)
 * becomes the inverses of its diagonal. False if the tile is not positive definite. */
bool drape_tile_factor(int n, double *tile, double *inverse);

/* X = A L^-T in place, for n columns of a strip; L is a factored tile. */
void drape_tile_divide(int n, const double *tile, const double *inverse, double *strip);

/* x (n) = L^-1 x, and L^-T x. */
void drape_tile_solve(int n, const double *tile, const double *inverse, double *x);
void drape_tile_solve_transposed(int n, const double *tile, const double *inverse, double *x);

/* Replaces the first n rows and columns of a tile T by its factors L U = P T, with row interchanges: row j
 * was exchanged with row pivot[j] (n); inverse (n) becomes the inverses of the diagonal of U. Returns the
 * smallest magnitude on it; if that is 0, there are no factors. */
double drape_tile_lu(int n, double *tile, double *inverse, int32_t *pivot);

/* X = A T^-1 in place, for n columns of a strip; x (n) = T^-1 x. */
void drape_tile_lu_divide(int n, const double *tile, const double *inverse, const int32_t *pivot,
                          double *strip);
void drape_tile_lu_solve(int n, const double *tile, const double *inverse, const int32_t *pivot, double *x);

/* y (DRAPE_STRIP) -= strip x, over the strip's n columns. */
void drape_strip_times(int n, const double *strip, const double *x, double *y);

/* sums (4 n) += strip' y, in four partial sums for each of the n columns. */
void drape_strip_transposed_times(int n, const double *strip, const double *y, double *sums);

#endif
