/* islands.c: see islands.h. */
#include "nonlinear/islands.h"

#include "base/search.h"

#include <string.h>

drape_status drape_islands_init(drape_arena *arena, size_t n, drape_islands *islands)
{
    islands->count = 1;
    islands->of = drape_arena_take(arena, n, sizeof *islands->of);
    islands->found = drape_arena_take(arena, n, sizeof *islands->found);
    return drape_arena_status(arena);
}

/* `of` is a forest at first, whose nodes point to earlier ones of their set. */
bool drape_islands_find(drape_islands *islands, const drape_pattern *pattern)
{
    int32_t *of = islands->found;
    const size_t n = (size_t)pattern->block_count;
    if (pattern->ranks)
        return false;
    for (int32_t i = 0; i < pattern->block_count; i++)
        of[i] = i;
    for (int32_t j = 0; j < pattern->block_count; j++)
        for (int32_t k = pattern->block_start[j]; k < pattern->block_start[j + 1]; k++)
            drape_set_join(of, j, pattern->block_row[k]);
    islands->count = 0;
    for (int32_t i = 0; i < pattern->block_count; i++)
        of[i] = of[i] == i ? islands->count++ : of[of[i]];
    const bool changed = memcmp(of, islands->of, n * sizeof *of) != 0;
    islands->found = islands->of;
    islands->of = of;
    return changed;
}
