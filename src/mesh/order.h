/* order.h: sorting by small integers in linear time. */
#ifndef DRAPE_MESH_ORDER_H
#define DRAPE_MESH_ORDER_H

#include "base/arena.h"

/* Returns the numbers 0 .. count - 1 in the order of their keys; equal keys keep the order of their numbers.
 * The key of item i is key[i * parts] ... key[i * parts + parts - 1], compared from its first part; each part
 * is in 0 .. limit - 1. The result and the workspace are allocated in the arena. Returns NULL with a message
 * if memory is out. */
int32_t *drape_order_by_keys(drape_arena *arena, const int32_t *key, int parts, int32_t count, int32_t limit);

#endif
