/*
 * skin.h: the surface of all cloth of a model as it is drawn, which is a render mesh where a cloth has one:
 * smooth normals and tangents weighted by area, texture coordinates, and curved point-normal triangles
 * (Vlachos, Peters, Boyd & Mitchell 2001) through the nodes, so that a coarse mesh has a smooth outline and
 * enough points to be displaced. Nodes are drawn where they are. Where a curved triangle would cut a collider
 * that the flat one clears, it is flattened. The border of a cloth has a hem: a tube just inside it, so that
 * cloth is seen to have a thickness.
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
    /* (collider_count) with their shapes at the drawn time; NULL: those of the model */
    const drape_collider *const *collider;
    int level; /* pieces of an edge */

    int32_t node_count, triangle_count, edge_count; /* of the surface */
    const int32_t *triangle;                        /* (triangle_count x 3) */
    const int32_t *edges;    /* (edge_count x 2) lower node first, sorted by (lower, higher) */
    float edge;              /* mean length of the edges at rest [m] */
    int32_t *triangle_edge;  /* (triangle_count x 3) edge e from corner k to k + 1; -1 - e if e is reversed */
    float *uv;               /* (node_count x 2) */
    float *normal, *tangent; /* (node_count x 3) */
    float *cloth;            /* (node_count) */
    drape_skin_vertex *vertex; /* (vertex_count) nodes, then points of edges, then of triangles */
    uint32_t *index;           /* (index_count) */
    size_t vertex_count, index_count;
    float *gap;       /* (node_count) distance from the nearest collider [m] */
    float *roundness; /* (edge_count) of its curve: 1 as curved as normals say, 0 straight */
    float *outward;   /* (node_count x 3) at the border: in the surface, away from the cloth */
    int32_t
        *border; /* (border_count x 2) triangle of each edge at the border, and which of its sides it is */
    size_t border_count;
    drape_skin_vertex *hem; /* (hem_count) */
    uint32_t *hem_index;    /* (hem_index_count) */
    size_t hem_count, hem_index_count;
    float hem_radius; /* [m] */
    float *segment;   /* (segment_count x 6) both ends of each piece of the mesh's edges, for wires */
    size_t segment_count;
} drape_skin;

/* Makes the skin in an arena. Errors: DRAPE_E_MEMORY. */
drape_status drape_skin_create(drape_arena *arena, const drape_model *model, drape_skin *skin);

/* Computes the vertices at positions (node_count x 3) [m] and the time t [s] of the colliders, with values
 * (node_count); NULL: 0. */
void drape_skin_update(drape_skin *skin, double t, const float *positions, const float *values);

/* Computes the hem from the vertices. */
void drape_skin_update_hem(drape_skin *skin);

/* Computes the segments from the vertices. */
void drape_skin_update_segments(drape_skin *skin);

#endif
