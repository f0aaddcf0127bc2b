/* hash.h: FNV-1a with 64 bits, over bytes (Fowler, Noll, Vo; RFC 9923). */
#ifndef DRAPE_BASE_HASH_H
#define DRAPE_BASE_HASH_H

#include <stddef.h>
#include <stdint.h>

#define DRAPE_HASH_START UINT64_C(0xcbf29ce484222325)

static inline uint64_t drape_hash_bytes(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *byte = data;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ byte[i]) * UINT64_C(0x100000001b3);
    return hash;
}

#endif
