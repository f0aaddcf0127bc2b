/*
 * fuzz.h: what the fuzz targets share. A target is one file with LLVMFuzzerTestOneInput, which runs the
 * library on some bytes and aborts if the library breaks a promise. libFuzzer (tools/fuzz) searches for such
 * bytes; linked with replay.c, a target runs on given files.
 */
#ifndef DRAPE_TESTS_FUZZ_H
#define DRAPE_TESTS_FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include "drape/drape.h"

/* The function that libFuzzer calls. Returns 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Prints the reason and aborts, also if asserts are off. */
#define FUZZ_REQUIRE(promise, ...)                                                                           \
    do {                                                                                                     \
        if (!(promise))                                                                                      \
            fuzz_die(__FILE__, __LINE__, #promise, __VA_ARGS__);                                             \
    } while (0)
_Noreturn void fuzz_die(const char *file, int line, const char *promise, const char *format, ...)
    DRAPE_PRINTF(4, 5);

/* ---- Contexts ---- */

/* A context whose allocator has at most max_bytes in use at a time: a scene may ask for a mesh of any size,
 * and is then refused as on a machine without more memory. */
drape_context *fuzz_open(size_t max_bytes);

/* Destroys the context. All that was made with it must have been destroyed. */
void fuzz_close(drape_context **ctx);

/* Checks a status that a public call returned: not one of those > 0 that only a step has; a failure has a
 * message of one line. */
void fuzz_check(const drape_context *ctx, drape_status status, const char *call);

/* ---- Bytes as choices; zeros follow their end ---- */

typedef struct fuzz_bytes {
    const uint8_t *at, *end;
} fuzz_bytes;

unsigned fuzz_byte(fuzz_bytes *bytes);
unsigned fuzz_below(fuzz_bytes *bytes, unsigned count);            /* 0 to count - 1; count at most 256 */
double fuzz_between(fuzz_bytes *bytes, double low, double high);   /* one of 65 536 equally spaced values */
double fuzz_magnitude(fuzz_bytes *bytes, double low, double high); /* the same in its logarithm */

/* ---- Folders ---- */

/* A folder of this process, with files: each piece of the bytes that begins with a line "=== NAME" is the
 * content of NAME. Files of the call before are removed. The folder is removed at exit. */
const char *fuzz_folder(const uint8_t *data, size_t size);

/* Removes a folder and the files in it. */
void fuzz_remove(const char *folder);

/* ---- Sims ---- */

/* Advances to t in at most `attempts` attempts, and cancels the advance after `seconds` of CPU, as a
 * single attempt may take much work ("static" makes a thousand steps of pseudo time). An advance must end
 * soon after it is cancelled, measured in CPU time and not by the clock of a busy machine. A loop that
 * never ends hangs, which libFuzzer and the timeout of the tests report. Checks during and after the
 * advance that all numbers are finite and that a rejected attempt or a failure leaves the last accepted
 * state to the bit. Call it once for each sim. */
drape_status fuzz_advance(drape_context *ctx, drape_sim *sim, double t, int attempts, double seconds);

/* Checks that the time, the positions and the velocities of a sim are finite; when: for the message. */
void fuzz_check_finite(const drape_sim *sim, const char *when);

/* A checkpoint in memory; data is to be freed. */
typedef struct fuzz_saved {
    uint8_t *data;
    size_t size, room;
} fuzz_saved;

/* For drape_sim_save_to: adds to the fuzz_saved that user is. */
drape_status fuzz_keep(void *user, const void *piece, size_t size);

/* Parses and compiles a text; NULL if it was refused. Checks that the printed scene compiles too. */
drape_model *fuzz_scene(drape_context *ctx, const uint8_t *data, size_t size);

/* Reads a mesh with this importer and takes it through all stages of a mesh. */
void fuzz_mesh(const char *format, const uint8_t *data, size_t size);

#endif
