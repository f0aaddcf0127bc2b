/*
 * import_obj.c: Wavefront OBJ (Wavefront Technologies, Advanced Visualizer manual, appendix B1). A sheet
 * needs two of its statements: "v x y z ..." defines a node, "f a b c ..." a polygon. A corner is v, v/vt,
 * v//vn or v/vt/vn; v and vt count from 1, or backwards from -1 for the last one so far. Of "vt u v" the
 * texture coordinates, of "usemtl" and "mtllib" the names are kept for output. All other statements are
 * ignored.
 *
 * What does not matter to the simulation is not refused: a face with a corner whose texture coordinates are
 * missing or are no numbers has none. Of corners in a row at one node the first counts: "f 1 2 3 3" is a
 * triangle.
 *
 * The file is read twice: the first pass only counts, so that the arrays are allocated once with the right
 * size.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/mesh.h"
#include "mesh/words.h"

#define FAIL(reader, ...) drape_mesh_fail((reader)->ctx, (reader)->source, (reader)->text.line, __VA_ARGS__)

typedef struct obj_count {
    size_t nodes, uvs, faces, corners, materials; /* materials: statements */
    size_t file_size;                             /* of the names in mtllib, each with its end */
} obj_count;

typedef struct obj_reader {
    drape_context *ctx;
    const drape_mesh_source *source;
    drape_mesh *mesh;
    drape_words text;
    int32_t nodes, uvs, faces, corners, materials; /* so far */
    drape_word *material;                          /* the name of each usemtl */
    char *file;                                    /* names of mtllib, one a line */
    size_t file_size;                              /* of that so far */
} obj_reader;

static drape_words open_text(const char *data, size_t size)
{
    drape_words text = drape_words_open(data, size);
    text.comment = '#';
    text.continuation = true;
    return text;
}

/* The rest of the line, without blanks at its end: names may contain blanks. */
static drape_word rest_of_line(drape_words *text)
{
    drape_word word, rest = {text->at, 0};
    for (bool first = true; drape_words_next(text, &word); first = false) {
        rest.start = first ? word.start : rest.start;
        rest.length = (size_t)(word.start + word.length - rest.start);
    }
    return rest;
}

static obj_count count_statements(const char *data, size_t size)
{
    drape_words text = open_text(data, size);
    obj_count count = {0};
    do {
        drape_word word;
        if (!drape_words_next(&text, &word))
            continue;
        count.nodes += drape_word_is(word, "v");
        count.uvs += drape_word_is(word, "vt");
        count.materials += drape_word_is(word, "usemtl");
        if (drape_word_is(word, "mtllib"))
            count.file_size += rest_of_line(&text).length + 1;
        if (drape_word_is(word, "f"))
            for (count.faces++; drape_words_next(&text, &word);)
                count.corners++;
    } while (drape_words_next_line(&text));
    return count;
}

static drape_status read_node(obj_reader *reader)
{
    double *x = reader->mesh->x + 3 * (size_t)reader->nodes++;
    for (int axis = 0; axis < 3; axis++) {
        drape_word word;
        if (!drape_words_next(&reader->text, &word))
            return FAIL(reader, "a node with %d coordinates; it needs x, y and z", axis);
        if (!drape_word_number(word, &x[axis]))
            return FAIL(reader, "%c of a node is \"%.*s\"; it must be a finite number", "xyz"[axis],
                        DRAPE_WORD(word));
    }
    return DRAPE_OK;
}

/* Texture coordinates that are no numbers stay not finite; a missing v is 0. */
static void read_uv(obj_reader *reader)
{
    double *uv = reader->mesh->faces.uv + 2 * (size_t)reader->uvs++;
    drape_word word;
    for (int axis = 0; axis < 2; axis++)
        if (drape_words_next(&reader->text, &word) ? !drape_word_number(word, &uv[axis]) : axis == 0)
            uv[axis] = NAN;
}

/* Parses up to three integers between slashes; those after the first may be empty, and are 0 then. */
static bool corner_numbers(drape_word corner, int64_t number[3])
{
    for (int field = 0; field < 3; field++) {
        const char *slash = memchr(corner.start, '/', corner.length);
        const drape_word part = {corner.start, slash ? (size_t)(slash - corner.start) : corner.length};
        const bool empty_is_fine = field > 0 && part.length == 0;
        if (!empty_is_fine && !drape_word_integer(part, &number[field]))
            return false;
        if (!slash)
            return true;
        corner = (drape_word){slash + 1, corner.length - part.length - 1};
    }
    return false;
}

static drape_status read_corner(const obj_reader *reader, drape_word word, int32_t *node, int32_t *uv)
{
    int64_t number[3] = {0};
    if (!corner_numbers(word, number))
        return FAIL(reader, "a corner is \"%.*s\"; it must be v, v/vt, v//vn or v/vt/vn", DRAPE_WORD(word));
    const int64_t index = number[0] < 0 ? reader->nodes + number[0] : number[0] - 1;
    if (index < 0 || index >= reader->mesh->node_count) {
        const long long n = (long long)number[0];
        const int32_t count = number[0] < 0 ? reader->nodes : reader->mesh->node_count;
        if (count == 0)
            return FAIL(reader, "there is no node %lld: none was defined", n);
        return FAIL(reader, "there is no node %lld; range is %d to %d", n, number[0] < 0 ? -count : 1,
                    number[0] < 0 ? -1 : count);
    }
    *node = (int32_t)index;
    const int64_t texture = number[1] < 0 ? reader->uvs + number[1] : number[1] - 1;
    if (texture >= 0 && texture < reader->mesh->faces.uv_count)
        *uv = (int32_t)texture;
    return DRAPE_OK;
}

static drape_status read_polygon(obj_reader *reader)
{
    drape_faces *faces = &reader->mesh->faces;
    drape_word word;
    const int32_t first = reader->corners;
    int32_t given = 0, end = first;
    for (; drape_words_next(&reader->text, &word); given++) {
        faces->uv_of[end] = -1;
        DRAPE_TRY(read_corner(reader, word, &faces->node[end], &faces->uv_of[end]));
        end += end == first || faces->node[end] != faces->node[end - 1];
    }
    while (end - first > 1 && faces->node[end - 1] == faces->node[first])
        end--;
    if (given < 3)
        return FAIL(reader, "a face with %d corners; it needs at least 3", given);
    if (end - first < 3)
        return FAIL(reader, "a face with corners at %d nodes; it needs at least 3; remedy: delete it",
                    end - first);
    reader->corners = end;
    faces->material[reader->faces++] = reader->materials - 1;
    faces->first[reader->faces] = reader->corners;
    return DRAPE_OK;
}

static drape_status read_statements(obj_reader *reader)
{
    drape_status status = DRAPE_OK;
    do {
        drape_word word;
        if (!drape_words_next(&reader->text, &word))
            continue;
        if (drape_word_is(word, "v"))
            status = read_node(reader);
        else if (drape_word_is(word, "vt"))
            read_uv(reader);
        else if (drape_word_is(word, "usemtl"))
            reader->material[reader->materials++] = rest_of_line(&reader->text);
        else if (drape_word_is(word, "mtllib")) {
            /* A file may have several of these statements. */
            const drape_word name = rest_of_line(&reader->text);
            if (name.length > 0 && reader->file_size > 0)
                reader->file[reader->file_size++] = '\n';
            for (size_t i = 0; i < name.length; i++)
                reader->file[reader->file_size++] = name.start[i] == '\n' ? ' ' : name.start[i];
        } else if (drape_word_is(word, "f"))
            status = read_polygon(reader);
        status = status ? status : drape_check_cancel_after(reader->ctx, 64);
    } while (!status && drape_words_next_line(&reader->text));
    return status;
}

/* ---- Materials ---- */

static char *copy_word(drape_arena *arena, drape_word word)
{
    char *text = drape_arena_take(arena, word.length + 1, 1);
    if (text)
        memcpy(text, word.start, word.length);
    return text;
}

typedef struct numbered_name {
    drape_word name;
    int32_t number;
} numbered_name;

static int compare_names(const void *left, const void *right)
{
    const numbered_name *a = left, *b = right;
    const size_t least = a->name.length < b->name.length ? a->name.length : b->name.length;
    const int order = memcmp(a->name.start, b->name.start, least);
    if (order || a->name.length != b->name.length)
        return order ? order : a->name.length < b->name.length ? -1 : 1;
    return (a->number > b->number) - (a->number < b->number);
}

/* Faces have the number of the last usemtl: replaces it by that of its name, in the order in which faces use
 * them. same (material_count) is workspace: the first usemtl of the same name. */
static drape_status name_materials(obj_reader *reader, numbered_name *sorted, int32_t *same)
{
    drape_faces *faces = &reader->mesh->faces;
    drape_arena *arena = &reader->mesh->arena;
    const int32_t count = reader->materials;
    for (int32_t i = 0; i < count; i++)
        sorted[i] = (numbered_name){reader->material[i], i};
    qsort(sorted, (size_t)count, sizeof *sorted, compare_names);
    for (int32_t i = 0; i < count; i++) {
        const bool repeats =
            i > 0 && sorted[i].name.length == sorted[i - 1].name.length &&
            memcmp(sorted[i].name.start, sorted[i - 1].name.start, sorted[i].name.length) == 0;
        same[sorted[i].number] = repeats ? same[sorted[i - 1].number] : sorted[i].number;
    }
    int32_t *number = drape_arena_take(arena, (size_t)count, sizeof *number);
    faces->name = drape_arena_take(arena, (size_t)count, sizeof *faces->name);
    for (int32_t f = 0; !drape_arena_status(arena) && f < faces->count; f++) {
        const int32_t first = faces->material[f] < 0 ? -1 : same[faces->material[f]];
        if (first < 0 || reader->material[first].length == 0) {
            faces->material[f] = -1;
            continue;
        }
        if (number[first] == 0) {
            faces->name[faces->material_count++] = copy_word(arena, reader->material[first]);
            number[first] = faces->material_count;
        }
        faces->material[f] = number[first] - 1;
    }
    if (faces->material_count > 0 && reader->file_size > 0)
        faces->material_file = copy_word(arena, (drape_word){reader->file, reader->file_size});
    drape_arena_release(arena, number);
    return drape_arena_status(arena);
}

static drape_status read_obj(drape_context *ctx, const drape_mesh_source *source, const char *data,
                             size_t size, drape_mesh *mesh)
{
    const obj_count count = count_statements(data, size);
    drape_status status =
        drape_faces_allocate(ctx, source, count.nodes, count.faces, count.corners, count.uvs, mesh);
    if (status)
        return status;
    drape_arena scratch = drape_arena_of(ctx);
    obj_reader reader = {.ctx = ctx, .source = source, .mesh = mesh, .text = open_text(data, size)};
    reader.material = drape_arena_take(&scratch, count.materials, sizeof *reader.material);
    reader.file = drape_arena_take(&scratch, count.file_size, 1);
    numbered_name *sorted = drape_arena_take(&scratch, count.materials, sizeof *sorted);
    int32_t *same = drape_arena_take(&scratch, count.materials, sizeof *same);
    status = drape_arena_status(&scratch);
    if (!status)
        status = read_statements(&reader);
    if (!status) {
        mesh->faces.corner_count = reader.corners;
        mesh->triangle_count = reader.corners - 2 * reader.faces;
    }
    if (!status)
        status = name_materials(&reader, sorted, same);
    drape_arena_free(&scratch);
    return status ? status : drape_faces_complete(ctx, mesh);
}

const drape_import_ops drape_import_obj = {
    .entry = {.name = "obj",
              .summary = "Wavefront OBJ; faces of any number of corners; their texture coordinates and the "
                         "names of their materials are for output"},
    .ending = ".obj",
    .read = read_obj,
};
