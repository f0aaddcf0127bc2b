/*
 * export_glb.c: folder/positions.glb: binary glTF 2.0. The mesh, all cloths in one, is the first frame.
 * Each later frame is a morph target: its displacements in float32, with normals. An animation of the
 * targets' weights plays them: at the time of frame k weight k - 1 is 1 and the others are 0; between two
 * times they are interpolated linearly, as positions are.
 *
 *     header                  12 bytes
 *     JSON chunk              8 bytes and JSON of a fixed length, with blanks for what is not known yet
 *     binary chunk            8 bytes, triangles, texture coordinates, positions and normals of the first
 *                             frame, the differences of the others, and at the end, when all frames are
 *                             known, times and weights
 *
 * The mesh has a primitive for each material that the files of the cloths name; all of them share the
 * vertices. Each collider is a node of its own: one that is rigid has a mesh in its own coordinates and,
 * if it moves, an animated translation and rotation; one that deforms has morph targets, as the cloth does.
 * A node of the cloth has several vertices where texture coordinates have a seam. Texture coordinates have v
 * downwards, unlike OBJ.
 *
 * The displacements of a frame are complete in the file before its few numbers are written into their
 * blanks: a run that is killed leaves a valid file with all frames as morph targets, but without the
 * animation. The animation comes last because the weights are a matrix, frames x targets.
 *
 * glTF has y up and metres, like Drape. Specification: Khronos, glTF 2.0, 3.6.2 (accessors), 3.7.2.2 (morph
 * targets), 3.11 (animations), 4.4 (GLB).
 */
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/rotation.h"
#include "base/vec3.h"
#include "io/export.h"
#include "io/json.h"
#include "mesh/gltf.h"
#include "model/model.h"
#include "model/normals.h"

#define FILE_NAME      "positions.glb"
#define JSON_OFFSET    (DRAPE_GLTF_HEADER + DRAPE_GLTF_CHUNK)
#define MAX_FRAMES     16384                  /* their weights take 1 GiB */
#define MAX_BYTES      (UINT32_MAX - 65535.0) /* lengths have 32 bits */
#define SURFACE_BYTES  3e5                    /* of a collider without triangles of its own */
#define POSE_SIZE      256                    /* ,"translation":[...],"rotation":[...] */
#define CHANNEL_SIZE   128                    /* a channel or a sampler */
#define LIST_HEAD      12                     /* ,"targets":[ and ,"weights":[ */
#define TARGET_WIDTH   36                     /* ,{"POSITION":32769,"NORMAL":32770} */
#define WEIGHT_WIDTH   2                      /* ,0 */
#define LENGTH_WIDTH   10
#define POSITIONS_SIZE 222 /* the accessor of the positions of a frame, with bounds such as -1.17549435e-38 */
#define ACCESSOR_SIZE  322 /* and that of the normals */
#define TIMES_SIZE     320 /* two accessors of the animation */

/* The triangles of one material, or of a collider. */
typedef struct primitive {
    const char *name;      /* of the material; "": faces without one, first in the order of names */
    char *quoted;          /* as a text of JSON */
    uint32_t first, count; /* of the triangles */
    uint32_t filled;       /* those that have their corners already */
    int64_t targets;       /* place of their list in the file */
} primitive;

/* A node of the scene and its mesh: all cloths in one, a collider that deforms, or a rigid one. */
typedef struct object {
    char *name;                      /* as a text of JSON */
    const drape_export_body *body;   /* NULL: the cloths */
    uint32_t first_vertex, vertices; /* among those of all that deform, or of all rigid ones */
    uint32_t first_point, points;    /* of what deforms */
    uint32_t first_primitive, primitives;
    int64_t weights; /* place of their list in the file */
    bool moves;      /* it is rigid, and its pose changes */
    float *pose;     /* (capacity, or 1 if it stays, x 7) translation and rotation of a rigid one */
} object;

/* Places in the file of what is filled in later: its blanks, and the header of the binary chunk. */
typedef struct places {
    int64_t buffer_length, view_length, views, accessors, times, animation, binary;
} places;

typedef struct glb_state {
    const drape_export_def *def;
    drape_file file;
    uint32_t capacity; /* frames that the blanks are enough for */
    uint32_t frames;   /* complete frames in the file */
    places at;
    primitive *primitive;
    uint32_t primitives, triangles;
    object *object; /* the cloths, then colliders that deform, then rigid ones */
    uint32_t objects, deforming;
    uint32_t vertices, rigid_vertices, points, moving;
    uint32_t uv_bytes, rigid_bytes, fixed_bytes, frame_bytes; /* fixed: all that comes before the frames */
    int32_t *node;                                            /* (vertices) the point of each */
    const double **uv; /* (vertices of the cloths) texture coordinates; NULL: no cloth has any */
    uint32_t *corner;  /* (triangles x 3) vertices of the object, in the order of the primitives */
    double *normal;    /* (points x 3) normals of the frame */
    float *base[2];    /* (points x 3) positions and normals of the first frame: nodes, points of colliders */
    float *moved[2];   /* (points x 3) their differences from these in the frame; the first one has its own */
    float *times;      /* (capacity) */
} glb_state;

/* ---- Accessors and views ---- */

typedef struct accessor {
    uint32_t view;
    int64_t offset; /* -1: none is written, which means 0 */
    int component, width;
    uint32_t count;
    const float *bounds; /* (width x 2) least and largest; NULL: none are written */
} accessor;

/* Writes an accessor into text (ACCESSOR_SIZE), which it returns. */
static const char *describe(accessor a, char *text)
{
    int used = snprintf(text, ACCESSOR_SIZE, "{\"bufferView\":%u", a.view);
    if (a.offset >= 0)
        used += snprintf(text + used, (size_t)(ACCESSOR_SIZE - used), ",\"byteOffset\":%" PRId64, a.offset);
    used += snprintf(text + used, (size_t)(ACCESSOR_SIZE - used),
                     ",\"componentType\":%d,\"count\":%u,\"type\":\"%s\"", a.component, a.count,
                     drape_gltf_types[a.width]);
    for (int k = 0; a.bounds && k < 2 * a.width; k++) {
        const char *before = k == 0 ? ",\"min\":[" : k == a.width ? "],\"max\":[" : ",";
        used += snprintf(text + used, (size_t)(ACCESSOR_SIZE - used), "%s%.9g", before, a.bounds[k]);
    }
    snprintf(text + used, (size_t)(ACCESSOR_SIZE - used), a.bounds ? "]}" : "}");
    return text;
}

/* Writes the accessors of positions, which have bounds, and of the normals that follow them. */
static void describe_vertices(accessor a, char *positions, char *normals)
{
    describe(a, positions);
    a.offset += 12 * (int64_t)a.count;
    a.bounds = NULL;
    describe(a, normals);
}

/* The number of the accessor of an object's positions in a frame; that of its normals follows. The accessors
 * are in this order: triangles of each primitive, texture coordinates, positions and normals of each rigid
 * object, and for each frame positions and normals of each deforming object. */
static uint32_t accessor_of(const glb_state *glb, uint32_t number, uint32_t frame)
{
    const uint32_t first = glb->primitives + (glb->uv != NULL), rigid = glb->objects - glb->deforming;
    return number >= glb->deforming ? first + 2 * (number - glb->deforming)
                                    : first + 2 * (rigid + frame * glb->deforming + number);
}

/* The number of the view of the rigid objects. The views are in this order: triangles, frames, texture
 * coordinates, rigid objects, and the animation. */
static uint32_t rigid_view(const glb_state *glb)
{
    return 2 + (glb->uv != NULL);
}

static void find_bounds(const float *value, size_t stride, size_t count, float bounds[6])
{
    for (int k = 0; k < 3; k++) {
        bounds[k] = FLT_MAX;
        bounds[3 + k] = -FLT_MAX;
    }
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++) {
            bounds[k] = fminf(bounds[k], value[stride * i + k]);
            bounds[3 + k] = fmaxf(bounds[3 + k], value[stride * i + k]);
        }
}

/* ---- Vertices and primitives ---- */

/* A text of JSON; quotes around it. */
static char *quote(drape_arena *arena, const char *name)
{
    json_t *text = drape_json_text(name);
    char *dumped = text ? json_dumps(text, JSON_ENCODE_ANY) : NULL;
    json_decref(text);
    char *out = dumped ? drape_arena_text(arena, dumped) : NULL;
    if (!dumped)
        drape_fail(arena->ctx, DRAPE_E_MEMORY, "not enough memory for the name of a material");
    free(dumped);
    return out;
}

/* The triangles of a mesh whose faces have this material (-1: none), and the vertices at their corners.
 * Returns their number. at: the vertex at each corner of a triangle of the mesh; NULL: they are counted. */
static uint32_t find_triangles(const drape_mesh *mesh, int32_t material, const int32_t *at,
                               uint32_t first_vertex, uint32_t *corner)
{
    const drape_faces *faces = &mesh->faces;
    const int32_t face_count = faces->count > 0 ? faces->count : mesh->triangle_count;
    uint32_t found = 0, passed = 0;
    for (int32_t f = 0; f < face_count; f++) {
        const uint32_t n = faces->count > 0 ? (uint32_t)(faces->first[f + 1] - faces->first[f] - 2) : 1;
        const bool has = (faces->count > 0 ? faces->material[f] : -1) == material;
        for (uint32_t k = 0; at && has && k < 3 * n; k++)
            corner[3 * found + k] = first_vertex + (uint32_t)at[3 * passed + k];
        found += has ? n : 0;
        passed += n;
    }
    return found;
}

/* The primitive of a material of a mesh, which is made if there is none of its name. */
static primitive *primitive_of(glb_state *glb, const drape_faces *faces, int32_t material)
{
    const char *name = material < 0 ? "" : faces->name[material];
    for (uint32_t i = 0; i < glb->primitives; i++)
        if (strcmp(glb->primitive[i].name, name) == 0)
            return &glb->primitive[i];
    glb->primitive[glb->primitives].name = name;
    return &glb->primitive[glb->primitives++];
}

static int compare_names(const void *left, const void *right)
{
    return strcmp(((const primitive *)left)->name, ((const primitive *)right)->name);
}

/* Makes a primitive for each name of a material that triangles have, in the order of the names. */
static drape_status make_primitives(glb_state *glb)
{
    const drape_render_surface *surface = &glb->def->model->surface;
    for (int32_t c = 0; c < surface->cloth_count; c++) {
        const drape_mesh *mesh = surface->cloths[c].mesh;
        for (int32_t m = -1; m < mesh->faces.material_count; m++) {
            const uint32_t count = find_triangles(mesh, m, NULL, 0, NULL);
            if (count > 0)
                primitive_of(glb, &mesh->faces, m)->count += count;
        }
    }
    qsort(glb->primitive, glb->primitives, sizeof *glb->primitive, compare_names);
    for (primitive *p = glb->primitive; p < glb->primitive + glb->primitives; p++) {
        p->first = glb->triangles;
        p->quoted = quote(glb->def->arena, *p->name ? p->name : DRAPE_NO_MATERIAL);
        if (!p->quoted)
            return DRAPE_E_MEMORY;
        glb->triangles += p->count;
    }
    return DRAPE_OK;
}

/* Adds the vertices of a cloth, and its triangles to those of their primitives. */
static drape_status add_cloth(glb_state *glb, const drape_render_cloth *cloth)
{
    const drape_faces *faces = &cloth->mesh->faces;
    drape_arena scratch = drape_arena_of(glb->def->ctx);
    drape_vertices vertices;
    const drape_status status = drape_faces_vertices(&scratch, cloth->mesh, &vertices);
    for (int32_t i = 0; !status && i < vertices.count; i++) {
        const size_t to = (size_t)glb->vertices + (size_t)i;
        glb->node[to] = cloth->first_node + vertices.node[i];
        if (glb->uv)
            glb->uv[to] = vertices.uv[i] < 0 ? NULL : faces->uv + 2 * (size_t)vertices.uv[i];
    }
    for (int32_t m = -1; !status && m < faces->material_count; m++) {
        if (find_triangles(cloth->mesh, m, NULL, 0, NULL) == 0)
            continue;
        primitive *p = primitive_of(glb, faces, m);
        p->filled += find_triangles(cloth->mesh, m, vertices.at, glb->vertices,
                                    glb->corner + 3 * ((size_t)p->first + p->filled));
    }
    glb->vertices += status ? 0 : (uint32_t)vertices.count;
    drape_arena_free(&scratch);
    return status;
}

/* The memory of vertices, triangles, primitives and objects. */
static drape_status take_arrays(glb_state *glb)
{
    const drape_export_def *def = glb->def;
    const drape_render_surface *surface = &def->model->surface;
    size_t nodes = 0, points = 0, primitives = 1, triangles = (size_t)surface->triangle_count;
    bool has_uvs = false;
    for (int32_t c = 0; c < surface->cloth_count; c++) {
        const drape_mesh *mesh = surface->cloths[c].mesh;
        has_uvs = has_uvs || mesh->faces.uv_count > 0;
        nodes += (size_t)(mesh->faces.uv_count > 0 ? 3 * mesh->triangle_count : mesh->node_count);
        primitives += (size_t)mesh->faces.material_count;
    }
    for (int32_t b = 0; b < def->body_count; b++) {
        triangles += (size_t)def->bodies[b].triangle_count;
        points += def->bodies[b].deforms ? (size_t)def->bodies[b].vertex_count : 0;
    }
    glb->primitive =
        drape_arena_take(def->arena, primitives + (size_t)def->body_count, sizeof *glb->primitive);
    glb->object = drape_arena_take(def->arena, (size_t)def->body_count + 1, sizeof *glb->object);
    glb->corner = drape_arena_take(def->arena, triangles, 3 * sizeof *glb->corner);
    glb->node = drape_arena_take(def->arena, nodes + points, sizeof *glb->node);
    if (has_uvs)
        glb->uv = drape_arena_take(def->arena, nodes, sizeof *glb->uv);
    return drape_arena_status(def->arena);
}

/* Adds the rigid colliders as objects, or those that deform, which come first. */
static void add_bodies(glb_state *glb, bool rigid)
{
    const drape_export_def *def = glb->def;
    for (int32_t b = 0; b < def->body_count; b++) {
        const drape_export_body *body = &def->bodies[b];
        const uint32_t vertices = (uint32_t)body->vertex_count, triangles = (uint32_t)body->triangle_count;
        if (body->deforms == rigid)
            continue;
        object *o = &glb->object[glb->objects++];
        *o = (object){.body = body,
                      .first_vertex = rigid ? glb->rigid_vertices : glb->vertices,
                      .vertices = vertices,
                      .first_point = glb->points,
                      .points = rigid ? 0 : vertices,
                      .first_primitive = glb->primitives,
                      .primitives = 1};
        glb->primitive[glb->primitives++] = (primitive){.first = glb->triangles, .count = triangles};
        memcpy(glb->corner + 3 * (size_t)glb->triangles, body->triangle, 12 * (size_t)triangles);
        glb->triangles += triangles;
        glb->rigid_vertices += rigid ? vertices : 0;
        for (uint32_t i = 0; i < o->points; i++)
            glb->node[glb->vertices++] = (int32_t)glb->points++;
        o->moves = body->moves && rigid;
        glb->moving += o->moves;
        if (rigid)
            o->pose = drape_arena_take(def->arena, o->moves ? glb->capacity : 1, 7 * sizeof *o->pose);
    }
}

static drape_status make_objects(glb_state *glb)
{
    const drape_render_surface *surface = &glb->def->model->surface;
    drape_status status = take_arrays(glb);
    if (!status)
        status = make_primitives(glb);
    for (int32_t c = 0; !status && c < surface->cloth_count; c++)
        status = add_cloth(glb, &surface->cloths[c]);
    if (status)
        return status;
    glb->points = (uint32_t)surface->node_count;
    glb->objects = 1;
    glb->object[0] =
        (object){.vertices = glb->vertices, .points = glb->points, .primitives = glb->primitives};
    add_bodies(glb, false);
    glb->deforming = glb->objects;
    add_bodies(glb, true);
    for (uint32_t i = 0; i < glb->objects; i++) {
        glb->object[i].name = quote(glb->def->arena, i ? glb->object[i].body->name : "cloth");
        if (!glb->object[i].name)
            return DRAPE_E_MEMORY;
    }
    glb->uv_bytes = glb->uv ? 8 * glb->object[0].vertices : 0;
    glb->rigid_bytes = 24 * glb->rigid_vertices;
    glb->fixed_bytes = 12 * glb->triangles + glb->uv_bytes + glb->rigid_bytes;
    glb->frame_bytes = 24 * glb->vertices;
    return drape_arena_status(glb->def->arena);
}

/* ---- The beginning of the file ---- */

/* Puts blanks and returns where they begin. */
static int64_t put_blanks(glb_state *glb, size_t count)
{
    const int64_t at = drape_file_end(&glb->file);
    while (count-- > 0)
        drape_file_put(&glb->file, " ", 1);
    return at;
}

/* Puts blanks for a list of texts of one width, each for a frame after the first. */
static int64_t put_list(glb_state *glb, size_t width)
{
    return put_blanks(glb, LIST_HEAD + glb->capacity * width + 1);
}

/* The beginning of an object of an array. name: as a text of JSON, of any length. */
static void put_named(drape_file *file, bool first, const char *name)
{
    drape_file_put_text(file, first ? "{\"name\":" : ",{\"name\":");
    drape_file_put_text(file, name);
}

static void put_views(glb_state *glb)
{
    drape_file *file = &glb->file;
    static const char vertices[] =
        ",{\"buffer\":0,\"byteOffset\":%u,\"byteStride\":%d,\"target\":%d,\"byteLength\":";
    const uint32_t triangle_bytes = 12 * glb->triangles;
    drape_file_print(file, "\"buffers\":[{\"byteLength\":");
    glb->at.buffer_length = put_blanks(glb, LENGTH_WIDTH);
    drape_file_print(file, "}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":%u,\"target\":%d}",
                     triangle_bytes, DRAPE_GLTF_INDICES);
    drape_file_print(file, vertices, glb->fixed_bytes, 12, DRAPE_GLTF_VERTICES);
    glb->at.view_length = put_blanks(glb, LENGTH_WIDTH);
    drape_file_put_text(file, "}");
    if (glb->uv) {
        drape_file_print(file, vertices, triangle_bytes, 8, DRAPE_GLTF_VERTICES);
        drape_file_print(file, "%u}", glb->uv_bytes);
    }
    if (glb->objects > glb->deforming) {
        drape_file_print(file, vertices, triangle_bytes + glb->uv_bytes, 12, DRAPE_GLTF_VERTICES);
        drape_file_print(file, "%u}", glb->rigid_bytes);
    }
    glb->at.views = put_blanks(glb, TIMES_SIZE);
    drape_file_put_text(file, "],");
}

static void put_accessors(glb_state *glb)
{
    drape_file *file = &glb->file;
    char text[ACCESSOR_SIZE], normals[ACCESSOR_SIZE];
    float bounds[6];
    drape_file_print(file, "\"accessors\":[");
    for (uint32_t i = 0; i < glb->primitives; i++) {
        const primitive *p = &glb->primitive[i];
        drape_file_print(file, "%s%s", i ? "," : "",
                         describe((accessor){.offset = p->first ? 12 * (int64_t)p->first : -1,
                                             .component = DRAPE_GLTF_UINT32,
                                             .count = 3 * p->count,
                                             .width = 1},
                                  text));
    }
    if (glb->uv)
        drape_file_print(
            file, ",%s",
            describe((accessor){2, -1, DRAPE_GLTF_FLOAT, 2, glb->object[0].vertices, NULL}, text));
    for (uint32_t i = glb->deforming; i < glb->objects; i++) {
        const object *o = &glb->object[i];
        find_bounds(o->body->vertex, 6, o->vertices, bounds);
        describe_vertices((accessor){rigid_view(glb), 24 * (int64_t)o->first_vertex, DRAPE_GLTF_FLOAT, 3,
                                     o->vertices, bounds},
                          text, normals);
        drape_file_print(file, ",%s,%s", text, normals);
    }
    glb->at.accessors = put_blanks(glb, (size_t)glb->capacity * glb->deforming * ACCESSOR_SIZE);
    glb->at.times = put_blanks(glb, TIMES_SIZE * (1 + (size_t)glb->moving));
    drape_file_put_text(file, "]");
}

static void put_meshes(glb_state *glb)
{
    drape_file *file = &glb->file;
    drape_file_print(file, ",\"meshes\":[");
    for (uint32_t i = 0; i < glb->objects; i++) {
        object *o = &glb->object[i];
        const uint32_t positions = accessor_of(glb, i, 0);
        put_named(file, i == 0, o->name);
        drape_file_put_text(file, ",\"primitives\":[");
        for (uint32_t k = 0; k < o->primitives; k++) {
            drape_file_print(file, "%s{\"attributes\":{\"POSITION\":%u,\"NORMAL\":%u", k ? "," : "",
                             positions, positions + 1);
            if (glb->uv && !o->body)
                drape_file_print(file, ",\"TEXCOORD_0\":%u", glb->primitives);
            drape_file_print(file, "},\"indices\":%u,\"material\":%u", o->first_primitive + k,
                             o->body ? glb->object[0].primitives : k);
            if (i < glb->deforming)
                glb->primitive[o->first_primitive + k].targets = put_list(glb, TARGET_WIDTH);
            drape_file_put_text(file, "}");
        }
        drape_file_put_text(file, "]");
        if (i < glb->deforming)
            o->weights = put_list(glb, WEIGHT_WIDTH);
        drape_file_put_text(file, "}");
    }
    drape_file_put_text(file, "]");
}

/* Puts `count` vectors, which are `stride` numbers apart: number node[i], or i if node is NULL. */
static void put_vectors(glb_state *glb, const float *value, size_t stride, const int32_t *node, size_t count)
{
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++)
            drape_file_put_float(&glb->file, value[stride * (node ? (size_t)node[i] : i) + k]);
}

/* Header and JSON, with blanks for what is not known yet, and what of the binary chunk all frames share.
 * Named materials are those of the artist, to be replaced by name: they are light grey. Rigid nodes are where
 * the first frame has them. */
static void put_head(glb_state *glb)
{
    static const char material[] =
        ",\"doubleSided\":true,\"pbrMetallicRoughness\":{\"baseColorFactor\":[%s,1],"
        "\"metallicFactor\":0,\"roughnessFactor\":0.85}}";
    drape_file *file = &glb->file;
    drape_file_put_text(file, DRAPE_GLTF_MAGIC);
    drape_file_put_word(file, DRAPE_GLTF_VERSION);
    drape_file_put_word(file, 0); /* the length of the file, and that of the JSON */
    drape_file_put_word(file, 0);
    drape_file_put_text(file, DRAPE_GLTF_JSON);
    drape_file_print(file, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Drape %s\"},", drape_version());
    drape_file_put_text(file, "\"scene\":0,\"scenes\":[{\"nodes\":[");
    for (uint32_t i = 0; i < glb->objects; i++)
        drape_file_print(file, "%s%u", i ? "," : "", i);
    drape_file_put_text(file, "]}],\"nodes\":[");
    for (uint32_t i = 0; i < glb->objects; i++) {
        const float *p = glb->object[i].pose;
        put_named(file, i == 0, glb->object[i].name);
        drape_file_print(file, ",\"mesh\":%u", i);
        if (i >= glb->deforming) {
            const int64_t end = drape_file_end(file) + POSE_SIZE;
            drape_file_print(file, ",\"translation\":[%.9g,%.9g,%.9g]", p[0], p[1], p[2]);
            drape_file_print(file, ",\"rotation\":[%.9g,%.9g,%.9g,%.9g]", p[3], p[4], p[5], p[6]);
            put_blanks(glb, (size_t)(end - drape_file_end(file)));
        }
        drape_file_put_text(file, "}");
    }
    drape_file_put_text(file, "],\"materials\":[");
    for (uint32_t p = 0; p < glb->object[0].primitives; p++) {
        put_named(file, p == 0, glb->primitive[p].quoted);
        drape_file_print(file, material, *glb->primitive[p].name ? "0.8,0.8,0.8" : "0.55,0.16,0.13");
    }
    if (glb->def->body_count > 0) {
        put_named(file, false, "\"collider\"");
        drape_file_print(file, material, "0.35,0.37,0.4");
    }
    drape_file_put_text(file, "],");
    put_views(glb);
    put_accessors(glb);
    put_meshes(glb);
    glb->at.animation = put_blanks(glb, (3 + glb->deforming + 4 * (size_t)glb->moving) * CHANNEL_SIZE);
    drape_file_put_text(file, "}");
    put_blanks(glb, 3 - (size_t)(drape_file_end(file) + 3) % 4);
    glb->at.binary = drape_file_end(file);
    drape_file_overwrite_word(file, DRAPE_GLTF_HEADER, (uint32_t)glb->at.binary - JSON_OFFSET);
    drape_file_put_word(file, 0);
    drape_file_put(file, DRAPE_GLTF_BIN, 4); /* with its terminating 0 */
    drape_file_declare(file, 0, (size_t)drape_file_end(file));
    for (size_t i = 0; i < 3 * (size_t)glb->triangles; i++)
        drape_file_put_word(file, glb->corner[i]);
    for (size_t i = 0; glb->uv && i < glb->object[0].vertices; i++) {
        drape_file_put_float(file, glb->uv[i] ? (float)glb->uv[i][0] : 0);
        drape_file_put_float(file, glb->uv[i] ? (float)(1 - glb->uv[i][1]) : 0);
    }
    for (uint32_t i = glb->deforming; i < glb->objects; i++)
        for (size_t part = 0; part < 6; part += 3)
            put_vectors(glb, glb->object[i].body->vertex + part, 6, NULL, glb->object[i].vertices);
}

/* ---- Opening ---- */

/* Bytes of JSON that a frame takes. */
static double frame_json(double objects, double primitives)
{
    return objects * (ACCESSOR_SIZE + WEIGHT_WIDTH) + primitives * TARGET_WIDTH;
}

static drape_status glb_check(drape_context *ctx, const char *pointer, const drape_export_def *def)
{
    const drape_render_surface *surface = &def->model->surface;
    double frames = (double)def->most_frames, vertices = (double)drape_frame_points(def->model);
    double primitives = 1 + def->model->collider_count;
    for (int32_t c = 0; c < surface->cloth_count; c++) {
        const drape_mesh *mesh = surface->cloths[c].mesh;
        /* a seam of the texture coordinates splits a node for each further pair that is used */
        vertices += mesh->faces.uv_count > mesh->node_count ? mesh->faces.uv_count : mesh->node_count;
        primitives += mesh->faces.material_count;
    }
    double bytes = 12.0 * surface->triangle_count + 24 * vertices * frames + 4 * frames * frames +
                   frames * frame_json(1 + def->model->collider_count, primitives);
    for (int32_t i = 0; i < def->model->collider_count; i++)
        bytes += SURFACE_BYTES + 84.0 * def->model->colliders[i].shape.triangle_count + 28 * frames;
    if (frames <= MAX_FRAMES && bytes <= MAX_BYTES)
        return DRAPE_OK;
    return drape_fail_at(
        ctx, DRAPE_E_ARGUMENT, pointer,
        "glb: %.0f frames of %.0f nodes take %.3g bytes; a file has at most %d frames and 4 GiB: "
        "lower the frame rate or take another format",
        frames, vertices, bytes, MAX_FRAMES);
}

static drape_status glb_open(const drape_export_def *def, void *state)
{
    glb_state *glb = state;
    drape_arena *arena = def->arena;
    glb->def = def;
    glb->capacity = (uint32_t)def->most_frames;
    drape_status status = make_objects(glb);
    if (status)
        return status;
    const size_t count = 3 * (size_t)glb->points;
    glb->normal = drape_arena_take(arena, count, sizeof *glb->normal);
    for (int part = 0; part < 2; part++) {
        glb->base[part] = drape_arena_take(arena, count, sizeof **glb->base);
        glb->moved[part] = drape_arena_take(arena, count, sizeof **glb->moved);
    }
    glb->times = drape_arena_take(arena, glb->capacity, sizeof *glb->times);
    status = drape_arena_status(arena);
    return status ? status : drape_export_open(def, FILE_NAME, &glb->file);
}

/* ---- What frames fill in ---- */

static void fill(glb_state *glb, int64_t at, const char *format, ...) DRAPE_PRINTF(3, 4);
static void fill(glb_state *glb, int64_t at, const char *format, ...)
{
    char text[2 * TIMES_SIZE];
    va_list values;
    va_start(values, format);
    const int length = vsnprintf(text, sizeof text, format, values);
    va_end(values);
    drape_file_overwrite(&glb->file, (off_t)at, text, (size_t)length);
}

/* Fills in the item of this frame in a list of the JSON; with the first one also the key and the brackets. */
static void fill_list(glb_state *glb, int64_t list, int64_t width, const char *key, const char *text)
{
    const int64_t target = (int64_t)glb->frames - 1;
    if (target == 0) {
        fill(glb, list + LIST_HEAD + glb->capacity * width, "]");
        fill(glb, list, ",\"%s\":[%s", key, text);
    } else {
        fill(glb, list + LIST_HEAD + target * width, ",%s", text);
    }
}

/* Fills in all lengths as they are with so many frames. */
static void fill_lengths(glb_state *glb, uint32_t frames)
{
    const uint32_t size = (uint32_t)drape_file_end(&glb->file),
                   length = size - (uint32_t)glb->at.binary - DRAPE_GLTF_CHUNK;
    drape_file_overwrite_word(&glb->file, (off_t)glb->at.binary, length);
    drape_file_overwrite_word(&glb->file, DRAPE_GLTF_HEADER - 4, size);
    fill(glb, glb->at.buffer_length, "%*u", LENGTH_WIDTH, length);
    fill(glb, glb->at.view_length, "%*u", LENGTH_WIDTH, frames * glb->frame_bytes);
}

/* ---- Frames ---- */

/* Finds the differences of positions and normals from those of the first frame. A normal is the mean of those
 * of the triangles around a point, weighted by area; upwards if they cancel. */
static void find_differences(glb_state *glb, const drape_frame *frame)
{
    const drape_render_surface *surface = &glb->def->model->surface;
    const size_t numbers = 3 * (size_t)glb->points;
    const double *x = frame->positions;
    memset(glb->normal, 0, numbers * sizeof *glb->normal);
    drape_add_normals(x, surface->triangle, (size_t)surface->triangle_count, glb->normal);
    for (uint32_t i = 1; i < glb->deforming; i++) {
        const object *o = &glb->object[i];
        const size_t first = 3 * (size_t)o->first_point;
        drape_add_normals(x + first, o->body->triangle, (size_t)o->body->triangle_count, glb->normal + first);
    }
    for (double *n = glb->normal; n < glb->normal + numbers; n += 3) {
        const double length = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : k == 1;
    }
    for (size_t i = 0; i < numbers; i++) {
        glb->moved[0][i] = (float)(x[i] - (double)glb->base[0][i]);
        glb->moved[1][i] = (float)(glb->normal[i] - (double)glb->base[1][i]);
    }
}

/* Fills in the accessors of each deforming object for this frame and, after the first frame, its morph target
 * and weight. */
static void fill_frame(glb_state *glb)
{
    for (uint32_t number = 0; number < glb->deforming; number++) {
        const object *o = &glb->object[number];
        const uint32_t positions = accessor_of(glb, number, glb->frames);
        const int64_t at =
            glb->at.accessors + (glb->frames * (int64_t)glb->deforming + number) * ACCESSOR_SIZE;
        float bounds[6];
        char text[ACCESSOR_SIZE], normals[ACCESSOR_SIZE];
        find_bounds(glb->moved[0] + 3 * (size_t)o->first_point, 3, o->points, bounds);
        describe_vertices((accessor){1,
                                     glb->frames * (int64_t)glb->frame_bytes + 24 * (int64_t)o->first_vertex,
                                     DRAPE_GLTF_FLOAT, 3, o->vertices, bounds},
                          text, normals);
        fill(glb, at, ",%s", text);
        fill(glb, at + POSITIONS_SIZE, ",%s", normals);
        if (glb->frames == 0)
            continue;
        snprintf(text, sizeof text, "{\"POSITION\":%u,\"NORMAL\":%u}", positions, positions + 1);
        for (uint32_t i = 0; i < o->primitives; i++)
            fill_list(glb, glb->primitive[o->first_primitive + i].targets, TARGET_WIDTH, "targets", text);
        fill_list(glb, o->weights, WEIGHT_WIDTH, "weights", "0");
    }
}

static void put_frame(glb_state *glb)
{
    for (uint32_t i = 0; i < glb->deforming; i++)
        for (int part = 0; part < 2; part++)
            put_vectors(glb, glb->moved[part], 3, glb->node + glb->object[i].first_vertex,
                        glb->object[i].vertices);
}

/* Keeps translation and rotation of each rigid object in this frame. A rotation is a quaternion x, y, z, w;
 * of its two signs that is taken which is nearer to the frame before. */
static void keep_poses(glb_state *glb, const drape_frame *frame)
{
    for (uint32_t i = glb->deforming; i < glb->objects; i++) {
        const object *o = &glb->object[i];
        const drape_collider_pose *pose = &frame->poses[o->body - glb->def->bodies];
        float *p = o->pose + 7 * (size_t)glb->frames;
        double q[4] = {1, 0, 0, 0}, sign = 1;
        if (!o->moves && glb->frames > 0)
            continue;
        if (pose->turned)
            drape_rotation_quaternion(pose->turn, q);
        if (glb->frames > 0 &&
            q[1] * (double)p[-4] + q[2] * (double)p[-3] + q[3] * (double)p[-2] + q[0] * (double)p[-1] < 0)
            sign = -1;
        for (int k = 0; k < 3; k++) {
            p[k] = (float)pose->displacement[k];
            p[3 + k] = (float)(sign * q[1 + k]);
        }
        p[6] = (float)(sign * q[0]);
    }
}

/* The file appears with its first frame, since a file without positions would not be valid. The times of an
 * animation must strictly increase, in float32. */
static drape_status glb_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    glb_state *glb = state;
    const bool first = glb->frames == 0;
    if (glb->frames == glb->capacity)
        return drape_fail(def->ctx, DRAPE_E_FILE,
                          "\"%.300s/%.200s\" has room for %u frames, those of the scene's duration",
                          drape_folder_path(def->folder), glb->file.path, glb->capacity);
    float *time = &glb->times[glb->frames];
    *time = (float)frame->time;
    if (!first && !(*time > time[-1]))
        *time = nextafterf(time[-1], FLT_MAX);
    keep_poses(glb, frame);
    find_differences(glb, frame);
    if (first)
        put_head(glb);
    put_frame(glb);
    fill_lengths(glb, glb->frames + 1);
    fill_frame(glb);
    for (int part = 0; part < 2 && first; part++)
        memcpy(glb->base[part], glb->moved[part], 3 * (size_t)glb->points * sizeof **glb->base);
    const drape_status status = first ? drape_file_publish(&glb->file) : drape_file_keep(&glb->file);
    if (status && !first)
        fill_lengths(glb, glb->frames); /* of the file as it was cut */
    glb->frames += !status;
    return status;
}

/* ---- Animation and end ---- */

/* Fills in the view and the accessors of times, weights, translations and rotations. */
static void fill_accessors(glb_state *glb)
{
    const uint32_t n = glb->frames, view = rigid_view(glb) + (glb->objects > glb->deforming);
    const float bounds[2] = {glb->times[0], glb->times[n - 1]};
    char first[ACCESSOR_SIZE], second[ACCESSOR_SIZE];
    fill(glb, glb->at.views, ",{\"buffer\":0,\"byteOffset\":%u,\"byteLength\":%u}",
         glb->fixed_bytes + n * glb->frame_bytes, 4 * n * (n + 7 * glb->moving));
    fill(glb, glb->at.times, ",%s,%s", describe((accessor){view, -1, DRAPE_GLTF_FLOAT, 1, n, bounds}, first),
         describe((accessor){view, 4 * (int64_t)n, DRAPE_GLTF_FLOAT, 1, n * (n - 1), NULL}, second));
    for (uint32_t i = 0; i < glb->moving; i++) {
        const int64_t offset = 4 * (int64_t)n * (n + 7 * i);
        fill(glb, glb->at.times + (1 + (int64_t)i) * TIMES_SIZE, ",%s,%s",
             describe((accessor){view, offset, DRAPE_GLTF_FLOAT, 3, n, NULL}, first),
             describe((accessor){view, offset + 12 * n, DRAPE_GLTF_FLOAT, 4, n, NULL}, second));
    }
}

/* Fills in the channels: for the weights of each deforming object, which share one sampler, and for
 * translation and rotation of each rigid object that moves. */
static void fill_channels(glb_state *glb)
{
    const uint32_t times = accessor_of(glb, 0, glb->frames);
    int64_t at = glb->at.animation;
    uint32_t sampler = 1;
    fill(glb, at, ",\"animations\":[{\"name\":\"run\",\"channels\":[");
    at += CHANNEL_SIZE;
    for (uint32_t i = 0; i < glb->deforming; i++, at += CHANNEL_SIZE)
        fill(glb, at, "%s{\"sampler\":0,\"target\":{\"node\":%u,\"path\":\"weights\"}}", i ? "," : "", i);
    for (uint32_t i = glb->deforming; i < glb->objects; i++)
        for (int turns = 0; turns < 2 && glb->object[i].moves; turns++, at += CHANNEL_SIZE)
            fill(glb, at, ",{\"sampler\":%u,\"target\":{\"node\":%u,\"path\":\"%s\"}}", sampler++, i,
                 turns ? "rotation" : "translation");
    fill(glb, at, "],\"samplers\":[");
    at += CHANNEL_SIZE / 2;
    for (uint32_t i = 0; i < sampler; i++, at += CHANNEL_SIZE)
        fill(glb, at, "%s{\"input\":%u,\"interpolation\":\"LINEAR\",\"output\":%u}", i ? "," : "", times,
             times + 1 + i);
    fill(glb, at, "]}]");
}

/* The end of the binary chunk: n times, n (n - 1) weights, and 7 n numbers of each rigid object that moves.
 */
static drape_status glb_close(const drape_export_def *def, void *state)
{
    glb_state *glb = state;
    (void)def;
    if (glb->frames < 2)
        return DRAPE_OK;
    for (uint32_t i = 0; i < glb->frames; i++)
        drape_file_put_float(&glb->file, glb->times[i]);
    for (uint32_t frame = 0; frame < glb->frames; frame++)
        for (uint32_t target = 1; target < glb->frames; target++)
            drape_file_put_float(&glb->file, frame == target);
    for (uint32_t i = 0; i < glb->objects; i++) {
        const object *o = &glb->object[i];
        for (uint32_t k = 0; o->moves && k < 3 * glb->frames; k++)
            drape_file_put_float(&glb->file, o->pose[k / 3 * 7 + k % 3]);
        for (uint32_t k = 0; o->moves && k < 4 * glb->frames; k++)
            drape_file_put_float(&glb->file, o->pose[k / 4 * 7 + 3 + k % 4]);
    }
    fill_lengths(glb, glb->frames);
    fill_accessors(glb);
    fill_channels(glb);
    return drape_file_keep(&glb->file);
}

/* ---- Checkpoints ---- */

static void glb_archive(void *state, drape_archive *a)
{
    glb_state *glb = state;
    int64_t frames = glb->frames;
    drape_archive_int64(a, &frames);
    drape_archive_same(a, "the number of vertices in " FILE_NAME, glb->vertices);
    drape_archive_same(a, "the number of materials in " FILE_NAME, glb->primitives);
    drape_archive_same(a, "the number of colliders that move in " FILE_NAME, glb->moving);
    if (a->reading && (frames < 0 || frames > glb->capacity))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %lld frames of %u", (long long)frames,
                           glb->capacity);
    if (a->status)
        return;
    glb->frames = (uint32_t)frames;
    drape_archive_bytes(a, glb->base[0], 3 * (size_t)glb->points * sizeof **glb->base);
    drape_archive_bytes(a, glb->base[1], 3 * (size_t)glb->points * sizeof **glb->base);
    drape_archive_bytes(a, &glb->at, sizeof glb->at);
    for (uint32_t i = 0; i < glb->primitives; i++)
        drape_archive_int64(a, &glb->primitive[i].targets);
    for (uint32_t i = 0; i < glb->objects; i++) {
        const object *o = &glb->object[i];
        drape_archive_int64(a, &glb->object[i].weights);
        if (o->moves)
            drape_archive_bytes(a, o->pose, glb->frames * 7 * sizeof *o->pose);
    }
    drape_archive_bytes(a, glb->times, glb->frames * sizeof *glb->times);
}

const drape_exporter_ops drape_exporter_glb = {
    .entry = {.name = "glb",
              .summary =
                  "positions.glb: glTF 2.0 with a morph target for each frame, float32, normals, texture "
                  "coordinates, a primitive for each material, and an animation; y up",
              .reference = "Khronos, glTF 2.0 specification, 2021 (ISO/IEC 12113)"},
    .state_size = sizeof(glb_state),
    .y_up = true,
    .wants_bodies = true,
    .names = {FILE_NAME},
    .check = glb_check,
    .open = glb_open,
    .write = glb_write,
    .archive = glb_archive,
    .close = glb_close,
};
