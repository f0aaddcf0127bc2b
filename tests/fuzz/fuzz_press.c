/*
 * fuzz_press.c: a scene made from the bytes in which cloth is pressed against colliders and against other
 * cloth, by one integrator. A scene that starts without a crossing has none in any accepted state or frame,
 * as support/crossings.h counts them; a run may stop.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "fuzz/fuzz.h"
#include "support/crossings.h"

#define MAX_MEMORY ((size_t)256 << 20)
#define ATTEMPTS   150
#define SECONDS    0.5 /* [s] of CPU */
#define DURATION   0.2 /* [s] */
#define SIZE       0.3 /* [m] of a cloth */

static const char *const integrators[] = {"'method': 'be'",
                                          "'method': 'bdf2'",
                                          "'method': 'midpoint'",
                                          "'method': 'trbdf2'",
                                          "'method': 'newton_k', 'iterations': 1",
                                          "'method': 'newton_k', 'iterations': 2",
                                          "'method': 'newton_k', 'iterations': 4",
                                          "'method': 'ida'"};
#define INTEGRATORS (sizeof integrators / sizeof *integrators)

/* ---- The text of a scene, with apostrophes for quotation marks ---- */

typedef struct text {
    char data[8192];
    size_t size;
} text;

DRAPE_PRINTF(2, 3) static void put(text *t, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    const int length = vsnprintf(t->data + t->size, sizeof t->data - t->size, format, values);
    va_end(values);
    FUZZ_REQUIRE(length >= 0 && t->size + (size_t)length < sizeof t->data, "a scene of %zu bytes", t->size);
    for (int i = 0; i < length; i++)
        if (t->data[t->size + (size_t)i] == '\'')
            t->data[t->size + (size_t)i] = '"';
    t->size += (size_t)length;
}

static void put_track(text *t, fuzz_bytes *in, double x, double y, double z)
{
    const double time = fuzz_between(in, 0.3, 1) * DURATION;
    put(t, ", 'track': [[0, [0, 0, 0]], [%.9g, [%.9g, %.9g, %.9g]]]", time, x, y, z);
}

/* Two opposite sides, the corners or one corner of a square, which may move. */
static void put_pins(text *t, fuzz_bytes *in, int n)
{
    const unsigned which = fuzz_below(in, 4);
    if (which == 3)
        return;
    put(t, ", 'pins': [{'nodes': [0");
    for (int i = 1; which == 0 && i < n; i++)
        put(t, ", %d, %d", i, n * (n - 1) + i - 1);
    if (which < 2)
        put(t, ", %d%s", n * n - 1, "");
    if (which == 1)
        put(t, ", %d, %d", n - 1, n * (n - 1));
    put(t, "]");
    if (fuzz_below(in, 4) > 0) {
        const double aside = fuzz_between(in, -0.03, 0.03);
        put_track(t, in, aside, fuzz_between(in, -0.12, 0), aside);
    }
    put(t, "}]");
}

static void put_cloth(text *t, fuzz_bytes *in, int index)
{
    const int n = 3 + (int)fuzz_below(in, 6);
    const double thickness = fuzz_magnitude(in, 2e-4, 2e-3);
    put(t,
        "%s{'name': 'cloth%d', 'mesh': {'grid': '%s', 'columns': %d, 'rows': %d, 'width': %g, 'height': %g, ",
        index ? ", " : "", index, fuzz_below(in, 2) ? "irregular" : "square", n, n, SIZE, SIZE);
    put(t, "'transform': {'rotate': [0, 1, 0, %.9g], 'translate': [%.9g, %.9g, %.9g]}}, ",
        index * fuzz_between(in, 0, 45), -SIZE / 2 + index * fuzz_between(in, -0.1, 0.1),
        0.01 + index * fuzz_magnitude(in, 3e-3, 3e-2), SIZE / 2);
    put(t, "'material': {'young_modulus': %.9g, 'thickness': %.9g, 'areal_density': %.9g}, 'terms': [",
        fuzz_magnitude(in, 1e2, 1e6) / thickness, thickness, fuzz_magnitude(in, 0.03, 0.5));
    put(t, "'%s', '%s'", fuzz_below(in, 2) ? "stretch.cst" : "stretch.edge",
        fuzz_below(in, 2) ? "bend.midedge" : "bend.hinge");
    if (fuzz_below(in, 3) == 0)
        put(t, ", {'type': 'drag.wind', 'wind': [%.9g, %.9g, 0]}", fuzz_between(in, -5, 5),
            fuzz_between(in, -30, 0));
    put(t, "]");
    if (fuzz_below(in, 3) == 0)
        put(t, ", 'velocity': [%.9g, %.9g, 0]", fuzz_between(in, -5, 5), -fuzz_magnitude(in, 1, 50));
    if (index == 0) /* pins of one cloth may not lead through those of another */
        put_pins(t, in, n);
    put(t, "}");
}

/* A collider that begins below the height 0, or above the cloths. */
static void put_collider(text *t, fuzz_bytes *in, int index)
{
    const double size = fuzz_magnitude(in, 5e-4, 0.05), x = fuzz_between(in, -0.1, 0.1),
                 z = fuzz_between(in, -0.1, 0.1), half = fuzz_between(in, 0.02, 0.2);
    const bool above = fuzz_below(in, 4) == 0;
    const double y = above ? 0.06 + size : -size;
    put(t, "%s{", index ? ", " : "");
    switch (fuzz_below(in, 5)) {
    case 0:
        put(t, "'type': 'plane', 'point': [0, %.9g, 0], 'normal': [0, %d, 0]", above ? 0.06 : -0.02,
            above ? -1 : 1);
        break;
    case 1:
        put(t, "'type': 'sphere', 'center': [%.9g, %.9g, %.9g], 'radius': %.9g", x, y, z, size);
        break;
    case 2:
        put(t, "'type': 'capsule', 'a': [%.9g, %.9g, %.9g], 'b': [%.9g, %.9g, %.9g], 'radius': %.9g",
            x - half, y, z, x + half, y, -z, size);
        break;
    case 3: /* a corner up */
        put(t, "'type': 'box', 'center': [%.9g, %.9g, %.9g], 'size': %.9g, 'rotate': [1, 0, -1, 54.7356]", x,
            y, z, 2 * size / sqrt(3));
        break;
    default: /* a thin plate upright */
        put(t,
            "'type': 'box', 'center': [%.9g, %.9g, %.9g], 'size': [%.9g, %.9g, %.9g], 'rotate': [0, 1, 0, "
            "%.9g]",
            x, y, z, half, 2 * size, size / 4, fuzz_between(in, 0, 180));
    }
    put(t, ", 'friction': %.9g", fuzz_below(in, 2) ? fuzz_between(in, 0, 1) : 0);
    if (fuzz_below(in, 2)) {
        const double move = fuzz_magnitude(in, 0.01, 0.3);
        put_track(t, in, fuzz_between(in, -0.05, 0.05), above ? -move : move, fuzz_between(in, -0.05, 0.05));
    }
    put(t, "}");
}

static void put_scene(text *t, fuzz_bytes *in)
{
    const char *integrator = integrators[fuzz_below(in, INTEGRATORS)];
    const int cloths = 1 + (int)fuzz_below(in, 2), colliders = (int)fuzz_below(in, 4);
    put(t, "{'drape': 1, 'cloth': [");
    for (int i = 0; i < cloths; i++)
        put_cloth(t, in, i);
    put(t, "], 'colliders': [");
    for (int i = 0; i < colliders; i++)
        put_collider(t, in, i);
    put(t, "], 'duration': %g, 'frame_rate': %d, 'integrator': {%s", DURATION, fuzz_below(in, 2) ? 30 : 400,
        integrator);
    if (!strstr(integrator, "ida"))
        put(t, ", 'dt': %.9g", fuzz_magnitude(in, 1.0 / 500, 1.0 / 30));
    put(t, "}");
    if (cloths > 1 || fuzz_below(in, 2))
        put(t, ", 'self_contact': {'thickness': %.9g, 'friction': %.9g}", fuzz_magnitude(in, 3e-4, 2e-3),
            fuzz_below(in, 2) ? fuzz_between(in, 0, 1) : 0);
    if (fuzz_below(in, 2))
        put(t, ", 'contact': {'distance': %.9g}", fuzz_magnitude(in, 3e-4, 4e-3));
    if (fuzz_below(in, 4) == 0)
        put(t, ", 'gravity': [0, 0, 0]");
    put(t, "}");
}

/* ---- Running ---- */

static drape_status look(void *user, const drape_event *event)
{
    const text *scene = user;
    crossings_run found = {.states = 0};
    const drape_status status = crossings_observe(&found, event);
    FUZZ_REQUIRE(found.crossed_states + found.crossed_frames == 0, "%s %.9g s: %s\n%s",
                 found.states ? "state at" : "frame at", found.first_time, found.first, scene->data);
    return status;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static text scene; /* large */
    fuzz_bytes in = {.at = data, .end = data + size};
    drape_context *ctx = fuzz_open(MAX_MEMORY);
    drape_sim *sim = NULL;
    scene.size = 0;
    put_scene(&scene, &in);
    drape_model *model = fuzz_scene(ctx, (const uint8_t *)scene.data, scene.size);
    FUZZ_REQUIRE(model, "refused: %s\n%s", drape_context_message(ctx), scene.data);
    const crossings start = crossings_count(model, model->rest, 0);
    if (crossings_total(&start) == 0) {
        const drape_status status = drape_sim_create(ctx, model, NULL, &sim);
        FUZZ_REQUIRE(!status && !drape_sim_observe(sim, look, &scene), "%s", drape_context_message(ctx));
        fuzz_advance(ctx, sim, DURATION, ATTEMPTS, SECONDS);
    }
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    fuzz_close(&ctx);
    return 0;
}
