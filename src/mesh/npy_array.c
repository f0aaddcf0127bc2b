/* npy_array.c: see npy_array.h. The header is the text of a Python dict, which is read key by key. */
#include "mesh/npy_array.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAGIC      "\x93NUMPY"
#define MAGIC_SIZE 6
#define MAX_DICT   512 /* bytes of the dict that are read: its three keys are at its start */

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

/* The text of a key's value in the dict: what follows "'key':". NULL: there is no such key. */
static const char *value_of(const char *dict, const char *key)
{
    const char *word = DRAPE_FORMAT("'%s':", key);
    const char *at = strstr(dict, word);
    return at ? at + strlen(word) + strspn(at + strlen(word), " ") : NULL;
}

/* "(6, 81, 3)", "(6,)", "()" */
static bool read_shape(const char *text, drape_npy *header)
{
    char *end;
    if (*text++ != '(')
        return false;
    for (text += strspn(text, " "); *text != ')'; text += strspn(text, " ")) {
        if (header->dims == DRAPE_NPY_DIMS)
            return false;
        const int64_t length = header->shape[header->dims++] = strtoll(text, &end, 10);
        if (end == text || length < 0)
            return false;
        text = end;
        if (*text == ',')
            text++;
        else if (*text != ')')
            return false;
    }
    return true;
}

bool drape_npy_read(const char *bytes, size_t size, drape_npy *header)
{
    char dict[MAX_DICT + 1];
    *header = (drape_npy){.dims = 0};
    const size_t before = size > MAGIC_SIZE && bytes[MAGIC_SIZE] > 1 ? MAGIC_SIZE + 6 : MAGIC_SIZE + 4;
    if (size < before || memcmp(bytes, MAGIC, MAGIC_SIZE) != 0 || bytes[MAGIC_SIZE] < 1 ||
        bytes[MAGIC_SIZE] > 3)
        return false;
    size_t length = 0;
    for (size_t i = before; i-- > MAGIC_SIZE + 2;)
        length = length << 8 | (unsigned char)bytes[i];
    header->data = before + length;
    if (length > MAX_DICT)
        length = MAX_DICT;
    if (length > size - before)
        length = size - before;
    memcpy(dict, bytes + before, length);
    dict[length] = 0;
    const char *type = value_of(dict, "descr"), *order = value_of(dict, "fortran_order"),
               *shape = value_of(dict, "shape");
    if (!type || !order || !shape || sscanf(type, "'%15[^']'", header->type) != 1)
        return false;
    header->fortran = strncmp(order, "True", 4) == 0;
    return (header->fortran || strncmp(order, "False", 5) == 0) && read_shape(shape, header);
}

drape_status drape_npy_array_parse(drape_context *ctx, const drape_mesh_source *source, const char *data,
                                   size_t size, drape_npy_array *out)
{
    drape_npy header;
    *out = (drape_npy_array){.shape = {1, 1, 1}};
    if (size < MAGIC_SIZE || memcmp(data, MAGIC, MAGIC_SIZE) != 0)
        return drape_mesh_fail(ctx, source, 0, "it is not an NPY file: it does not begin with \\x93NUMPY");
    if (!drape_npy_read(data, size, &header) || header.data > size)
        return drape_mesh_fail(ctx, source, 0,
                               "its header is not one of NPY version 1 to 3 of at most %d dimensions",
                               DRAPE_NPY_DIMS);
    if (strcmp(header.type, "<f4") != 0 && strcmp(header.type, "<f8") != 0)
        return drape_mesh_fail(ctx, source, 0, "the type of its numbers is '%s'; '<f4' or '<f8' is needed",
                               header.type);
    if (header.fortran)
        return drape_mesh_fail(ctx, source, 0, "'fortran_order' must be False: the array is in C order");
    if (header.dims < 1 || header.dims > 3)
        return drape_mesh_fail(ctx, source, 0, "it has %d dimensions; 1 to 3 can be read", header.dims);
    out->dimensions = header.dims;
    out->item = header.type[2] - '0';
    out->data = data + header.data;
    memcpy(out->shape, header.shape, (size_t)header.dims * sizeof *out->shape);
    /* The numbers must be as many as the shape says: a file that was cut while it was written has fewer. */
    const size_t bytes = size - header.data;
    uint64_t count = 1;
    for (int k = 0; k < out->dimensions; k++) {
        const uint64_t length = (uint64_t)out->shape[k];
        count = length > 0 && count > UINT64_MAX / 16 / length ? UINT64_MAX / 16 : count * length;
    }
    if (bytes == count * (uint64_t)out->item)
        return DRAPE_OK;
    return drape_mesh_fail(ctx, source, 0,
                           "%zu bytes of numbers; (%" PRId64 ", %" PRId64 ", %" PRId64 ") has %" PRIu64,
                           bytes, out->shape[0], out->shape[1], out->shape[2], count * (uint64_t)out->item);
}
