/* order.c: radix sort: one stable counting sort per part of the key, from the last part to the first. It
 * takes O(parts (count + limit)) for any input; hash tables and quicksort have bad cases. */
#include "mesh/order.h"

int32_t *drape_order_by_keys(drape_arena *arena, const int32_t *key, int parts, int32_t count, int32_t limit)
{
    int32_t *order = drape_arena_take(arena, (size_t)count, sizeof *order);
    int32_t *other = drape_arena_take(arena, (size_t)count, sizeof *other);
    int32_t *start = drape_arena_take(arena, (size_t)limit + 1, sizeof *start);
    if (drape_arena_status(arena))
        return NULL;
    for (int32_t i = 0; i < count; i++)
        order[i] = i;
    for (int part = parts - 1; part >= 0; part--) {
        for (int32_t value = 0; value <= limit; value++)
            start[value] = 0;
        for (int32_t i = 0; i < count; i++)
            start[key[(size_t)i * (size_t)parts + (size_t)part] + 1]++;
        for (int32_t value = 0; value < limit; value++)
            start[value + 1] += start[value];
        for (int32_t i = 0; i < count; i++)
            other[start[key[(size_t)order[i] * (size_t)parts + (size_t)part]]++] = order[i];
        int32_t *sorted = other;
        other = order;
        order = sorted;
    }
    return order;
}
