/* npy_array.c: see npy_array.h. The header is the text of a Python dict, which is read key by key. */
#include "mesh/npy_array.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define MAGIC      "\x93NUMPY"
#define MAGIC_SIZE 6
#define MAX_HEADER 65536 /* [bytes] */

uint32_t drape_bytes_word(const char *bytes)
{
    uint32_t word = 0;
    for (int b = 0; b < 4; b++)
        word |= (uint32_t)(unsigned char)bytes[b] << 8 * b;
    return word;
}

double drape_bytes_float32(const char *bytes)
{
    const uint32_t word = drape_bytes_word(bytes);
    float number;
    memcpy(&number, &word, sizeof number);
    return (double)number;
}

double drape_bytes_float64(const char *bytes)
{
    const uint64_t word = drape_bytes_word(bytes) | (uint64_t)drape_bytes_word(bytes + 4) << 32;
    double number;
    memcpy(&number, &word, sizeof number);
    return number;
}

double drape_npy_array_at(const drape_npy_array *array, size_t index)
{
    const char *at = array->data + index * (size_t)array->item;
    return array->item == 4 ? drape_bytes_float32(at) : drape_bytes_float64(at);
}

/* The text behind 'key': in the dict; NULL: there is no such key. */
static const char *value_of(const char *header, const char *key)
{
    char quoted[32];
    snprintf(quoted, sizeof quoted, "'%s'", key);
    const char *at = strstr(header, quoted);
    if (!at)
        return NULL;
    at += strlen(quoted);
    at += strspn(at, " ");
    if (*at != ':')
        return NULL;
    return at + 1 + strspn(at + 1, " ");
}

static drape_status read_type(drape_context *ctx, const drape_mesh_source *source, const char *header,
                              drape_npy_array *out)
{
    const char *type = value_of(header, "descr"), *order = value_of(header, "fortran_order");
    if (type && strncmp(type, "'<f4'", 5) == 0)
        out->item = 4;
    else if (type && strncmp(type, "'<f8'", 5) == 0)
        out->item = 8;
    else
        return drape_mesh_fail(ctx, source, 0, "the type of its numbers is %.*s; '<f4' or '<f8' is needed",
                               type ? (int)strcspn(type, ",}") : 7, type ? type : "missing");
    if (!order || strncmp(order, "False", 5) != 0)
        return drape_mesh_fail(ctx, source, 0, "'fortran_order' must be False: the array is in C order");
    return DRAPE_OK;
}

static drape_status read_shape(drape_context *ctx, const drape_mesh_source *source, const char *header,
                               drape_npy_array *out)
{
    const char *at = value_of(header, "shape");
    int used = 0;
    out->shape[0] = out->shape[1] = out->shape[2] = 1;
    if (!at || *at++ != '(')
        return drape_mesh_fail(ctx, source, 0, "its header has no 'shape'");
    while (*(at += strspn(at, " ,")) != ')') {
        if (out->dimensions == 3)
            return drape_mesh_fail(ctx, source, 0, "more than 3 dimensions");
        if (sscanf(at, "%18" SCNd64 "%n", &out->shape[out->dimensions], &used) != 1 ||
            out->shape[out->dimensions] < 0)
            return drape_mesh_fail(ctx, source, 0, "its header has no valid 'shape'");
        out->dimensions++;
        at += used;
    }
    return out->dimensions > 0 ? DRAPE_OK
                               : drape_mesh_fail(ctx, source, 0, "it is a single number, not an array");
}

static drape_status parse_header(drape_context *ctx, const drape_mesh_source *source, const char *text,
                                 size_t length, drape_npy_array *out)
{
    char *header = drape_alloc(ctx, length + 1, 1);
    if (!header)
        return DRAPE_E_MEMORY;
    memcpy(header, text, length);
    drape_status status = read_type(ctx, source, header, out);
    if (!status)
        status = read_shape(ctx, source, header, out);
    drape_free(ctx, header);
    return status;
}

/* The numbers must be as many as the shape says: a file that was cut while it was written has fewer. */
static drape_status check_size(drape_context *ctx, const drape_mesh_source *source, size_t bytes,
                               const drape_npy_array *array)
{
    uint64_t count = 1;
    for (int k = 0; k < array->dimensions; k++) {
        const uint64_t length = (uint64_t)array->shape[k];
        count = length > 0 && count > UINT64_MAX / 16 / length ? UINT64_MAX / 16 : count * length;
    }
    if (bytes == count * (uint64_t)array->item)
        return DRAPE_OK;
    return drape_mesh_fail(
        ctx, source, 0, "%zu bytes of numbers; (%" PRId64 ", %" PRId64 ", %" PRId64 ") has %" PRIu64, bytes,
        array->shape[0], array->shape[1], array->shape[2], count * (uint64_t)array->item);
}

drape_status drape_npy_array_parse(drape_context *ctx, const drape_mesh_source *source, const char *data,
                                   size_t size, drape_npy_array *out)
{
    *out = (drape_npy_array){.dimensions = 0};
    if (size < MAGIC_SIZE + 4 || memcmp(data, MAGIC, MAGIC_SIZE) != 0)
        return drape_mesh_fail(ctx, source, 0, "it is not an NPY file: it does not begin with \\x93NUMPY");
    const int version = (unsigned char)data[MAGIC_SIZE];
    const size_t start = version == 1 ? MAGIC_SIZE + 4 : MAGIC_SIZE + 6;
    if (version < 1 || version > 3 || size < start)
        return drape_mesh_fail(ctx, source, 0, "NPY version %d; 1 to 3 can be read", version);
    const size_t length = version == 1 ? (size_t)(unsigned char)data[MAGIC_SIZE + 2] +
                                             256 * (size_t)(unsigned char)data[MAGIC_SIZE + 3]
                                       : drape_bytes_word(data + MAGIC_SIZE + 2);
    if (length > MAX_HEADER || length > size - start)
        return drape_mesh_fail(ctx, source, 0, "its header ends behind the end of the file");
    drape_status status = parse_header(ctx, source, data + start, length, out);
    if (!status)
        status = check_size(ctx, source, size - start - length, out);
    out->data = data + start + length;
    return status;
}
