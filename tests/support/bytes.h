/* bytes.h: a checkpoint of a sim in memory. */
#ifndef DRAPE_TESTS_BYTES_H
#define DRAPE_TESTS_BYTES_H

#include <check.h>
#include <stdlib.h>
#include <string.h>

#include "support/context.h"

typedef struct bytes {
    unsigned char *data;
    size_t size, room;
} bytes;

static inline drape_status bytes_keep(void *user, const void *data, size_t size)
{
    bytes *b = user;
    if (b->size + size > b->room) {
        b->room = 2 * (b->size + size);
        b->data = realloc(b->data, b->room);
        ck_assert_ptr_nonnull(b->data);
    }
    memcpy(b->data + b->size, data, size);
    b->size += size;
    return DRAPE_OK;
}

static inline void bytes_free(bytes *b)
{
    free(b->data);
}

#define scoped_bytes SCOPED(bytes_free) bytes

static inline bytes bytes_save(drape_sim *sim)
{
    bytes b = {0};
    ck_assert_int_eq(drape_sim_save_to(sim, bytes_keep, &b), DRAPE_OK);
    return b;
}

#endif
