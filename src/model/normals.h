/* normals.h: the part of drape_model_normals (drape.h) that other surfaces share. */
#ifndef DRAPE_MODEL_NORMALS_H
#define DRAPE_MODEL_NORMALS_H

#include <stddef.h>
#include <stdint.h>

/* Adds the normals of triangles, twice as long as their areas, to those of their nodes at x. */
void drape_add_normals(const double *x, const int32_t *triangle, size_t count, double *normals);

#endif
