/* npy.c: see npy.h. */
#include "io/npy.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define MAGIC      "\x93NUMPY\x01"
#define MAGIC_SIZE 10 /* magic, version, length */

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
