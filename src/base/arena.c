/* arena.c: a doubly linked list of blocks, one for each request: requests are few and large. */
#include "base/arena.h"

#include <stdalign.h>
#include <string.h>

struct drape_arena_block {
    struct drape_arena_block *before, *after;
    size_t size; /* bytes of memory */
    alignas(max_align_t) unsigned char memory[];
};

drape_arena drape_arena_of(drape_context *ctx)
{
    return (drape_arena){.ctx = ctx};
}

drape_arena *drape_arena_create(drape_context *ctx)
{
    drape_arena *arena = drape_alloc(ctx, 1, sizeof *arena);
    if (arena)
        *arena = drape_arena_of(ctx);
    return arena;
}

void drape_arena_destroy(drape_arena **arena)
{
    if (!*arena)
        return;
    drape_arena_free(*arena);
    drape_free((*arena)->ctx, *arena);
    *arena = NULL;
}

drape_arena drape_arena_within(drape_arena *owner)
{
    return (drape_arena){.ctx = owner->ctx, .owner = owner};
}

static void count_bytes(drape_arena *arena, size_t taken, size_t released)
{
    for (; arena; arena = arena->owner)
        arena->bytes += taken - released;
}

void *drape_arena_take(drape_arena *arena, size_t count, size_t size)
{
    size_t bytes = 0, total = SIZE_MAX; /* on overflow SIZE_MAX, which drape_alloc refuses with a message */
    if (__builtin_mul_overflow(count, size, &bytes) ||
        __builtin_add_overflow(bytes, sizeof(struct drape_arena_block), &total))
        total = SIZE_MAX;
    struct drape_arena_block *block = drape_alloc(arena->ctx, total, 1);
    if (!block) {
        arena->failed = true;
        return NULL;
    }
    block->size = bytes;
    block->before = arena->last;
    if (block->before)
        block->before->after = block;
    arena->last = block;
    count_bytes(arena, total, 0);
    return block->memory;
}

char *drape_arena_text(drape_arena *arena, const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = drape_arena_take(arena, size, 1);
    if (copy)
        memcpy(copy, text, size);
    return copy;
}

static struct drape_arena_block *block_of(void *memory)
{
    return (struct drape_arena_block *)((unsigned char *)memory - offsetof(struct drape_arena_block, memory));
}

void *drape_arena_resize(drape_arena *arena, void *memory, size_t count, size_t size)
{
    void *resized = drape_arena_take(arena, count, size);
    if (resized && memory) {
        size_t before = block_of(memory)->size;
        memcpy(resized, memory, before < count * size ? before : count * size);
        drape_arena_release(arena, memory);
    }
    return resized;
}

void drape_arena_release(drape_arena *arena, void *memory)
{
    if (!memory)
        return;
    struct drape_arena_block *block = block_of(memory);
    if (block->before)
        block->before->after = block->after;
    if (block->after)
        block->after->before = block->before;
    else
        arena->last = block->before;
    count_bytes(arena, 0, sizeof *block + block->size);
    drape_free(arena->ctx, block);
}

drape_status drape_arena_status(const drape_arena *arena)
{
    return arena->failed ? DRAPE_E_MEMORY : DRAPE_OK;
}

void drape_arena_free(drape_arena *arena)
{
    count_bytes(arena->owner, 0, arena->bytes);
    while (arena->last) {
        struct drape_arena_block *block = arena->last;
        arena->last = block->before;
        drape_free(arena->ctx, block);
    }
    *arena = (drape_arena){.ctx = arena->ctx, .owner = arena->owner};
}
