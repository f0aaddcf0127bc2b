/* list.h: arrays in an arena that grow by doubling. */
#ifndef DRAPE_BASE_LIST_H
#define DRAPE_BASE_LIST_H

#include "base/arena.h"

#include <string.h>

#define DRAPE_LIST_START 64 /* elements of the first capacity */

/* Appends a copy of an element of `size` bytes to the array that the pointer at `list` points to, *count of
 * *capacity elements, which grows if necessary. Returns false if memory is out; the list is then
 * unchanged. */
static inline bool drape_list_append(drape_arena *arena, void *list, int32_t *count, int32_t *capacity,
                                     const void *element, size_t size)
{
    char *elements;
    memcpy(&elements, list, sizeof elements);
    if (*count == *capacity) {
        const int32_t doubled = *capacity > 0 ? 2 * *capacity : DRAPE_LIST_START;
        elements = drape_arena_resize(arena, elements, (size_t)doubled, size);
        if (!elements)
            return false;
        memcpy(list, &elements, sizeof elements);
        *capacity = doubled;
    }
    memcpy(elements + (size_t)(*count)++ * size, element, size);
    return true;
}

#endif
