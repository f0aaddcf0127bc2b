/* fuzz_cs184.c: the bytes are the text of a scene of the CS184 cloth simulator. If it compiles and is small,
 * it makes a step. */
#include "fuzz/fuzz.h"

#define MAX_MEMORY ((size_t)32 << 20)
#define MAX_NODES  64
#define STEP       1e-3 /* [s] */

static void step(drape_context *ctx, const drape_model *model)
{
    drape_sim *sim = NULL;
    const drape_status status = drape_sim_create(ctx, model, NULL, &sim);
    fuzz_check(ctx, status, "drape_sim_create");
    if (!status)
        fuzz_advance(ctx, sim, STEP, 3, 3);
    drape_sim_destroy(&sim);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    drape_context *ctx = fuzz_open(MAX_MEMORY);
    drape_model *model = fuzz_scene(ctx, data, size);
    if (model && drape_model_node_count(model) <= MAX_NODES)
        step(ctx, model);
    drape_model_destroy(&model);
    fuzz_close(&ctx);
    return 0;
}
