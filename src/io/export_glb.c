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
 * vertices. A node has several vertices where texture coordinates have a seam. Texture coordinates have v
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

#include "base/vec3.h"
#include "io/export.h"
#include "io/json.h"
#include "model/model.h"

#define FILE_NAME      "positions.glb"
#define JSON_OFFSET    20
#define MAX_FRAMES     16384                  /* their weights take 1 GiB */
#define MAX_BYTES      (UINT32_MAX - 65535.0) /* lengths have 32 bits */
#define FIXED_ROOM     4096                   /* JSON without the parts of each frame */
#define PRIMITIVE_ROOM 512
#define TARGET_WIDTH   36 /* ,{"POSITION":32769,"NORMAL":32770} */
#define WEIGHT_WIDTH   2  /* ,0 */
#define BOUND_WIDTH    17 /* -1.17549435e-38 and a comma */
#define OPEN_WIDTH     11 /* ,"targets":[ and ,"weights":[ */
#define LENGTH_WIDTH   10
#define ACCESSOR_HEAD                                                                                        \
    ",{\"bufferView\":1,\"byteOffset\":%u,\"componentType\":5126,\"count\":%u,\"type\":\"VEC3\","
#define BOUNDS_ROOM   (120 + 6 * BOUND_WIDTH)
#define NORMALS_ROOM  100
#define ACCESSOR_ROOM (BOUNDS_ROOM + NORMALS_ROOM) /* both accessors of a frame */
#define TIMES_ROOM    640

/* The triangles of one material. */
typedef struct primitive {
    char *material; /* its name, as a text of JSON */
    bool is_default;
    uint32_t first, count;                       /* of the triangles */
    size_t targets_open, targets, targets_close; /* blanks in the JSON */
} primitive;

/* Positions of the blanks in the JSON, counted from its beginning. */
typedef struct blanks {
    size_t buffer_length, view_length, views, accessors, times, weights_open, weights, weights_close,
        animation;
} blanks;

typedef struct glb_state {
    const drape_export_def *def;
    drape_file file;
    uint32_t room;   /* number of frames for which there is room */
    uint32_t frames; /* complete frames in the file */
    bool live;       /* the file ends with these frames and can be continued */
    char *json;      /* for the beginning of the file; not used after that is written */
    size_t json_size, used;
    blanks at;
    uint32_t vertices;    /* number of them */
    int32_t *node;        /* (vertices) */
    const double **uv;    /* (vertices) texture coordinates; NULL: no cloth has any */
    uint32_t *corner;     /* (triangles x 3) vertices, in the order of the primitives */
    primitive *primitive; /* (primitives) */
    uint32_t primitives;
    float *base;    /* (node_count x 3) positions of the first frame */
    float *upright; /* (node_count x 3) normals of the first frame */
    double *normal; /* (node_count x 3) normals of the present frame */
    float *times;   /* (room) */
} glb_state;

/* ---- Sizes ---- */

static uint32_t triangle_bytes(const glb_state *glb)
{
    return 12 * (uint32_t)drape_model_triangle_count(glb->def->model);
}

static uint32_t node_bytes(const glb_state *glb)
{
    return 12 * (uint32_t)drape_model_node_count(glb->def->model);
}

static uint32_t uv_bytes(const glb_state *glb)
{
    return glb->uv ? 8 * glb->vertices : 0;
}

/* What comes before the frames. */
static uint32_t fixed_bytes(const glb_state *glb)
{
    return triangle_bytes(glb) + uv_bytes(glb);
}

/* Positions or normals of one frame. */
static uint32_t vertex_bytes(const glb_state *glb)
{
    return 12 * glb->vertices;
}

/* Both. */
static uint32_t frame_bytes(const glb_state *glb)
{
    return 2 * vertex_bytes(glb);
}

/* The accessor of a frame's positions; that of its normals follows. Before those of the first frame are the
 * triangles of each primitive, and the texture coordinates. */
static uint32_t accessor_of(const glb_state *glb, uint32_t frame)
{
    return glb->primitives + (glb->uv != NULL) + 2 * frame;
}

/* ---- Vertices and primitives ---- */

/* A material of one cloth; all cloths share those of the same name. */
typedef struct material {
    const char *name;
    int32_t cloth, number; /* of the cloth; -1: triangles without one */
    uint32_t triangles, primitive;
} material;

static int compare_materials(const void *left, const void *right)
{
    const material *a = left, *b = right;
    const int order = strcmp(a->name, b->name);
    if (order)
        return order;
    return a->cloth != b->cloth ? (a->cloth > b->cloth) - (a->cloth < b->cloth)
                                : (a->number > b->number) - (a->number < b->number);
}

static int compare_places(const void *left, const void *right)
{
    const material *a = left, *b = right;
    return a->cloth != b->cloth ? (a->cloth > b->cloth) - (a->cloth < b->cloth)
                                : (a->number > b->number) - (a->number < b->number);
}

/* Lists the materials of all cloths, those that triangles lack first; first (cloth_count) receives where
 * those of each cloth begin. */
static material *list_materials(drape_arena *scratch, const drape_model *model, size_t *first, size_t *count)
{
    *count = 0;
    for (int32_t c = 0; c < model->cloth_count; c++)
        *count += (size_t)model->cloths[c].mesh.faces.material_count + 1;
    material *list = drape_arena_take(scratch, *count, sizeof *list);
    size_t at = 0;
    for (int32_t c = 0; list && c < model->cloth_count; c++) {
        const drape_faces *faces = &model->cloths[c].mesh.faces;
        first[c] = at;
        for (int32_t m = -1; m < faces->material_count; m++)
            list[at++] = (material){.name = m < 0 ? "" : faces->name[m], .cloth = c, .number = m};
        if (faces->count == 0)
            list[first[c]].triangles = (uint32_t)model->cloths[c].mesh.triangle_count;
        for (int32_t f = 0; f < faces->count; f++)
            list[first[c] + (size_t)(faces->material[f] + 1)].triangles +=
                (uint32_t)(faces->first[f + 1] - faces->first[f] - 2);
    }
    return list;
}

/* A text of JSON; quotes around it. */
static drape_status quote(drape_arena *arena, const char *name, char **out)
{
    json_t *text = drape_json_text(name);
    char *dumped = text ? json_dumps(text, JSON_ENCODE_ANY) : NULL;
    json_decref(text);
    if (!dumped)
        return drape_fail(arena->ctx, DRAPE_E_MEMORY, "not enough memory for the name of a material");
    *out = drape_arena_text(arena, dumped);
    free(dumped);
    return drape_arena_status(arena);
}

/* One for each name that triangles have, in the order of the names; those without one come first. */
static drape_status make_primitives(glb_state *glb, material *list, size_t count)
{
    drape_status status = DRAPE_OK;
    uint32_t triangles = 0;
    qsort(list, count, sizeof *list, compare_materials);
    glb->primitive = drape_arena_take(glb->def->arena, count, sizeof *glb->primitive);
    if (!glb->primitive)
        return DRAPE_E_MEMORY;
    const char *last = NULL;
    for (size_t i = 0; i < count && !status; i++) {
        if (list[i].triangles == 0)
            continue;
        if (!last || strcmp(last, list[i].name) != 0) {
            primitive *p = &glb->primitive[glb->primitives++];
            last = list[i].name;
            p->is_default = !*last;
            p->first = triangles;
            status = quote(glb->def->arena, *last ? last : DRAPE_NO_MATERIAL, &p->material);
        }
        list[i].primitive = glb->primitives - 1;
        glb->primitive[list[i].primitive].count += list[i].triangles;
        triangles += list[i].triangles;
    }
    qsort(list, count, sizeof *list, compare_places);
    return status;
}

/* Puts the triangles of one cloth where their primitives have them; next (primitives): the place of the next
 * triangle of each. */
static void put_corners(glb_state *glb, const drape_cloth *cloth, const material *own,
                        const drape_vertices *vertices, uint32_t *next)
{
    const drape_faces *faces = &cloth->mesh.faces;
    const int32_t *at = vertices->at;
    const int32_t count = faces->count > 0 ? faces->count : cloth->mesh.triangle_count;
    for (int32_t f = 0; f < count; f++) {
        const int32_t triangles = faces->count > 0 ? faces->first[f + 1] - faces->first[f] - 2 : 1;
        const int32_t number = faces->count > 0 ? faces->material[f] : -1;
        uint32_t *to = &next[own[number + 1].primitive];
        for (int32_t k = 0; k < 3 * triangles; k++)
            glb->corner[3 * (size_t)*to + (size_t)k] = glb->vertices + (uint32_t)*at++;
        *to += (uint32_t)triangles;
    }
}

static drape_status add_cloth(glb_state *glb, const drape_cloth *cloth, const material *own, uint32_t *next)
{
    drape_arena scratch = drape_arena_of(glb->def->arena->ctx);
    drape_vertices vertices;
    const drape_status status = drape_faces_vertices(&scratch, &cloth->mesh, &vertices);
    for (int32_t i = 0; !status && i < vertices.count; i++) {
        const size_t to = (size_t)glb->vertices + (size_t)i;
        glb->node[to] = cloth->first_node + vertices.node[i];
        if (glb->uv)
            glb->uv[to] = vertices.uv[i] < 0 ? NULL : cloth->mesh.faces.uv + 2 * (size_t)vertices.uv[i];
    }
    if (!status) {
        put_corners(glb, cloth, own, &vertices, next);
        glb->vertices += (uint32_t)vertices.count;
    }
    drape_arena_free(&scratch);
    return status;
}

static drape_status add_cloths(glb_state *glb, drape_arena *scratch)
{
    const drape_model *model = glb->def->model;
    size_t count, room = 0;
    bool has_uvs = false;
    size_t *first = drape_arena_take(scratch, (size_t)model->cloth_count, sizeof *first);
    material *list = first ? list_materials(scratch, model, first, &count) : NULL;
    drape_status status = list ? make_primitives(glb, list, count) : DRAPE_E_MEMORY;
    if (status)
        return status;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_mesh *mesh = &model->cloths[c].mesh;
        has_uvs = has_uvs || mesh->faces.uv_count > 0;
        room += (size_t)(mesh->faces.uv_count > 0 ? 3 * mesh->triangle_count : mesh->node_count);
    }
    uint32_t *next = drape_arena_take(scratch, glb->primitives, sizeof *next);
    glb->corner = drape_arena_take(glb->def->arena, (size_t)model->triangle_count, 3 * sizeof *glb->corner);
    glb->node = drape_arena_take(glb->def->arena, room, sizeof *glb->node);
    if (has_uvs)
        glb->uv = drape_arena_take(glb->def->arena, room, sizeof *glb->uv);
    if (drape_arena_status(glb->def->arena) || !next)
        return DRAPE_E_MEMORY;
    for (uint32_t p = 0; p < glb->primitives; p++)
        next[p] = glb->primitive[p].first;
    for (int32_t c = 0; c < model->cloth_count && !status; c++)
        status = add_cloth(glb, &model->cloths[c], list + first[c], next);
    return status;
}

static drape_status make_vertices(glb_state *glb)
{
    drape_arena scratch = drape_arena_of(glb->def->arena->ctx);
    const drape_status status = add_cloths(glb, &scratch);
    drape_arena_free(&scratch);
    return status;
}

/* ---- JSON ---- */

static void add(glb_state *glb, const char *format, ...) DRAPE_PRINTF(2, 3);
static void add(glb_state *glb, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    glb->used += (size_t)vsnprintf(glb->json + glb->used, glb->json_size - glb->used, format, values);
    va_end(values);
}

/* Adds blanks and returns where they begin. */
static size_t add_blanks(glb_state *glb, size_t count)
{
    size_t at = glb->used;
    memset(glb->json + at, ' ', count);
    glb->used += count;
    return at;
}

/* Positions and normals of the frames are in view 1. */
static void add_buffers(glb_state *glb)
{
    add(glb, "\"buffers\":[{\"byteLength\":");
    glb->at.buffer_length = add_blanks(glb, LENGTH_WIDTH);
    add(glb, "}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":%" PRIu32 ",\"target\":34963}",
        triangle_bytes(glb));
    add(glb, ",{\"buffer\":0,\"byteOffset\":%" PRIu32 ",\"byteStride\":12,\"target\":34962,\"byteLength\":",
        fixed_bytes(glb));
    glb->at.view_length = add_blanks(glb, LENGTH_WIDTH);
    add(glb, "}");
    if (glb->uv)
        add(glb,
            ",{\"buffer\":0,\"byteOffset\":%" PRIu32
            ",\"byteStride\":8,\"target\":34962,\"byteLength\":%" PRIu32 "}",
            triangle_bytes(glb), uv_bytes(glb));
    glb->at.views = add_blanks(glb, TIMES_ROOM / 2);
    add(glb, "],\"accessors\":[");
    for (uint32_t p = 0; p < glb->primitives; p++) {
        add(glb, "%s{\"bufferView\":0,", p ? "," : "");
        if (p > 0)
            add(glb, "\"byteOffset\":%" PRIu32 ",", 12 * glb->primitive[p].first);
        add(glb, "\"componentType\":5125,\"count\":%" PRIu32 ",\"type\":\"SCALAR\"}",
            3 * glb->primitive[p].count);
    }
    if (glb->uv)
        add(glb, ",{\"bufferView\":2,\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"VEC2\"}",
            glb->vertices);
    glb->at.accessors = add_blanks(glb, (size_t)glb->room * ACCESSOR_ROOM);
    glb->at.times = add_blanks(glb, TIMES_ROOM / 2);
    add(glb, "]");
}

static void add_primitive(glb_state *glb, uint32_t number)
{
    primitive *p = &glb->primitive[number];
    add(glb, "%s{\"attributes\":{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32, number ? "," : "",
        accessor_of(glb, 0), accessor_of(glb, 0) + 1);
    if (glb->uv)
        add(glb, ",\"TEXCOORD_0\":%" PRIu32, glb->primitives);
    add(glb, "},\"indices\":%" PRIu32 ",\"material\":%" PRIu32, number, number);
    p->targets_open = add_blanks(glb, OPEN_WIDTH + 1);
    p->targets = add_blanks(glb, (size_t)glb->room * TARGET_WIDTH);
    p->targets_close = add_blanks(glb, 1);
    add(glb, "}");
}

static void add_mesh(glb_state *glb)
{
    add(glb, ",\"meshes\":[{\"name\":\"cloth\",\"primitives\":[");
    for (uint32_t p = 0; p < glb->primitives; p++)
        add_primitive(glb, p);
    add(glb, "]");
    glb->at.weights_open = add_blanks(glb, OPEN_WIDTH + 1);
    glb->at.weights = add_blanks(glb, (size_t)glb->room * WEIGHT_WIDTH);
    glb->at.weights_close = add_blanks(glb, 1);
    add(glb, "}]");
}

/* Named materials are those of the artist, to be replaced by name: they are white. */
static void add_materials(glb_state *glb)
{
    add(glb, "\"materials\":[");
    for (uint32_t p = 0; p < glb->primitives; p++)
        add(glb,
            "%s{\"name\":%s,\"doubleSided\":true,\"pbrMetallicRoughness\":{\"baseColorFactor\":[%s,1],"
            "\"metallicFactor\":0,\"roughnessFactor\":0.85}}",
            p ? "," : "", glb->primitive[p].material,
            glb->primitive[p].is_default ? "0.55,0.16,0.13" : "0.8,0.8,0.8");
    add(glb, "],");
}

static void make_json(glb_state *glb)
{
    add(glb,
        "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Drape "
        "%s\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"name\":\"cloth\",\"mesh\":0}],",
        drape_version());
    add_materials(glb);
    add_buffers(glb);
    add_mesh(glb);
    glb->at.animation = add_blanks(glb, TIMES_ROOM / 2);
    add(glb, "}");
    add_blanks(glb, 3 - (glb->used + 3) % 4);
    glb->json_size = glb->used;
}

/* ---- Opening ---- */

/* Bytes of JSON for each frame. */
static double frame_room(uint32_t primitives)
{
    return ACCESSOR_ROOM + (double)primitives * TARGET_WIDTH + WEIGHT_WIDTH;
}

static drape_status glb_check(drape_context *ctx, const char *pointer, const drape_export_def *def)
{
    double frames = (double)def->most_frames, vertices = 0, primitives = 1;
    for (int32_t c = 0; c < def->model->cloth_count; c++) {
        const drape_mesh *mesh = &def->model->cloths[c].mesh;
        /* a seam of the texture coordinates splits a node for each further pair that is used */
        vertices += mesh->faces.uv_count > mesh->node_count ? mesh->faces.uv_count : mesh->node_count;
        primitives += mesh->faces.material_count;
    }
    double bytes = 12.0 * drape_model_triangle_count(def->model) + 24 * vertices * frames +
                   4 * frames * frames + frames * frame_room((uint32_t)primitives);
    if (frames <= MAX_FRAMES && bytes <= MAX_BYTES)
        return DRAPE_OK;
    return drape_fail_at(
        ctx, DRAPE_E_ARGUMENT, pointer,
        "glb: %.0f frames of %.0f nodes take %.3g bytes; a file has at most %d frames and 4 GiB: "
        "lower the frame rate or take another format",
        frames, vertices, bytes, MAX_FRAMES);
}

static bool glb_names(const char *name)
{
    return strcmp(name, FILE_NAME) == 0;
}

static drape_status allocate(const drape_export_def *def, glb_state *glb)
{
    drape_arena *arena = def->arena;
    glb->def = def;
    glb->room = (uint32_t)def->most_frames;
    drape_status status = make_vertices(glb);
    if (status)
        return status;
    glb->json_size = FIXED_ROOM + (size_t)glb->room * (size_t)frame_room(glb->primitives);
    for (uint32_t p = 0; p < glb->primitives; p++)
        glb->json_size += PRIMITIVE_ROOM + strlen(glb->primitive[p].material);
    glb->json = drape_arena_take(arena, glb->json_size, 1);
    size_t count = 3 * (size_t)drape_model_node_count(def->model);
    glb->base = drape_arena_take(arena, count, sizeof *glb->base);
    glb->upright = drape_arena_take(arena, count, sizeof *glb->upright);
    glb->normal = drape_arena_take(arena, count, sizeof *glb->normal);
    glb->times = drape_arena_take(arena, glb->room, sizeof *glb->times);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    make_json(glb);
    return DRAPE_OK;
}

static drape_status glb_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    drape_status status = allocate(def, state);
    return status ? status : drape_export_begin(ctx, def->folder, FILE_NAME, &((glb_state *)state)->file);
}

/* ---- Normals and bounds ---- */

/* The mean of the normals of the triangles around each node, weighted by area; upwards if they cancel. */
static void find_normals(glb_state *glb, const double *x)
{
    const drape_model *model = glb->def->model;
    const int32_t *node = drape_model_triangles(model);
    memset(glb->normal, 0, 3 * (size_t)drape_model_node_count(model) * sizeof *glb->normal);
    for (size_t t = 0; t < (size_t)drape_model_triangle_count(model); t++, node += 3) {
        const double *a = x + 3 * (size_t)node[0];
        double ab[3], ac[3], n[3];
        vec3_sub(x + 3 * (size_t)node[1], a, ab);
        vec3_sub(x + 3 * (size_t)node[2], a, ac);
        vec3_cross(ab, ac, n);
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(1, n, glb->normal + 3 * (size_t)node[k]);
    }
    for (size_t i = 0; i < (size_t)drape_model_node_count(model); i++) {
        double *n = glb->normal + 3 * i, length = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : k == 1;
    }
}

static void find_bounds(const glb_state *glb, const double *x, bool relative, float bounds[6])
{
    for (int k = 0; k < 3; k++) {
        bounds[k] = FLT_MAX;
        bounds[3 + k] = -FLT_MAX;
    }
    for (size_t i = 0; i < 3 * (size_t)drape_model_node_count(glb->def->model); i++) {
        float value = relative ? (float)(x[i] - (double)glb->base[i]) : (float)x[i];
        bounds[i % 3] = fminf(bounds[i % 3], value);
        bounds[3 + i % 3] = fmaxf(bounds[3 + i % 3], value);
    }
}

static void format_bounds(const float bounds[6], char *text, size_t size)
{
    snprintf(text, size, "\"min\":[%.9g,%.9g,%.9g],\"max\":[%.9g,%.9g,%.9g]}", bounds[0], bounds[1],
             bounds[2], bounds[3], bounds[4], bounds[5]);
}

/* The accessor of a frame's normals, which has no bounds. */
static void format_normals(const glb_state *glb, uint32_t frame, char text[NORMALS_ROOM])
{
    int length = snprintf(text, NORMALS_ROOM, ACCESSOR_HEAD, frame * frame_bytes(glb) + vertex_bytes(glb),
                          glb->vertices);
    text[length - 1] = '}'; /* instead of the comma */
}

/* ---- Changes to the beginning of the file ---- */

static drape_status fill(glb_state *glb, size_t at, const char *format, ...) DRAPE_PRINTF(3, 4);
static drape_status fill(glb_state *glb, size_t at, const char *format, ...)
{
    char text[TIMES_ROOM];
    va_list values;
    va_start(values, format);
    int length = vsnprintf(text, sizeof text, format, values);
    va_end(values);
    return drape_file_overwrite(&glb->file, (off_t)(JSON_OFFSET + at), text, (size_t)length);
}

static drape_status write_word(glb_state *glb, off_t at, uint32_t word)
{
    unsigned char bytes[4];
    for (int b = 0; b < 4; b++)
        bytes[b] = (unsigned char)(word >> 8 * b);
    return drape_file_overwrite(&glb->file, at, bytes, sizeof bytes);
}

/* Writes all lengths as they are now. positions: bytes of positions and normals. */
static drape_status write_lengths(glb_state *glb, uint32_t positions)
{
    off_t binary = JSON_OFFSET + (off_t)glb->json_size;
    uint32_t size = (uint32_t)glb->file.kept, length = size - (uint32_t)binary - 8;
    drape_status status = write_word(glb, binary, length);
    if (!status)
        status = write_word(glb, 8, size);
    if (!status)
        status = fill(glb, glb->at.buffer_length, "%10" PRIu32, length);
    return status ? status : fill(glb, glb->at.view_length, "%10" PRIu32, positions);
}

/* ---- Frames ---- */

static void put_vertices(glb_state *glb, const float *of_nodes)
{
    for (size_t i = 0; i < glb->vertices; i++)
        for (size_t k = 0; k < 3; k++)
            drape_file_put_float(&glb->file, of_nodes[3 * (size_t)glb->node[i] + k]);
}

static void put_differences(glb_state *glb, const double *of_nodes, const float *base)
{
    for (size_t i = 0; i < glb->vertices; i++)
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)glb->node[i] + k;
            drape_file_put_float(&glb->file, (float)(of_nodes[at] - (double)base[at]));
        }
}

/* The file appears with its first frame, since a file without positions would not be valid. */
static drape_status write_first(glb_state *glb, const drape_frame *frame)
{
    float bounds[6];
    char accessor[ACCESSOR_ROOM + 1];
    uint32_t length = fixed_bytes(glb) + frame_bytes(glb);
    find_bounds(glb, frame->positions, false, bounds);
    int head = snprintf(accessor, sizeof accessor, ACCESSOR_HEAD, 0u, glb->vertices);
    format_bounds(bounds, accessor + head, sizeof accessor - (size_t)head);
    memcpy(glb->json + glb->at.accessors, accessor, strlen(accessor));
    format_normals(glb, 0, accessor);
    memcpy(glb->json + glb->at.accessors + BOUNDS_ROOM, accessor, strlen(accessor));
    snprintf(accessor, sizeof accessor, "%10" PRIu32, length);
    memcpy(glb->json + glb->at.buffer_length, accessor, LENGTH_WIDTH);
    snprintf(accessor, sizeof accessor, "%10" PRIu32, frame_bytes(glb));
    memcpy(glb->json + glb->at.view_length, accessor, LENGTH_WIDTH);

    drape_file_put_text(&glb->file, "glTF");
    drape_file_put_word(&glb->file, 2);
    drape_file_put_word(&glb->file, (uint32_t)(JSON_OFFSET + glb->json_size + 8 + length));
    drape_file_put_word(&glb->file, (uint32_t)glb->json_size);
    drape_file_put_text(&glb->file, "JSON");
    drape_file_put(&glb->file, glb->json, glb->json_size);
    drape_file_put_word(&glb->file, length);
    drape_file_put(&glb->file, "BIN", 4); /* with its terminating 0 */
    for (size_t i = 0; i < triangle_bytes(glb) / 4; i++)
        drape_file_put_word(&glb->file, glb->corner[i]);
    for (size_t i = 0; glb->uv && i < glb->vertices; i++) {
        drape_file_put_float(&glb->file, glb->uv[i] ? (float)glb->uv[i][0] : 0);
        drape_file_put_float(&glb->file, glb->uv[i] ? (float)(1 - glb->uv[i][1]) : 0);
    }
    find_normals(glb, frame->positions);
    for (size_t i = 0; i < node_bytes(glb) / 4; i++) {
        glb->base[i] = (float)frame->positions[i];
        glb->upright[i] = (float)glb->normal[i];
    }
    put_vertices(glb, glb->base);
    put_vertices(glb, glb->upright);
    return drape_file_publish(&glb->file);
}

/* Adds the frame's accessors, target and weight; the first target also opens the lists. */
static drape_status add_target(glb_state *glb, const drape_frame *frame)
{
    uint32_t target = glb->frames - 1;
    float bounds[6];
    char text[ACCESSOR_ROOM + 1];
    find_bounds(glb, frame->positions, true, bounds);
    int head = snprintf(text, sizeof text, ACCESSOR_HEAD, glb->frames * frame_bytes(glb), glb->vertices);
    format_bounds(bounds, text + head, sizeof text - (size_t)head);
    size_t at = glb->at.accessors + (size_t)glb->frames * ACCESSOR_ROOM;
    drape_status status = fill(glb, at, "%s", text);
    format_normals(glb, glb->frames, text);
    if (!status)
        status = fill(glb, at + BOUNDS_ROOM, "%s", text);
    for (uint32_t i = 0; i < glb->primitives && !status; i++) {
        const primitive *p = &glb->primitive[i];
        if (target == 0)
            status = fill(glb, p->targets_close, "]");
        if (!status)
            status =
                fill(glb, target ? p->targets + (size_t)target * TARGET_WIDTH : p->targets_open,
                     "%s{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32 "}", target ? "," : ",\"targets\":[",
                     accessor_of(glb, glb->frames), accessor_of(glb, glb->frames) + 1);
    }
    if (!status && target == 0)
        status = fill(glb, glb->at.weights_close, "]");
    if (!status)
        status = fill(glb, target ? glb->at.weights + (size_t)target * WEIGHT_WIDTH : glb->at.weights_open,
                      "%s0", target ? "," : ",\"weights\":[");
    return status;
}

static drape_status write_next(glb_state *glb, const drape_frame *frame)
{
    off_t before = glb->file.kept;
    put_differences(glb, frame->positions, glb->base);
    find_normals(glb, frame->positions);
    put_differences(glb, glb->normal, glb->upright);
    drape_status status = drape_file_keep(&glb->file);
    if (status)
        return status;
    status = write_lengths(glb, (glb->frames + 1) * frame_bytes(glb));
    if (status)
        drape_file_cut(&glb->file, before);
    return status ? status : add_target(glb, frame);
}

/* The frame's time; the times of an animation must strictly increase, in float32. */
static float time_of(const glb_state *glb, const drape_frame *frame)
{
    float time = (float)frame->time;
    if (glb->frames > 0 && !(time > glb->times[glb->frames - 1]))
        time = nextafterf(glb->times[glb->frames - 1], FLT_MAX);
    return time;
}

static drape_status glb_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    glb_state *glb = state;
    if (glb->frames == glb->room)
        return drape_fail(ctx, DRAPE_E_FILE,
                          "\"%.300s/%.200s\" has room for %" PRIu32 " frames, those of the scene's duration",
                          drape_folder_path(glb->file.folder), glb->file.path, glb->room);
    glb->times[glb->frames] = time_of(glb, frame);
    drape_status status = glb->frames == 0 ? write_first(glb, frame) : write_next(glb, frame);
    if (!status)
        glb->frames++;
    glb->live = glb->frames > 0;
    return status;
}

/* ---- Animation and end ---- */

static drape_status add_animation(glb_state *glb)
{
    uint32_t n = glb->frames, offset = fixed_bytes(glb) + n * frame_bytes(glb);
    uint32_t view = glb->uv ? 3 : 2, times = accessor_of(glb, n);
    drape_status status =
        fill(glb, glb->at.views, ",{\"buffer\":0,\"byteOffset\":%" PRIu32 ",\"byteLength\":%" PRIu32 "}",
             offset, 4 * n * n);
    if (!status)
        status = fill(glb, glb->at.times,
                      ",{\"bufferView\":%" PRIu32 ",\"componentType\":5126,\"count\":%" PRIu32
                      ",\"type\":\"SCALAR\",\"min\":[%.9g],\"max\":[%.9g]},{\"bufferView\":%" PRIu32
                      ",\"byteOffset\":%" PRIu32 ",\"componentType\":5126,\"count\":%" PRIu32
                      ",\"type\":\"SCALAR\"}",
                      view, n, glb->times[0], glb->times[n - 1], view, 4 * n, n * (n - 1));
    if (!status)
        status =
            fill(glb, glb->at.animation,
                 ",\"animations\":[{\"name\":\"run\",\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,"
                 "\"path\":\"weights\"}}],\"samplers\":[{\"input\":%" PRIu32
                 ",\"interpolation\":\"LINEAR\",\"output\":%" PRIu32 "}]}]",
                 times, times + 1);
    return status;
}

/* Times and weights: n + n (n - 1) numbers. */
static drape_status write_animation(glb_state *glb)
{
    for (uint32_t i = 0; i < glb->frames; i++)
        drape_file_put_float(&glb->file, glb->times[i]);
    for (uint32_t frame = 0; frame < glb->frames; frame++)
        for (uint32_t target = 1; target < glb->frames; target++)
            drape_file_put_float(&glb->file, frame == target);
    drape_status status = drape_file_keep(&glb->file);
    if (!status)
        status = write_lengths(glb, glb->frames * frame_bytes(glb));
    return status ? status : add_animation(glb);
}

static drape_status glb_close(drape_context *ctx, void *state)
{
    glb_state *glb = state;
    (void)ctx;
    drape_status status = glb->frames > 1 && glb->live ? write_animation(glb) : DRAPE_OK;
    drape_status closing = drape_file_close(&glb->file);
    drape_file_destroy(&glb->file);
    return status ? status : closing;
}

/* ---- Checkpoints ---- */

static void glb_archive(void *state, drape_archive *a)
{
    glb_state *glb = state;
    int64_t frames = glb->frames;
    drape_archive_int64(a, &frames);
    drape_archive_same(a, "the number of vertices in " FILE_NAME, glb->vertices);
    drape_archive_same(a, "the number of materials in " FILE_NAME, glb->primitives);
    if (a->reading && (frames < 0 || frames > glb->room))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %lld frames of %u", (long long)frames,
                           glb->room);
    if (a->status)
        return;
    glb->frames = (uint32_t)frames;
    drape_export_archive_file(a, &glb->file);
    drape_archive_bytes(a, glb->base, node_bytes(glb));
    drape_archive_bytes(a, glb->upright, node_bytes(glb));
    drape_archive_bytes(a, glb->times, glb->frames * sizeof *glb->times);
}

/* Before the first frame there is no file. */
static drape_status glb_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    glb_state *glb = state;
    (void)frames;
    drape_status status = allocate(def, glb);
    if (status)
        return status;
    glb_archive(glb, a);
    if (a->status || glb->frames == 0)
        return a->status;
    return drape_export_reopen(ctx, def->folder, FILE_NAME, &glb->file);
}

/* Blanks a list from item `from` on. */
static drape_status blank_items(glb_state *glb, size_t list, size_t width, uint32_t from)
{
    size_t begin = list + from * width, end = list + glb->room * width;
    char blank[1024];
    drape_status status = DRAPE_OK;
    memset(blank, ' ', sizeof blank);
    while (!status && begin < end) {
        size_t part = end - begin < sizeof blank ? end - begin : sizeof blank;
        status = drape_file_overwrite(&glb->file, (off_t)(JSON_OFFSET + begin), blank, part);
        begin += part;
    }
    return status;
}

/* Blanks the targets of a primitive that later frames added. */
static drape_status blank_targets(glb_state *glb, const primitive *p)
{
    uint32_t n = glb->frames;
    const char blank[OPEN_WIDTH + 1 + 1] = "            ";
    drape_status status = DRAPE_OK;
    if (n <= 1)
        status =
            drape_file_overwrite(&glb->file, (off_t)(JSON_OFFSET + p->targets_open), blank, OPEN_WIDTH + 1);
    if (!status && n <= 1)
        status = drape_file_overwrite(&glb->file, (off_t)(JSON_OFFSET + p->targets_close), blank, 1);
    return status ? status : blank_items(glb, p->targets, TARGET_WIDTH, n == 0 ? n : n - 1);
}
/* Blanks everything that later frames and the animation wrote. */
static drape_status blank_rest(glb_state *glb)
{
    const blanks *at = &glb->at;
    uint32_t n = glb->frames;
    const struct {
        size_t begin, width;
    } lists[] = {{at->accessors, ACCESSOR_ROOM}, {at->weights, WEIGHT_WIDTH}};
    const struct {
        size_t begin, size;
        bool kept;
    } pieces[] = {{at->views, TIMES_ROOM / 2, false},
                  {at->times, TIMES_ROOM / 2, false},
                  {at->animation, TIMES_ROOM / 2, false},
                  {at->weights_open, OPEN_WIDTH + 1, n > 1},
                  {at->weights_close, 1, n > 1}};
    char blank[TIMES_ROOM];
    drape_status status = DRAPE_OK;
    memset(blank, ' ', sizeof blank);
    for (size_t i = 0; !status && i < sizeof pieces / sizeof *pieces; i++)
        if (!pieces[i].kept)
            status = drape_file_overwrite(&glb->file, (off_t)(JSON_OFFSET + pieces[i].begin), blank,
                                          pieces[i].size);
    for (uint32_t p = 0; p < glb->primitives && !status; p++)
        status = blank_targets(glb, &glb->primitive[p]);
    /* accessors k belong to frame k, target and weight k to frame k + 1 */
    for (size_t i = 0; !status && i < sizeof lists / sizeof *lists; i++)
        status = blank_items(glb, lists[i].begin, lists[i].width, i == 0 || n == 0 ? n : n - 1);
    return status;
}

/* Removes the animation and targets before the data that they refer to. */
static drape_status glb_cut(drape_context *ctx, void *state, int64_t frames)
{
    glb_state *glb = state;
    (void)frames;
    const bool rehearses = drape_folder_rehearses(glb->def->folder);
    if (glb->frames == 0)
        return rehearses ? DRAPE_OK : drape_export_begin(ctx, glb->def->folder, FILE_NAME, &glb->file);
    drape_status status = blank_rest(glb);
    if (!status)
        status = write_lengths(glb, glb->frames * frame_bytes(glb));
    if (!status)
        status = drape_file_trim(&glb->file);
    glb->live = !status && !rehearses;
    return status;
}

static drape_status glb_sync(void *state)
{
    glb_state *glb = state;
    return glb->frames > 0 ? drape_file_sync(&glb->file) : DRAPE_OK;
}

const drape_exporter_ops drape_exporter_glb = {
    .entry = {.name = "glb",
              .summary =
                  "positions.glb: glTF 2.0 with a morph target for each frame, float32, normals, texture "
                  "coordinates, a primitive for each material, and an animation; y up",
              .reference = "Khronos, glTF 2.0 specification, 2021 (ISO/IEC 12113)"},
    .state_size = sizeof(glb_state),
    .y_up = true,
    .check = glb_check,
    .open = glb_open,
    .names = glb_names,
    .write = glb_write,
    .archive = glb_archive,
    .resume = glb_resume,
    .cut = glb_cut,
    .sync = glb_sync,
    .close = glb_close,
};
