/* elements_of.c: see elements_of.h. */
#include "contact/elements_of.h"

drape_status drape_elements_of_create(drape_arena *arena, int32_t count, int size, const int32_t *point,
                                      int32_t points, drape_elements_of *out)
{
    const size_t entries = (size_t)count * (size_t)size;
    out->first = drape_arena_take(arena, (size_t)points + 2, sizeof *out->first);
    out->element = drape_arena_take(arena, entries, sizeof *out->element);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < entries; i++)
        out->first[point[i] + 2]++;
    for (int32_t i = 0; i < points; i++)
        out->first[i + 2] += out->first[i + 1];
    for (size_t i = 0; i < entries; i++)
        out->element[out->first[point[i] + 1]++] = (int32_t)(i / (size_t)size);
    return DRAPE_OK;
}

int32_t drape_elements_of_edge(const drape_elements_of *edges, const int32_t *edge, int32_t a, int32_t b)
{
    for (int32_t k = edges->first[a]; k < edges->first[a + 1]; k++) {
        const int32_t *ends = edge + 2 * (size_t)edges->element[k];
        if (ends[0] == b || ends[1] == b)
            return edges->element[k];
    }
    return -1;
}
