/* preload.c: preloaded into the program, makes one of its calls go wrong at a moment that is counted, not
 * timed.
 *
 *   DRAPE_FAIL=N    the Nth allocation from main on fails
 *   DRAPE_SIGNAL=S  the process receives the signal S
 *   DRAPE_CALL=N      at its Nth counted call: allocations, readings of the clock, new names of files, from
 *                     the moment on at which it catches signals
 *   DRAPE_FILE=NAME   or when a file of that name first is in its place
 *   DRAPE_AGAIN=S   it receives the signal S as soon as it has handled the first one
 *   DRAPE_COUNT=F   the number of allocations and that of counted calls are written to the file F at the end
 *
 * Processes that the program starts are left alone. A build with sanitizers, which have an allocator of their
 * own, cannot fail an allocation.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <malloc.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static atomic_long allocations, calls;
static atomic_bool begun, catching;
static long failing, signal_call;
static int signal_sent, signal_again;
static const char *signal_file;

static long number(const char *name)
{
    const char *text = getenv(name);
    return text ? atol(text) : 0;
}

static void count_call(void)
{
    if (catching && atomic_fetch_add(&calls, 1) + 1 == signal_call)
        kill(getpid(), signal_sent);
}

static void count_name(const char *name)
{
    count_call();
    if (signal_file && strcmp(name, signal_file) == 0) {
        signal_file = NULL;
        kill(getpid(), signal_sent);
    }
}

/* Whether this allocation is to fail. */
static int count_allocation(void)
{
    if (!begun)
        return 0;
    count_call();
    if (atomic_fetch_add(&allocations, 1) + 1 != failing)
        return 0;
    errno = ENOMEM;
    return 1;
}

/* ---- Allocations ---- */

#ifdef SANITIZED

/* The sanitizers call this function after each allocation. */
void __sanitizer_malloc_hook(const volatile void *block, size_t size)
{
    (void)block, (void)size;
    count_allocation();
}

#else

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

void *malloc(size_t size)
{
    return count_allocation() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return count_allocation() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    return count_allocation() ? NULL : __libc_realloc(memory, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return count_allocation() ? NULL : __libc_memalign(alignment, size);
}

void *memalign(size_t alignment, size_t size)
{
    return aligned_alloc(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    void *taken = aligned_alloc(alignment, size);
    if (taken)
        *memory = taken;
    return taken ? 0 : ENOMEM;
}

#endif

/* ---- Other calls ---- */

int clock_gettime(clockid_t id, struct timespec *time)
{
    count_call();
    return (int)syscall(SYS_clock_gettime, id, time);
}

int linkat(int from, const char *old, int to, const char *new, int flags)
{
    const int result = (int)syscall(SYS_linkat, from, old, to, new, flags);
    if (!result)
        count_name(new);
    return result;
}

int renameat(int from, const char *old, int to, const char *new)
{
    const int result = (int)syscall(SYS_renameat2, from, old, to, new, 0);
    if (!result)
        count_name(new);
    return result;
}

/* The program installs its handler of SIGHUP last. That handler notes a signal, and last of all installs the
 * system's handler of SIGHUP. */
int sigaction(int one, const struct sigaction *action, struct sigaction *before)
{
    int (*real)(int, const struct sigaction *, struct sigaction *) = NULL;
    *(void **)&real = dlsym(RTLD_NEXT, "sigaction");
    const int result = real(one, action, before);
    if (one == SIGHUP && action && signal_again && catching)
        kill(getpid(), signal_again);
    if (one == SIGHUP && action && begun)
        catching = 1;
    return result;
}

/* A preloaded library is initialised after the libraries that the program needs. */
__attribute__((constructor)) static void begin(void)
{
    failing = number("DRAPE_FAIL");
    signal_call = number("DRAPE_CALL");
    signal_sent = (int)number("DRAPE_SIGNAL");
    signal_again = (int)number("DRAPE_AGAIN");
    signal_file = getenv("DRAPE_FILE");
    unsetenv("LD_PRELOAD");
    begun = 1;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("DRAPE_COUNT");
    begun = catching = 0;
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) {
        fprintf(file, "%ld %ld\n", (long)allocations, (long)calls);
        fclose(file);
    }
}
