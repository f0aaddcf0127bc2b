/*
 * npy.h: the header of an array of positions, frames x nodes x 3, float64, C order, little endian, in the NPY
 * format version 1.0 (numpy.lib.format; NEP 1): magic, version, length of the header, a Python dict padded
 * with blanks so that the data begin at a multiple of 64 bytes.
 */
#ifndef DRAPE_IO_NPY_H
#define DRAPE_IO_NPY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DRAPE_NPY_HEADER 128 /* bytes: the dict takes at most 92, with counts of 19 and 10 digits */

/* Fills the header: of the same length for any number of frames, so that the count can be raised in place. */
void drape_npy_put_header(int64_t frames, int32_t nodes, char header[DRAPE_NPY_HEADER]);

/* Reads the counts from the first bytes of a file, and where its numbers begin [bytes]. Returns whether they
 * are such a header; headers of other lengths are read, too. */
bool drape_npy_read_header(const char *bytes, size_t size, int64_t *frames, int32_t *nodes, size_t *data);

#endif
