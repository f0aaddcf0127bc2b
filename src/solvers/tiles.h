/*
 * tiles.h: the dense arithmetic of a front's Cholesky factors. Rows are kept in strips of DRAPE_STRIP: number
 * i of column p of a strip is at [DRAPE_STRIP p + i], so that a strip is read in one go and needs no copy to
 * be multiplied with. A tile is a strip of as many columns as rows. Unused rows are zero.
 */
#ifndef DRAPE_SOLVERS_TILES_H
#define DRAPE_SOLVERS_TILES_H

#include <stdbool.h>
#include <stdint.h>

#define DRAPE_STRIP 12 /* 4 blocks; with three columns nine vectors of four, which fit into the registers */
#define DRAPE_TILE  (DRAPE_STRIP * DRAPE_STRIP)

/* to -= A B' over the first `depth` columns of the strips a and b, in `columns` columns of to: a multiple of
 * 3. fresh: to has been 0, whatever it holds. */
void drape_tile_multiply(const double *a, const double *b, int depth, int columns, bool fresh, double *to);

/* The lower triangle of the first n rows and columns of a tile becomes its Cholesky factor, inverse (n) what
 * its diagonal is divided by; false where it is not positive definite. */
bool drape_tile_factor(int n, double *tile, double *inverse);

/* X = A L^-T in place: n columns of a strip, L a factored tile. */
void drape_tile_divide(int n, const double *tile, const double *inverse, double *strip);

/* y (DRAPE_STRIP) -= strip x over its n columns. */
void drape_strip_times(int n, const double *strip, const double *x, double *y);

/* sums (4 n) += of strip' y, four parts of each of its n columns. */
void drape_strip_transposed_times(int n, const double *strip, const double *y, double *sums);

#endif
