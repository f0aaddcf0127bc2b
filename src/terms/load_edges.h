/* load_edges.h: the boundary edges that a load acts on. */
#ifndef DRAPE_TERMS_LOAD_EDGES_H
#define DRAPE_TERMS_LOAD_EDGES_H

#include "terms/terms.h"

#include <float.h>

/* By how much coordinates that are meant to be on a side of a box may be beyond it, as a share of their
 * size: what transforms of a mesh leave, some products and sums one after another, each with half an
 * epsilon. */
#define DRAPE_BOX_SLACK (64 * DBL_EPSILON)

/* The parameters that all loads begin with, as a list and among the values, where a box takes three a
 * corner. */
enum { DRAPE_LOAD_LIST_EDGE, DRAPE_LOAD_LIST_BOX_MIN, DRAPE_LOAD_LIST_BOX_MAX, DRAPE_LOAD_LIST_COUNT };
enum {
    DRAPE_LOAD_EDGE,
    DRAPE_LOAD_BOX_MIN,
    DRAPE_LOAD_BOX_MAX = DRAPE_LOAD_BOX_MIN + 3,
    DRAPE_LOAD_COUNT = DRAPE_LOAD_BOX_MAX + 3
};

extern const char *const drape_load_edges[];

/* The number of edges. Refuses a mesh that has none, and one that is not a grid if a side of the grid is
 * given. */
drape_status drape_load_count(const drape_cloth_view *cloth, const double *values,
                              drape_term_builder *builder, int32_t *count);

/* Whether edge e is one of them. */
bool drape_load_takes(const drape_cloth_view *cloth, const double *values, int32_t e);

/* Whether a point lies in a box, boundary and rounding included. */
bool drape_load_in_box(const double *x, const double *low, const double *high);

/* Refuses a mesh with two triangles of opposite orientations beside an edge: a load along normals would push
 * one of them forth and the other one back. */
drape_status drape_load_check_faces(const drape_cloth_view *cloth, drape_term_builder *builder);

#define DRAPE_LOAD_PARAMS                                                                                    \
    [DRAPE_LOAD_LIST_EDGE] =                                                                                 \
        DRAPE_CHOICE("edge", 0, drape_load_edges, "a side of a grid, or all of the boundary"),               \
    [DRAPE_LOAD_LIST_BOX_MIN] = DRAPE_VECTOR(                                                                \
        "box_min", "m", -1e9, -1e9, 1e9,                                                                     \
        "corner of a box; only nodes in it, at rest, are loaded, and edges with both ends in it"),           \
    [DRAPE_LOAD_LIST_BOX_MAX] = DRAPE_VECTOR("box_max", "m", 1e9, -1e9, 1e9, "opposite corner of the box")

#endif
