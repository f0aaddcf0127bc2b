/* npy_array.h: reads the NPY format, versions 1 to 3 (numpy.lib.format; NEP 1): its header, and arrays of
 * float32 or float64 of one to three dimensions, in C order, little endian. */
#ifndef DRAPE_MESH_NPY_ARRAY_H
#define DRAPE_MESH_NPY_ARRAY_H

#include "mesh/mesh.h"

#define DRAPE_NPY_DIMS 8 /* that are read; an array of more is not described */

/* What the header of an NPY file, version 1 to 3, says. */
typedef struct drape_npy {
    char type[16]; /* as numpy writes it: "<f8" is float64, little endian */
    bool fortran;  /* the first index runs fastest */
    int dims;
    int64_t shape[DRAPE_NPY_DIMS];
    size_t data; /* where the numbers begin [bytes] */
} drape_npy;

/* Reads it from the first bytes of a file. Returns whether they begin such a file. */
bool drape_npy_read(const char *bytes, size_t size, drape_npy *header);

typedef struct drape_npy_array {
    int dimensions;   /* 1 to 3 */
    int64_t shape[3]; /* those behind the last are 1 */
    int item;         /* bytes of a number: 4 or 8 */
    const char *data; /* as many numbers as the shape says */
} drape_npy_array;

/* Parses the bytes of a file, which must outlive the array. Faults are reported as those of a mesh
 * (drape_mesh_fail). */
drape_status drape_npy_array_parse(drape_context *ctx, const drape_mesh_source *source, const char *data,
                                   size_t size, drape_npy_array *out);

double drape_npy_array_at(const drape_npy_array *array, size_t index);

/* A little-endian float32, float64 or unsigned integer of 4 bytes. */
double drape_bytes_float32(const char *bytes);
double drape_bytes_float64(const char *bytes);
uint32_t drape_bytes_word(const char *bytes);

#endif
