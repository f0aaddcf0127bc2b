/* host.h: a sim as a host has it, through the public headers only, whose memory is counted. */
#ifndef DRAPE_TESTS_HOST_H
#define DRAPE_TESTS_HOST_H

#include <check.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "drape/drape.h"
#include "support/context.h"
#include "support/failing_allocator.h"

typedef struct host {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
    failing_allocator *memory; /* of the context */
} host;

static inline host empty_host(void)
{
    failing_allocator *memory = calloc(1, sizeof *memory);
    ck_assert_ptr_nonnull(memory);
    return (host){.ctx = failing_context(memory), .memory = memory};
}

/* Compiles a scene and makes a sim; in the format ' stands for ". */
__attribute__((format(printf, 1, 2))) static inline host open_scene(const char *format, ...)
{
    char text[4096];
    host h = empty_host();
    drape_scene *scene = NULL;
    va_list values;
    va_start(values, format);
    int length = vsnprintf(text, sizeof text, format, values);
    va_end(values);
    ck_assert(length > 0 && length < (int)sizeof text);
    quote(text);
    drape_status status = drape_scene_parse(h.ctx, text, "s.json", &scene);
    if (!status)
        status = drape_scene_compile(scene, &h.model);
    if (!status)
        status = drape_sim_create(h.ctx, h.model, NULL, &h.sim);
    assert_ok(h.ctx, status);
    drape_scene_destroy(&scene);
    return h;
}

static inline void close_scene(host *h)
{
    drape_sim_destroy(&h->sim);
    drape_model_destroy(&h->model);
    drape_context_destroy(&h->ctx);
    if (h->memory)
        ck_assert_int_eq(h->memory->live, 0);
    free(h->memory);
    h->memory = NULL;
}

#define scoped_host SCOPED(close_scene) host

static inline void good(const host *h, drape_status status)
{
    ck_assert_msg(status == DRAPE_OK, "%s: %s", drape_status_name(status), drape_context_message(h->ctx));
}

static inline void says(const host *h, drape_status status, drape_status expected, const char *part)
{
    ck_assert_int_eq(status, expected);
    ck_assert_msg(strstr(drape_context_message(h->ctx), part) != NULL, "\"%s\" is not in: %s", part,
                  drape_context_message(h->ctx));
}

static inline double distance(const double *a, const double *b)
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* A square sheet of 5 x 4 nodes with the top row pinned; more members of the cloth, and the rest of the
 * scene. */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.5, 'height': "   \
    "0.375, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': "   \
    "200}, 'terms': ['stretch.edge', 'bend.hinge'%s], 'pins': [%s]}], 'integrator': {%s}, 'frame_rate': "    \
    "64, %s 'duration': 1}"

/* The integrators that have steps in time: all of them, as entries/integrators checks. */
static const char *const methods[] = {"be",     "bdf2", "midpoint", "trbdf2",     "newton_k",
                                      "verlet", "ida",  "dirk",     "rosenbrock", "radau"};
enum { METHODS = sizeof methods / sizeof *methods };

#endif
