/* arena.h: memory that lives as long as its owner and is freed with it: a model, a sim, a scene. An object
 * made in an arena needs no destructor of its own, unless it holds what is not memory, and no function that
 * counts its bytes. */
#ifndef DRAPE_BASE_ARENA_H
#define DRAPE_BASE_ARENA_H

#include "base/context.h"

typedef struct drape_arena {
    drape_context *ctx;
    struct drape_arena *owner; /* NULL, or the arena whose bytes include those of this one */
    struct drape_arena_block *last;
    size_t bytes; /* in use */
    bool failed;  /* an allocation failed since the arena was empty */
} drape_arena;

/* An empty arena. Allocates nothing. */
drape_arena drape_arena_of(drape_context *ctx);

/* The same with an address that stays, for owners that move. NULL with a message where there is no memory. */
drape_arena *drape_arena_create(drape_context *ctx);
void drape_arena_destroy(drape_arena **arena); /* frees all; NULL is fine, and it becomes NULL */

/* An empty arena for a part of an owner that is made again while the owner lives: it is freed on its own,
 * before the owner, who counts its bytes. owner keeps its address. */
drape_arena drape_arena_within(drape_arena *owner);

/* As drape_alloc: count x size bytes, zeroed, until drape_arena_free. NULL with a message where there is no
 * memory. */
void *drape_arena_take(drape_arena *arena, size_t count, size_t size);
char *drape_arena_text(drape_arena *arena, const char *text); /* a copy */

/* memory (of this arena, or NULL) at count x size bytes: its contents are kept as far as they fit, bytes
 * beyond its former size are zero. NULL with a message where there is no memory; then memory is as it was. */
void *drape_arena_resize(drape_arena *arena, void *memory, size_t count, size_t size);

/* Gives memory of this arena back before the others; NULL is fine. */
void drape_arena_release(drape_arena *arena, void *memory);

/* DRAPE_E_MEMORY where any allocation failed: many can be made, and checked once. */
drape_status drape_arena_status(const drape_arena *arena);

void drape_arena_free(drape_arena *arena); /* leaves it empty, of the same context and owner */

#endif
