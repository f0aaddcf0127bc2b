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

static int32_t capacity_for(int32_t count, int32_t capacity)
{
    return count <= capacity ? capacity : count <= INT32_MAX / 2 ? 2 * count : count;
}

/* The smallest and the largest of one of the ranks. */
typedef struct span {
    int32_t low, high;
} span;

static span span_of(const drape_pair *pairs, int32_t count, int which)
{
    span of = {pairs[0].rank[which], pairs[0].rank[which]};
    for (int32_t i = 1; i < count; i++) {
        of.low = pairs[i].rank[which] < of.low ? pairs[i].rank[which] : of.low;
        of.high = pairs[i].rank[which] > of.high ? pairs[i].rank[which] : of.high;
    }
    return of;
}

static drape_status reserve(drape_pair_sorter *s, const drape_pair *pairs, int32_t count)
{
    int32_t widest = 0;
    for (int k = 0; k < 3; k++) {
        const span of = span_of(pairs, count, k);
        widest = of.high - of.low > widest ? of.high - of.low : widest;
    }
    const int32_t capacity = capacity_for(count, s->capacity),
                  first_capacity = capacity_for(widest + 2, s->first_capacity);
    if (capacity > s->capacity) {
        drape_pair *to = drape_arena_resize(s->arena, s->pairs, (size_t)capacity, sizeof *to);
        s->pairs = to ? to : s->pairs;
        for (int k = 0; k < 2 && to; k++) {
            int32_t *order = drape_arena_resize(s->arena, s->order[k], (size_t)capacity, sizeof *order);
            s->order[k] = order ? order : s->order[k];
            to = order ? to : NULL;
        }
        s->capacity = to ? capacity : s->capacity;
    }
    if (first_capacity > s->first_capacity) {
        int32_t *first = drape_arena_resize(s->arena, s->first, (size_t)first_capacity, sizeof *first);
        s->first = first ? first : s->first;
        s->first_capacity = first ? first_capacity : s->first_capacity;
    }
    return capacity > s->capacity || first_capacity > s->first_capacity ? DRAPE_E_MEMORY : DRAPE_OK;
}

/* Writes the numbers of the pairs sorted by one of their ranks. Pairs with the same one stay in the order of
 * `from`; NULL: in which they are listed. */
static void order_by(const drape_pair_sorter *s, int which, const drape_pair *pairs, int32_t count,
                     const int32_t *from, int32_t *to)
{
    const span of = span_of(pairs, count, which);
    memset(s->first, 0, ((size_t)(of.high - of.low) + 2) * sizeof *s->first);
    for (int32_t i = 0; i < count; i++)
        s->first[pairs[i].rank[which] - of.low + 1]++;
    for (int32_t k = 0; k < of.high - of.low; k++)
        s->first[k + 1] += s->first[k];
    for (int32_t i = 0; i < count; i++) {
        const int32_t pair = from ? from[i] : i;
        to[s->first[pairs[pair].rank[which] - of.low]++] = pair;
    }
}

drape_status drape_sort_pairs(drape_pair_sorter *s, drape_pair *pairs, int32_t count)
{
    if (are_sorted(pairs, count))
        return DRAPE_OK;
    if (reserve(s, pairs, count))
        return DRAPE_E_MEMORY;
    order_by(s, 2, pairs, count, NULL, s->order[0]);
    order_by(s, 1, pairs, count, s->order[0], s->order[1]);
    order_by(s, 0, pairs, count, s->order[1], s->order[0]);
    for (int32_t i = 0; i < count; i++)
        s->pairs[i] = pairs[s->order[0][i]];
    memcpy(pairs, s->pairs, (size_t)count * sizeof *pairs);
    return DRAPE_OK;
}
