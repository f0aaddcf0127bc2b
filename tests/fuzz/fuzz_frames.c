/* fuzz_frames.c: the bytes are files of the animation of a body: frames.npy or frames.pc2, mesh.obj,
 * times.npy. */
#include <stdio.h>
#include <unistd.h>

#include "base/arena.h"
#include "fuzz/fuzz.h"
#include "mesh/sequence.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const names[] = {"frames.npy", "frames.pc2", "mesh.obj", "times.npy"};
    char paths[4][300];
    const char *folder = fuzz_folder(data, size);
    for (int i = 0; i < 4; i++)
        snprintf(paths[i], sizeof paths[i], "%s/%s", folder, names[i]);
    drape_context *ctx = fuzz_open((size_t)1 << 28);
    drape_arena arena = drape_arena_of(ctx);
    drape_mesh mesh = {0};
    drape_sequence frames = {0};
    const drape_sequence_def def = {.file = paths[access(paths[0], F_OK) != 0],
                                    .mesh = paths[2],
                                    .times = access(paths[3], F_OK) ? NULL : paths[3],
                                    .rate = 10};
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
