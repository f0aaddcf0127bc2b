/* gltf.c: see gltf.h. */
#include "mesh/gltf.h"

#include "base/json_read.h"
#include "mesh/npy_array.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define MAGIC      0x46546c67u /* "glTF" */
#define CHUNK_JSON 0x4e4f534au
#define CHUNK_BIN  0x004e4942u
#define HEADER     12 /* [bytes] of the file */
#define CHUNK      8  /* [bytes] of the header of a chunk */
#define MAX_JSON   ((size_t)1 << 28)
#define MAX_READ   ((size_t)1 << 32) /* [bytes] of numbers: those of an accessor may be read many times */

#define FAIL(g, ...) drape_mesh_fail((g)->ctx, (g)->file, 0, __VA_ARGS__)

/* ---- The container ---- */

static drape_status parse_json(drape_gltf *g, const char *text, size_t size)
{
    json_error_t error;
    if (size > MAX_JSON)
        return FAIL(g, "its JSON has %zu bytes; at most %zu are read", size, MAX_JSON);
    g->root = drape_json_read(text, size, JSON_DECODE_INT_AS_REAL, &error);
    if (g->root && json_is_object(g->root))
        return DRAPE_OK;
    if (!g->root && json_error_code(&error) == json_error_out_of_memory)
        return drape_fail_memory(g->ctx, size);
    return FAIL(g, "its JSON, byte %d: %s", g->root ? 0 : error.position,
                g->root ? "it is no object" : error.text);
}

/* The header, and then chunks: that of the JSON is the first, that of the buffer the second. Unknown ones are
 * skipped. */
static drape_status read_chunks(drape_gltf *g, const char *data, size_t size)
{
    if (size < HEADER || drape_bytes_word(data) != MAGIC)
        return FAIL(g, "it is not a GLB file: it does not begin with glTF");
    if (drape_bytes_word(data + 4) != 2)
        return FAIL(g, "glTF version %u; 2 can be read", (unsigned)drape_bytes_word(data + 4));
    if (drape_bytes_word(data + 8) > size)
        return FAIL(g, "it has %zu bytes; its header says %u", size, (unsigned)drape_bytes_word(data + 8));
    const size_t end = drape_bytes_word(data + 8);
    for (size_t at = HEADER; at + CHUNK <= end;) {
        const size_t length = drape_bytes_word(data + at), rest = end - at - CHUNK;
        const uint32_t type = drape_bytes_word(data + at + 4);
        if (length > rest)
            return FAIL(g, "a chunk of %zu bytes at byte %zu ends behind the file, which has %zu", length, at,
                        end);
        const char *chunk = data + at + CHUNK;
        if (!g->root && type != CHUNK_JSON)
            return FAIL(g, "its first chunk is not JSON");
        if (!g->root) {
            const drape_status status = parse_json(g, chunk, length);
            if (status)
                return status;
        } else if (type == CHUNK_BIN && !g->bytes) {
            g->bytes = chunk;
            g->size = length;
        }
        at += CHUNK + length;
    }
    return g->root ? DRAPE_OK : FAIL(g, "it has no JSON");
}

/* What a file says it cannot be read without; materials and lights do not matter here. */
static drape_status check_extensions(const drape_gltf *g)
{
    static const char *const harmless[] = {"KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_"};
    const json_t *name;
    size_t i;
    json_array_foreach(json_object_get(g->root, "extensionsRequired"), i, name)
    {
        const char *text = json_string_value(name);
        bool known = false;
        for (size_t k = 0; text && k < sizeof harmless / sizeof *harmless; k++)
            known = known || strncmp(text, harmless[k], strlen(harmless[k])) == 0;
        if (!known)
            return FAIL(g, "it needs the extension %.60s, which is not read", text ? text : "(no name)");
    }
    return DRAPE_OK;
}

drape_status drape_gltf_open(drape_context *ctx, const drape_mesh_source *file, const char *data, size_t size,
                             drape_gltf *g)
{
    *g = (drape_gltf){.ctx = ctx, .file = file};
    const drape_status status = read_chunks(g, data, size);
    return status ? status : check_extensions(g);
}

void drape_gltf_close(drape_gltf *g)
{
    json_decref(g->root);
    g->root = NULL;
}

/* ---- JSON ---- */

int32_t drape_gltf_count(const drape_gltf *g, const char *array)
{
    const size_t count = json_array_size(json_object_get(g->root, array));
    return count > INT32_MAX ? INT32_MAX : (int32_t)count;
}

const json_t *drape_gltf_item(const drape_gltf *g, const char *array, int32_t index)
{
    return json_array_get(json_object_get(g->root, array), (size_t)index);
}

/* An integer from low to high; false if the value is something else. */
static bool take_integer(const json_t *value, double low, double high, int64_t *out)
{
    const double number = json_is_number(value) ? json_number_value(value) : -1;
    if (!json_is_number(value) || !(number >= low && number <= high) || number != (double)(int64_t)number)
        return false;
    *out = (int64_t)number;
    return true;
}

/* A value as a message says it. */
static const char *describe(const json_t *value, char *text, size_t size)
{
    static const char *const names[] = {[JSON_OBJECT] = "an object",
                                        [JSON_ARRAY] = "an array",
                                        [JSON_TRUE] = "true",
                                        [JSON_FALSE] = "false",
                                        [JSON_NULL] = "null"};
    if (json_is_number(value))
        snprintf(text, size, "%.17g", json_number_value(value));
    else if (json_is_string(value))
        snprintf(text, size, "\"%.30s\"", json_string_value(value));
    else
        snprintf(text, size, "%s", value ? names[json_typeof(value)] : "missing");
    return text;
}

drape_status drape_gltf_index_of(const drape_gltf *g, const char *owner, const json_t *value, int32_t limit,
                                 int32_t *index)
{
    int64_t number;
    char given[40];
    if (limit == 0)
        return FAIL(g, "%s: %s; the file has nothing that it could refer to", owner,
                    describe(value, given, sizeof given));
    if (!take_integer(value, 0, (double)limit - 1, &number))
        return FAIL(g, "%s: %s; it must be an integer from 0 to %d", owner,
                    describe(value, given, sizeof given), (int)limit - 1);
    *index = (int32_t)number;
    return DRAPE_OK;
}

drape_status drape_gltf_index(const drape_gltf *g, const char *owner, const json_t *object, const char *key,
                              int32_t limit, int32_t *index)
{
    const json_t *value = json_object_get(object, key);
    char where[160];
    *index = -1;
    if (!value)
        return drape_check_cancel_after(g->ctx, 64);
    snprintf(where, sizeof where, "%s: \"%s\"", owner, key);
    return drape_gltf_index_of(g, where, value, limit, index);
}

drape_status drape_gltf_numbers(const drape_gltf *g, const char *owner, const json_t *object, const char *key,
                                size_t count, double *out)
{
    const json_t *array = json_object_get(object, key);
    if (!array)
        return DRAPE_OK;
    if (!json_is_array(array) || json_array_size(array) != count)
        return FAIL(g, "%s: \"%s\" must have %zu numbers", owner, key, count);
    for (size_t i = 0; i < count; i++) {
        const json_t *value = json_array_get(array, i);
        if (!json_is_number(value))
            return FAIL(g, "%s: \"%s\" must have %zu numbers", owner, key, count);
        out[i] = json_number_value(value);
    }
    return DRAPE_OK;
}

/* ---- Accessors ---- */

/* A type of numbers, by its code. */
typedef struct component {
    int code, bytes;
    double largest; /* of an integer: 1 if it is normalized; 0: a float */
    bool negative;
} component;

static const component components[] = {
    {5120, 1, 127, true},    {5121, 1, 255, false},        {5122, 2, 32767, true},
    {5123, 2, 65535, false}, {5125, 4, 4294967295, false}, {5126, 4, 0, true},
};

static const component *find_component(int64_t code)
{
    for (size_t i = 0; i < sizeof components / sizeof *components; i++)
        if (components[i].code == code)
            return &components[i];
    return NULL;
}

static int width_of(const char *type)
{
    static const struct {
        const char *name;
        int width;
    } types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (strcmp(types[i].name, type) == 0)
            return types[i].width;
    return 0;
}

static double number_at(const component *c, const char *at)
{
    uint32_t bits = 0;
    for (int b = 0; b < c->bytes; b++)
        bits |= (uint32_t)(unsigned char)at[b] << 8 * b;
    if (c->largest == 0)
        return drape_bytes_float32(at);
    if (c->negative && bits >> (8 * c->bytes - 1))
        return (double)bits - (double)((int64_t)1 << 8 * c->bytes);
    return (double)bits;
}

/* The elements of an accessor in the buffer. */
typedef struct stretch {
    const char *start;
    size_t stride;
} stretch;

/* Finds elements at a byte of a buffer view; object has "bufferView" and "byteOffset". */
static drape_status locate(const drape_gltf *g, const char *owner, const json_t *object, int64_t count,
                           size_t bytes, stretch *out)
{
    int32_t view, buffer;
    int64_t offset = 0, start = 0, length = 0, stride = (int64_t)bytes;
    drape_status status =
        drape_gltf_index(g, owner, object, "bufferView", drape_gltf_count(g, "bufferViews"), &view);
    if (status)
        return status;
    if (view < 0)
        return FAIL(g, "%s has no \"bufferView\"", owner);
    const json_t *from = drape_gltf_item(g, "bufferViews", view), *at = json_object_get(object, "byteOffset"),
                 *first = json_object_get(from, "byteOffset"), *step = json_object_get(from, "byteStride");
    status = drape_gltf_index(g, owner, from, "buffer", 1, &buffer);
    if (!status && (buffer != 0 || !g->bytes || json_object_get(drape_gltf_item(g, "buffers", 0), "uri")))
        status = FAIL(g, "%s: buffer view %d is not in the binary chunk of the file", owner, (int)view);
    if (status)
        return status;
    if ((at && !take_integer(at, 0, 0x1p40, &offset)) || (first && !take_integer(first, 0, 0x1p40, &start)) ||
        !take_integer(json_object_get(from, "byteLength"), 0, 0x1p40, &length) ||
        (step && !take_integer(step, (double)bytes, 0x1p20, &stride)))
        return FAIL(g, "%s: buffer view %d: its bytes or their stride are out of range", owner, (int)view);
    if (start + length > (int64_t)g->size)
        return FAIL(g, "%s: buffer view %d: bytes %" PRId64 " to %" PRId64 "; the buffer has %zu", owner,
                    (int)view, start, start + length, g->size);
    const int64_t end = count > 0 ? offset + (count - 1) * stride + (int64_t)bytes : offset;
    if (count > length || end > length)
        return FAIL(g,
                    "%s: %" PRId64 " elements from byte %" PRId64 " on; buffer view %d has %" PRId64 " bytes",
                    owner, count, offset, (int)view, length);
    *out = (stretch){.start = g->bytes + start + offset, .stride = (size_t)stride};
    return DRAPE_OK;
}

static void copy_element(const component *c, bool normalized, const char *from, int width, double *to)
{
    for (int k = 0; k < width; k++) {
        to[k] = number_at(c, from + k * c->bytes);
        if (normalized)
            to[k] = to[k] / c->largest < -1 ? -1 : to[k] / c->largest;
    }
}

/* Elements that replace others, by their numbers, which increase. */
static drape_status read_sparse(const drape_gltf *g, const char *owner, const json_t *sparse,
                                const component *c, bool normalized, const drape_gltf_array *out)
{
    const json_t *indices = json_object_get(sparse, "indices"), *values = json_object_get(sparse, "values");
    int64_t count, code = 0, before = -1;
    stretch number, value;
    char part[120], text[40];
    snprintf(part, sizeof part, "%s, sparse", owner);
    const json_t *given = json_object_get(sparse, "count");
    if (!take_integer(given, 0, (double)out->count, &count))
        return FAIL(g, "%s: \"count\": %s; it must be an integer from 0 to %" PRId64, part,
                    describe(given, text, sizeof text), out->count);
    take_integer(json_object_get(indices, "componentType"), 0, 65536, &code);
    const component *type = find_component(code);
    if (!type || type->largest == 0 || type->negative)
        return FAIL(g, "%s: its indices must be unsigned integers", part);
    drape_status status = locate(g, part, indices, count, (size_t)type->bytes, &number);
    if (!status)
        status = locate(g, part, values, count, (size_t)(out->width * c->bytes), &value);
    for (int64_t i = 0; !status && i < count; i++) {
        const int64_t to = (int64_t)number_at(type, number.start + (size_t)i * number.stride);
        if (to <= before || to >= out->count)
            return FAIL(g, "%s: index %" PRId64 "; they must increase and be below %" PRId64, part, to,
                        out->count);
        before = to;
        copy_element(c, normalized, value.start + (size_t)i * value.stride, out->width,
                     out->value + to * out->width);
    }
    return status;
}

/* Of an accessor without a buffer view all numbers are 0. */
static drape_status read_elements(const drape_gltf *g, drape_arena *arena, const char *owner,
                                  const json_t *object, const component *c, drape_gltf_array *out)
{
    const bool normalized = json_is_true(json_object_get(object, "normalized")) && c->largest > 0,
               dense = json_object_get(object, "bufferView");
    const json_t *sparse = json_object_get(object, "sparse");
    stretch from;
    drape_status status = DRAPE_OK;
    if (dense)
        status = locate(g, owner, object, out->count, (size_t)(out->width * c->bytes), &from);
    const size_t bytes = (size_t)out->count * (size_t)out->width * sizeof *out->value;
    if (!status && arena->bytes + bytes > MAX_READ)
        status = FAIL(g, "%s: its numbers, and those read before, take more than %zu bytes", owner, MAX_READ);
    status = status ? status : drape_check_cancel_after(g->ctx, bytes);
    if (status)
        return status;
    out->value = drape_arena_take(arena, (size_t)out->count, (size_t)out->width * sizeof *out->value);
    if (!out->value)
        return DRAPE_E_MEMORY;
    for (int64_t i = 0; dense && i < out->count; i++)
        copy_element(c, normalized, from.start + (size_t)i * from.stride, out->width,
                     out->value + i * out->width);
    return sparse ? read_sparse(g, owner, sparse, c, normalized, out) : DRAPE_OK;
}

drape_status drape_gltf_read(const drape_gltf *g, drape_arena *arena, int32_t accessor,
                             const drape_gltf_want *want, drape_gltf_array *out)
{
    const json_t *object = drape_gltf_item(g, "accessors", accessor);
    const char *type = json_string_value(json_object_get(object, "type"));
    char owner[96], text[40];
    int64_t code = 0;
    snprintf(owner, sizeof owner, "accessor %d (%s)", (int)accessor, want->purpose);
    *out = (drape_gltf_array){.width = width_of(want->type)};
    if (!type || strcmp(type, want->type) != 0)
        return FAIL(g, "%s: its type is %.20s; %s is needed", owner, type ? type : "missing", want->type);
    const json_t *count = json_object_get(object, "count");
    if (!take_integer(count, 1, 0x1p31, &out->count))
        return FAIL(g, "%s: \"count\": %s; it must be an integer from 1 to 2^31", owner,
                    describe(count, text, sizeof text));
    if (want->expected >= 0 && out->count != want->expected)
        return FAIL(g, "%s: %" PRId64 " elements; %" PRId64 " are needed", owner, out->count, want->expected);
    if (want->expected < 0 && !json_object_get(object, "bufferView"))
        return FAIL(g, "%s has no \"bufferView\"", owner);
    take_integer(json_object_get(object, "componentType"), 0, 65536, &code);
    const component *c = find_component(code);
    const bool integer = c && c->largest > 0 && !json_is_true(json_object_get(object, "normalized"));
    if (!c || (want->integer ? !integer || c->negative : integer))
        return FAIL(g, "%s: its numbers have the type %d; %s are needed", owner, (int)code,
                    want->integer ? "unsigned integers" : "floats or normalized integers");
    return read_elements(g, arena, owner, object, c, out);
}
