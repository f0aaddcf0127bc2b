/*
 * skin.h: the surface of all cloth of a model as it is drawn: smooth normals and tangents by area weighting,
 * texture coordinates, and curved point-normal triangles (Vlachos, Peters, Boyd & Mitchell 2001) through the nodes,
 * so that a coarse mesh has a smooth outline and enough points to be displaced. Nodes are drawn where they are.
 */
#ifndef DRAPE_RENDER_SKIN_H
#define DRAPE_RENDER_SKIN_H

#include "model/model.h"

/* What the GPU gets of a point. */
typedef struct drape_skin_vertex {
    float p[3], n[3], t[3]; /* position [m], normal, tangent along u */
    float uv[2];            /* one unit is the longer side of the cloth; u to the right seen from the front */
    float value;            /* of the field that is shown */
    float cloth;            /* number of its cloth */
} drape_skin_vertex;

typedef struct drape_skin {
    drape_context *ctx;
    const drape_model *model;
    int level; /* pieces of an edge */
    int32_t
        *triangle_edge; /* (triangle_count x 3) edge from corner k to k + 1; -1 - e: it runs the other way */
    float *uv;          /* (node_count x 2) */
    float *normal, *tangent;   /* (node_count x 3) */
    float *cloth;              /* (node_count) */
    drape_skin_vertex *vertex; /* (vertex_count): the nodes, the edges' points, the triangles' points */
    uint32_t *index;           /* (index_count) */
    size_t vertex_count, index_count;
    float *segment; /* (segment_count x 6): the pieces of the mesh's edges, for wires */
    size_t segment_count;
} drape_skin;

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_skin_create(drape_context *ctx, const drape_model *model, drape_skin *skin);
void drape_skin_free(drape_skin *skin); /* an empty one is fine */

/* positions (node_count x 3) [m]; values (node_count), NULL: 0. */
void drape_skin_fit(drape_skin *skin, const float *positions, const float *values);

/* Makes the segments of the present surface. */
void drape_skin_wire(drape_skin *skin);

#endif
