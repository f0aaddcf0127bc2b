/*
 * def.h: structs that a host fills. They begin with their size as the host's header has it. A host built
 * against an older header has a shorter struct, whose members are the first ones of ours; one that was built
 * against a newer header has more members, which are set to zero here.
 */
#ifndef DRAPE_BASE_DEF_H
#define DRAPE_BASE_DEF_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

/* Fills the def of a host, of struct_size bytes, from defaults of `size` bytes. Nothing if def is NULL. */
static inline void drape_def_fill(void *def, size_t struct_size, const void *defaults, size_t size)
{
    if (!def)
        return;
    memset(def, 0, struct_size);
    memcpy(def, defaults, struct_size < size ? struct_size : size);
}

/* Whether a def has the size of this version or of an older one. `least` is that of the first version that is
 * read; whatever is shorter was not initialised, or is not the struct in question. */
static inline bool drape_def_fits(size_t struct_size, size_t least, size_t size)
{
    return struct_size >= least && struct_size <= size;
}

#endif
