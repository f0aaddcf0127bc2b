/* gltf.c: see gltf.h. */
#include "mesh/gltf.h"

#include "base/json_read.h"
#include "mesh/npy_array.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define MAX_JSON ((size_t)1 << 28)
#define MAX_READ ((size_t)1 << 32) /* [bytes] of numbers: those of an accessor may be read many times */
#define FAIL     DRAPE_GLTF_FAIL

const char *const drape_gltf_types[17] = {
    [1] = "SCALAR", [2] = "VEC2", [3] = "VEC3", [4] = "VEC4", [16] = "MAT4"};

void *drape_gltf_take(drape_gltf *g, size_t count, size_t size)
{
    void *memory = g->status ? NULL : drape_arena_take(g->arena, count, size);
    if (!memory && !g->status)
        g->status = DRAPE_E_MEMORY;
    return memory;
}

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
        return g->status = drape_fail_memory(g->arena->ctx, size);
    return FAIL(g, "its JSON, byte %d: %s", g->root ? 0 : error.position,
                g->root ? "it is no object" : error.text);
}

/* The header, and then chunks: that of the JSON is the first, that of the buffer the second. Unknown ones are
 * skipped. */
static drape_status read_chunks(drape_gltf *g, const char *data, size_t size)
{
    if (size < DRAPE_GLTF_HEADER || memcmp(data, DRAPE_GLTF_MAGIC, 4) != 0)
        return FAIL(g, "it is not a GLB file: it does not begin with glTF");
    if (drape_bytes_word(data + 4) != DRAPE_GLTF_VERSION)
        return FAIL(g, "glTF version %u; 2 can be read", (unsigned)drape_bytes_word(data + 4));
    const size_t end = drape_bytes_word(data + 8);
    if (end > size)
        return FAIL(g, "it has %zu bytes; its header says %zu", size, end);
    for (size_t at = DRAPE_GLTF_HEADER; !g->status && at + DRAPE_GLTF_CHUNK <= end;) {
        const size_t length = drape_bytes_word(data + at), rest = end - at - DRAPE_GLTF_CHUNK;
        const char *type = data + at + 4, *chunk = data + at + DRAPE_GLTF_CHUNK;
        if (length > rest)
            return FAIL(g, "a chunk of %zu bytes at byte %zu ends behind the file, which has %zu", length, at,
                        end);
        if (!g->root && memcmp(type, DRAPE_GLTF_JSON, 4) != 0)
            return FAIL(g, "its first chunk is not JSON");
        if (!g->root) {
            parse_json(g, chunk, length);
        } else if (memcmp(type, DRAPE_GLTF_BIN, 4) == 0 && !g->bytes) {
            g->bytes = chunk;
            g->size = length;
        }
        at += DRAPE_GLTF_CHUNK + length;
    }
    return g->root ? g->status : FAIL(g, "it has no JSON");
}

void drape_gltf_open(drape_gltf *g, const char *data, size_t size)
{
    read_chunks(g, data, size);
    /* What a file says it cannot be read without; materials and lights do not matter here. */
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
            FAIL(g, "it needs the extension %.60s, which is not read", text ? text : "(no name)");
    }
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

/* An integer from low to high; false, and *out is unchanged, if the value is something else. */
static bool take_integer(const json_t *value, double low, double high, int64_t *out)
{
    const double number = json_is_number(value) ? json_number_value(value) : NAN;
    if (!(number >= low && number <= high) || number != (double)(int64_t)number)
        return false;
    *out = (int64_t)number;
    return true;
}

/* A value as a message says it. */
static const char *describe(const json_t *value, char text[DRAPE_POINTER_SIZE])
{
    static const char *const names[] = {[JSON_OBJECT] = "an object",
                                        [JSON_ARRAY] = "an array",
                                        [JSON_TRUE] = "true",
                                        [JSON_FALSE] = "false",
                                        [JSON_NULL] = "null"};
    return json_is_number(value)   ? drape_format(text, "%.17g", json_number_value(value))
           : json_is_string(value) ? drape_format(text, "\"%.30s\"", json_string_value(value))
           : value                 ? names[json_typeof(value)]
                                   : "missing";
}
#define DESCRIBE(value) describe(value, (char[DRAPE_POINTER_SIZE]){0})

int32_t drape_gltf_index_of(drape_gltf *g, const char *owner, const json_t *value, int32_t limit)
{
    int64_t index = -1;
    const char *given = DESCRIBE(value);
    if (limit == 0)
        FAIL(g, "%s: %s; the file has nothing that it could refer to", owner, given);
    else if (!take_integer(value, 0, (double)limit - 1, &index))
        FAIL(g, "%s: %s; it must be an integer from 0 to %d", owner, given, (int)limit - 1);
    return (int32_t)index;
}

int32_t drape_gltf_index(drape_gltf *g, const char *owner, const json_t *object, const char *key,
                         int32_t limit)
{
    const json_t *value = json_object_get(object, key);
    if (!g->status)
        g->status = drape_check_cancel_after(g->arena->ctx, 64);
    const char *where = DRAPE_FORMAT("%s: \"%s\"", owner, key);
    return value ? drape_gltf_index_of(g, where, value, limit) : -1;
}

void drape_gltf_check_finite(drape_gltf *g, const char *owner, const char *what, size_t count,
                             const double *number)
{
    for (size_t i = 0; !g->status && i < count; i++)
        if (!(fabs(number[i]) <= DRAPE_GLTF_LARGEST))
            FAIL(g, "%s: number %zu of its %s is %g; it must be finite and within %g", owner, i, what,
                 number[i], DRAPE_GLTF_LARGEST);
}

void drape_gltf_numbers(drape_gltf *g, const char *owner, const json_t *object, const char *key, size_t count,
                        double *out)
{
    const json_t *array = json_object_get(object, key);
    bool given = json_is_array(array) && json_array_size(array) == count;
    for (size_t i = 0; given && i < count; i++) {
        given = json_is_number(json_array_get(array, i));
        out[i] = json_number_value(json_array_get(array, i));
    }
    if (array && !given)
        FAIL(g, "%s: \"%s\" must have %zu numbers", owner, key, count);
    else if (array)
        drape_gltf_check_finite(g, owner, key, count, out);
}

/* ---- Accessors ---- */

/* A type of numbers, by its code. */
typedef struct component {
    int code, bytes;
    double largest; /* of an integer: 1 if it is normalized; 0: a float */
    bool negative;
} component;

static const component *find_component(const json_t *object)
{
    static const component components[] = {
        {DRAPE_GLTF_INT8, 1, 127, true},           {DRAPE_GLTF_UINT8, 1, 255, false},
        {DRAPE_GLTF_INT16, 2, 32767, true},        {DRAPE_GLTF_UINT16, 2, 65535, false},
        {DRAPE_GLTF_UINT32, 4, 4294967295, false}, {DRAPE_GLTF_FLOAT, 4, 0, true},
    };
    const double code = json_number_value(json_object_get(object, "componentType"));
    for (size_t i = 0; i < sizeof components / sizeof *components; i++)
        if (components[i].code == code)
            return &components[i];
    return NULL;
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

/* Finds `count` elements of `bytes` bytes in the buffer: object has "bufferView" and "byteOffset". Returns
 * the first one, or NULL. */
static const char *locate(drape_gltf *g, const char *owner, const json_t *object, int64_t count,
                          int64_t bytes, int64_t *stride)
{
    const int32_t view = drape_gltf_index(g, owner, object, "bufferView", drape_gltf_count(g, "bufferViews"));
    int64_t offset = 0, start = 0, length = 0;
    *stride = bytes;
    if (view < 0)
        FAIL(g, "%s has no \"bufferView\"", owner);
    const json_t *from = drape_gltf_item(g, "bufferViews", view), *at = json_object_get(object, "byteOffset"),
                 *first = json_object_get(from, "byteOffset"), *step = json_object_get(from, "byteStride");
    if (drape_gltf_index(g, owner, from, "buffer", 1) != 0 || !g->bytes ||
        json_object_get(drape_gltf_item(g, "buffers", 0), "uri"))
        FAIL(g, "%s: buffer view %d is not in the binary chunk of the file", owner, (int)view);
    if ((at && !take_integer(at, 0, 0x1p40, &offset)) || (first && !take_integer(first, 0, 0x1p40, &start)) ||
        !take_integer(json_object_get(from, "byteLength"), 0, 0x1p40, &length) ||
        (step && !take_integer(step, (double)bytes, 0x1p20, stride)))
        FAIL(g, "%s: buffer view %d: its bytes or their stride are out of range", owner, (int)view);
    if (start + length > (int64_t)g->size)
        FAIL(g, "%s: buffer view %d: bytes %" PRId64 " to %" PRId64 "; the buffer has %zu", owner, (int)view,
             start, start + length, g->size);
    const int64_t end = count > 0 ? offset + (count - 1) * *stride + bytes : offset;
    if (count > length || end > length)
        FAIL(g, "%s: %" PRId64 " elements from byte %" PRId64 " on; buffer view %d has %" PRId64 " bytes",
             owner, count, offset, (int)view, length);
    return g->status ? NULL : g->bytes + start + offset;
}

static void copy_element(const component *c, bool normalized, const char *from, int width, double *to)
{
    for (int k = 0; k < width; k++) {
        to[k] = number_at(c, from + k * c->bytes);
        if (normalized)
            to[k] = to[k] / c->largest < -1 ? -1 : to[k] / c->largest;
    }
}

/* Replaces some elements of *out: a sparse accessor lists their numbers, in ascending order, and values. */
static drape_status read_sparse(drape_gltf *g, const char *owner, const json_t *sparse, const component *c,
                                bool normalized, const drape_gltf_array *out)
{
    const json_t *indices = json_object_get(sparse, "indices"), *given = json_object_get(sparse, "count");
    int64_t count, before = -1, stride[2];
    const char *part = DRAPE_FORMAT("%s, sparse", owner);
    if (!take_integer(given, 0, (double)out->count, &count))
        return FAIL(g, "%s: \"count\": %s; it must be an integer from 0 to %" PRId64, part, DESCRIBE(given),
                    out->count);
    const component *type = find_component(indices);
    if (!type || type->negative)
        return FAIL(g, "%s: its indices must be unsigned integers", part);
    const char *number = locate(g, part, indices, count, type->bytes, &stride[0]);
    const char *value =
        locate(g, part, json_object_get(sparse, "values"), count, (int64_t)out->width * c->bytes, &stride[1]);
    for (int64_t i = 0; !g->status && i < count; i++) {
        const int64_t to = (int64_t)number_at(type, number + i * stride[0]);
        if (to <= before || to >= out->count)
            return FAIL(g, "%s: index %" PRId64 "; they must increase and be below %" PRId64, part, to,
                        out->count);
        before = to;
        copy_element(c, normalized, value + i * stride[1], out->width, out->value + to * out->width);
    }
    return g->status;
}

/* Takes memory for the numbers and reads them. Of an accessor without a buffer view all numbers are 0. */
static void read_elements(drape_gltf *g, const char *owner, const json_t *object, const component *c,
                          drape_gltf_array *out)
{
    const bool normalized = json_is_true(json_object_get(object, "normalized")) && c->largest > 0,
               dense = json_object_get(object, "bufferView");
    const json_t *sparse = json_object_get(object, "sparse");
    const size_t bytes = (size_t)out->count * (size_t)out->width * sizeof *out->value;
    int64_t stride = 0;
    const char *from =
        dense ? locate(g, owner, object, out->count, (int64_t)out->width * c->bytes, &stride) : NULL;
    if (g->arena->bytes + bytes > MAX_READ)
        FAIL(g, "%s: its numbers, and those read before, take more than %zu bytes", owner, MAX_READ);
    if (!g->status)
        g->status = drape_check_cancel_after(g->arena->ctx, bytes);
    out->value = drape_gltf_take(g, (size_t)out->count, (size_t)out->width * sizeof *out->value);
    for (int64_t i = 0; !g->status && dense && i < out->count; i++)
        copy_element(c, normalized, from + i * stride, out->width, out->value + i * out->width);
    if (!g->status && sparse)
        read_sparse(g, owner, sparse, c, normalized, out);
}

drape_gltf_array drape_gltf_read(drape_gltf *g, const char *parent, const json_t *holder,
                                 const drape_gltf_want *want)
{
    const int32_t accessor = drape_gltf_index(g, parent, holder, want->key, drape_gltf_count(g, "accessors"));
    const json_t *object = drape_gltf_item(g, "accessors", accessor),
                 *count = json_object_get(object, "count");
    const char *type = json_string_value(json_object_get(object, "type"));
    const component *c = find_component(object);
    const bool integer = c && c->largest > 0 && !json_is_true(json_object_get(object, "normalized"));
    drape_gltf_array out = {.width = want->width};
    if (g->status || accessor < 0)
        return out;
    const char *owner =
        DRAPE_FORMAT("accessor %d (%s)", (int)accessor, want->purpose ? want->purpose : want->key);
    if (!type || strcmp(type, drape_gltf_types[want->width]) != 0)
        FAIL(g, "%s: its type is %.20s; %s is needed", owner, type ? type : "missing",
             drape_gltf_types[want->width]);
    if (!take_integer(count, 1, 0x1p31, &out.count))
        FAIL(g, "%s: \"count\": %s; it must be an integer from 1 to 2^31", owner, DESCRIBE(count));
    if (want->expected >= 0 && out.count != want->expected)
        FAIL(g, "%s: %" PRId64 " elements; %" PRId64 " are needed", owner, out.count, want->expected);
    if (want->expected < 0 && !json_object_get(object, "bufferView"))
        FAIL(g, "%s has no \"bufferView\"", owner);
    if (!c || (want->integer ? !integer || c->negative : integer))
        FAIL(g, "%s: its numbers have the type %s; %s are needed", owner,
             DESCRIBE(json_object_get(object, "componentType")),
             want->integer ? "unsigned integers" : "floats or normalized integers");
    if (!g->status)
        read_elements(g, owner, object, c, &out);
    return g->status ? (drape_gltf_array){.width = want->width} : out;
}
