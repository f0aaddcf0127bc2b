/* list.h: arrays in an arena that grow by doubling. */
#ifndef DRAPE_CONTACT_LIST_H
#define DRAPE_CONTACT_LIST_H

#include "base/arena.h"

#define DRAPE_LIST_START 64

/* Grows the list, if necessary, to room for one more element than count, and keeps its content. NULL: out
 * of memory, and the list is unchanged. */
static inline void *drape_list_grow(drape_arena *arena, void *list, int32_t count, int32_t *room, size_t size)
{
    const int32_t wanted = *room > 0 ? 2 * *room : DRAPE_LIST_START;
    if (count < *room)
        return list;
    void *grown = drape_arena_resize(arena, list, (size_t)wanted, size);
    if (grown)
        *room = wanted;
    return grown;
}

#endif
