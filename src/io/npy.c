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

bool drape_npy_read_header(const char *bytes, size_t size, int64_t *frames, int32_t *nodes, size_t *data)
{
    char text[DRAPE_NPY_HEADER + 1] = "";
    if (size < DRAPE_NPY_HEADER || memcmp(bytes, MAGIC, 7) != 0)
        return false;
    memcpy(text, bytes + MAGIC_SIZE, DRAPE_NPY_HEADER - MAGIC_SIZE);
    const char *shape = strstr(text, "'shape': (");
    *data = MAGIC_SIZE + ((size_t)(unsigned char)bytes[8] | (size_t)(unsigned char)bytes[9] << 8);
    return shape && strstr(text, "'<f8'") && strstr(text, "'fortran_order': False") &&
           sscanf(shape, "'shape': (%" SCNd64 ", %" SCNd32 ", 3)", frames, nodes) == 2;
}
