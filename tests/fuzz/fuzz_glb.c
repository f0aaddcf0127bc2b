/* fuzz_glb.c: the bytes are a GLB file with the animation of a body, which is sampled at 10 Hz. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/arena.h"
#include "fuzz/fuzz.h"
#include "mesh/sequence.h"

static char path[256]; /* readers of frames take names of files */

static void remove_file(void)
{
    unlink(path);
}

static void name_file(void)
{
    const char *folder = getenv("TMPDIR");
    snprintf(path, sizeof path, "%s/drape-fuzz-%ld.glb", folder ? folder : "/tmp", (long)getpid());
    atexit(remove_file);
}

static void write_file(const uint8_t *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    FUZZ_REQUIRE(file && fwrite(data, 1, size, file) == size, "%s", path);
    FUZZ_REQUIRE(fclose(file) == 0, "%s", path);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (!*path)
        name_file();
    write_file(data, size);
    drape_context *ctx = fuzz_open((size_t)1 << 28);
    drape_arena arena = drape_arena_of(ctx);
    drape_mesh mesh = {0};
    drape_sequence frames = {0};
    const drape_sequence_def def = {.file = path, .rate = 10};
    const drape_status status = drape_sequence_read(&arena, "/body", NULL, &def, &mesh, &frames);
    fuzz_check(ctx, status, "drape_sequence_read");
    for (int32_t i = 0; !status && i < 3 * mesh.triangle_count; i++)
        FUZZ_REQUIRE(mesh.triangle[i] >= 0 && mesh.triangle[i] < frames.node_count, "corner %d", (int)i);
    for (int32_t i = 1; !status && i < frames.frame_count; i++)
        FUZZ_REQUIRE(frames.time[i] > frames.time[i - 1], "frame %d", (int)i);
    drape_mesh_free(&mesh);
    drape_arena_free(&arena);
    fuzz_close(&ctx);
    return 0;
}
