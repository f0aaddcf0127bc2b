/* fuzz_scene.c: the bytes are the text of a Drape scene, which is refused with one line or compiles. */
#include "fuzz/fuzz.h"

#define MAX_MEMORY ((size_t)32 << 20)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    drape_context *ctx = fuzz_open(MAX_MEMORY);
    drape_model *model = fuzz_scene(ctx, data, size);
    drape_model_destroy(&model);
    fuzz_close(&ctx);
    return 0;
}
