/* host.h: a sim as a host has it, through the public headers only, whose memory is counted. */
#ifndef DRAPE_TESTS_HOST_H
#define DRAPE_TESTS_HOST_H

#include <check.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "drape/drape.h"
#include "support/failing_allocator.h"

typedef struct host {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
} host;

/* Compiles a scene and makes a sim, in a context on the given allocator; in the format ' stands for ". */
static inline host open_scene(failing_allocator *memory, const char *format, ...)
{
    char text[4096];
    host h = {.ctx = failing_context(memory)};
    drape_scene *scene = NULL;
    va_list values;
    va_start(values, format);
    int length = vsnprintf(text, sizeof text, format, values);
    va_end(values);
    ck_assert(length > 0 && length < (int)sizeof text);
    for (char *c = text; *c; c++)
        *c = *c == '\'' ? '"' : *c;
    drape_status status = drape_scene_parse(h.ctx, text, "s.json", &scene);
    if (!status)
        status = drape_scene_compile(scene, &h.model);
    if (!status)
        status = drape_sim_create(h.ctx, h.model, NULL, &h.sim);
    ck_assert_msg(status == DRAPE_OK, "%s", drape_context_message(h.ctx));
    drape_scene_destroy(&scene);
    return h;
}

static inline void close_scene(host *h, failing_allocator *memory)
{
    drape_sim_destroy(&h->sim);
    drape_model_destroy(&h->model);
    drape_context_destroy(&h->ctx);
    ck_assert_int_eq(memory->live, 0);
}

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
