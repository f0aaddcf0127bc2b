/* arena.h: memory that lives as long as its owner (a model, a sim, a scene) and is freed with it. An object
 * in an arena needs neither a destructor, unless it holds other resources, nor a function that counts its
 * bytes. */
#ifndef DRAPE_BASE_ARENA_H
#define DRAPE_BASE_ARENA_H

#include "base/context.h"

typedef struct drape_arena {
    drape_context *ctx;
    struct drape_arena *owner; /* NULL, or the arena whose byte count includes this one */
    struct drape_arena_block *last;
    size_t bytes; /* bytes in use */
    bool failed;  /* an allocation has failed since the arena was empty */
} drape_arena;

/* Returns an empty arena. Allocates nothing. */
drape_arena drape_arena_of(drape_context *ctx);

/* The same on the heap, for owners that change their address. Returns NULL with a message if memory is
 * out. */
drape_arena *drape_arena_create(drape_context *ctx);
void drape_arena_destroy(drape_arena **arena); /* frees everything and sets *arena to NULL; a NULL arena is
                                                  allowed */

/* Returns an empty arena for a part of its owner that is rebuilt while the owner lives. It is freed
 * separately, before the owner, whose byte count includes it. The owner must keep its address. */
drape_arena drape_arena_within(drape_arena *owner);

/* As drape_alloc: count x size bytes, zeroed, valid until drape_arena_free. Returns NULL with a message if
 * memory is out. */
void *drape_arena_take(drape_arena *arena, size_t count, size_t size);
char *drape_arena_text(drape_arena *arena, const char *text); /* a copy of text */

/* Resizes memory (from this arena, or NULL) to count x size bytes. Contents are kept as far as they fit;
 * bytes beyond the former size are zero. Returns NULL with a message if memory is out; memory is then
 * unchanged. */
void *drape_arena_resize(drape_arena *arena, void *memory, size_t count, size_t size);

/* Frees memory of this arena before the rest. NULL is allowed. */
void drape_arena_release(drape_arena *arena, void *memory);

/* Returns DRAPE_E_MEMORY if any allocation failed: a caller can make several and check once. */
drape_status drape_arena_status(const drape_arena *arena);

void drape_arena_free(drape_arena *arena); /* leaves it empty, with the same context and owner */

#endif
