/* npy.c: see npy.h. */
#include "io/npy.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define MAGIC      "\x93NUMPY\x01"
#define MAGIC_SIZE 10  /* magic, version, length; versions 2 and 3 have two more bytes of length */
#define MAX_DICT   512 /* bytes of the dict that are read: its three keys are at its start */

void drape_npy_put_header(int64_t frames, int32_t nodes, char header[DRAPE_NPY_HEADER])
{
    const int length = DRAPE_NPY_HEADER - MAGIC_SIZE;
    memset(header, ' ', DRAPE_NPY_HEADER);
    memcpy(header, MAGIC, 8); /* with version 1.0, whose 0 is the end of the string */
    header[8] = (char)(length & 0xff);
    header[9] = (char)(length >> 8);
    int used = snprintf(header + MAGIC_SIZE, (size_t)length,
                        "{'descr': '<f8', 'fortran_order': False, 'shape': (%" PRId64 ", %" PRId32 ", 3), }",
                        frames, nodes);
    header[MAGIC_SIZE + used] = ' ';
    header[DRAPE_NPY_HEADER - 1] = '\n';
}

/* The text of a key's value in the dict: what follows "'key':". NULL: there is no such key. */
static const char *value_of(const char *dict, const char *key)
{
    char word[32];
    snprintf(word, sizeof word, "'%s':", key);
    const char *at = strstr(dict, word);
    return at ? at + strlen(word) + strspn(at + strlen(word), " ") : NULL;
}

/* "(6, 81, 3)", "(6,)", "()" */
static bool read_shape(const char *text, drape_npy *header)
{
    int used = 0;
    if (*text++ != '(')
        return false;
    for (text += strspn(text, " "); *text != ')'; text += strspn(text, " ")) {
        if (header->dims == DRAPE_NPY_DIMS ||
            sscanf(text, "%" SCNd64 "%n", &header->shape[header->dims], &used) != 1 ||
            header->shape[header->dims] < 0)
            return false;
        header->dims++;
        text += used;
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
    const size_t before = size > 6 && bytes[6] > 1 ? MAGIC_SIZE + 2 : MAGIC_SIZE;
    if (size < before || memcmp(bytes, MAGIC, 6) != 0 || bytes[6] < 1 || bytes[6] > 3)
        return false;
    size_t length = 0;
    for (size_t i = before; i-- > 8;)
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

void drape_npy_shape_text(const drape_npy *header, char *text, size_t size)
{
    size_t used = 0;
    for (int i = 0; i < header->dims && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, "%s%" PRId64, i ? ", " : "(", header->shape[i]);
    if (used < size)
        snprintf(text + used, size - used, "%s", header->dims == 0 ? "()" : header->dims == 1 ? ",)" : ")");
}

bool drape_npy_read_header(const char *bytes, size_t size, int64_t *frames, int32_t *nodes, size_t *data)
{
    drape_npy header;
    if (!drape_npy_read(bytes, size, &header) || strcmp(header.type, "<f8") != 0 || header.fortran ||
        header.dims != 3 || header.shape[2] != 3 || header.shape[1] > INT32_MAX)
        return false;
    *frames = header.shape[0];
    *nodes = (int32_t)header.shape[1];
    *data = header.data;
    return true;
}
