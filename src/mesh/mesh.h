/* mesh.h: a triangle mesh at rest: nodes, triangles, unique edges, hinges, areas; where meshes come from is a
 * table of grids and one of file formats. */
#ifndef DRAPE_MESH_MESH_H
#define DRAPE_MESH_MESH_H

#include "base/arena.h"
#include "base/registry.h"

/* One mesh. All numbers are 0-based and local to the mesh. */
typedef struct drape_mesh {
    drape_arena arena; /* holds the arrays */
    int32_t node_count, triangle_count, edge_count, hinge_count;
    int32_t rows, columns;  /* of a grid, in nodes: node r * columns + c; 0 on other meshes */
    bool rectangular;       /* a grid whose cells are rectangles before the transform */
    double *x;              /* (node_count x 3) [m] */
    int32_t *triangle;      /* (triangle_count x 3) */
    int32_t *edge;          /* (edge_count x 2) lower node first, ordered by (lower, higher) */
    int32_t *edge_triangle; /* (edge_count x 2) triangles beside the edge, lower first; second -1 on the
                               boundary */
    int32_t *triangle_edge; /* (triangle_count x 3) the edge from corner k to corner k + 1 */
    int32_t *hinge;         /* (hinge_count x 4): x0 x1 the edge, x2 the apex of its first triangle, x3 of its
                               second */
    int32_t *hinge_edge;    /* (hinge_count) in the order of edges */
    double *triangle_area;  /* (triangle_count) [m2] */
    double *edge_length;    /* (edge_count) [m] */
    double *node_area;      /* (node_count) a third of the area of each triangle around it [m2] */
} drape_mesh;

/* With these no count and no number of a corner (3 a triangle) leaves an int32_t. Offsets into arrays are
 * size_t: four nodes a hinge do leave it. */
#define DRAPE_MAX_NODES     (1 << 28)
#define DRAPE_MAX_TRIANGLES (2 * DRAPE_MAX_NODES)

/* Where a mesh came from: the place of its faults. */
typedef struct drape_mesh_source {
    const char *pointer; /* JSON pointer that faults are reported at */
    const char *file;    /* begins the message; NULL: the mesh is not from a file */
} drape_mesh_source;

/* Reports a fault of a mesh. From a file: DRAPE_E_PARSE with "file:line: text", or "file: text" for line 0;
 * else DRAPE_E_ARGUMENT with the text alone. */
drape_status drape_mesh_fail(drape_context *ctx, const drape_mesh_source *source, int64_t line,
                             const char *format, ...) DRAPE_PRINTF(4, 5);

/* A grid: a mesh from parameters alone. Checks counts against DRAPE_MAX_NODES before anything is allocated.
 */
typedef struct drape_grid_ops {
    drape_entry entry;
    /* Fills x, triangle, their counts, rows, columns and rectangular. Faults are reported at pointer or below
     * it. */
    drape_status (*generate)(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh);
} drape_grid_ops;
extern const drape_grid_ops *const drape_grids[]; /* NULL-ended */
extern const drape_registry drape_grid_registry;

/* A file format. */
typedef struct drape_import_ops {
    drape_entry entry;
    const char *ending; /* with its dot: ".obj", any case */
    /* Parses size bytes of data (followed by a 0 byte) into x, triangle and their counts; indices are
     * checked. Polygons become fans. The caller has entered the C locale. */
    drape_status (*read)(drape_context *ctx, const drape_mesh_source *source, const char *data, size_t size,
                         drape_mesh *mesh);
} drape_import_ops;
extern const drape_import_ops *const drape_imports[]; /* NULL-ended */
extern const drape_registry drape_import_registry;

/* The stages of making a mesh, each usable alone on a mesh that began as all zeros. On failure they leave it
 * to be freed by drape_mesh_free. The first three are the sources; pointer names the mesh, and faults are
 * reported at it or at the key below it that is wrong. */
drape_status drape_mesh_from_grid(drape_context *ctx, const char *pointer, const drape_entry_def *grid,
                                  drape_mesh *mesh);
drape_status drape_mesh_from_file(drape_context *ctx, const char *pointer, const char *folder,
                                  const char *file, drape_mesh *mesh);
drape_status drape_mesh_from_arrays(drape_context *ctx, const char *pointer, const double *x,
                                    size_t node_count, const int32_t *triangle, size_t triangle_count,
                                    drape_mesh *mesh);

/* Room for nodes and triangles, all zeros, and their counts; more than the limits above are refused. */
drape_status drape_mesh_allocate(drape_context *ctx, const drape_mesh_source *source, size_t node_count,
                                 size_t triangle_count, drape_mesh *mesh);

/* Scale, then rotate, then translate; faults of the three at pointer/transform/scale and so on. */
drape_status drape_mesh_check_transform(drape_context *ctx, const char *pointer, const double scale[3],
                                        const double rotate[4], const double translate[3]);
/* The matrix of a turn about the axis rotate[0..2], of any length, by the angle rotate[3] [degrees]; exact at
 * right angles. */
void drape_rotation_matrix(const double rotate[4], double matrix[3][3]);
void drape_mesh_transform(drape_mesh *mesh, const double scale[3], const double rotate[4],
                          const double translate[3]);

/* Every position is finite and within 1e9 m. */
drape_status drape_mesh_validate_positions(drape_context *ctx, const drape_mesh_source *source,
                                           const drape_mesh *mesh);

/* Before drape_mesh_connect, of valid positions: there are nodes and triangles; indices are in range; no
 * triangle has a node twice or an altitude below 1e-12 of its longest edge; no two triangles have the same
 * nodes. */
drape_status drape_mesh_validate_triangles(drape_context *ctx, const drape_mesh_source *source,
                                           const drape_mesh *mesh);

/* Edges, edge_triangle, hinges, of valid triangles. Refuses an edge with three triangles. Triangles may be
 * wound either way. */
drape_status drape_mesh_connect(drape_context *ctx, const drape_mesh_source *source, drape_mesh *mesh);

/* After drape_mesh_connect: every node has a triangle, and its triangles are one fan. */
drape_status drape_mesh_validate_nodes(drape_context *ctx, const drape_mesh_source *source,
                                       const drape_mesh *mesh);

/* Areas, lengths, lumped node areas. */
drape_status drape_mesh_measure(drape_mesh *mesh);

/* All of it: source, transform, validate, connect, measure. pointer names the mesh: "/cloth/0/mesh"; folder
 * is the one that a relative file is in, NULL for the working directory. *mesh is overwritten; it is empty on
 * failure. */
drape_status drape_mesh_make(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                             const char *folder, drape_mesh *mesh);
/* Frees what only the building of terms needs: edge_triangle, triangle_edge and the hinges. Their pointers
 * become NULL. */
void drape_mesh_drop_topology(drape_mesh *mesh);

void drape_mesh_free(drape_mesh *mesh); /* leaves it empty; an empty one is fine */

#endif
