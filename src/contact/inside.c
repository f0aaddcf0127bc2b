/* inside.c: see inside.h. */
#include "contact/inside.h"

#include "contact/list.h"

#include <stdlib.h>
#include <string.h>

static drape_pair_key key_of(const drape_pair *pair)
{
    drape_pair_key key = {.kind = (int32_t)pair->kind, .collider = pair->collider};
    memcpy(key.node, pair->node, sizeof key.node);
    return key;
}

static int compare(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(drape_pair_key));
}

bool drape_inside_has(const drape_inside_pairs *inside, const drape_pair *pair)
{
    const drape_pair_key key = key_of(pair);
    return inside->count > 0 &&
           bsearch(&key, inside->keys, (size_t)inside->count, sizeof *inside->keys, compare);
}

drape_status drape_inside_add(drape_inside_pairs *inside, const drape_pair_key *key)
{
    drape_pair_key *keys =
        drape_list_grow(inside->arena, inside->keys, inside->count, &inside->room, sizeof *keys);
    if (!keys)
        return DRAPE_E_MEMORY;
    inside->keys = keys;
    inside->keys[inside->count++] = *key;
    return DRAPE_OK;
}

void drape_inside_sort(drape_inside_pairs *inside)
{
    if (inside->count > 0)
        qsort(inside->keys, (size_t)inside->count, sizeof *inside->keys, compare);
}

/* The new list is made behind the old one, which it then replaces. */
bool drape_inside_update(drape_inside_pairs *inside, const drape_near_pair *near, int32_t count,
                         double rounding, drape_status *status)
{
    const int32_t before = inside->count;
    bool added = false;
    for (int32_t i = 0; i < count; i++) {
        const drape_inside_pairs old = {.keys = inside->keys, .count = before};
        const bool had = drape_inside_has(&old, &near[i].pair);
        if (!had && !(near[i].gap < drape_pair_least_gap(&near[i].pair, rounding)))
            continue;
        const drape_pair_key key = key_of(&near[i].pair);
        *status = drape_inside_add(inside, &key);
        if (*status) {
            inside->count = before;
            return false;
        }
        added = added || !had;
    }
    inside->count -= before;
    if (inside->count > 0)
        memmove(inside->keys, inside->keys + before, (size_t)inside->count * sizeof *inside->keys);
    drape_inside_sort(inside);
    return added;
}

void drape_inside_archive(drape_inside_pairs *inside, drape_archive *a)
{
    int32_t count = inside->count;
    drape_archive_int32(a, &count);
    if (a->reading)
        inside->count = 0;
    for (int32_t i = 0; i < count && drape_archive_good(a); i++) {
        if (a->reading && drape_inside_add(inside, &(drape_pair_key){0})) {
            drape_archive_note(a, DRAPE_E_MEMORY);
            return;
        }
        drape_archive_bytes(a, &inside->keys[i], sizeof *inside->keys);
    }
}
