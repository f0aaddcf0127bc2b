/*
 * gltf_scene.h: the nodes of a glTF file, a tree of transforms, and its first animation, which moves them:
 * where they are at a time. glTF 2.0 specification, sections 3.5, 3.7.3 and 3.11 and appendix C.
 */
#ifndef DRAPE_MESH_GLTF_SCENE_H
#define DRAPE_MESH_GLTF_SCENE_H

#include "mesh/gltf.h"

/* x -> A x + b: the columns of A, then b. */
typedef struct drape_gltf_map {
    double column[4][3];
} drape_gltf_map;

typedef struct drape_gltf_node {
    int32_t parent;     /* -1: none */
    int32_t mesh, skin; /* -1: none */
    bool drawn;         /* it is in the scene */
    bool fixed;         /* it has a matrix: its local map does not change */
    double rest[10];    /* translation, rotation x y z w, scale */
    double now[10];     /* at the time of the last pose */
    double *weight;     /* (weight_count) of morph targets, at rest */
    double *now_weight; /* (weight_count) at the time of the last pose */
    int32_t weight_count;
    drape_gltf_map local, world; /* at the time of the last pose */
} drape_gltf_node;

typedef struct drape_gltf_channel drape_gltf_channel;

typedef struct drape_gltf_scene {
    drape_gltf *gltf;
    drape_gltf_node *nodes;
    int32_t *order; /* (node_count) parents before children */
    int32_t node_count;
    drape_gltf_channel *channels;
    int32_t channel_count;
    double start, end; /* [s] of the animation; 0 and 0 if there is none */
} drape_gltf_scene;

/* Reads nodes and the animation into the arena of the file, whose status says whether that failed. */
void drape_gltf_scene_read(drape_gltf *gltf, drape_gltf_scene *out);

/* Moves the nodes to where they are at a time [s]. */
void drape_gltf_scene_pose(drape_gltf_scene *scene, double t);

void drape_gltf_map_point(const drape_gltf_map *map, const double x[3], double y[3]);
drape_gltf_map drape_gltf_map_product(const drape_gltf_map *a, const drape_gltf_map *b); /* x -> a(b(x)) */

/* Negative: it mirrors. */
double drape_gltf_map_determinant(const drape_gltf_map *map);

/* The map of the 16 numbers of a matrix, column by column, whose last row is 0 0 0 1. */
drape_gltf_map drape_gltf_map_of(const double matrix[16]);

#endif
