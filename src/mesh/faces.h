/* faces.h: the faces of a mesh as its file has them: polygons with texture coordinates and materials. The
 * simulation knows triangles only; frame formats write these faces again. */
#ifndef DRAPE_MESH_FACES_H
#define DRAPE_MESH_FACES_H

#include "base/arena.h"

struct drape_mesh;
struct drape_mesh_source;

/* All zeros if every face is a triangle without texture coordinates and without a material: then the
 * triangles of the mesh are the faces. Texture coordinates have v upwards, as in OBJ. */
typedef struct drape_faces {
    int32_t count, corner_count, uv_count, material_count;
    int32_t *first;      /* (count + 1) the corners of face i are first[i] ... first[i + 1] - 1 */
    int32_t *node;       /* (corner_count) */
    int32_t *uv_of;      /* (corner_count) -1, at all corners of a face or at none: it has no coordinates */
    double *uv;          /* (uv_count x 2) each pair once */
    int32_t *material;   /* (count) -1: none */
    char **name;         /* (material_count) of the materials */
    char *material_file; /* the file or files that define the materials, as the mesh names them,
                          * one statement a line; NULL: none */
    int32_t *corner;     /* (triangle_count x 3) the corner of a face at each corner of a triangle */
} drape_faces;

/* Takes memory for a mesh whose faces are then filled in: positions, triangles, and all arrays above but the
 * names of materials; no corner has texture coordinates, and no face a material. Each face must get at least
 * 3 corners. Refuses counts above the limits of a mesh. */
drape_status drape_faces_allocate(drape_context *ctx, const struct drape_mesh_source *source, size_t nodes,
                                  size_t faces, size_t corners, size_t uvs, struct drape_mesh *mesh);

/*
 * Divides the faces into triangles, merges equal texture coordinates, and drops what is not needed.
 *
 * Of the two diagonals of a quadrilateral that which leaves both triangles facing the same side is taken; if
 * both do, or none, the shorter one, and if they are alike to a thousandth the one from the first corner, so
 * that grids whose coordinates were rounded are divided regularly. Polygons of up to 256 corners lose ears,
 * that with the shortest diagonal first (Meisters 1975, doi:10.2307/2319703); larger ones become fans around
 * their first corner. Errors: DRAPE_E_MEMORY.
 */
drape_status drape_faces_complete(drape_context *ctx, struct drape_mesh *mesh);

/* Whether two meshes have the same triangles, or were the same faces before these were divided. */
bool drape_faces_same(const struct drape_mesh *a, const struct drape_mesh *b);

/* The vertices of a mesh for rendering: pairs of a node and a texture coordinate, as a vertex has only one.
 * uv is -1 if it has none. In the order of nodes, then of coordinates. */
typedef struct drape_vertices {
    int32_t count;
    int32_t *node, *uv; /* (count) */
    int32_t *at;        /* (triangle_count x 3) the vertex at each corner of a triangle */
} drape_vertices;

/* Finds them; the memory is of the arena. A mesh without faces has its nodes. Errors: DRAPE_E_MEMORY. */
drape_status drape_faces_vertices(drape_arena *arena, const struct drape_mesh *mesh,
                                  drape_vertices *vertices);

#endif
