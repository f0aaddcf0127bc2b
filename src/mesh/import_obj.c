/*
 * import_obj.c: Wavefront OBJ (Wavefront Technologies, Advanced Visualizer manual, appendix B1). A sheet
 * needs two of its statements: "v x y z ..." defines a node, "f a b c ..." a polygon, which becomes a fan of
 * triangles around its first corner. A corner is v, v/vt, v//vn or v/vt/vn; v counts from 1, or backwards
 * from -1 for the last node so far. All other statements are ignored.
 *
 * The file is read twice: the first pass only counts, so that the arrays are allocated once with the right
 * size.
 */
#include <string.h>

#include "mesh/mesh.h"
#include "mesh/text.h"

typedef struct obj_reader {
    drape_context *ctx;
    const drape_mesh_source *source;
    drape_mesh *mesh;
    drape_text text;
    int32_t nodes, triangles; /* so far */
} obj_reader;

static drape_text open_text(const char *data, size_t size)
{
    drape_text text = drape_text_open(data, size);
    text.comment = '#';
    text.continuation = true;
    return text;
}

static void count_statements(const char *data, size_t size, size_t *nodes, size_t *triangles)
{
    drape_text text = open_text(data, size);
    do {
        drape_word word;
        if (!drape_text_next_word(&text, &word))
            continue;
        if (drape_word_is(word, "v"))
            ++*nodes;
        if (drape_word_is(word, "f"))
            for (size_t corner = 1; drape_text_next_word(&text, &word); corner++)
                *triangles += corner >= 3;
    } while (drape_text_next_line(&text));
}

static drape_status read_node(obj_reader *reader)
{
    double *x = reader->mesh->x + 3 * (size_t)reader->nodes++;
    for (int axis = 0; axis < 3; axis++) {
        drape_word word;
        if (!drape_text_next_word(&reader->text, &word))
            return drape_mesh_fail(reader->ctx, reader->source, reader->text.line,
                                   "a node with %d coordinates; it needs x, y and z", axis);
        if (!drape_word_number(word, &x[axis]))
            return drape_mesh_fail(reader->ctx, reader->source, reader->text.line,
                                   "%c of a node is \"%.*s\"; it must be a finite number", "xyz"[axis],
                                   drape_word_shown(word), word.start);
    }
    return DRAPE_OK;
}

/* Parses the first of up to three integers between slashes; the others may be empty. */
static bool corner_number(drape_word corner, int64_t *number)
{
    for (int field = 0; field < 3; field++) {
        int64_t passed_over;
        const char *slash = memchr(corner.start, '/', corner.length);
        const drape_word part = {corner.start, slash ? (size_t)(slash - corner.start) : corner.length};
        const bool empty_is_fine = field > 0 && part.length == 0;
        if (!empty_is_fine && !drape_word_integer(part, field == 0 ? number : &passed_over))
            return false;
        if (!slash)
            return true;
        corner = (drape_word){slash + 1, corner.length - part.length - 1};
    }
    return false;
}

static drape_status fail_node(const obj_reader *reader, int64_t number)
{
    const long long n = (long long)number;
    const int32_t count = number < 0 ? reader->nodes : reader->mesh->node_count;
    if (count == 0)
        return drape_mesh_fail(reader->ctx, reader->source, reader->text.line,
                               "there is no node %lld: none was defined", n);
    return drape_mesh_fail(reader->ctx, reader->source, reader->text.line,
                           "there is no node %lld; range is %d to %d", n, number < 0 ? -count : 1,
                           number < 0 ? -1 : count);
}

static drape_status read_corner(const obj_reader *reader, drape_word word, int32_t *node)
{
    int64_t number;
    if (!corner_number(word, &number))
        return drape_mesh_fail(reader->ctx, reader->source, reader->text.line,
                               "a corner is \"%.*s\"; it must be v, v/vt, v//vn or v/vt/vn",
                               drape_word_shown(word), word.start);
    const int64_t index = number < 0 ? reader->nodes + number : number - 1;
    if (index < 0 || index >= reader->mesh->node_count)
        return fail_node(reader, number);
    *node = (int32_t)index;
    return DRAPE_OK;
}

static drape_status read_polygon(obj_reader *reader)
{
    drape_word word;
    int32_t first = 0, last = 0, corners = 0;
    for (; drape_text_next_word(&reader->text, &word); corners++) {
        int32_t node = 0;
        const drape_status status = read_corner(reader, word, &node);
        if (status)
            return status;
        if (corners == 0)
            first = node;
        if (corners >= 2) {
            int32_t *triangle = reader->mesh->triangle + 3 * (size_t)reader->triangles++;
            triangle[0] = first;
            triangle[1] = last;
            triangle[2] = node;
        }
        last = node;
    }
    if (corners < 3)
        return drape_mesh_fail(reader->ctx, reader->source, reader->text.line,
                               "a face with %d corners; it needs at least 3", corners);
    return DRAPE_OK;
}

static drape_status read_statements(obj_reader *reader)
{
    drape_status status = DRAPE_OK;
    do {
        drape_word word;
        if (!drape_text_next_word(&reader->text, &word))
            continue;
        if (drape_word_is(word, "v"))
            status = read_node(reader);
        else if (drape_word_is(word, "f"))
            status = read_polygon(reader);
    } while (!status && drape_text_next_line(&reader->text));
    return status;
}

static drape_status read_obj(drape_context *ctx, const drape_mesh_source *source, const char *data,
                             size_t size, drape_mesh *mesh)
{
    obj_reader reader = {.ctx = ctx, .source = source, .mesh = mesh, .text = open_text(data, size)};
    size_t nodes = 0, triangles = 0;
    count_statements(data, size, &nodes, &triangles);
    const drape_status status = drape_mesh_allocate(ctx, source, nodes, triangles, mesh);
    return status ? status : read_statements(&reader);
}

const drape_import_ops drape_import_obj = {
    .entry =
        {.name = "obj",
         .summary =
             "Wavefront OBJ; polygons become fans of triangles, everything but nodes and faces is ignored"},
    .ending = ".obj",
    .read = read_obj,
};
