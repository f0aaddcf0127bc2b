/* build_parts.c: the parts that the elements of a term share, and the patches of elements with the same
 * nodes. */
#include "compile/term_builder.h"

#include <string.h>

/* ---- Parts ---- */

/* Leaves out parts without a link. */
static drape_status leave_out_unused(drape_term_builder *builder, drape_arena *scratch)
{
    drape_parts *p = &builder->term->parts;
    const size_t nodes = (size_t)p->nodes, before = (size_t)p->count;
    size_t rest = 0;
    int32_t *number =
        drape_arena_take(scratch, before, sizeof *number); /* 1 of what has links, then the new */
    if (!number)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < p->link_count; i++)
        number[p->part[i]] = 1;
    for (size_t i = 0; i < (size_t)p->rest_count * before; i++)
        if (number[i % before])
            builder->part_rest[rest++] = builder->part_rest[i];
    p->count = 0;
    for (size_t from = 0; from < before; from++) {
        if (number[from] == 0)
            continue;
        memmove(builder->part_node + (size_t)p->count * nodes, builder->part_node + from * nodes,
                nodes * sizeof *builder->part_node);
        builder->part_turn[p->count] = builder->part_turn[from];
        number[from] = p->count++;
    }
    for (int32_t i = 0; i < p->link_count; i++)
        builder->link_part[i] = number[p->part[i]];
    return DRAPE_OK;
}

/* Where the nodes of the part of link i are in its element; false if the element lacks one. */
static bool find_places(const drape_elements *el, int32_t i, uint8_t *place)
{
    const drape_parts *p = el->parts;
    const int32_t *node = p->node + (size_t)p->part[i] * (size_t)p->nodes,
                  *of = el->node + (size_t)p->element[i] * (size_t)el->nodes;
    for (int a = 0; a < p->nodes; a++) {
        int b = 0;
        while (b < el->nodes && of[b] != node[a])
            b++;
        if (b == el->nodes)
            return false;
        place[a] = (uint8_t)b;
    }
    return true;
}

static drape_status find_links(drape_term_builder *builder)
{
    const drape_elements *el = &builder->term->elements;
    drape_parts *p = &builder->term->parts;
    drape_arena *arena = &builder->model->arena;
    const size_t nodes = (size_t)p->nodes;
    int32_t *first_link = drape_arena_take(arena, (size_t)el->count + 1, sizeof *first_link),
            *first_user = drape_arena_take(arena, (size_t)p->count + 1, sizeof *first_user),
            *user = drape_arena_take(arena, (size_t)p->link_count, sizeof *user);
    uint8_t *place = drape_arena_take(arena, (size_t)p->link_count * nodes, sizeof *place);
    if (!first_link || !first_user || !user || !place)
        return DRAPE_E_MEMORY;
    memset(first_link, 0, ((size_t)el->count + 1) * sizeof *first_link);
    memset(first_user, 0, ((size_t)p->count + 1) * sizeof *first_user);
    for (int32_t i = 0; i < p->link_count; i++) {
        first_link[p->element[i] + 1]++;
        first_user[p->part[i] + 1]++;
    }
    for (int32_t e = 0; e < el->count; e++)
        first_link[e + 1] += first_link[e];
    for (int32_t k = 0; k < p->count; k++)
        first_user[k + 1] += first_user[k];
    for (int32_t i = 0; i < p->link_count; i++)
        user[first_user[p->part[i]]++] = i;
    for (int32_t k = p->count; k > 0; k--)
        first_user[k] = first_user[k - 1];
    first_user[0] = 0;
    p->first_link = first_link;
    p->first_user = first_user;
    p->user = user;
    p->place = place;
    for (int32_t i = 0; i < p->link_count; i++)
        if (!find_places(el, i, place + (size_t)i * nodes))
            return drape_term_refuse(builder, "element %d of %s lacks a node of its part %d",
                                     (int)p->element[i], builder->term->ops->entry.name, (int)p->part[i]);
    return DRAPE_OK;
}

/* ---- Patches ---- */

static drape_status find_patches(drape_term_builder *builder)
{
    drape_term *term = builder->term;
    const drape_elements *el = &term->elements;
    const drape_parts *p = &term->parts;
    drape_patches *patches = &term->patches;
    drape_arena *arena = &builder->model->arena;
    const size_t n = (size_t)el->nodes, most = (size_t)el->count;
    patches->first = drape_arena_take(arena, most + 1, sizeof *patches->first);
    patches->node = drape_arena_take(arena, most * n, sizeof *patches->node);
    patches->used = drape_arena_take(arena, most, sizeof *patches->used);
    patches->coupled = drape_arena_take(arena, most * n, sizeof *patches->coupled);
    if (!patches->first || !patches->node || !patches->used || !patches->coupled)
        return DRAPE_E_MEMORY;
    for (int32_t e = 0; e < el->count; e++) {
        const int32_t *node = el->node + (size_t)e * n;
        if (e == 0 || memcmp(node, node - n, n * sizeof *node) != 0) {
            memcpy(patches->node + (size_t)patches->count * n, node, n * sizeof *node);
            patches->used[patches->count] = 0;
            patches->first[patches->count++] = e;
        }
        uint8_t *used = &patches->used[patches->count - 1];
        int32_t *coupled = patches->coupled + (size_t)e * n;
        const size_t first = (size_t)p->first_link[e] * (size_t)p->nodes,
                     last = (size_t)p->first_link[e + 1] * (size_t)p->nodes;
        for (size_t a = 0; a < n; a++)
            coupled[a] = node[first < last ? p->place[first] : 0];
        for (size_t k = first; k < last; k++) {
            coupled[p->place[k]] = node[p->place[k]];
            if (*used <= p->place[k])
                *used = (uint8_t)(p->place[k] + 1);
        }
    }
    patches->first[patches->count] = el->count;
    return DRAPE_OK;
}

drape_status drape_term_finish_parts(drape_term_builder *builder)
{
    const drape_term *term = builder->term;
    const drape_parts *p = &term->parts;
    if (!term->ops->part)
        return DRAPE_OK;
    if (!builder->reserved_parts || builder->links != p->link_count)
        return drape_term_refuse(builder, "%s announced %d links and made %d", term->ops->entry.name,
                                 (int)p->link_count, (int)builder->links);
    drape_arena scratch = drape_arena_of(builder->model->ctx);
    drape_status status = leave_out_unused(builder, &scratch);
    drape_arena_free(&scratch);
    if (!status)
        status = find_links(builder);
    return status ? status : find_patches(builder);
}
