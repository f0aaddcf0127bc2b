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

/* Returns a sub-arena that can be emptied alone, for a part of the owner that is rebuilt while the owner
 * lives. Its bytes count in the owner, whose address must not change. It must be freed before the owner. */
drape_arena drape_arena_within(drape_arena *owner);

/* Allocates count x size bytes, zeroed, valid until drape_arena_free. Returns NULL with a message if memory
 * is out. */
void *drape_arena_take(drape_arena *arena, size_t count, size_t size);
char *drape_arena_text(drape_arena *arena, const char *text); /* a copy of text */

/* Resizes memory of this arena to count x size bytes and returns its new address; NULL is resized like 0
 * bytes. Contents are kept as far as they fit; added bytes are zero. Returns NULL with a message if memory is
 * out; the old memory is then unchanged. */
void *drape_arena_resize(drape_arena *arena, void *memory, size_t count, size_t size);

/* Frees one allocation early. NULL is allowed. */
void drape_arena_release(drape_arena *arena, void *memory);

/* Returns DRAPE_E_MEMORY if any allocation failed: a caller can make several and check once. */
drape_status drape_arena_status(const drape_arena *arena);

void drape_arena_free(drape_arena *arena); /* leaves it empty, with the same context and owner */

#endif
