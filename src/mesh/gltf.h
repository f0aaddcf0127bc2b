/*
 * gltf.h: a glTF 2.0 file in its binary form, GLB: its JSON, and the numbers of its accessors, which are
 * checked against the bytes that are there. glTF 2.0 specification, Khronos Group 2021, sections 3.6 and 4.
 */
#ifndef DRAPE_MESH_GLTF_H
#define DRAPE_MESH_GLTF_H

#include "mesh/mesh.h"

#include <jansson.h>

typedef struct drape_gltf {
    drape_context *ctx;
    const drape_mesh_source *file; /* for messages */
    json_t *root;                  /* an object */
    const char *bytes;             /* of buffer 0 */
    size_t size;
} drape_gltf;

/* Opens the bytes of a file, which must outlive it; drape_gltf_close in any case. Faults are reported as
 * those of a mesh (drape_mesh_fail). The caller has switched to the C locale. Errors: DRAPE_E_PARSE,
 * DRAPE_E_MEMORY. */
drape_status drape_gltf_open(drape_context *ctx, const drape_mesh_source *file, const char *data, size_t size,
                             drape_gltf *out);
void drape_gltf_close(drape_gltf *gltf);

/* How many objects an array of the root has, such as "nodes"; 0 if there is none. */
int32_t drape_gltf_count(const drape_gltf *gltf, const char *array);
const json_t *drape_gltf_item(const drape_gltf *gltf, const char *array, int32_t index);

/* An index of `limit` things that an object has at a key; -1 if it has none. owner names the object in
 * messages. */
drape_status drape_gltf_index(const drape_gltf *gltf, const char *owner, const json_t *object,
                              const char *key, int32_t limit, int32_t *index);
/* The same for a value that must be an index. */
drape_status drape_gltf_index_of(const drape_gltf *gltf, const char *owner, const json_t *value,
                                 int32_t limit, int32_t *index);

/* The numbers of an array of an object; they keep their values if it has none. */
drape_status drape_gltf_numbers(const drape_gltf *gltf, const char *owner, const json_t *object,
                                const char *key, size_t count, double *out);

typedef struct drape_gltf_array {
    int64_t count;
    int width;     /* numbers of each element */
    double *value; /* (count x width) integers that are normalized are within -1 to 1 */
} drape_gltf_array;

/* Reads an accessor into the arena. purpose: what it is, in messages: "POSITION"; type: "VEC3" ...;
 * integer: its numbers must be integers that are not normalized; else they must be floats or normalized
 * integers; expected: count, -1: any. */
typedef struct drape_gltf_want {
    const char *purpose, *type;
    bool integer;
    int64_t expected;
} drape_gltf_want;
drape_status drape_gltf_read(const drape_gltf *gltf, drape_arena *arena, int32_t accessor,
                             const drape_gltf_want *want, drape_gltf_array *out);

#endif
