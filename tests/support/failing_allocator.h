/* failing_allocator.h: a context whose memory is counted and fails on demand. A test makes one allocation
 * after the other fail, and checks that each failure is reported and none leaks:
 *
 *     failing_allocator memory = {.fail_at = n};
 *     drape_context *ctx = failing_context(&memory);
 *     ...
 *     drape_context_destroy(&ctx);
 *     ck_assert_int_eq(memory.live, 0); */
#ifndef DRAPE_TESTS_FAILING_ALLOCATOR_H
#define DRAPE_TESTS_FAILING_ALLOCATOR_H

#include <stdlib.h>
#include <string.h>

#include "support/context.h"

typedef struct failing_allocator {
    long fail_at;     /* number of the call that fails, from 1, after the context's own; 0: none */
    bool stay_broken; /* all later calls fail too */
    long calls, live; /* allocations so far; those not yet released */
    size_t largest;   /* [bytes] largest request, failed or not */
} failing_allocator;

static inline void *failing_allocate(void *user, size_t size)
{
    failing_allocator *memory = user;
    memory->calls++;
    if (size > memory->largest)
        memory->largest = size;
    if (memory->fail_at > 0 &&
        (memory->calls == memory->fail_at || (memory->stay_broken && memory->calls > memory->fail_at)))
        return NULL;
    void *block = malloc(size);
    if (block) {
        memory->live++;
        memset(block, 0xA5, size); /* so that reads of uninitialized memory show */
    }
    return block;
}

static inline void failing_release(void *user, void *block)
{
    failing_allocator *memory = user;
    memory->live--;
    free(block);
}

static inline drape_context *failing_context(failing_allocator *memory)
{
    drape_context_def def = context_def();
    drape_context *ctx = NULL;
    const long fail_at = memory->fail_at;
    def.allocate = failing_allocate;
    def.release = failing_release;
    def.allocator_user = memory;
    memory->fail_at = 0;
    if (drape_context_create(&def, &ctx) != DRAPE_OK)
        abort();
    memory->fail_at = fail_at;
    memory->calls = 0;
    memory->largest = 0;
    return ctx;
}

#endif
