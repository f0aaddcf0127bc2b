/*
 * skin.h: the surface of all cloth of a model as it is drawn: smooth normals and tangents weighted by area,
 * texture coordinates, and curved point-normal triangles (Vlachos, Peters, Boyd & Mitchell 2001) through the
 * nodes, so that a coarse mesh has a smooth outline and enough points to be displaced. Nodes are drawn where
 * they are.
 */
#ifndef DRAPE_RENDER_SKIN_H
#define DRAPE_RENDER_SKIN_H

#include "base/arena.h"
#include "model/model.h"

/* A vertex as the GPU gets it. */
typedef struct drape_skin_vertex {
    float p[3], n[3], t[3]; /* position [m], normal, tangent along u */
    float uv[2];            /* 1 is the longer side of the cloth; u grows to the right seen from the front */
    float value;            /* of the field shown */
    float cloth;            /* number of its cloth */
} drape_skin_vertex;

typedef struct drape_skin {
    const drape_model *model;
    int level;               /* pieces of an edge */
    int32_t *triangle_edge;  /* (triangle_count x 3) edge e from corner k to k + 1; -1 - e if e is reversed */
    float *uv;               /* (node_count x 2) */
    float *normal, *tangent; /* (node_count x 3) */
    float *cloth;            /* (node_count) */
    drape_skin_vertex *vertex; /* (vertex_count) nodes, then points of edges, then of triangles */
    uint32_t *index;           /* (index_count) */
    size_t vertex_count, index_count;
    float *segment; /* (segment_count x 6) both ends of each piece of the mesh's edges, for wires */
    size_t segment_count;
} drape_skin;

/* Makes the skin in an arena. Errors: DRAPE_E_MEMORY. */
drape_status drape_skin_create(drape_arena *arena, const drape_model *model, drape_skin *skin);

/* Computes the vertices at positions (node_count x 3) [m], with values (node_count); NULL: 0. */
void drape_skin_update(drape_skin *skin, const float *positions, const float *values);

/* Computes the segments from the vertices. */
void drape_skin_update_segments(drape_skin *skin);

#endif
