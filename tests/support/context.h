/* context.h: what most tests begin with: a context, defs with their defaults, texts, and variables that own
 * what they hold, which is destroyed where their block ends, the last one first. */
#ifndef DRAPE_TESTS_CONTEXT_H
#define DRAPE_TESTS_CONTEXT_H

#include <check.h>
#include <stdlib.h>
#include <string.h>

#include "drape/drape.h"

#define SCOPED(destroy) __attribute__((cleanup(destroy)))

#define scoped_context SCOPED(drape_context_destroy) drape_context
#define scoped_parsed  SCOPED(drape_scene_destroy) drape_scene
#define scoped_model   SCOPED(drape_model_destroy) drape_model
#define scoped_sim     SCOPED(drape_sim_destroy) drape_sim
#define scoped_arena   SCOPED(drape_arena_destroy) drape_arena
#define scoped_memory  SCOPED(release_memory)

/* Of malloc: `pointer` is the address of the variable. */
static inline void release_memory(void *pointer)
{
    void *memory;
    memcpy(&memory, pointer, sizeof memory);
    free(memory);
}

static inline drape_context *make_context(void)
{
    drape_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    return ctx;
}

/* Fails with the message of the context. */
#define assert_ok(ctx, status)                                                                               \
    do {                                                                                                     \
        const drape_status status_ = (status);                                                               \
        ck_assert_msg(status_ == DRAPE_OK, "%s: %s", drape_status_name(status_),                             \
                      drape_context_message(ctx));                                                           \
    } while (0)

/* sim_def() and so on: a def as its init function leaves it. */
#define DEF(name)                                                                                            \
    static inline drape_##name name(void)                                                                    \
    {                                                                                                        \
        drape_##name def;                                                                                    \
        drape_##name##_init(&def, sizeof def);                                                               \
        return def;                                                                                          \
    }
DEF(context_def)
DEF(scene_def)
DEF(cloth_def)
DEF(pin_def)
DEF(collider_def)
DEF(seam_def)
DEF(sim_def)
DEF(place_def)
DEF(event_def)
#undef DEF

/* In texts of tests ' stands for ", in place. */
static inline void quote(char *text)
{
    for (; *text; text++)
        *text = *text == '\'' ? '"' : *text;
}

#endif
