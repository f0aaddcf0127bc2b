/* context.h: allocator, last message, log, user-defined terms and colliders. Every function that can fail
 * reports through its context. */
#ifndef DRAPE_BASE_CONTEXT_H
#define DRAPE_BASE_CONTEXT_H

#include <errno.h>
#include <locale.h>

#include "drape/extend.h"

#define DRAPE_MESSAGE_SIZE       1024
#define DRAPE_POINTER_SIZE       256 /* of a JSON pointer, with its zero byte */
#define DRAPE_MAX_HOST_TERMS     32
#define DRAPE_MAX_HOST_COLLIDERS 32

struct drape_context {
    drape_context_def def;
    char message[DRAPE_MESSAGE_SIZE];
    drape_status status; /* with which it was set */
    char
        pointer[DRAPE_POINTER_SIZE]; /* JSON pointer of the last fault, from which the scene reader finds line
                                       * and column; "": none */
    char text[DRAPE_MESSAGE_SIZE];   /* the message without its place */
    drape_term_ops host_terms[DRAPE_MAX_HOST_TERMS]; /* copies, with the size of this version */
    int host_term_count;
    drape_collider_ops host_colliders[DRAPE_MAX_HOST_COLLIDERS];
    int host_collider_count;
    struct drape_shared_elimination *eliminations; /* those in use (solvers/elimination.h); NULL: none */
    size_t work; /* operations since the host was last asked whether to cancel */
};

/* User-defined entry number `index` of the context, of the terms that cloths or seams may have; NULL past the
 * last. */
const drape_term_ops *drape_context_term_ops(const drape_context *ctx, bool of_seams, int index);
const drape_entry *drape_context_term(const drape_context *ctx, int index);
const drape_entry *drape_context_seam(const drape_context *ctx, int index);
const drape_entry *drape_context_collider(const drape_context *ctx, int index);

/* Allocates count x size bytes, zeroed and aligned for any type. Returns NULL with a message on failure or
 * overflow. 0 bytes give a valid pointer. */
void *drape_alloc(drape_context *ctx, size_t count, size_t size);
void drape_free(drape_context *ctx, void *memory); /* NULL is allowed */
char *drape_copy_text(drape_context *ctx, const char *text);

/* Replaces what a terminal would obey instead of show, as text quoted from files and arguments may contain
 * it: tabs and ends of lines by spaces; other control characters, also those of UTF-8 (U+0080 to U+009F),
 * marks that change the direction of writing (U+202A to U+202E, U+2066 to U+2069), and bytes that are not
 * UTF-8 by question marks. All that the program prints of a file, a name or an argument passes here. */
void drape_make_printable(char *text);

/* Set the message and return status. drape_fail_at also names the place by its JSON pointer: message
 * "pointer: text". drape_refuse does that with DRAPE_E_ARGUMENT, drape_fail_below likewise at a key of the
 * object at `pointer`: "/seams/0/name" for "name". */
drape_status drape_fail(drape_context *ctx, drape_status status, const char *format, ...) DRAPE_PRINTF(3, 4);
drape_status drape_fail_at(drape_context *ctx, drape_status status, const char *pointer, const char *format,
                           ...) DRAPE_PRINTF(4, 5);
#define drape_refuse(ctx, pointer, ...) drape_fail_at(ctx, DRAPE_E_ARGUMENT, pointer, __VA_ARGS__)
#define drape_fail_below(ctx, pointer, key, ...)                                                             \
    drape_refuse(ctx, DRAPE_FORMAT("%s/%s", pointer, key), __VA_ARGS__)

/* Returns from the calling function with the status of a call that failed. Not for functions that must free
 * something first. */
#define DRAPE_TRY(call)                                                                                      \
    do {                                                                                                     \
        const drape_status status_of_call = (call);                                                          \
        if (status_of_call)                                                                                  \
            return status_of_call;                                                                           \
    } while (0)

/* A short text, such as a JSON pointer, that is made in place: valid until the end of the block, and cut off
 * if it is longer. */
#define DRAPE_FORMAT(...) drape_format((char[DRAPE_POINTER_SIZE]){0}, __VA_ARGS__)
const char *drape_format(char text[DRAPE_POINTER_SIZE], const char *format, ...) DRAPE_PRINTF(2, 3);

/* Appends a name to a list, "a, b, c", of which it cuts off what is longer than size - 1. */
void drape_list_add(char *list, size_t size, const char *name);

/* Whether the name of a file is longer than this ending and ends in it, in any case. */
bool drape_ends_in(const char *file, const char *ending);

/* For the status of a user-defined function, before whose call the message was cleared: if it failed without
 * setting a message, sets this one. Returns status. */
drape_status drape_fail_unsaid(drape_context *ctx, drape_status status, const char *pointer,
                               const char *format, ...) DRAPE_PRINTF(4, 5);
drape_status drape_fail_memory(drape_context *ctx, size_t bytes);

/* Whether an allocation has failed since the caller set errno to 0, also one of a library that does not
 * report it: malloc leaves ENOMEM there, and neither a success nor free changes it. Between the two, nothing
 * else may set errno. */
static inline bool drape_memory_ran_out(void)
{
    return errno == ENOMEM;
}

/* For long operations before a sim runs, called between their stages: returns DRAPE_E_STOPPED with a message
 * if the host asks to cancel. */
drape_status drape_check_cancel(drape_context *ctx);

/* For long loops: adds `work`, operations of some nanoseconds each, to those since the host was last asked,
 * and asks again after a million of them. */
drape_status drape_check_cancel_after(drape_context *ctx, size_t work);

void drape_log(drape_context *ctx, drape_log_level level, const char *format, ...) DRAPE_PRINTF(3, 4);

/* Switches to the C locale, for all reading and writing of numbers, whatever the locale of the host: old =
 * drape_locale_enter(); ... drape_locale_leave(old). */
locale_t drape_locale_enter(void);
void drape_locale_leave(locale_t old);

#endif
