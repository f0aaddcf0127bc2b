/* render_mesh.h: what frames show of the cloths: the mesh that is simulated or, of a cloth with a render
 * mesh, that one, whose vertices are bound to the triangles of the simulation at rest and follow them. */
#ifndef DRAPE_MODEL_RENDER_MESH_H
#define DRAPE_MODEL_RENDER_MESH_H

#include "mesh/mesh.h"

/* A vertex that a triangle of cloth carries. It is at  sum w_i (x_i + h n_i)  with the normals n_i of the
 * corners, so that neighbouring triangles agree along their edge; flat: at  sum w_i x_i + h n  with the
 * normal of the triangle. The weights sum to 1 and may be outside of [0, 1]. */
typedef struct drape_embedded {
    int32_t triangle, node[3]; /* its number in the model, and its corners */
    double weights[3], height; /* [1], [m] */
    bool flat;
} drape_embedded;

/* Where it is, for nodes at x with normals (node_count x 3; not used if it is flat). */
void drape_embedded_point(const drape_embedded *e, const double *x, const double *normals, double point[3]);

typedef struct drape_render_cloth {
    const char *name;
    const drape_mesh *mesh;
    int32_t first_node, first_triangle;
    const drape_embedded *bound; /* (mesh->node_count); NULL: the mesh is the simulated one */
} drape_render_cloth;

typedef struct drape_render_surface {
    bool bound; /* some cloth has a render mesh */
    int32_t cloth_count, node_count, triangle_count;
    drape_render_cloth *cloths;
    const int32_t *triangle; /* (triangle_count x 3) */
    const double *rest;      /* (node_count x 3) [m] */
} drape_render_surface;

/* Positions of one cloth of the surface, or of all (-1), for nodes at x with normals. */
void drape_render_positions(const drape_model *model, int32_t cloth, const double *x, const double *normals,
                            double *positions);

/* Interpolates values at nodes, `width` numbers each, at the nodes of the surface; within the triangles. */
void drape_render_values(const drape_model *model, const double *values, int width, double *out);

/* The triangle of the simulation that is shown by each one of the surface (triangle_count). */
void drape_render_triangles(const drape_model *model, int32_t *out);

/* Which nodes of the surface (node_count) are pinned: those between nodes that all are. */
void drape_render_pinned(const drape_model *model, uint8_t *out);

#endif
