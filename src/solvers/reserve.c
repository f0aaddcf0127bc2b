/* reserve.c: see reserve.h. Blocks that are not used are never touched: they take addresses, not memory. */
#include "solvers/reserve.h"

#include <stdlib.h>
#include <string.h>

#define SMALL_SIZE  8192 /* [bytes] more than the largest struct of SUNDIALS */
#define SMALL_COUNT 160  /* more than an integrator takes besides the numbers of its vectors: four a vector */
#define LARGE_COUNT 32   /* more than the vectors of an integrator */

static _Thread_local drape_reserve *opened;

/* The names that --wrap demands; weak, because a host of the static library links without it. */
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
__attribute__((weak)) void *__real_malloc(size_t size);
__attribute__((weak)) void *__real_calloc(size_t count, size_t size);

static void *pop(void **list)
{
    void *block = *list;
    if (block)
        *list = *(void **)block;
    return block;
}

static void *from_reserve(size_t size)
{
    if (!opened)
        return NULL;
    opened->used = true;
    return size <= SMALL_SIZE ? pop(&opened->small) : size <= opened->large_size ? pop(&opened->large) : NULL;
}

void *__wrap_malloc(size_t size)
{
    void *memory = __real_malloc(size);
    return memory || size == 0 ? memory : from_reserve(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    void *memory = __real_calloc(count, size);
    if (memory || count == 0 || size > SIZE_MAX / count)
        return memory;
    memory = from_reserve(count * size);
    return memory ? memset(memory, 0, count * size) : NULL;
}

static bool push(void **list, size_t size, int count)
{
    for (int i = 0; i < count; i++) {
        void **block = malloc(size);
        if (!block)
            return false;
        *block = *list;
        *list = block;
    }
    return true;
}

drape_status drape_reserve_open(drape_reserve *reserve, drape_context *ctx, size_t n)
{
    *reserve = (drape_reserve){.large_size = n * sizeof(double)};
    if (!push(&reserve->small, SMALL_SIZE, SMALL_COUNT) ||
        (reserve->large_size > SMALL_SIZE && !push(&reserve->large, reserve->large_size, LARGE_COUNT)))
        return drape_fail_memory(ctx, LARGE_COUNT * reserve->large_size);
    reserve->outer = opened;
    opened = reserve;
    return DRAPE_OK;
}

drape_status drape_reserve_close(drape_reserve *reserve, drape_context *ctx, drape_status status)
{
    if (opened == reserve)
        opened = reserve->outer;
    for (void *block; (block = pop(&reserve->small)) || (block = pop(&reserve->large));)
        free(block);
    return status || !reserve->used ? status : drape_fail_memory(ctx, reserve->large_size);
}
