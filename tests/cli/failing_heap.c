/* failing_heap.c: preloaded into the program by test_shortage.py, makes one allocation of the process fail:
 * that of number DRAPE_HEAP_FAIL, counted from main on. Where DRAPE_HEAP_COUNT names a file, the number of
 * all of them is written there. */
#include <errno.h>
#include <malloc.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

static atomic_long calls;
static long chosen;
static int counting;

static int fails(void)
{
    if (!counting || atomic_fetch_add(&calls, 1) + 1 != chosen)
        return 0;
    errno = ENOMEM;
    return 1;
}

void *malloc(size_t size)
{
    return fails() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return fails() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    return fails() ? NULL : __libc_realloc(memory, size);
}

void *memalign(size_t alignment, size_t size)
{
    return fails() ? NULL : __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return memalign(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    void *taken = memalign(alignment, size);
    if (taken)
        *memory = taken;
    return taken ? 0 : ENOMEM;
}

/* A preloaded library is initialised after the libraries that the program needs. */
__attribute__((constructor)) static void begin(void)
{
    const char *number = getenv("DRAPE_HEAP_FAIL");
    chosen = number ? atol(number) : 0;
    counting = 1;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("DRAPE_HEAP_COUNT");
    counting = 0;
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) {
        fprintf(file, "%ld\n", (long)calls);
        fclose(file);
    }
}
