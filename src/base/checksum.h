/*
 * checksum.h: a checksum of the bytes of a file that can be kept current while the file grows and while bytes
 * in its middle are overwritten.
 *
 * It is the sum over the words of 8 bytes, of which the last is padded with zeros, of mix(word + (k + 1) G)
 * modulo 2^64, with k the number of the word and G, mix() those of SplitMix64 (Steele, Lea, Flood: Fast
 * splittable pseudorandom number generators, OOPSLA 2014). mix() is a bijection: a change within one word is
 * always detected, any other with a probability of 1 - 2^-64. It detects damage, not forgery. The length is
 * not part of it.
 */
#ifndef DRAPE_BASE_CHECKSUM_H
#define DRAPE_BASE_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* The contribution of a word, little endian, at an offset that is a multiple of 8. */
static inline uint64_t drape_checksum_word(uint64_t offset, const unsigned char word[8])
{
    uint64_t z;
    memcpy(&z, word, sizeof z);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    z = __builtin_bswap64(z);
#endif
    z += (offset / 8 + 1) * UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

/* The contribution of bytes from an offset that is a multiple of 8; the last word is padded with zeros. */
static inline uint64_t drape_checksum_bytes(uint64_t offset, const void *data, size_t size)
{
    const unsigned char *from = data;
    unsigned char last[8] = {0};
    uint64_t sum = 0;
    size_t done = 0;
    for (; done + 8 <= size; done += 8)
        sum += drape_checksum_word(offset + done, from + done);
    if (done == size)
        return sum;
    memcpy(last, from + done, size - done);
    return sum + drape_checksum_word(offset + done, last);
}

/* The checksum of a file and the last, incomplete word of it. All members zero: the file is empty. */
typedef struct drape_checksum {
    uint64_t sum, size;
    unsigned char tail[8]; /* its first size % 8 bytes */
} drape_checksum;

/* Adds bytes to the end. */
static inline void drape_checksum_add(drape_checksum *c, const void *data, size_t size)
{
    const unsigned char *from = data;
    size_t used = c->size % 8, fill = used ? 8 - used : 0;
    if (fill > size)
        fill = size;
    if (fill) {
        c->sum -= drape_checksum_bytes(c->size - used, c->tail, used);
        memcpy(c->tail + used, from, fill);
        c->sum += drape_checksum_bytes(c->size - used, c->tail, used + fill);
        c->size += fill;
        from += fill;
        size -= fill;
    }
    if (size == 0)
        return;
    c->sum += drape_checksum_bytes(c->size, from, size);
    c->size += size;
    memcpy(c->tail, from + size - size % 8, size % 8);
}

#endif
