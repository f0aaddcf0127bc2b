/* arena.h: memory that lives as long as its owner and is freed with it: a model, a sim, a scene. An object made in an
 * arena needs no destructor of its own, unless it holds what is not memory, and no function that counts its bytes. */
#ifndef DRAPE_BASE_ARENA_H
#define DRAPE_BASE_ARENA_H

#include "base/context.h"

typedef struct drape_arena {
    drape_context *ctx;
    struct drape_arena_block *last;
    size_t bytes; /* in use */
    bool failed;  /* an allocation failed since drape_arena_of */
} drape_arena;

/* An empty arena. Allocates nothing. */
drape_arena drape_arena_of(drape_context *ctx);

/* As drape_alloc: count x size bytes, zeroed, until drape_arena_free. NULL with a message where there is no memory. */
void *drape_arena_take(drape_arena *arena, size_t count, size_t size);
char *drape_arena_text(drape_arena *arena, const char *text); /* a copy */

/* memory (of this arena, or NULL) at count x size bytes: its contents are kept as far as they fit, bytes beyond its former
 * size are zero. NULL with a message where there is no memory; then memory is as it was. */
void *drape_arena_resize(drape_arena *arena, void *memory, size_t count, size_t size);

/* Gives memory of this arena back before the others; NULL is fine. */
void drape_arena_release(drape_arena *arena, void *memory);

/* DRAPE_E_MEMORY where any allocation failed: many can be made, and checked once. */
drape_status drape_arena_status(const drape_arena *arena);

void drape_arena_free(drape_arena *arena); /* leaves it empty, and of the same context */

#endif
