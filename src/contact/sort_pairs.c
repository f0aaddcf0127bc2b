/* sort_pairs.c: see sort_pairs.h. */
#include "contact/sort_pairs.h"

#include <string.h>

static bool are_sorted(const drape_pair *pairs, int32_t count)
{
    for (int32_t i = 1; i < count; i++)
        if (drape_pair_is_before(&pairs[i], &pairs[i - 1]))
            return false;
    return true;
}

static int32_t room_for(int32_t count, int32_t room)
{
    return count <= room ? room : count <= INT32_MAX / 2 ? 2 * count : count;
}

static drape_status reserve(drape_pair_sorter *s, const drape_pair *pairs, int32_t count)
{
    int32_t last = 0;
    for (int32_t i = 0; i < count; i++)
        for (int k = 1; k < 3; k++)
            last = pairs[i].rank[k] > last ? pairs[i].rank[k] : last;
    const int32_t room = room_for(count, s->room), first_room = room_for(last + 2, s->first_room);
    if (room > s->room) {
        drape_pair *to = drape_arena_resize(s->arena, s->pairs, (size_t)room, sizeof *to);
        s->pairs = to ? to : s->pairs;
        for (int k = 0; k < 2 && to; k++) {
            int32_t *order = drape_arena_resize(s->arena, s->order[k], (size_t)room, sizeof *order);
            s->order[k] = order ? order : s->order[k];
            to = order ? to : NULL;
        }
        s->room = to ? room : s->room;
    }
    if (first_room > s->first_room) {
        int32_t *first = drape_arena_resize(s->arena, s->first, (size_t)first_room, sizeof *first);
        s->first = first ? first : s->first;
        s->first_room = first ? first_room : s->first_room;
    }
    return room > s->room || first_room > s->first_room ? DRAPE_E_MEMORY : DRAPE_OK;
}

/* Writes the numbers of the pairs by one of their ranks, those with the same one as they were; from NULL:
 * as they are listed. */
static void order_by(const drape_pair_sorter *s, int which, const drape_pair *pairs, int32_t count,
                     const int32_t *from, int32_t *to)
{
    int32_t last = 0;
    for (int32_t i = 0; i < count; i++)
        last = pairs[i].rank[which] > last ? pairs[i].rank[which] : last;
    memset(s->first, 0, ((size_t)last + 2) * sizeof *s->first);
    for (int32_t i = 0; i < count; i++)
        s->first[pairs[i].rank[which] + 1]++;
    for (int32_t k = 0; k < last; k++)
        s->first[k + 1] += s->first[k];
    for (int32_t i = 0; i < count; i++) {
        const int32_t pair = from ? from[i] : i;
        to[s->first[pairs[pair].rank[which]]++] = pair;
    }
}

drape_status drape_sort_pairs(drape_pair_sorter *s, drape_pair *pairs, int32_t count)
{
    if (are_sorted(pairs, count))
        return DRAPE_OK;
    if (reserve(s, pairs, count))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0, end; i < count; i = end) { /* a stage; those of surfaces are sorted */
        for (end = i + 1; end < count && pairs[end].rank[0] == pairs[i].rank[0]; end++)
            ;
        order_by(s, 2, pairs + i, end - i, NULL, s->order[0]);
        order_by(s, 1, pairs + i, end - i, s->order[0], s->order[1]);
        for (int32_t k = i; k < end; k++)
            s->pairs[k] = pairs[i + s->order[1][k - i]];
    }
    memcpy(pairs, s->pairs, (size_t)count * sizeof *pairs);
    return DRAPE_OK;
}
