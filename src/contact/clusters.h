/*
 * clusters.h: the faces of the cloths in clusters of a few neighbours, each with nodes and edges of its own,
 * and a binary tree over them. Which elements they have follows from the rest shape and does not change.
 */
#ifndef DRAPE_CONTACT_CLUSTERS_H
#define DRAPE_CONTACT_CLUSTERS_H

#include "base/arena.h"
#include "base/lanes.h"
#include "model/model.h"

#define DRAPE_CLUSTER_FACES (3 * LANES) /* at most: whole groups */

typedef enum drape_element_kind {
    DRAPE_ELEMENT_NODE,
    DRAPE_ELEMENT_EDGE,
    DRAPE_ELEMENT_FACE,
    DRAPE_ELEMENT_KINDS
} drape_element_kind;

/* Some neighbouring faces, and the nodes and edges that belong to them, in groups of LANES elements, the last
 * of which is filled up with -1. */
typedef struct drape_cluster {
    int32_t first_group[DRAPE_ELEMENT_KINDS], groups[DRAPE_ELEMENT_KINDS];
    int32_t first_point, points; /* the nodes of all its elements */
    int32_t cloth;
} drape_cluster;

typedef struct drape_cluster_branch {
    int32_t second;  /* the second child; the first one is the next branch; 0: a leaf */
    int32_t cluster; /* of a leaf */
} drape_cluster_branch;

typedef struct drape_clusters {
    const drape_model *model;
    drape_cluster *cluster;
    int32_t count;
    int32_t *element[DRAPE_ELEMENT_KINDS]; /* (groups x LANES) */
    int32_t groups[DRAPE_ELEMENT_KINDS];
    int32_t *point;
    drape_cluster_branch *branches; /* children come after their parent */
    int32_t branch_count;
    int32_t *faces_of_edge; /* (edge_count) how many faces have it */
} drape_clusters;

/* The pairs of children of two branches a <= b, neither of which is within the other unless they are the
 * same: up to four, so that from the root with itself each pair of leaves is reached once. Returns their
 * number, 0 for two leaves. */
static inline int drape_clusters_descend(const drape_clusters *clusters, int32_t a, int32_t b,
                                         int32_t pair[4][2])
{
    const int32_t of_a[2] = {a + 1, clusters->branches[a].second},
                  of_b[2] = {b + 1, clusters->branches[b].second};
    const int first = of_a[1] > 0 ? 2 : 1, second = of_b[1] > 0 ? 2 : 1;
    int count = 0;
    for (int i = 0; first * second > 1 && i < first; i++)
        for (int k = a == b ? i : 0; k < second; k++) {
            pair[count][0] = first > 1 ? of_a[i] : a;
            pair[count++][1] = second > 1 ? of_b[k] : b;
        }
    return count;
}

/* rest: (node_count x 3). Errors: DRAPE_E_MEMORY. */
drape_status drape_clusters_create(drape_arena *arena, const drape_model *model, const double *rest,
                                   drape_clusters *out);

/* The nodes of an element; *node need not be an array of the model. Returns their number. */
static inline int drape_element_nodes(const drape_model *m, drape_element_kind kind, const int32_t *element,
                                      const int32_t **node)
{
    *node = kind == DRAPE_ELEMENT_NODE   ? element
            : kind == DRAPE_ELEMENT_EDGE ? m->edge + 2 * (size_t)*element
                                         : m->triangle + 3 * (size_t)*element;
    return kind == DRAPE_ELEMENT_NODE ? 1 : kind == DRAPE_ELEMENT_EDGE ? 2 : 3;
}

/* The elements, edges or faces, that have each point. */
typedef struct drape_elements_of {
    int32_t *first;   /* (points + 1) where those of a point begin */
    int32_t *element; /* in rising order */
} drape_elements_of;

/* Takes memory for as many elements of this size, and lists those in `point` (count x size). */
drape_status drape_elements_of_create(drape_arena *arena, int32_t count, int size, const int32_t *point,
                                      int32_t points, drape_elements_of *out);

/* The edge, of (edges x 2), between two points; -1: none. */
int32_t drape_elements_of_edge(const drape_elements_of *edges, const int32_t *edge, int32_t a, int32_t b);

#endif
