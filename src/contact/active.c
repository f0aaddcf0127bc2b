/* active.c: see active.h. */
#include "contact/active.h"

#include "base/list.h"
#include "contact/barrier.h"

#include <stdlib.h>
#include <string.h>

#define SLOTS 4 /* of the hash table, for each contact that the list has memory for */

/* Removes the nodes that have no weight. */
static void reduce(drape_active_contact *contact)
{
    int which[4], points = contact->gap.closest.points;
    if (points < 4 || contact->gap.mollified || contact->gap.fixed_normal)
        return;
    drape_closest_reduce(&contact->gap.closest, which);
    for (int a = 0; a < contact->gap.closest.points; a++)
        contact->pair.node[a] = contact->pair.node[which[a]];
    for (int a = contact->gap.closest.points; a < 4; a++)
        contact->pair.node[a] = -1;
}

/* Whether several pairs can have this contact: one of two points, or of a point and an edge. A contact of
 * four nodes belongs to its own pair only, and so does one that depends on more than its nodes. */
static bool is_shared(const drape_active_contact *contact)
{
    const int points = contact->gap.closest.points;
    return contact->pair.kind != DRAPE_PAIR_SURFACE && points > 1 && points < 4 && !contact->gap.mollified &&
           !contact->gap.fixed_normal;
}

static void sort_two(int32_t *a)
{
    int32_t lower = a[0] < a[1] ? a[0] : a[1];
    a[1] += a[0] - lower;
    a[0] = lower;
}

/* Two points, or a point and then the ends of an edge, ascending. */
static void key_of(const drape_active_contact *contact, int32_t key[3])
{
    const int32_t *n = contact->pair.node;
    const double *c = contact->gap.closest.c;
    if (contact->gap.closest.points == 2) {
        const int32_t points[3] = {n[0], n[1], -1};
        memcpy(key, points, sizeof points);
        sort_two(key);
        return;
    }
    int positive = (c[0] > 0) + (c[1] > 0) + (c[2] > 0),
        single = 0; /* the index of the weight with the other sign */
    while (single < 2 && (c[single] > 0) != (positive == 1))
        single++;
    const int32_t nodes[3] = {n[single], n[single == 0], n[single == 2 ? 1 : 2]};
    memcpy(key, nodes, sizeof nodes);
    sort_two(key + 1);
}

static bool is_same(const drape_active_contact *a, const drape_active_contact *b)
{
    int32_t key[3], other[3];
    if (a->pair.collider != b->pair.collider || a->pair.distance != b->pair.distance ||
        a->gap.closest.points != b->gap.closest.points || a->inside != b->inside || a->exempt != b->exempt)
        return false;
    key_of(a, key);
    key_of(b, other);
    return memcmp(key, other, sizeof key) == 0;
}

/* The slot of a contact, or a free one for it. */
static int32_t *slot_of(const drape_active_set *set, const drape_active_contact *contact)
{
    int32_t key[3];
    key_of(contact, key);
    uint64_t hash = 0;
    for (int a = 0; a < 3; a++)
        hash = (hash ^ (uint32_t)key[a]) * 0x9e3779b97f4a7c15u;
    uint64_t size = (uint64_t)set->slot_count, at = (hash >> 20) % size;
    while (set->slots[at] > 0 && !is_same(contact, &set->contacts[set->slots[at] - 1]))
        at = at + 1 < size ? at + 1 : 0;
    return &set->slots[at];
}

drape_status drape_active_set_add(drape_active_set *set, const drape_active_contact *contact)
{
    int32_t *slot = is_shared(contact) && set->slot_count > 0 ? slot_of(set, contact) : NULL;
    if (slot && *slot > 0) {
        set->contacts[*slot - 1].pair.area += contact->pair.area;
        return DRAPE_OK;
    }
    if (!drape_list_append(set->arena, &set->contacts, &set->count, &set->capacity, contact, sizeof *contact))
        return DRAPE_E_MEMORY;
    if (slot)
        *slot = set->count;
    if (set->slot_count == SLOTS * set->capacity)
        return DRAPE_OK;
    int32_t *slots = drape_arena_take(set->arena, SLOTS * (size_t)set->capacity, sizeof *slots);
    if (!slots)
        return DRAPE_E_MEMORY;
    drape_arena_release(set->arena, set->slots);
    set->slots = slots;
    set->slot_count = SLOTS * set->capacity;
    for (int32_t i = 0; i < set->count; i++)
        if (is_shared(&set->contacts[i]))
            *slot_of(set, &set->contacts[i]) = i + 1;
    return DRAPE_OK;
}

static drape_pair_key key_of_pair(const drape_pair *pair)
{
    drape_pair_key key = {.kind = (int32_t)pair->kind, .collider = pair->collider};
    memcpy(key.node, pair->node, sizeof key.node);
    return key;
}

static int compare(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(drape_pair_key));
}

static bool has_pair(const drape_inside_pairs *inside, const drape_pair *pair)
{
    const drape_pair_key key = key_of_pair(pair);
    return inside->count > 0 &&
           bsearch(&key, inside->keys, (size_t)inside->count, sizeof *inside->keys, compare);
}

drape_status drape_active_set_list(drape_active_set *set, const drape_candidates *candidates,
                                   const drape_distances *away, const drape_configuration *at,
                                   const drape_inside_pairs *inside, bool all_inside,
                                   const drape_exempt *exempt)
{
    const double rounding = candidates->broad->rounding;
    drape_candidate_cursor cursor = {0};
    const drape_pair *pair;
    set->count = set->near_count = 0;
    if (set->slots)
        memset(set->slots, 0, (size_t)set->slot_count * sizeof *set->slots);
    while ((pair = drape_candidates_next(candidates, away, &cursor))) {
        drape_active_contact contact;
        if (!drape_pair_gap(pair, at, candidates->broad->rest, &contact.gap))
            continue;
        contact.pair = *pair;
        contact.inside = false;
        contact.exempt = drape_exempt_factor(exempt, pair);
        if (contact.exempt > 0 && !exempt->acts(exempt, pair))
            continue;
        if (!(contact.exempt > 0) && contact.gap.value < DRAPE_BARRIER_PARABOLA * pair->distance) {
            contact.inside = has_pair(inside, pair) ||
                             (all_inside && contact.gap.value < drape_pair_least_gap(pair, rounding));
            const drape_near_pair near = {.pair = *pair, .gap = contact.gap.value};
            if (!drape_list_append(set->arena, &set->near, &set->near_count, &set->near_capacity, &near,
                                   sizeof near))
                return DRAPE_E_MEMORY;
        }
        reduce(&contact);
        if (drape_active_set_add(set, &contact))
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

/* ---- Pairs that began inside ---- */

drape_status drape_inside_add(drape_inside_pairs *inside, const drape_pair_key *key)
{
    return drape_list_append(inside->arena, &inside->keys, &inside->count, &inside->capacity, key,
                             sizeof *key)
               ? DRAPE_OK
               : DRAPE_E_MEMORY;
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
        const bool had = has_pair(&old, &near[i].pair);
        if (!had && !(near[i].gap < drape_pair_least_gap(&near[i].pair, rounding)))
            continue;
        const drape_pair_key key = key_of_pair(&near[i].pair);
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
