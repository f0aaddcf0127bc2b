/* arena.h: memory that is freed together. */
#ifndef DRAPE_BASE_ARENA_H
#define DRAPE_BASE_ARENA_H

#include "base/context.h"

/* Zero is an empty arena. */
typedef struct drape_arena {
    struct drape_arena_block *last;
    size_t bytes; /* taken so far */
} drape_arena;

/* As drape_alloc: count x size bytes, zeroed; they live until drape_arena_free. */
void *drape_arena_take(drape_arena *arena, drape_context *ctx, size_t count, size_t size);
char *drape_arena_text(drape_arena *arena, drape_context *ctx, const char *text); /* a copy */
void drape_arena_free(drape_arena *arena, drape_context *ctx);                    /* leaves it empty */

#endif
