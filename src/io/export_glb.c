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
#include "model/model.h"

#define FILE_NAME      "positions.glb"
#define JSON_OFFSET    20
#define MAX_FRAMES     16384                  /* their weights take 1 GiB */
#define MAX_BYTES      (UINT32_MAX - 65535.0) /* lengths have 32 bits */
#define FIXED_ROOM     4096                   /* JSON without the parts of each frame */
#define PRIMITIVE_ROOM 512
#define SURFACE_BYTES  3e5 /* of a collider without triangles of its own */
#define BODY_ROOM      2048
#define PLACE_ROOM     256 /* ,"translation":[...],"rotation":[...] */
#define CHANNEL_ROOM   128 /* a channel or a sampler */
#define TARGET_WIDTH   36  /* ,{"POSITION":32769,"NORMAL":32770} */
#define WEIGHT_WIDTH   2   /* ,0 */
#define BOUND_WIDTH    17  /* -1.17549435e-38 and a comma */
#define OPEN_WIDTH     11  /* ,"targets":[ and ,"weights":[ */
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

/* A mesh with morph targets: all cloths, or a collider that deforms. */
typedef struct object {
    char *name;                    /* as a text of JSON */
    const drape_export_body *body; /* NULL: the cloths */
    uint32_t first_vertex, vertices, first_point, points, first_primitive, primitives;
    size_t weights_open, weights, weights_close; /* blanks in the JSON */
} object;

/* A rigid collider. */
typedef struct solid {
    char *name; /* as a text of JSON */
    const drape_export_body *body;
    int32_t collider;
    uint32_t first_vertex, first_triangle; /* among those of all solids; among all triangles */
    float *moves;                          /* (room x 7) translation and rotation; NULL: it stays */
    size_t place;                          /* blanks in the JSON: where it is first */
} solid;

/* Positions of the blanks in the JSON, counted from its beginning. */
typedef struct blanks {
    size_t buffer_length, view_length, views, accessors, times, animation;
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
    uint32_t vertices; /* of all objects */
    int32_t *node;     /* (vertices) the point of each */
    const double **uv; /* (vertices of the cloths) texture coordinates; NULL: no cloth has any */
    uint32_t *corner;  /* (triangles x 3) vertices of the object or solid, in the order of the primitives */
    primitive *primitive; /* (primitives) of all objects */
    uint32_t primitives, triangles, points;
    object *object; /* (objects) the first one is the cloths */
    uint32_t objects;
    solid *solid; /* (solids) */
    uint32_t solids, solid_vertices, moving;
    float *base;    /* (points x 3) positions of the first frame: nodes of cloth, points of colliders */
    float *upright; /* (points x 3) normals of the first frame */
    double *x;      /* (points x 3) positions of the present frame, if there are points of colliders */
    double *normal; /* (points x 3) normals of the present frame */
    float *times;   /* (room) */
} glb_state;

/* ---- Sizes ---- */

static uint32_t triangle_bytes(const glb_state *glb)
{
    return 12 * glb->triangles;
}

static uint32_t uv_bytes(const glb_state *glb)
{
    return glb->uv ? 8 * glb->object[0].vertices : 0;
}

static uint32_t solid_bytes(const glb_state *glb)
{
    return 24 * glb->solid_vertices;
}

/* What comes before the frames. */
static uint32_t fixed_bytes(const glb_state *glb)
{
    return triangle_bytes(glb) + uv_bytes(glb) + solid_bytes(glb);
}

/* Positions and normals of one frame. */
static uint32_t frame_bytes(const glb_state *glb)
{
    return 24 * glb->vertices;
}

/* The accessors of the triangles are first, those of the objects' primitives and of the solids; then that of
 * the texture coordinates; positions and normals of each solid; and for each frame those of each object. */
static uint32_t uv_accessor(const glb_state *glb)
{
    return glb->primitives + glb->solids;
}

static uint32_t solid_accessor(const glb_state *glb, uint32_t number)
{
    return uv_accessor(glb) + (glb->uv != NULL) + 2 * number;
}

/* That of the positions; that of the normals follows. */
static uint32_t accessor_of(const glb_state *glb, uint32_t frame, uint32_t number)
{
    return solid_accessor(glb, glb->solids) + 2 * (frame * glb->objects + number);
}

/* The view of the times and of what is animated. */
static uint32_t last_view(const glb_state *glb)
{
    return 2 + (glb->uv != NULL) + (glb->solids > 0);
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
static material *list_materials(drape_arena *scratch, const drape_render_surface *surface, size_t *first,
                                size_t *count)
{
    *count = 0;
    for (int32_t c = 0; c < surface->cloth_count; c++)
        *count += (size_t)surface->cloths[c].mesh->faces.material_count + 1;
    material *list = drape_arena_take(scratch, *count, sizeof *list);
    size_t at = 0;
    for (int32_t c = 0; list && c < surface->cloth_count; c++) {
        const drape_faces *faces = &surface->cloths[c].mesh->faces;
        first[c] = at;
        for (int32_t m = -1; m < faces->material_count; m++)
            list[at++] = (material){.name = m < 0 ? "" : faces->name[m], .cloth = c, .number = m};
        if (faces->count == 0)
            list[first[c]].triangles = (uint32_t)surface->cloths[c].mesh->triangle_count;
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
    qsort(list, count, sizeof *list, compare_materials);
    glb->primitive =
        drape_arena_take(glb->def->arena, count + (size_t)glb->def->body_count, sizeof *glb->primitive);
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
            p->first = glb->triangles;
            status = quote(glb->def->arena, *last ? last : DRAPE_NO_MATERIAL, &p->material);
        }
        list[i].primitive = glb->primitives - 1;
        glb->primitive[list[i].primitive].count += list[i].triangles;
        glb->triangles += list[i].triangles;
    }
    qsort(list, count, sizeof *list, compare_places);
    return status;
}

/* Puts the triangles of one cloth where their primitives have them; next (primitives): the place of the next
 * triangle of each. */
static void put_corners(glb_state *glb, const drape_render_cloth *cloth, const material *own,
                        const drape_vertices *vertices, uint32_t *next)
{
    const drape_faces *faces = &cloth->mesh->faces;
    const int32_t *at = vertices->at;
    const int32_t count = faces->count > 0 ? faces->count : cloth->mesh->triangle_count;
    for (int32_t f = 0; f < count; f++) {
        const int32_t triangles = faces->count > 0 ? faces->first[f + 1] - faces->first[f] - 2 : 1;
        const int32_t number = faces->count > 0 ? faces->material[f] : -1;
        uint32_t *to = &next[own[number + 1].primitive];
        for (int32_t k = 0; k < 3 * triangles; k++)
            glb->corner[3 * (size_t)*to + (size_t)k] = glb->vertices + (uint32_t)*at++;
        *to += (uint32_t)triangles;
    }
}

static drape_status add_cloth(glb_state *glb, const drape_render_cloth *cloth, const material *own,
                              uint32_t *next)
{
    drape_arena scratch = drape_arena_of(glb->def->arena->ctx);
    drape_vertices vertices;
    const drape_status status = drape_faces_vertices(&scratch, cloth->mesh, &vertices);
    for (int32_t i = 0; !status && i < vertices.count; i++) {
        const size_t to = (size_t)glb->vertices + (size_t)i;
        glb->node[to] = cloth->first_node + vertices.node[i];
        if (glb->uv)
            glb->uv[to] = vertices.uv[i] < 0 ? NULL : cloth->mesh->faces.uv + 2 * (size_t)vertices.uv[i];
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
    const drape_render_surface *surface = &glb->def->model->surface;
    size_t count, room = 0;
    bool has_uvs = false;
    size_t *first = drape_arena_take(scratch, (size_t)surface->cloth_count, sizeof *first);
    material *list = first ? list_materials(scratch, surface, first, &count) : NULL;
    drape_status status = list ? make_primitives(glb, list, count) : DRAPE_E_MEMORY;
    if (status)
        return status;
    for (int32_t c = 0; c < surface->cloth_count; c++) {
        const drape_mesh *mesh = surface->cloths[c].mesh;
        has_uvs = has_uvs || mesh->faces.uv_count > 0;
        room += (size_t)(mesh->faces.uv_count > 0 ? 3 * mesh->triangle_count : mesh->node_count);
    }
    uint32_t *next = drape_arena_take(scratch, glb->primitives, sizeof *next);
    size_t triangles = (size_t)surface->triangle_count;
    const size_t own = room;
    for (int32_t b = 0; b < glb->def->body_count; b++) {
        triangles += (size_t)glb->def->bodies[b].triangle_count;
        room += glb->def->bodies[b].deforms ? (size_t)glb->def->bodies[b].vertex_count : 0;
    }
    glb->corner = drape_arena_take(glb->def->arena, triangles, 3 * sizeof *glb->corner);
    glb->node = drape_arena_take(glb->def->arena, room, sizeof *glb->node);
    if (has_uvs)
        glb->uv = drape_arena_take(glb->def->arena, own, sizeof *glb->uv);
    if (drape_arena_status(glb->def->arena) || !next)
        return DRAPE_E_MEMORY;
    for (uint32_t p = 0; p < glb->primitives; p++)
        next[p] = glb->primitive[p].first;
    for (int32_t c = 0; c < surface->cloth_count && !status; c++)
        status = add_cloth(glb, &surface->cloths[c], list + first[c], next);
    return status;
}

static void put_body_corners(glb_state *glb, const drape_export_body *body)
{
    uint32_t *to = glb->corner + 3 * (size_t)glb->triangles;
    for (size_t i = 0; i < 3 * (size_t)body->triangle_count; i++)
        to[i] = (uint32_t)body->triangle[i];
    glb->triangles += (uint32_t)body->triangle_count;
}

/* Those that deform are objects, after the cloths; the others are solids, whose triangles follow theirs. */
static drape_status add_bodies(glb_state *glb)
{
    const drape_export_def *def = glb->def;
    for (int32_t b = 0; b < def->body_count; b++) {
        const drape_export_body *body = &def->bodies[b];
        if (!body->deforms)
            continue;
        glb->object[glb->objects++] = (object){.body = body,
                                               .first_vertex = glb->vertices,
                                               .vertices = (uint32_t)body->vertex_count,
                                               .first_point = glb->points,
                                               .points = (uint32_t)body->vertex_count,
                                               .first_primitive = glb->primitives,
                                               .primitives = 1};
        glb->primitive[glb->primitives++] =
            (primitive){.first = glb->triangles, .count = (uint32_t)body->triangle_count};
        put_body_corners(glb, body);
        for (int32_t i = 0; i < body->vertex_count; i++)
            glb->node[glb->vertices++] = (int32_t)glb->points++;
    }
    for (int32_t b = 0; b < def->body_count; b++) {
        const drape_export_body *body = &def->bodies[b];
        if (body->deforms)
            continue;
        solid *s = &glb->solid[glb->solids++];
        *s = (solid){.body = body,
                     .collider = b,
                     .first_vertex = glb->solid_vertices,
                     .first_triangle = glb->triangles};
        put_body_corners(glb, body);
        glb->solid_vertices += (uint32_t)body->vertex_count;
        glb->moving += body->moves;
        if (body->moves)
            s->moves = drape_arena_take(def->arena, glb->room, 7 * sizeof *s->moves);
    }
    return drape_arena_status(def->arena);
}

static drape_status make_vertices(glb_state *glb)
{
    const size_t bodies = (size_t)glb->def->body_count;
    drape_arena scratch = drape_arena_of(glb->def->arena->ctx);
    glb->object = drape_arena_take(glb->def->arena, bodies + 1, sizeof *glb->object);
    glb->solid = drape_arena_take(glb->def->arena, bodies, sizeof *glb->solid);
    drape_status status = glb->object && glb->solid ? DRAPE_OK : DRAPE_E_MEMORY;
    if (!status)
        status = add_cloths(glb, &scratch);
    drape_arena_free(&scratch);
    if (status)
        return status;
    glb->points = (uint32_t)glb->def->model->surface.node_count;
    glb->objects = 1;
    glb->object[0] =
        (object){.vertices = glb->vertices, .points = glb->points, .primitives = glb->primitives};
    status = add_bodies(glb);
    for (uint32_t i = 0; i < glb->objects && !status; i++)
        status = quote(glb->def->arena, i ? glb->object[i].body->name : "cloth", &glb->object[i].name);
    for (uint32_t i = 0; i < glb->solids && !status; i++)
        status = quote(glb->def->arena, glb->solid[i].body->name, &glb->solid[i].name);
    return status;
}

/* ---- JSON ---- */

static void format_bounds(const float bounds[6], char *text, size_t size)
{
    snprintf(text, size, "\"min\":[%.9g,%.9g,%.9g],\"max\":[%.9g,%.9g,%.9g]}", bounds[0], bounds[1],
             bounds[2], bounds[3], bounds[4], bounds[5]);
}

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

static void add_triangles(glb_state *glb, uint32_t first, uint32_t count)
{
    add(glb, "%s{\"bufferView\":0,", first ? "," : "");
    if (first > 0)
        add(glb, "\"byteOffset\":%" PRIu32 ",", 12 * first);
    add(glb, "\"componentType\":5125,\"count\":%" PRIu32 ",\"type\":\"SCALAR\"}", 3 * count);
}

static void add_solid_accessors(glb_state *glb, const solid *s)
{
    const uint32_t view = 2 + (glb->uv != NULL), count = (uint32_t)s->body->vertex_count;
    float bounds[6] = {FLT_MAX, FLT_MAX, FLT_MAX, -FLT_MAX, -FLT_MAX, -FLT_MAX};
    char text[BOUNDS_ROOM];
    for (size_t i = 0; i < 3 * (size_t)count; i++) {
        const float value = s->body->vertex[i / 3 * 6 + i % 3];
        bounds[i % 3] = fminf(bounds[i % 3], value);
        bounds[3 + i % 3] = fmaxf(bounds[3 + i % 3], value);
    }
    format_bounds(bounds, text, sizeof text);
    for (uint32_t normals = 0; normals < 2; normals++)
        add(glb,
            ",{\"bufferView\":%" PRIu32 ",\"byteOffset\":%" PRIu32
            ",\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"VEC3\"%s%s",
            view, 24 * s->first_vertex + 12 * count * normals, count, normals ? "" : ",",
            normals ? "}" : text);
}

/* Bytes of JSON for the accessors of the animation: of times, weights, and of each solid that moves. */
static size_t times_room(const glb_state *glb)
{
    return TIMES_ROOM / 2 + glb->moving * TIMES_ROOM / 2;
}

/* And for the animation itself: channels and samplers. */
static size_t animation_room(const glb_state *glb)
{
    return (3 + glb->objects + 4 * (size_t)glb->moving) * CHANNEL_ROOM;
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
    if (glb->solids > 0)
        add(glb,
            ",{\"buffer\":0,\"byteOffset\":%" PRIu32
            ",\"byteStride\":12,\"target\":34962,\"byteLength\":%" PRIu32 "}",
            triangle_bytes(glb) + uv_bytes(glb), solid_bytes(glb));
    glb->at.views = add_blanks(glb, TIMES_ROOM / 2);
    add(glb, "],\"accessors\":[");
    for (uint32_t p = 0; p < glb->primitives; p++)
        add_triangles(glb, glb->primitive[p].first, glb->primitive[p].count);
    for (uint32_t i = 0; i < glb->solids; i++)
        add_triangles(glb, glb->solid[i].first_triangle, (uint32_t)glb->solid[i].body->triangle_count);
    if (glb->uv)
        add(glb, ",{\"bufferView\":2,\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"VEC2\"}",
            glb->object[0].vertices);
    for (uint32_t i = 0; i < glb->solids; i++)
        add_solid_accessors(glb, &glb->solid[i]);
    glb->at.accessors = add_blanks(glb, (size_t)glb->room * glb->objects * ACCESSOR_ROOM);
    glb->at.times = add_blanks(glb, times_room(glb));
    add(glb, "]");
}

static void add_primitive(glb_state *glb, const object *o, uint32_t number)
{
    const uint32_t position = accessor_of(glb, 0, (uint32_t)(o - glb->object));
    primitive *p = &glb->primitive[o->first_primitive + number];
    add(glb, "%s{\"attributes\":{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32, number ? "," : "", position,
        position + 1);
    if (glb->uv && !o->body)
        add(glb, ",\"TEXCOORD_0\":%" PRIu32, uv_accessor(glb));
    add(glb, "},\"indices\":%" PRIu32 ",\"material\":%" PRIu32, o->first_primitive + number,
        o->body ? glb->object[0].primitives : number);
    p->targets_open = add_blanks(glb, OPEN_WIDTH + 1);
    p->targets = add_blanks(glb, (size_t)glb->room * TARGET_WIDTH);
    p->targets_close = add_blanks(glb, 1);
    add(glb, "}");
}

static void add_meshes(glb_state *glb)
{
    add(glb, ",\"meshes\":[");
    for (uint32_t i = 0; i < glb->objects; i++) {
        object *o = &glb->object[i];
        add(glb, "%s{\"name\":%s,\"primitives\":[", i ? "," : "", o->name);
        for (uint32_t p = 0; p < o->primitives; p++)
            add_primitive(glb, o, p);
        add(glb, "]");
        o->weights_open = add_blanks(glb, OPEN_WIDTH + 1);
        o->weights = add_blanks(glb, (size_t)glb->room * WEIGHT_WIDTH);
        o->weights_close = add_blanks(glb, 1);
        add(glb, "}");
    }
    for (uint32_t i = 0; i < glb->solids; i++)
        add(glb,
            ",{\"name\":%s,\"primitives\":[{\"attributes\":{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32
            "},\"indices\":%" PRIu32 ",\"material\":%" PRIu32 "}]}",
            glb->solid[i].name, solid_accessor(glb, i), solid_accessor(glb, i) + 1, glb->primitives + i,
            glb->object[0].primitives);
    add(glb, "]");
}

/* Named materials are those of the artist, to be replaced by name: they are light grey. */
static void add_materials(glb_state *glb)
{
    static const char format[] =
        "%s{\"name\":%s,\"doubleSided\":true,\"pbrMetallicRoughness\":{\"baseColorFactor\":[%s,1],"
        "\"metallicFactor\":0,\"roughnessFactor\":0.85}}";
    add(glb, "\"materials\":[");
    for (uint32_t p = 0; p < glb->object[0].primitives; p++)
        add(glb, format, p ? "," : "", glb->primitive[p].material,
            glb->primitive[p].is_default ? "0.55,0.16,0.13" : "0.8,0.8,0.8");
    if (glb->def->body_count > 0)
        add(glb, format, ",", "\"collider\"", "0.35,0.37,0.4");
    add(glb, "],");
}

/* A node of glTF for each object and solid. */
static void add_nodes(glb_state *glb)
{
    add(glb, "\"scene\":0,\"scenes\":[{\"nodes\":[0");
    for (uint32_t i = 1; i < glb->objects + glb->solids; i++)
        add(glb, ",%" PRIu32, i);
    add(glb, "]}],\"nodes\":[");
    for (uint32_t i = 0; i < glb->objects; i++)
        add(glb, "%s{\"name\":%s,\"mesh\":%" PRIu32 "}", i ? "," : "", glb->object[i].name, i);
    for (uint32_t i = 0; i < glb->solids; i++) {
        add(glb, ",{\"name\":%s,\"mesh\":%" PRIu32, glb->solid[i].name, glb->objects + i);
        glb->solid[i].place = add_blanks(glb, PLACE_ROOM);
        add(glb, "}");
    }
    add(glb, "],");
}

static void make_json(glb_state *glb)
{
    add(glb, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Drape %s\"},", drape_version());
    add_nodes(glb);
    add_materials(glb);
    add_buffers(glb);
    add_meshes(glb);
    glb->at.animation = add_blanks(glb, animation_room(glb));
    add(glb, "}");
    add_blanks(glb, 3 - (glb->used + 3) % 4);
    glb->json_size = glb->used;
}

/* ---- Opening ---- */

/* Bytes of JSON for each frame. */
static double frame_room(double objects, double primitives)
{
    return objects * (ACCESSOR_ROOM + WEIGHT_WIDTH) + primitives * TARGET_WIDTH;
}

static drape_status glb_check(drape_context *ctx, const char *pointer, const drape_export_def *def)
{
    const drape_render_surface *surface = &def->model->surface;
    double frames = (double)def->most_frames, vertices = (double)drape_export_points(def->model);
    double primitives = 1 + def->model->collider_count;
    for (int32_t c = 0; c < surface->cloth_count; c++) {
        const drape_mesh *mesh = surface->cloths[c].mesh;
        /* a seam of the texture coordinates splits a node for each further pair that is used */
        vertices += mesh->faces.uv_count > mesh->node_count ? mesh->faces.uv_count : mesh->node_count;
        primitives += mesh->faces.material_count;
    }
    double bytes = 12.0 * surface->triangle_count + 24 * vertices * frames + 4 * frames * frames +
                   frames * frame_room(1 + def->model->collider_count, primitives);
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
    glb->json_size = FIXED_ROOM + (size_t)glb->room * (size_t)frame_room(glb->objects, glb->primitives);
    for (uint32_t p = 0; p < glb->object[0].primitives; p++)
        glb->json_size += PRIMITIVE_ROOM + strlen(glb->primitive[p].material);
    for (uint32_t i = 1; i < glb->objects; i++)
        glb->json_size += BODY_ROOM + 2 * strlen(glb->object[i].name);
    for (uint32_t i = 0; i < glb->solids; i++)
        glb->json_size += BODY_ROOM + 2 * strlen(glb->solid[i].name);
    glb->json = drape_arena_take(arena, glb->json_size, 1);
    size_t count = 3 * (size_t)glb->points;
    glb->base = drape_arena_take(arena, count, sizeof *glb->base);
    glb->upright = drape_arena_take(arena, count, sizeof *glb->upright);
    glb->normal = drape_arena_take(arena, count, sizeof *glb->normal);
    if (glb->objects > 1)
        glb->x = drape_arena_take(arena, count, sizeof *glb->x);
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

/* Positions of the points of all objects. */
static const double *positions_of(glb_state *glb, const drape_frame *frame)
{
    const size_t nodes = 3 * (size_t)glb->def->model->surface.node_count;
    if (!glb->x)
        return frame->positions;
    memcpy(glb->x, frame->positions, nodes * sizeof *glb->x);
    memcpy(glb->x + nodes, frame->points, (3 * (size_t)glb->points - nodes) * sizeof *glb->x);
    return glb->x;
}

static void add_normals(glb_state *glb, const double *x, const int32_t *node, size_t triangles,
                        uint32_t first)
{
    for (size_t t = 0; t < triangles; t++, node += 3) {
        const double *p[3];
        double ab[3], ac[3], n[3];
        for (int k = 0; k < 3; k++)
            p[k] = x + 3 * ((size_t)first + (size_t)node[k]);
        vec3_sub(p[1], p[0], ab);
        vec3_sub(p[2], p[0], ac);
        vec3_cross(ab, ac, n);
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(1, n, glb->normal + 3 * ((size_t)first + (size_t)node[k]));
    }
}

/* The mean of the normals of the triangles around each point, weighted by area; upwards if they cancel. */
static void find_normals(glb_state *glb, const double *x)
{
    const drape_render_surface *surface = &glb->def->model->surface;
    memset(glb->normal, 0, 3 * (size_t)glb->points * sizeof *glb->normal);
    add_normals(glb, x, surface->triangle, (size_t)surface->triangle_count, 0);
    for (uint32_t i = 1; i < glb->objects; i++)
        add_normals(glb, x, glb->object[i].body->triangle, (size_t)glb->object[i].body->triangle_count,
                    glb->object[i].first_point);
    for (size_t i = 0; i < (size_t)glb->points; i++) {
        double *n = glb->normal + 3 * i, length = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : k == 1;
    }
}

static void find_bounds(const glb_state *glb, const object *o, const double *x, bool relative,
                        float bounds[6])
{
    for (int k = 0; k < 3; k++) {
        bounds[k] = FLT_MAX;
        bounds[3 + k] = -FLT_MAX;
    }
    for (size_t i = 3 * (size_t)o->first_point; i < 3 * (size_t)(o->first_point + o->points); i++) {
        float value = relative ? (float)(x[i] - (double)glb->base[i]) : (float)x[i];
        bounds[i % 3] = fminf(bounds[i % 3], value);
        bounds[3 + i % 3] = fmaxf(bounds[3 + i % 3], value);
    }
}

/* The accessors of an object's positions and normals in a frame. */
static void format_accessors(const glb_state *glb, const object *o, uint32_t frame, const float bounds[6],
                             char positions[ACCESSOR_ROOM + 1], char normals[NORMALS_ROOM])
{
    const uint32_t at = frame * frame_bytes(glb) + 24 * o->first_vertex;
    const int head = snprintf(positions, ACCESSOR_ROOM + 1, ACCESSOR_HEAD, at, o->vertices);
    format_bounds(bounds, positions + head, (size_t)(ACCESSOR_ROOM + 1 - head));
    const int length = snprintf(normals, NORMALS_ROOM, ACCESSOR_HEAD, at + 12 * o->vertices, o->vertices);
    normals[length - 1] = '}'; /* instead of the comma */
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

static void put_vertices(glb_state *glb, const object *o, const float *of_points)
{
    for (size_t i = 0; i < o->vertices; i++)
        for (size_t k = 0; k < 3; k++)
            drape_file_put_float(&glb->file, of_points[3 * (size_t)glb->node[o->first_vertex + i] + k]);
}

static void put_differences(glb_state *glb, const object *o, const double *of_points, const float *base)
{
    for (size_t i = 0; i < o->vertices; i++)
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)glb->node[o->first_vertex + i] + k;
            drape_file_put_float(&glb->file, (float)(of_points[at] - (double)base[at]));
        }
}

static void put_solid(glb_state *glb, const solid *s)
{
    for (size_t part = 0; part < 6; part += 3)
        for (size_t i = 0; i < (size_t)s->body->vertex_count; i++)
            for (size_t k = 0; k < 3; k++)
                drape_file_put_float(&glb->file, s->body->vertex[6 * i + part + k]);
}

/* Translation and rotation, a quaternion x, y, z, w; of the two of a rotation that nearer to the one before.
 * */
static void find_place(const drape_collider_pose *pose, const float *before, float place[7])
{
    double q[4] = {1, 0, 0, 0}, sign = 1;
    if (pose->turned)
        drape_rotation_quaternion(pose->turn, q);
    if (before && q[1] * (double)before[3] + q[2] * (double)before[4] + q[3] * (double)before[5] +
                          q[0] * (double)before[6] <
                      0)
        sign = -1;
    for (int k = 0; k < 3; k++) {
        place[k] = (float)pose->displacement[k];
        place[3 + k] = (float)(sign * q[1 + k]);
    }
    place[6] = (float)(sign * q[0]);
}

static void keep_places(glb_state *glb, const drape_frame *frame)
{
    for (uint32_t i = 0; i < glb->solids; i++)
        if (glb->solid[i].moves) {
            float *to = glb->solid[i].moves + 7 * (size_t)glb->frames;
            find_place(&frame->poses[glb->solid[i].collider], glb->frames ? to - 7 : NULL, to);
        }
}

static void place_solids(glb_state *glb, const drape_frame *frame)
{
    for (uint32_t i = 0; i < glb->solids; i++) {
        float p[7];
        char text[PLACE_ROOM];
        find_place(&frame->poses[glb->solid[i].collider], NULL, p);
        const int length = snprintf(text, sizeof text,
                                    ",\"translation\":[%.9g,%.9g,%.9g],\"rotation\":[%.9g,%.9g,%.9g,%.9g]",
                                    p[0], p[1], p[2], p[3], p[4], p[5], p[6]);
        memcpy(glb->json + glb->solid[i].place, text, (size_t)length);
    }
}

/* The file appears with its first frame, since a file without positions would not be valid. */
static drape_status write_first(glb_state *glb, const drape_frame *frame)
{
    float bounds[6];
    char accessor[ACCESSOR_ROOM + 1], normals[NORMALS_ROOM];
    const double *x = positions_of(glb, frame);
    uint32_t length = fixed_bytes(glb) + frame_bytes(glb);
    for (uint32_t i = 0; i < glb->objects; i++) {
        char *to = glb->json + glb->at.accessors + (size_t)i * ACCESSOR_ROOM;
        find_bounds(glb, &glb->object[i], x, false, bounds);
        format_accessors(glb, &glb->object[i], 0, bounds, accessor, normals);
        memcpy(to, accessor, strlen(accessor));
        memcpy(to + BOUNDS_ROOM, normals, strlen(normals));
    }
    place_solids(glb, frame);
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
    for (size_t i = 0; glb->uv && i < glb->object[0].vertices; i++) {
        drape_file_put_float(&glb->file, glb->uv[i] ? (float)glb->uv[i][0] : 0);
        drape_file_put_float(&glb->file, glb->uv[i] ? (float)(1 - glb->uv[i][1]) : 0);
    }
    for (uint32_t i = 0; i < glb->solids; i++)
        put_solid(glb, &glb->solid[i]);
    find_normals(glb, x);
    for (size_t i = 0; i < 3 * (size_t)glb->points; i++) {
        glb->base[i] = (float)x[i];
        glb->upright[i] = (float)glb->normal[i];
    }
    for (uint32_t i = 0; i < glb->objects; i++) {
        put_vertices(glb, &glb->object[i], glb->base);
        put_vertices(glb, &glb->object[i], glb->upright);
    }
    return drape_file_publish(&glb->file);
}

/* Adds the frame's accessors, target and weight of an object; the first target also opens the lists. */
static drape_status add_target(glb_state *glb, uint32_t number, const double *x)
{
    const object *o = &glb->object[number];
    uint32_t target = glb->frames - 1, accessor = accessor_of(glb, glb->frames, number);
    float bounds[6];
    char positions[ACCESSOR_ROOM + 1], normals[NORMALS_ROOM];
    find_bounds(glb, o, x, true, bounds);
    format_accessors(glb, o, glb->frames, bounds, positions, normals);
    size_t at = glb->at.accessors + ((size_t)glb->frames * glb->objects + number) * ACCESSOR_ROOM;
    drape_status status = fill(glb, at, "%s", positions);
    if (!status)
        status = fill(glb, at + BOUNDS_ROOM, "%s", normals);
    for (uint32_t i = 0; i < o->primitives && !status; i++) {
        const primitive *p = &glb->primitive[o->first_primitive + i];
        if (target == 0)
            status = fill(glb, p->targets_close, "]");
        if (!status)
            status = fill(glb, target ? p->targets + (size_t)target * TARGET_WIDTH : p->targets_open,
                          "%s{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32 "}",
                          target ? "," : ",\"targets\":[", accessor, accessor + 1);
    }
    if (!status && target == 0)
        status = fill(glb, o->weights_close, "]");
    if (!status)
        status = fill(glb, target ? o->weights + (size_t)target * WEIGHT_WIDTH : o->weights_open, "%s0",
                      target ? "," : ",\"weights\":[");
    return status;
}

static drape_status write_next(glb_state *glb, const drape_frame *frame)
{
    off_t before = glb->file.kept;
    const double *x = positions_of(glb, frame);
    find_normals(glb, x);
    for (uint32_t i = 0; i < glb->objects; i++) {
        put_differences(glb, &glb->object[i], x, glb->base);
        put_differences(glb, &glb->object[i], glb->normal, glb->upright);
    }
    drape_status status = drape_file_keep(&glb->file);
    if (status)
        return status;
    status = write_lengths(glb, (glb->frames + 1) * frame_bytes(glb));
    if (status)
        drape_file_cut(&glb->file, before);
    for (uint32_t i = 0; i < glb->objects && !status; i++)
        status = add_target(glb, i, x);
    return status;
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
    keep_places(glb, frame);
    drape_status status = glb->frames == 0 ? write_first(glb, frame) : write_next(glb, frame);
    if (!status)
        glb->frames++;
    glb->live = glb->frames > 0;
    return status;
}

/* ---- Animation and end ---- */

/* The number of bytes of the animation: times, weights, and places of the solids that move. */
static uint32_t animation_bytes(const glb_state *glb)
{
    return 4 * glb->frames * (glb->frames + 7 * glb->moving);
}

/* Accessors of translation and rotation of the solids that move, after those of times and weights. */
static drape_status add_places(glb_state *glb, size_t at)
{
    uint32_t n = glb->frames, view = last_view(glb), offset = 4 * n * n;
    drape_status status = DRAPE_OK;
    for (uint32_t i = 0; i < glb->moving && !status; i++, at += TIMES_ROOM / 2, offset += 28 * n)
        status = fill(glb, at,
                      ",{\"bufferView\":%" PRIu32 ",\"byteOffset\":%" PRIu32
                      ",\"componentType\":5126,\"count\":%" PRIu32
                      ",\"type\":\"VEC3\"},{\"bufferView\":%" PRIu32 ",\"byteOffset\":%" PRIu32
                      ",\"componentType\":5126,\"count\":%" PRIu32 ",\"type\":\"VEC4\"}",
                      view, offset, n, view, offset + 12 * n, n);
    return status;
}

/* A channel for the weights of each object, all by one sampler, and two for each solid that moves. */
static drape_status add_channels(glb_state *glb, uint32_t times)
{
    size_t at = glb->at.animation;
    uint32_t sampler = 1;
    drape_status status = fill(glb, at, ",\"animations\":[{\"name\":\"run\",\"channels\":[");
    at += CHANNEL_ROOM;
    for (uint32_t i = 0; i < glb->objects && !status; i++, at += CHANNEL_ROOM)
        status = fill(glb, at, "%s{\"sampler\":0,\"target\":{\"node\":%" PRIu32 ",\"path\":\"weights\"}}",
                      i ? "," : "", i);
    for (uint32_t i = 0; i < glb->solids; i++)
        for (int turns = 0; turns < 2 && glb->solid[i].moves && !status; turns++, at += CHANNEL_ROOM)
            status =
                fill(glb, at, ",{\"sampler\":%" PRIu32 ",\"target\":{\"node\":%" PRIu32 ",\"path\":\"%s\"}}",
                     sampler++, glb->objects + i, turns ? "rotation" : "translation");
    if (!status)
        status = fill(glb, at, "],\"samplers\":[");
    at += CHANNEL_ROOM / 2;
    for (uint32_t i = 0; i < sampler && !status; i++, at += CHANNEL_ROOM)
        status =
            fill(glb, at, "%s{\"input\":%" PRIu32 ",\"interpolation\":\"LINEAR\",\"output\":%" PRIu32 "}",
                 i ? "," : "", times, times + 1 + i);
    return status ? status : fill(glb, at, "]}]");
}

static drape_status add_animation(glb_state *glb)
{
    uint32_t n = glb->frames, offset = fixed_bytes(glb) + n * frame_bytes(glb);
    uint32_t view = last_view(glb), times = accessor_of(glb, n, 0);
    drape_status status =
        fill(glb, glb->at.views, ",{\"buffer\":0,\"byteOffset\":%" PRIu32 ",\"byteLength\":%" PRIu32 "}",
             offset, animation_bytes(glb));
    if (!status)
        status = fill(glb, glb->at.times,
                      ",{\"bufferView\":%" PRIu32 ",\"componentType\":5126,\"count\":%" PRIu32
                      ",\"type\":\"SCALAR\",\"min\":[%.9g],\"max\":[%.9g]},{\"bufferView\":%" PRIu32
                      ",\"byteOffset\":%" PRIu32 ",\"componentType\":5126,\"count\":%" PRIu32
                      ",\"type\":\"SCALAR\"}",
                      view, n, glb->times[0], glb->times[n - 1], view, 4 * n, n * (n - 1));
    if (!status)
        status = add_places(glb, glb->at.times + TIMES_ROOM / 2);
    return status ? status : add_channels(glb, times);
}

/* Times and weights, n + n (n - 1) numbers, then 7 n of each solid that moves. */
static drape_status write_animation(glb_state *glb)
{
    for (uint32_t i = 0; i < glb->frames; i++)
        drape_file_put_float(&glb->file, glb->times[i]);
    for (uint32_t frame = 0; frame < glb->frames; frame++)
        for (uint32_t target = 1; target < glb->frames; target++)
            drape_file_put_float(&glb->file, frame == target);
    for (uint32_t i = 0; i < glb->solids; i++) {
        const float *moves = glb->solid[i].moves;
        for (uint32_t k = 0; moves && k < 3 * glb->frames; k++)
            drape_file_put_float(&glb->file, moves[k / 3 * 7 + k % 3]);
        for (uint32_t k = 0; moves && k < 4 * glb->frames; k++)
            drape_file_put_float(&glb->file, moves[k / 4 * 7 + 3 + k % 4]);
    }
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
    drape_archive_same(a, "the number of colliders that move in " FILE_NAME, glb->moving);
    if (a->reading && (frames < 0 || frames > glb->room))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %lld frames of %u", (long long)frames,
                           glb->room);
    if (a->status)
        return;
    glb->frames = (uint32_t)frames;
    drape_export_archive_file(a, &glb->file);
    drape_archive_bytes(a, glb->base, 3 * (size_t)glb->points * sizeof *glb->base);
    drape_archive_bytes(a, glb->upright, 3 * (size_t)glb->points * sizeof *glb->upright);
    for (uint32_t i = 0; i < glb->solids; i++)
        if (glb->solid[i].moves)
            drape_archive_bytes(a, glb->solid[i].moves, glb->frames * 7 * sizeof *glb->solid[i].moves);
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

/* Blanks bytes of the JSON. */
static drape_status blank_bytes(glb_state *glb, size_t begin, size_t end)
{
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

/* Blanks a list of texts of one width, each for a frame after the first, from that of frame `frames` on;
 * with it the bracket before it, in which its first item is, and that after it. */
static drape_status blank_list(glb_state *glb, size_t open, size_t list, size_t width, size_t close)
{
    const uint32_t n = glb->frames, items = n > 0 ? n - 1 : 0;
    drape_status status = n > 1 ? DRAPE_OK : blank_bytes(glb, open, list);
    if (!status)
        status = blank_bytes(glb, list + items * width, n > 1 ? close : close + 1);
    return status;
}

/* Blanks everything that later frames and the animation wrote. */
static drape_status blank_rest(glb_state *glb)
{
    const blanks *at = &glb->at;
    const size_t frame = (size_t)glb->objects * ACCESSOR_ROOM;
    drape_status status = blank_bytes(glb, at->views, at->views + TIMES_ROOM / 2);
    if (!status)
        status = blank_bytes(glb, at->times, at->times + times_room(glb));
    if (!status)
        status = blank_bytes(glb, at->animation, at->animation + animation_room(glb));
    if (!status)
        status = blank_bytes(glb, at->accessors + glb->frames * frame, at->accessors + glb->room * frame);
    for (uint32_t i = 0; i < glb->primitives && !status; i++) {
        const primitive *p = &glb->primitive[i];
        status = blank_list(glb, p->targets_open, p->targets, TARGET_WIDTH, p->targets_close);
    }
    for (uint32_t i = 0; i < glb->objects && !status; i++) {
        const object *o = &glb->object[i];
        status = blank_list(glb, o->weights_open, o->weights, WEIGHT_WIDTH, o->weights_close);
    }
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
    .wants_bodies = true,
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
