/* order.h: sorting by small whole numbers in linear time. */
#ifndef DRAPE_MESH_ORDER_H
#define DRAPE_MESH_ORDER_H

#include "base/arena.h"

/* The numbers 0 .. count - 1 in the order of their keys; equal keys keep the order of their numbers. Item i
 * has the key key[i * parts] ... key[i * parts + parts - 1], compared from its first part; each part is in 0
 * .. limit - 1. The result and the workspace are of the arena; NULL with a message when memory is out. */
int32_t *drape_order_by_keys(drape_arena *arena, const int32_t *key, int parts, int32_t count, int32_t limit);

#endif
