/*
 * fuzz_checkpoint.c: a checkpoint of a small sim with some bytes changed and its length and checksum
 * corrected, so that the reader itself must find the errors. The first byte chooses the integrator; every 4
 * bytes after it are one change. A refused checkpoint leaves the sim as it is; a sim restored from an
 * accepted one makes some steps.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/checksum.h"
#include "fuzz/fuzz.h"
#include "integrators/integrator.h"

#define MAX_MEMORY ((size_t)64 << 20)
#define TAIL       (2 * sizeof(uint64_t)) /* length and checksum at the end of an archive */
#define CHANGES    16
#define STEP       0.01 /* [s] */

/* A scene in which every part has a state to save: contact, friction, an internal variable, a moving pin, the
 * history of steps, events. */
static const char sheet[] =
    "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"equilateral\", \"edges\": 2, \"edge_length\": 0.1},"
    "\"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200},"
    "\"terms\": [\"stretch.edge\", \"bend.hinge\", {\"type\": \"damp.kelvin_voigt\", \"beta\": 1e-3}],"
    "\"pins\": [{\"edge\": \"top\", \"track\": [[0, [0, 0, 0]], [1, [0, 0.1, 0]]]}]}],"
    "\"colliders\": [{\"type\": \"sphere\", \"center\": [0.1, -0.12, -0.1], \"radius\": 0.1,"
    "\"friction\": 0.2}], \"self_contact\": {\"thickness\": 0.01}, \"contact\": {\"friction\": \"lagged\"},"
    "\"events\": [{\"type\": \"height\", \"height\": -0.5, \"action\": \"stop\"},"
    "{\"type\": \"energy\", \"bound\": 1e-6}, {\"type\": \"pin_force\", \"limit\": 1e3, \"action\": "
    "\"release\"}],"
    "\"integrator\": {\"method\": \"be\", \"dt\": 0.01}, \"controller\": {\"type\": \"halving\"},"
    "\"duration\": 1, \"frame_rate\": 60}";

static void change(fuzz_saved *b, fuzz_bytes *in)
{
    static const double odd[] = {NAN, INFINITY, -1, 0, 1e300, 1e-300, -1e9, 0.5};
    static const int64_t whole[] = {-1, 0, 1, INT32_MAX, INT32_MIN, INT64_MAX, INT64_MIN, 64};
    const unsigned kind = fuzz_byte(in), high = fuzz_byte(in);
    const size_t body = b->size - TAIL, at = (256 * high + fuzz_byte(in)) % (body + !body);
    const unsigned value = fuzz_byte(in);
    if (body == 0) /* a cut left nothing */
        return;
    const size_t room = body - at, eight = room < 8 ? room : 8, four = room < 4 ? room : 4;
    if (kind % 6 == 0)
        b->data[at] = (uint8_t)value;
    else if (kind % 6 == 1)
        b->data[at] ^= (uint8_t)(1u << value % 8);
    else if (kind % 6 == 2)
        memcpy(b->data + at, &odd[value % 8], eight);
    else if (kind % 6 == 3)
        memcpy(b->data + at, &whole[value % 8], eight);
    else if (kind % 6 == 4)
        memcpy(b->data + at, &whole[value % 8], four);
    else if (at + TAIL > 0 && value % 8 == 0)
        b->size = at + TAIL;
}

static void make_right(fuzz_saved *b)
{
    const uint64_t length = b->size - TAIL;
    memcpy(b->data + b->size - TAIL, &length, sizeof length);
    const uint64_t sum = drape_checksum_bytes(0, b->data, b->size - sizeof sum);
    memcpy(b->data + b->size - sizeof sum, &sum, sizeof sum);
}

static void restore(drape_context *ctx, drape_sim *sim, const fuzz_saved *b)
{
    const uint64_t before = drape_sim_hash(sim);
    const drape_status status = drape_sim_restore_from(sim, b->data, b->size);
    fuzz_check(ctx, status, "drape_sim_restore_from");
    FUZZ_REQUIRE(!status || drape_sim_hash(sim) == before, "%s: the sim is another",
                 drape_context_message(ctx));
    fuzz_advance(ctx, sim, drape_sim_time(sim) + 2 * STEP, 20, 3);
}

/* ---- The input, made once: the model, and for each integrator a checkpoint after three steps ---- */

#define MAX_INTEGRATORS 32

static drape_model *model_made;
static fuzz_saved checkpoint_of[MAX_INTEGRATORS];
static unsigned integrator_count;

static drape_sim *open_sim(drape_context *ctx, unsigned integrator)
{
    drape_sim_def def;
    drape_sim *sim = NULL;
    drape_sim_def_init(&def, sizeof def);
    def.integrator = drape_integrators[integrator]->entry.name;
    FUZZ_REQUIRE(drape_sim_create(ctx, model_made, &def, &sim) == DRAPE_OK, "%s", drape_context_message(ctx));
    return sim;
}

/* In a separate context that is never destroyed. */
static void make_checkpoints(void)
{
    static drape_context *ctx;
    if (ctx)
        return;
    FUZZ_REQUIRE(drape_context_create(NULL, &ctx) == DRAPE_OK, "no context");
    model_made = fuzz_scene(ctx, (const uint8_t *)sheet, sizeof sheet - 1);
    FUZZ_REQUIRE(model_made, "%s", drape_context_message(ctx));
    for (; drape_integrators[integrator_count]; integrator_count++) {
        FUZZ_REQUIRE(integrator_count < MAX_INTEGRATORS, "%u integrators", integrator_count);
        drape_sim *sim = open_sim(ctx, integrator_count);
        FUZZ_REQUIRE(drape_sim_advance(sim, 3 * STEP) == DRAPE_OK, "%s", drape_context_message(ctx));
        FUZZ_REQUIRE(drape_sim_save_to(sim, fuzz_keep, &checkpoint_of[integrator_count]) == DRAPE_OK, "%s",
                     drape_context_message(ctx));
        drape_sim_destroy(&sim);
    }
}

static fuzz_saved copy(const fuzz_saved *from)
{
    fuzz_saved b = {.data = malloc(from->size), .size = from->size};
    FUZZ_REQUIRE(b.data, "no memory for %zu bytes", b.size);
    memcpy(b.data, from->data, b.size);
    return b;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    make_checkpoints();
    drape_context *ctx = fuzz_open(MAX_MEMORY);
    fuzz_bytes in = {.at = data, .end = data + size};
    const unsigned integrator = fuzz_below(&in, integrator_count);
    fuzz_saved b = copy(&checkpoint_of[integrator]);
    drape_sim *sim = open_sim(ctx, integrator);
    FUZZ_REQUIRE(drape_sim_advance(sim, STEP) == DRAPE_OK, "%s", drape_context_message(ctx));
    for (int i = 0; i < CHANGES && in.at < in.end; i++)
        change(&b, &in);
    make_right(&b);
    restore(ctx, sim, &b);
    drape_sim_destroy(&sim);
    free(b.data);
    fuzz_close(&ctx);
    return 0;
}
