/*
 * gltf.h: binary glTF 2.0, GLB: the names and numbers of the format, which the reader here and the writer in
 * io/export_glb.c share; a file that is read: its JSON, and the numbers of its accessors, which are checked
 * against the bytes that are there. glTF 2.0 specification, Khronos Group 2021, sections 3.6 and 4.
 */
#ifndef DRAPE_MESH_GLTF_H
#define DRAPE_MESH_GLTF_H

#include "mesh/mesh.h"

#include <jansson.h>

/* The container: a header of 12 bytes, and chunks, each with a header of 8. */
#define DRAPE_GLTF_MAGIC "glTF"
#define DRAPE_GLTF_JSON  "JSON"
#define DRAPE_GLTF_BIN   "BIN" /* and a 0 */
enum { DRAPE_GLTF_VERSION = 2, DRAPE_GLTF_HEADER = 12, DRAPE_GLTF_CHUNK = 8 };

/* Component types of accessors, the mode of primitives that are triangles, and targets of buffer views. */
enum {
    DRAPE_GLTF_TRIANGLES = 4,
    DRAPE_GLTF_INT8 = 5120,
    DRAPE_GLTF_UINT8,
    DRAPE_GLTF_INT16,
    DRAPE_GLTF_UINT16,
    DRAPE_GLTF_UINT32 = 5125,
    DRAPE_GLTF_FLOAT,
    DRAPE_GLTF_VERTICES = 34962,
    DRAPE_GLTF_INDICES
};

/* The type of an accessor whose elements have that many numbers: "VEC3". */
extern const char *const drape_gltf_types[17];

/* The first failure of a reader stays in its status. All functions below may be called after it: they take
 * and report nothing more, and return empty arrays, and indices that are -1 or in range. */
typedef struct drape_gltf {
    drape_arena *arena;            /* of all that is read */
    const drape_mesh_source *file; /* for messages */
    drape_status status;
    json_t *root;      /* an object */
    const char *bytes; /* of buffer 0 */
    size_t size;
} drape_gltf;

/* Reports a fault of the file, as those of a mesh, if it is the first failure. */
#define DRAPE_GLTF_FAIL(g, ...)                                                                              \
    ((g)->status = (g)->status ? (g)->status : drape_mesh_fail((g)->arena->ctx, (g)->file, 0, __VA_ARGS__))

/* Opens the bytes of a file, which must outlive it; arena and file are set, and drape_gltf_close is called in
 * any case. The caller has switched to the C locale. Errors: DRAPE_E_PARSE, DRAPE_E_MEMORY. */
void drape_gltf_open(drape_gltf *gltf, const char *data, size_t size);
void drape_gltf_close(drape_gltf *gltf);

/* Memory of the arena; NULL after a failure. */
void *drape_gltf_take(drape_gltf *gltf, size_t count, size_t size);

/* How many objects an array of the root has, such as "nodes"; 0 if there is none. */
int32_t drape_gltf_count(const drape_gltf *gltf, const char *array);
const json_t *drape_gltf_item(const drape_gltf *gltf, const char *array, int32_t index);

/* An index of `limit` things that an object has at a key; -1 if it has none. owner names the object in
 * messages. */
int32_t drape_gltf_index(drape_gltf *gltf, const char *owner, const json_t *object, const char *key,
                         int32_t limit);
/* The same for a value that must be an index. */
int32_t drape_gltf_index_of(drape_gltf *gltf, const char *owner, const json_t *value, int32_t limit);

/* Refuses numbers that are not finite or beyond 1e9; what: of the owner, in messages. */
#define DRAPE_GLTF_LARGEST 1e9
void drape_gltf_check_finite(drape_gltf *gltf, const char *owner, const char *what, size_t count,
                             const double *number);

/* The numbers of an array of an object, which are finite; they keep their values if it has none. */
void drape_gltf_numbers(drape_gltf *gltf, const char *owner, const json_t *object, const char *key,
                        size_t count, double *out);

typedef struct drape_gltf_array {
    int64_t count;
    int width;     /* numbers of each element */
    double *value; /* (count x width) integers that are normalized are within -1 to 1; NULL: none */
} drape_gltf_array;

/* Reads the accessor that an object has at a key, if it has one. */
typedef struct drape_gltf_want {
    const char *key;
    const char *purpose; /* in messages; NULL: the key */
    int width;
    bool integer;     /* its numbers must be integers that are not normalized; else floats or normalized */
    int64_t expected; /* count; -1: any, and it must have a buffer view */
} drape_gltf_want;
drape_gltf_array drape_gltf_read(drape_gltf *gltf, const char *owner, const json_t *object,
                                 const drape_gltf_want *want);
#define DRAPE_GLTF_READ(gltf, owner, object, ...)                                                            \
    drape_gltf_read(gltf, owner, object, &(drape_gltf_want){__VA_ARGS__})

/* ---- The scene: nodes, and the first animation, which moves them (sections 3.5, 3.7.3 and 3.11) ---- */

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
