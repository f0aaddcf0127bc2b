/*
 * fuzz.h: what the fuzz targets share. A target is one file with drape_fuzz_one, which tries the library on
 * some bytes and dies where it breaks a promise. With libFuzzer (tools/fuzz) it looks for such bytes; linked
 * to replay.c it goes over files that are given.
 */
#ifndef DRAPE_TESTS_FUZZ_H
#define DRAPE_TESTS_FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include "drape/drape.h"

/* libFuzzer's name for it; 0: always. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Says why and aborts: asserts may be off. */
#define FUZZ_REQUIRE(promise, ...)                                                                           \
    do {                                                                                                     \
        if (!(promise))                                                                                      \
            fuzz_die(__FILE__, __LINE__, #promise, __VA_ARGS__);                                             \
    } while (0)
_Noreturn void fuzz_die(const char *file, int line, const char *promise, const char *format, ...)
    DRAPE_PRINTF(4, 5);

/* ---- Contexts ---- */

/* A context whose allocator gives at most `most` bytes at a time: a scene may ask for a mesh of any size, and
 * is then refused as on a machine that has no more. */
drape_context *fuzz_open(size_t most);

/* Destroys it. Nothing that was made with it may be left. */
void fuzz_close(drape_context **ctx);

/* A status that a call from outside may end with: none that only a step has; with a failure one line. */
void fuzz_check(const drape_context *ctx, drape_status status, const char *call);

/* ---- Bytes as choices; where they end, zeros follow ---- */

typedef struct fuzz_bytes {
    const uint8_t *at, *end;
} fuzz_bytes;

unsigned fuzz_byte(fuzz_bytes *bytes);
unsigned fuzz_below(fuzz_bytes *bytes, unsigned count);              /* 0 to count - 1; count at most 256 */
double fuzz_between(fuzz_bytes *bytes, double least, double most);   /* in 65 536 equal steps */
double fuzz_magnitude(fuzz_bytes *bytes, double least, double most); /* the same of its logarithm */

/* ---- Sims ---- */

/* Advances to t in at most `attempts` attempts, and cancels what takes more than `seconds` of CPU: the work
 * of a single attempt has bounds of its own, which may be high ("static" follows a thousand steps of pseudo
 * time). What does not heed the cancellation soon, by CPU and not by the clock of a busy machine, breaks a
 * promise; a loop that never does hangs, which libFuzzer and the timeout of the tests tell. Along the way and
 * after it: numbers are finite, a rejected attempt or a failure leaves the last accepted state to the bit.
 * Once for each sim. */
drape_status fuzz_advance(drape_context *ctx, drape_sim *sim, double t, int attempts, double seconds);

/* Parses and compiles a text; NULL where it was refused. What it is printed as compiles, too. */
drape_model *fuzz_scene(drape_context *ctx, const uint8_t *data, size_t size);

/* Reads a mesh of the format of this row of the imports, and brings what was read through all stages of a
 * mesh. */
void fuzz_mesh(const char *format, const uint8_t *data, size_t size);

#endif
