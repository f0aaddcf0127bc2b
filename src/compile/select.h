/* select.h: the nodes of a cloth that a part of the scene, such as a pin, selects. */
#ifndef DRAPE_COMPILE_SELECT_H
#define DRAPE_COMPILE_SELECT_H

#include "mesh/mesh.h"
#include "model/scene.h"

/* Takes a node of the cloth. key: where in the scene it was selected, "nodes/3". */
typedef drape_status drape_select_take(void *user, const char *key, int32_t local);

/* Exactly one of nodes, corner, edge, row (>= 0) and has_box, as in drape_pin_def. */
typedef struct drape_selection {
    drape_context *ctx;
    const char *pointer; /* of the object whose keys these are */
    const drape_scene_object *form;
    const drape_mesh *mesh;
    const int32_t *nodes;
    size_t node_count;
    const char *corner, *edge;
    int32_t row;
    bool has_box;
    const double *box_min, *box_max;
    const uint8_t
        *taken; /* (nodes of the mesh) 1: take has taken it. Then nodes between these are taken, too,
                             if the mesh is subdivided. NULL: only nodes that its source has */
    drape_select_take *take;
    void *user;
} drape_selection;

/* The members of a selection that a def has: that of a pin, a mass, a side of a seam or an edge. */
#define DRAPE_SELECTED_BY(def)                                                                               \
    .nodes = (def)->nodes, .node_count = (def)->node_count, .corner = (def)->corner, .edge = (def)->edge,    \
    .row = (def)->row, .has_box = (def)->has_box, .box_min = (def)->box_min, .box_max = (def)->box_max

/* Takes each selected node: of a list in its order, else in ascending order. Errors: DRAPE_E_ARGUMENT (a node
 * that is not in the mesh, nothing selected, or by more than one key), those of take. */
drape_status drape_select_nodes(const drape_selection *selection);

/* A node at a coordinate along an axis, and the order of these, for qsort: by coordinate, then by node. */
typedef struct drape_node_along {
    double along;
    int32_t node;
} drape_node_along;
int drape_compare_along(const void *a, const void *b);

#endif
