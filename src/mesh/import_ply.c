/*
 * import_ply.c: the Stanford polygon format (Turk 1994, "The PLY Polygon File Format"), ascii and binary. A
 * header lists elements (vertex, face, others) with their properties; the items of each element follow in
 * that order, all as text or all as bytes. The reader uses x, y, z of vertex and the list vertex_indices (or
 * vertex_index) of face. Texture coordinates are kept for output: s, t of vertex (or u, v, or texture_u,
 * texture_v), or the list texcoord of face, u and v of each corner. Everything else is ignored.
 *
 * The data are read twice: the first pass only counts faces and corners, because a face may have any number
 * of these.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "mesh/mesh.h"
#include "mesh/words.h"

#define MAX_ELEMENTS   32
#define MAX_PROPERTIES 256

typedef enum ply_type { NO_TYPE, INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64 } ply_type;

static const struct {
    const char *name, *sized_name;
    size_t size; /* bytes */
} types[] = {
    [NO_TYPE] = {"", "", 0},
    [INT8] = {"char", "int8", 1},
    [UINT8] = {"uchar", "uint8", 1},
    [INT16] = {"short", "int16", 2},
    [UINT16] = {"ushort", "uint16", 2},
    [INT32] = {"int", "int32", 4},
    [UINT32] = {"uint", "uint32", 4},
    [FLOAT32] = {"float", "float32", 4},
    [FLOAT64] = {"double", "float64", 8},
};

typedef enum ply_role { X, Y, Z, CORNERS, U, V, CORNER_UVS, PASSED_OVER } ply_role;
#define NEEDED_ROLES U

typedef struct ply_property {
    ply_type count_type; /* type of a list's count; NO_TYPE: not a list */
    ply_type type;
    ply_role role;
} ply_property;

typedef struct ply_element {
    drape_word name;
    int64_t line; /* line of the header */
    int64_t count;
    int first_property, property_count;
} ply_element;

typedef enum ply_format { NO_FORMAT, ASCII, LITTLE_ENDIAN_BYTES, BIG_ENDIAN_BYTES } ply_format;

typedef struct ply_reader {
    drape_context *ctx;
    const drape_mesh_source *source;
    drape_mesh *mesh;
    drape_words text; /* the header, later the data, whether ascii or binary */
    ply_format format;
    ply_element elements[MAX_ELEMENTS];
    ply_property properties[MAX_PROPERTIES];
    int element_count, property_count;
    bool has_role[PASSED_OVER];
    /* while the data are read: */
    const ply_element *element;
    int64_t item;
    bool counting;         /* the first pass: nothing is written */
    size_t faces, corners; /* so far */
    int64_t list_count;    /* of the texture coordinates of this face's corners, which begin at `list` */
    ply_type list_type;
    drape_words list;
} ply_reader;

/* Reports a fault at the present place: a line or, in binary data, an item. */
static drape_status fail(const ply_reader *reader, const char *format, ...) DRAPE_PRINTF(2, 3);

static drape_status fail(const ply_reader *reader, const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (!reader->element || reader->format == ASCII)
        return drape_mesh_fail(reader->ctx, reader->source, reader->text.line, "%s", text);
    return drape_mesh_fail(reader->ctx, reader->source, 0, "%.*s %lld: %s", DRAPE_WORD(reader->element->name),
                           (long long)reader->item, text);
}

/* Header */

/* Takes the next word of a header line; what: its description, for the message if there is none. */
static drape_status take(ply_reader *reader, const char *what, drape_word *word)
{
    if (drape_words_next(&reader->text, word))
        return DRAPE_OK;
    return fail(reader, "the line ends before %s", what);
}

static drape_status read_format(ply_reader *reader)
{
    static const char *const names[] = {[ASCII] = "ascii",
                                        [LITTLE_ENDIAN_BYTES] = "binary_little_endian",
                                        [BIG_ENDIAN_BYTES] = "binary_big_endian"};
    drape_word name, version;
    DRAPE_TRY(take(reader, "the name of the format", &name));
    DRAPE_TRY(take(reader, "the version of the format", &version));
    reader->format = NO_FORMAT;
    for (int format = ASCII; format <= BIG_ENDIAN_BYTES; format++)
        if (drape_word_is(name, names[format]))
            reader->format = (ply_format)format;
    if (reader->format == NO_FORMAT)
        return fail(reader, "format \"%.*s\"; it must be one of: %s, %s, %s", DRAPE_WORD(name), names[ASCII],
                    names[LITTLE_ENDIAN_BYTES], names[BIG_ENDIAN_BYTES]);
    if (!drape_word_is(version, "1.0"))
        return fail(reader, "version \"%.*s\" of the format; it must be 1.0", DRAPE_WORD(version));
    return DRAPE_OK;
}

static const ply_element *find_element(const ply_reader *reader, const char *name)
{
    for (int i = 0; i < reader->element_count; i++)
        if (drape_word_is(reader->elements[i].name, name))
            return &reader->elements[i];
    return NULL;
}

static drape_status read_element(ply_reader *reader)
{
    ply_element element = {.line = reader->text.line, .first_property = reader->property_count};
    drape_word count;
    DRAPE_TRY(take(reader, "the name of the element", &element.name));
    DRAPE_TRY(take(reader, "the count of the element", &count));
    if (!drape_word_integer(count, &element.count) || element.count < 0)
        return fail(reader, "count \"%.*s\"; it must be a whole number from 0", DRAPE_WORD(count));
    for (int i = 0; i < reader->element_count; i++)
        if (reader->elements[i].name.length == element.name.length &&
            memcmp(reader->elements[i].name.start, element.name.start, element.name.length) == 0)
            return fail(reader, "element %.*s is defined twice", DRAPE_WORD(element.name));
    if (reader->element_count == MAX_ELEMENTS)
        return fail(reader, "more than %d elements", MAX_ELEMENTS);
    reader->elements[reader->element_count++] = element;
    return DRAPE_OK;
}

static drape_status take_type(ply_reader *reader, drape_word word, ply_type *type)
{
    for (int i = INT8; i <= FLOAT64; i++)
        if (drape_word_is(word, types[i].name) || drape_word_is(word, types[i].sized_name)) {
            *type = (ply_type)i;
            return DRAPE_OK;
        }
    return fail(reader, "unknown type \"%.*s\"", DRAPE_WORD(word));
}

static bool is_integer(ply_type type)
{
    return type >= INT8 && type <= UINT32;
}

static drape_status add_property(ply_reader *reader, ply_property property, drape_word name)
{
    static const struct {
        const char *element, *name;
        bool list;
        ply_role role;
    } known[] = {{"vertex", "x", false, X},
                 {"vertex", "y", false, Y},
                 {"vertex", "z", false, Z},
                 {"vertex", "s", false, U},
                 {"vertex", "u", false, U},
                 {"vertex", "texture_u", false, U},
                 {"vertex", "t", false, V},
                 {"vertex", "v", false, V},
                 {"vertex", "texture_v", false, V},
                 {"face", "vertex_indices", true, CORNERS},
                 {"face", "vertex_index", true, CORNERS},
                 {"face", "texcoord", true, CORNER_UVS}};
    const bool list = property.count_type != NO_TYPE;
    ply_element *element = &reader->elements[reader->element_count - 1];
    property.role = PASSED_OVER;
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (drape_word_is(element->name, known[i].element) && drape_word_is(name, known[i].name) &&
            list == known[i].list)
            property.role = known[i].role;
    if (list && !is_integer(property.count_type))
        return fail(reader, "the count of a list is %s; it must be an integer type",
                    types[property.count_type].name);
    if (property.role == CORNERS && !is_integer(property.type))
        return fail(reader, "%.*s are %s; they must be of an integer type", DRAPE_WORD(name),
                    types[property.type].name);
    if (property.role >= NEEDED_ROLES && property.role != PASSED_OVER && reader->has_role[property.role])
        property.role = PASSED_OVER; /* a second set of texture coordinates */
    if (property.role != PASSED_OVER && reader->has_role[property.role])
        return fail(reader, "property %.*s is defined twice", DRAPE_WORD(name));
    if (reader->property_count == MAX_PROPERTIES)
        return fail(reader, "more than %d properties", MAX_PROPERTIES);
    if (property.role != PASSED_OVER)
        reader->has_role[property.role] = true;
    reader->properties[reader->property_count++] = property;
    element->property_count++;
    return DRAPE_OK;
}

static drape_status read_property(ply_reader *reader)
{
    ply_property property = {.count_type = NO_TYPE};
    drape_word word;
    if (reader->element_count == 0)
        return fail(reader, "a property before the first element");
    DRAPE_TRY(take(reader, "the type of the property", &word));
    if (drape_word_is(word, "list")) {
        DRAPE_TRY(take(reader, "the type of the list's count", &word));
        DRAPE_TRY(take_type(reader, word, &property.count_type));
        DRAPE_TRY(take(reader, "the type of the list's values", &word));
    }
    DRAPE_TRY(take_type(reader, word, &property.type));
    DRAPE_TRY(take(reader, "the name of the property", &word));
    return add_property(reader, property, word);
}

static drape_status read_header_line(ply_reader *reader, drape_word keyword)
{
    if (drape_word_is(keyword, "format"))
        return read_format(reader);
    if (drape_word_is(keyword, "element"))
        return read_element(reader);
    if (drape_word_is(keyword, "property"))
        return read_property(reader);
    if (drape_word_is(keyword, "comment") || drape_word_is(keyword, "obj_info"))
        return DRAPE_OK;
    return fail(reader, "unknown keyword \"%.*s\"", DRAPE_WORD(keyword));
}

static drape_status check_contents(const ply_reader *reader)
{
    static const char *const names[NEEDED_ROLES] = {"x", "y", "z", "vertex_indices"};
    if (reader->format == NO_FORMAT)
        return fail(reader, "the header has no format");
    if (!find_element(reader, "vertex") || !find_element(reader, "face"))
        return fail(reader, "the header has no element %s",
                    find_element(reader, "vertex") ? "face" : "vertex");
    for (int role = 0; role < NEEDED_ROLES; role++)
        if (!reader->has_role[role])
            return fail(reader, "element %s has no %s %s", role == CORNERS ? "face" : "vertex",
                        role == CORNERS ? "list" : "property", names[role]);
    return DRAPE_OK;
}

/* Reads the lines up to end_header; the text is then at the start of the data. */
static drape_status read_header(ply_reader *reader)
{
    drape_word word;
    if (!drape_words_next(&reader->text, &word) || !drape_word_is(word, "ply"))
        return fail(reader, "the first line must be \"ply\"");
    while (drape_words_next_line(&reader->text)) {
        if (!drape_words_next(&reader->text, &word))
            continue;
        if (drape_word_is(word, "end_header")) {
            const drape_status status = check_contents(reader);
            drape_words_next_line(&reader->text);
            return status;
        }
        DRAPE_TRY(read_header_line(reader, word));
    }
    return fail(reader, "the header has no end_header");
}

/* Refuses counts that the rest of the file cannot hold, before memory is allocated for them. */
static drape_status check_counts(ply_reader *reader)
{
    /* the last line of a text may have no line end */
    const int64_t left = reader->text.end - reader->text.at + (reader->format == ASCII);
    for (int i = 0; i < reader->element_count; i++) {
        const ply_element *element = &reader->elements[i];
        int64_t least = 0; /* bytes that an item takes; in text, a digit and a blank per value */
        for (int k = 0; k < element->property_count; k++) {
            const ply_property *property = &reader->properties[element->first_property + k];
            const ply_type first = property->count_type ? property->count_type : property->type;
            least += reader->format == ASCII ? 2 : (int64_t)types[first].size;
        }
        if (least > 0 && element->count > left / least)
            return drape_mesh_fail(reader->ctx, reader->source, element->line,
                                   "%lld items of %.*s; the %lld bytes after the header hold at most %lld",
                                   (long long)element->count, DRAPE_WORD(element->name),
                                   (long long)(reader->text.end - reader->text.at),
                                   (long long)(left / least));
    }
    return DRAPE_OK;
}

/* Data */

static double decode(ply_type type, const unsigned char *bytes, bool big_endian)
{
    const size_t size = types[type].size;
    uint64_t bits = 0;
    for (size_t i = 0; i < size; i++)
        bits = bits << 8 | bytes[big_endian ? i : size - 1 - i];
    const uint64_t sign = UINT64_C(1) << (8 * size - 1);
    if (type == INT8 || type == INT16 || type == INT32) /* two's complement */
        return (double)(int64_t)(bits & (sign - 1)) - (double)(bits & sign);
    if (type == FLOAT32) {
        const uint32_t half = (uint32_t)bits;
        float value;
        memcpy(&value, &half, sizeof value);
        return (double)value;
    }
    if (type == FLOAT64) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    return (double)bits;
}

/* Reads the next value; a NULL value skips it. */
static drape_status read_value(ply_reader *reader, ply_type type, double *value)
{
    drape_words *text = &reader->text;
    if (reader->format == ASCII) {
        drape_word word;
        if (!drape_words_next(text, &word))
            return fail(reader, "the line ends before all values of its %.*s",
                        DRAPE_WORD(reader->element->name));
        if (value && !drape_word_number(word, value))
            return fail(reader, "value \"%.*s\"; it must be a finite number", DRAPE_WORD(word));
        return DRAPE_OK;
    }
    if ((size_t)(text->end - text->at) < types[type].size)
        return fail(reader, "the data end within it");
    if (value)
        *value = decode(type, (const unsigned char *)text->at, reader->format == BIG_ENDIAN_BYTES);
    text->at += types[type].size;
    return DRAPE_OK;
}

/* Texture coordinates of vertices count only where corners have none. */
static bool has_vertex_uvs(const ply_reader *reader)
{
    return reader->has_role[U] && reader->has_role[V] && !reader->has_role[CORNER_UVS];
}

static drape_status read_polygon(ply_reader *reader, ply_type type, int64_t corners)
{
    drape_faces *faces = &reader->mesh->faces;
    for (int64_t corner = 0; corner < corners; corner++) {
        double value = 0;
        DRAPE_TRY(read_value(reader, type, &value));
        if (!(value >= 0 && value < reader->mesh->node_count && value == floor(value)))
            return fail(reader, "there is no vertex %.10g; there are %d, counted from 0", value,
                        reader->mesh->node_count);
        faces->node[reader->corners] = (int32_t)value;
        if (has_vertex_uvs(reader))
            faces->uv_of[reader->corners] = (int32_t)value;
        reader->corners++;
    }
    faces->first[++reader->faces] = (int32_t)reader->corners;
    return DRAPE_OK;
}

/* Numbers of the file, not all of which need to be read: texture coordinates that are no numbers do not
 * matter to the simulation. */
static void read_uv(ply_reader *reader, ply_type type, double *uv)
{
    drape_word word;
    if (reader->format != ASCII)
        read_value(reader, type, uv);
    else if (!drape_words_next(&reader->text, &word) || !drape_word_number(word, uv))
        *uv = NAN;
}

static drape_status read_list(ply_reader *reader, const ply_property *property)
{
    double length = 0;
    DRAPE_TRY(read_value(reader, property->count_type, &length));
    if (!(length >= 0 && length <= UINT32_MAX && length == floor(length)))
        return fail(reader, "a list of %.10g values; it must be a whole number from 0", length);
    const int64_t count = (int64_t)length;
    if (property->role == CORNERS && count < 3)
        return fail(reader, "a face with %d corners; it needs at least 3", (int)count);
    if (property->role == CORNERS && !reader->counting)
        return read_polygon(reader, property->type, count);
    if (property->role == CORNER_UVS) {
        reader->list = reader->text;
        reader->list_type = property->type;
        reader->list_count = count;
    }
    for (int64_t i = 0; i < count; i++)
        DRAPE_TRY(read_value(reader, property->type, NULL));
    if (property->role == CORNERS) {
        reader->faces++;
        reader->corners += (size_t)count;
    }
    return DRAPE_OK;
}

static drape_status read_property_value(ply_reader *reader, const ply_property *property)
{
    if (property->count_type)
        return read_list(reader, property);
    const size_t item = (size_t)reader->item, role = (size_t)property->role;
    if (reader->counting || property->role == PASSED_OVER)
        return read_value(reader, property->type, NULL);
    if (role <= Z)
        return read_value(reader, property->type, &reader->mesh->x[3 * item + role]);
    const drape_words before = reader->text;
    DRAPE_TRY(read_value(reader, property->type, NULL));
    const drape_words after = reader->text;
    reader->text = before;
    if (has_vertex_uvs(reader))
        read_uv(reader, property->type, &reader->mesh->faces.uv[2 * item + (role - U)]);
    reader->text = after;
    return DRAPE_OK;
}

/* In ascii data an item is a line; empty lines are skipped. */
static drape_status find_item_line(ply_reader *reader)
{
    drape_word word;
    for (;;) {
        drape_words ahead = reader->text;
        if (drape_words_next(&ahead, &word))
            return DRAPE_OK;
        if (!drape_words_next_line(&reader->text))
            return fail(reader, "the file ends before %.*s %lld of %lld", DRAPE_WORD(reader->element->name),
                        (long long)reader->item, (long long)reader->element->count);
    }
}

static drape_status read_item(ply_reader *reader)
{
    const ply_property *property = reader->properties + reader->element->first_property;
    if (reader->format == ASCII)
        DRAPE_TRY(find_item_line(reader));
    for (int i = 0; i < reader->element->property_count; i++)
        DRAPE_TRY(read_property_value(reader, &property[i]));
    if (!reader->counting && reader->has_role[CORNER_UVS] && drape_word_is(reader->element->name, "face")) {
        /* Texture coordinates of the corners of the last face: the reader returns to their list when it has
         * the corners, which may follow the list. */
        drape_faces *faces = &reader->mesh->faces;
        const size_t first = (size_t)faces->first[reader->faces - 1], last = reader->corners;
        const drape_words after = reader->text;
        reader->text = reader->list;
        for (size_t c = first; c < last && reader->list_count == 2 * (int64_t)(last - first); c++) {
            faces->uv_of[c] = (int32_t)c;
            for (size_t k = 0; k < 2; k++)
                read_uv(reader, reader->list_type, &faces->uv[2 * c + k]);
        }
        reader->text = after;
    }
    drape_word word;
    if (reader->format != ASCII)
        return DRAPE_OK;
    if (drape_words_next(&reader->text, &word))
        return fail(reader, "\"%.*s\" after the last value of its %.*s", DRAPE_WORD(word),
                    DRAPE_WORD(reader->element->name));
    drape_words_next_line(&reader->text);
    return DRAPE_OK;
}

/* Reads the items of all elements, from the present place of the text. */
static drape_status read_items(ply_reader *reader, bool counting)
{
    reader->counting = counting;
    reader->faces = reader->corners = 0;
    for (int i = 0; i < reader->element_count; i++) {
        reader->element = &reader->elements[i];
        if (reader->element->property_count == 0) /* items without properties take no byte and no line */
            continue;
        for (int64_t item = 0; item < reader->element->count; item++) {
            reader->item = item;
            DRAPE_TRY(read_item(reader));
            DRAPE_TRY(drape_check_cancel_after(reader->ctx, 64));
        }
    }
    return DRAPE_OK;
}

static drape_status read_ply(drape_context *ctx, const drape_mesh_source *source, const char *data,
                             size_t size, drape_mesh *mesh)
{
    ply_reader reader = {.ctx = ctx, .source = source, .mesh = mesh, .text = drape_words_open(data, size)};
    DRAPE_TRY(read_header(&reader));
    DRAPE_TRY(check_counts(&reader));
    const drape_words items = reader.text;
    DRAPE_TRY(read_items(&reader, true));
    const size_t nodes = (size_t)find_element(&reader, "vertex")->count;
    const size_t uvs = reader.has_role[CORNER_UVS] ? reader.corners : has_vertex_uvs(&reader) ? nodes : 0;
    DRAPE_TRY(drape_faces_allocate(ctx, source, nodes, reader.faces, reader.corners, uvs, mesh));
    reader.text = items;
    DRAPE_TRY(read_items(&reader, false));
    return drape_faces_complete(ctx, mesh);
}

const drape_import_ops drape_import_ply = {
    .entry = {.name = "ply",
              .summary = "Stanford PLY, ascii or binary of either byte order; faces of any number of "
                         "corners; their texture coordinates are for output"},
    .ending = ".ply",
    .read = read_ply,
};
