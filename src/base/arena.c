/* arena.c: a list of blocks, one a request. What is taken is few and large, so there is no carving of chunks.
 */
#include "base/arena.h"

#include <stdalign.h>
#include <string.h>

struct drape_arena_block {
    struct drape_arena_block *before;
    alignas(max_align_t) unsigned char memory[];
};

void *drape_arena_take(drape_arena *arena, drape_context *ctx, size_t count, size_t size)
{
    size_t bytes = SIZE_MAX;
    if (__builtin_mul_overflow(count, size, &bytes) ||
        __builtin_add_overflow(bytes, sizeof(struct drape_arena_block), &bytes))
        bytes = SIZE_MAX; /* refused by drape_alloc, with its message */
    struct drape_arena_block *block = drape_alloc(ctx, bytes, 1);
    if (!block)
        return NULL;
    block->before = arena->last;
    arena->last = block;
    arena->bytes += bytes;
    return block->memory;
}

char *drape_arena_text(drape_arena *arena, drape_context *ctx, const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = drape_arena_take(arena, ctx, size, 1);
    if (copy)
        memcpy(copy, text, size);
    return copy;
}

void drape_arena_free(drape_arena *arena, drape_context *ctx)
{
    while (arena->last) {
        struct drape_arena_block *block = arena->last;
        arena->last = block->before;
        drape_free(ctx, block);
    }
    arena->bytes = 0;
}
