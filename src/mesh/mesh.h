/* mesh.h: a triangle mesh at rest: nodes, triangles, unique edges, hinges, areas. Meshes come from a table of
 * grids and a table of file formats. */
#ifndef DRAPE_MESH_MESH_H
#define DRAPE_MESH_MESH_H

#include "base/arena.h"
#include "base/registry.h"
#include "mesh/faces.h"

/* One mesh. All numbers are 0-based and local to the mesh. */
typedef struct drape_mesh {
    drape_arena arena; /* holds the arrays below */
    int32_t node_count, triangle_count, edge_count, hinge_count;
    int32_t rows, columns;    /* of a grid, in nodes: node r * columns + c; 0 on other meshes */
    bool rectangular;         /* a grid whose cells are rectangles before the transform */
    double *x;                /* (node_count x 3) [m] */
    int32_t *triangle;        /* (triangle_count x 3) */
    int32_t *edge;            /* (edge_count x 2) lower node first, sorted by (lower, higher) */
    int32_t *edge_triangle;   /* (edge_count x 2) triangles beside the edge, lower first; second -1 on the
                               boundary */
    int32_t *triangle_edge;   /* (triangle_count x 3) the edge from corner k to corner k + 1 */
    int32_t *hinge;           /* (hinge_count x 4) x0 x1: the edge; x2, x3: the apices of its first and second
                               triangle */
    int32_t *hinge_edge;      /* (hinge_count) in the order of edges */
    double *triangle_area;    /* (triangle_count) [m2] */
    double *edge_length;      /* (edge_count) [m] */
    double *node_area;        /* (node_count) a third of the area of each triangle around it [m2] */
    drape_faces faces;        /* of the file; all zeros: the triangles are all there is */
    int32_t subdivided;       /* so many times */
    struct drape_mesh *given; /* of a subdivided mesh: the counts, triangles and faces of its source, whose
                                 nodes are its first ones, and whose rows and columns it keeps; NULL: it is
                                 not subdivided */
    int32_t *parent; /* ((node_count - given->node_count) x 2) each further node is between these two */
} drape_mesh;

static inline const drape_mesh *drape_mesh_given(const drape_mesh *mesh)
{
    return mesh->given ? mesh->given : mesh;
}

/* These limits keep every count and every corner number (3 per triangle) within int32_t. Offsets into arrays
 * are size_t, because four nodes per hinge exceed it. */
#define DRAPE_MAX_NODES     (1 << 28)
#define DRAPE_MAX_TRIANGLES (2 * DRAPE_MAX_NODES)

/* Where a mesh comes from, for messages about its faults. */
typedef struct drape_mesh_source {
    const char *pointer; /* JSON pointer at which faults are reported */
    const char *file;    /* begins the message; NULL: the mesh is not from a file */
    const char *part;    /* begins the rest of it: "frame 3: "; NULL: nothing */
} drape_mesh_source;

/* Reports a fault of a mesh. For a file: DRAPE_E_PARSE with "file:line: text", or "file: text" if line is 0;
 * otherwise DRAPE_E_ARGUMENT with the text alone. */
drape_status drape_mesh_fail(drape_context *ctx, const drape_mesh_source *source, int64_t line,
                             const char *format, ...) DRAPE_PRINTF(4, 5);

/* A grid: a mesh generated from parameters. Checks counts against DRAPE_MAX_NODES before allocating. */
typedef struct drape_grid_ops {
    drape_entry entry;
    /* Fills x, triangle, their counts, rows, columns and rectangular. Faults are reported at pointer or
     * below. */
    drape_status (*generate)(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh);
} drape_grid_ops;
extern const drape_grid_ops *const drape_grids[]; /* NULL-terminated */
extern const drape_registry drape_grid_registry;

/* A file format. */
typedef struct drape_import_ops {
    drape_entry entry;
    const char *ending; /* extension with its dot: ".obj", in any case */
    /* Parses size bytes of data (followed by a 0 byte) into x, triangle, their counts and faces, and checks
     * indices. The caller has switched to the C locale. */
    drape_status (*read)(drape_context *ctx, const drape_mesh_source *source, const char *data, size_t size,
                         drape_mesh *mesh);
} drape_import_ops;
extern const drape_import_ops *const drape_imports[]; /* NULL-terminated */
extern const drape_registry drape_import_registry;

/* The stages of making a mesh. Each can be used alone, on a mesh that started as all zeros. On failure the
 * mesh must still be freed by drape_mesh_free. The first three functions are the sources; pointer names the
 * mesh, and faults are reported there or at the key below it that is wrong. */
drape_status drape_mesh_from_grid(drape_context *ctx, const char *pointer, const drape_entry_def *grid,
                                  drape_mesh *mesh);
drape_status drape_mesh_from_file(drape_context *ctx, const char *pointer, const char *folder,
                                  const char *file, drape_mesh *mesh);
drape_status drape_mesh_from_arrays(drape_context *ctx, const char *pointer, const double *x,
                                    size_t node_count, const int32_t *triangle, size_t triangle_count,
                                    drape_mesh *mesh);

/* As drape_mesh_from_file, but faults of the file are reported at the pointer itself. */
drape_status drape_mesh_read(drape_context *ctx, const char *pointer, const char *folder, const char *file,
                             drape_mesh *mesh);

/* Allocates nodes and triangles, all zeros, and sets their counts; refuses counts above the limits. */
drape_status drape_mesh_allocate(drape_context *ctx, const drape_mesh_source *source, size_t node_count,
                                 size_t triangle_count, drape_mesh *mesh);

/* Scales, then rotates, then translates. Faults are reported at pointer/transform/scale and so on. */
drape_status drape_mesh_check_transform(drape_context *ctx, const char *pointer, const double scale[3],
                                        const double rotate[4], const double translate[3]);
/* Writes the matrix of a rotation about the axis rotate[0..2], of any length, by the angle rotate[3]
 * [degrees]; exact at right angles. */
void drape_rotation_matrix(const double rotate[4], double matrix[3][3]);
void drape_mesh_transform(drape_mesh *mesh, const double scale[3], const double rotate[4],
                          const double translate[3]);

/* Checks that every position is finite and within 1e9 m. */
drape_status drape_mesh_validate_positions(drape_context *ctx, const drape_mesh_source *source,
                                           const drape_mesh *mesh);

/* Checks that there are nodes and triangles, and that the indices of these are in range. */
drape_status drape_mesh_validate_indices(drape_context *ctx, const drape_mesh_source *source,
                                         const drape_mesh *mesh);

/* To be called before drape_mesh_connect, on valid positions. Checks that there are nodes and triangles, that
 * indices are in range, that no triangle has a node twice or an altitude below 1e-12 of its longest edge, and
 * that no two triangles have the same nodes. */
drape_status drape_mesh_validate_triangles(drape_context *ctx, const drape_mesh_source *source,
                                           const drape_mesh *mesh);

/* The check of altitudes alone, for triangles that are valid at other positions. */
drape_status drape_mesh_validate_shapes(drape_context *ctx, const drape_mesh_source *source,
                                        const drape_mesh *mesh);

/* Finds edges, edge_triangle and hinges of valid triangles. Refuses an edge with three triangles. Triangles
 * may have either orientation. */
drape_status drape_mesh_connect(drape_context *ctx, const drape_mesh_source *source, drape_mesh *mesh);

/* Returns the numbers 0 .. count - 1 in the order of their keys; equal keys keep the order of their numbers.
 * The key of item i is key[i * parts] ... key[i * parts + parts - 1], compared from its first part; each part
 * is in 0 .. limit - 1. The result and the workspace are allocated in the arena. Returns NULL with a message
 * if memory is out. */
int32_t *drape_order_by_keys(drape_arena *arena, const int32_t *key, int parts, int32_t count, int32_t limit);

/* The number of the edge between two nodes, of edges in ascending order; -1: there is none. */
int32_t drape_edge_between(const int32_t *edge, int32_t edge_count, int32_t a, int32_t b);

/* To be called after drape_mesh_connect. Checks that every node has a triangle and that its triangles form
 * one fan. */
drape_status drape_mesh_validate_nodes(drape_context *ctx, const drape_mesh_source *source,
                                       const drape_mesh *mesh);

/* Cuts each triangle of a connected mesh in four similar ones, so many times; the mesh is connected again.
 * The faces of the file are gone. source: for messages. Errors: DRAPE_E_MEMORY, DRAPE_E_ARGUMENT (too many
 * nodes), DRAPE_E_STOPPED. */
drape_status drape_mesh_subdivide(drape_context *ctx, const drape_mesh_source *source, int times,
                                  drape_mesh *mesh);

/* Sets vectors (node_count x 3) of the nodes that the given mesh does not have to the means of their
 * parents. */
void drape_mesh_fill_middles(const drape_mesh *mesh, double *values);

/* Computes areas, lengths and lumped node areas. */
drape_status drape_mesh_measure(drape_mesh *mesh);

/* Source and transform alone, for a mesh that is not simulated: it may have any edges, and nodes without
 * triangles, but has a node and a triangle, and its positions are valid. pointer, folder, *mesh: as below. */
drape_status drape_mesh_place(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                              const char *folder, drape_mesh *mesh);

/* Runs all stages: source, transform, validate, connect, subdivide, measure. pointer names the mesh:
 * "/cloth/0/mesh".
 * folder is the one that a relative file name refers to, NULL for the working directory. *mesh is
 * overwritten; it is empty on failure. */
drape_status drape_mesh_make(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                             const char *folder, drape_mesh *mesh);
/* Frees arrays that only the building of terms needs: edge_triangle, triangle_edge and the hinges. Their
 * pointers become NULL. */
void drape_mesh_drop_topology(drape_mesh *mesh);

void drape_mesh_free(drape_mesh *mesh); /* leaves it empty; an empty mesh is allowed */

#endif
