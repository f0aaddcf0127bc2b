/* context.c: see context.h. Messages are composed in place, so that a failed allocation can be reported
 * without allocating. */
#include "base/context.h"

#include "base/def.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* The shortest def of an older host. */
#define MIN_SIZE        offsetof(drape_context_def, log)
#define BETWEEN_CANCELS (1 << 20) /* operations */

static void *default_allocate(void *user, size_t size)
{
    (void)user;
    return malloc(size);
}

static void default_release(void *user, void *memory)
{
    (void)user;
    free(memory);
}

void drape_context_def_init(drape_context_def *def, size_t struct_size)
{
    const drape_context_def defaults = {.struct_size = struct_size};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

drape_status drape_context_create(const drape_context_def *def, drape_context **out)
{
    drape_context_def d;
    drape_context_def_init(&d, sizeof d);
    if (!out)
        return DRAPE_E_ARGUMENT;
    *out = NULL;
    if (def) {
        if (!drape_def_fits(def->struct_size, MIN_SIZE, sizeof d) || !def->allocate != !def->release)
            return DRAPE_E_ARGUMENT;
        memcpy(&d, def, def->struct_size);
    }
    if (!d.allocate) {
        d.allocate = default_allocate;
        d.release = default_release;
    }
    drape_context *ctx = d.allocate(d.allocator_user, sizeof *ctx);
    if (!ctx)
        return DRAPE_E_MEMORY;
    memset(ctx, 0, sizeof *ctx);
    ctx->def = d;
    *out = ctx;
    return DRAPE_OK;
}

void drape_context_destroy(drape_context **ctx)
{
    if (!ctx || !*ctx)
        return;
    drape_context_def d = (*ctx)->def;
    d.release(d.allocator_user, *ctx);
    *ctx = NULL;
}

const char *drape_context_message(const drape_context *ctx)
{
    return ctx ? ctx->message : "no context";
}

void *drape_alloc(drape_context *ctx, size_t count, size_t size)
{
    size_t bytes = 0;
    void *memory = NULL;
    if (!__builtin_mul_overflow(count, size, &bytes) && bytes <= PTRDIFF_MAX)
        memory = ctx->def.allocate(ctx->def.allocator_user, bytes ? bytes : 1);
    else
        bytes = SIZE_MAX;
    if (memory)
        memset(memory, 0, bytes);
    else
        drape_fail_memory(ctx, bytes);
    return memory;
}

void drape_free(drape_context *ctx, void *memory)
{
    if (memory)
        ctx->def.release(ctx->def.allocator_user, memory);
}

char *drape_copy_text(drape_context *ctx, const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = drape_alloc(ctx, size, 1);
    if (copy)
        memcpy(copy, text, size);
    return copy;
}

/* The UTF-8 character at text and its number of bytes; 0: there is none (RFC 3629, section 3). */
static size_t character(const unsigned char *text, uint32_t *code)
{
    static const uint32_t first[] = {0, 0x80, 0x800, 0x10000}; /* in an encoding of so many bytes more */
    const size_t more = *text >= 0xf0 ? 3 : *text >= 0xe0 ? 2 : *text >= 0xc0 ? 1 : 0;
    *code = more ? *text & (0x3fu >> more) : *text;
    for (size_t i = 1; i <= more; i++) {
        if ((text[i] & 0xc0) != 0x80)
            return 0;
        *code = *code << 6 | (text[i] & 0x3f);
    }
    const bool stray = (*text >= 0x80 && !more) || *text >= 0xf8, surrogate = *code >> 11 == 0xd800 >> 11;
    return stray || surrogate || *code < first[more] || *code > 0x10ffff ? 0 : more + 1;
}

void drape_make_printable(char *text)
{
    for (size_t count; *text; text += count) {
        uint32_t c;
        count = character((const unsigned char *)text, &c);
        if (count == 0 || c < ' ' || (c >= 0x7f && c <= 0x9f) || (c >= 0x202a && c <= 0x202e) ||
            (c >= 0x2066 && c <= 0x2069) || (c & 0xfffe) == 0xfffe || (c >= 0xfdd0 && c <= 0xfdef)) {
            count += count == 0;
            memset(text, *text >= '\t' && *text <= '\r' ? ' ' : '?', count);
        }
    }
}

static drape_status fail(drape_context *ctx, drape_status status, const char *pointer, const char *format,
                         va_list args)
{
    locale_t old = drape_locale_enter();
    ctx->status = status;
    vsnprintf(ctx->text, sizeof ctx->text, format, args);
    drape_make_printable(ctx->text);
    snprintf(ctx->pointer, sizeof ctx->pointer, "%s", pointer);
    drape_make_printable(ctx->pointer);
    snprintf(ctx->message, sizeof ctx->message, "%s%s%.700s", ctx->pointer, *pointer ? ": " : "", ctx->text);
    drape_locale_leave(old);
    return status;
}

drape_status drape_fail(drape_context *ctx, drape_status status, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fail(ctx, status, "", format, args);
    va_end(args);
    return status;
}

drape_status drape_fail_at(drape_context *ctx, drape_status status, const char *pointer, const char *format,
                           ...)
{
    va_list args;
    va_start(args, format);
    fail(ctx, status, pointer, format, args);
    va_end(args);
    return status;
}

const drape_term_ops *drape_context_term_ops(const drape_context *ctx, bool of_seams, int index)
{
    for (int i = 0; i < ctx->host_term_count; i++) {
        const drape_term_ops *ops = &ctx->host_terms[i];
        if ((of_seams ? ops->build_seam != NULL : ops->build || ops->law) && index-- == 0)
            return ops;
    }
    return NULL;
}

const drape_entry *drape_context_term(const drape_context *ctx, int index)
{
    const drape_term_ops *ops = drape_context_term_ops(ctx, false, index);
    return ops ? &ops->entry : NULL;
}

const drape_entry *drape_context_seam(const drape_context *ctx, int index)
{
    const drape_term_ops *ops = drape_context_term_ops(ctx, true, index);
    return ops ? &ops->entry : NULL;
}

const drape_entry *drape_context_collider(const drape_context *ctx, int index)
{
    return index < ctx->host_collider_count ? &ctx->host_colliders[index].entry : NULL;
}

const char *drape_format(char text[DRAPE_POINTER_SIZE], const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(text, DRAPE_POINTER_SIZE, format, args);
    va_end(args);
    return text;
}

void drape_list_add(char *list, size_t size, const char *name)
{
    const size_t used = strlen(list);
    snprintf(list + used, size - used, "%s%s", used ? ", " : "", name);
}

bool drape_ends_in(const char *file, const char *ending)
{
    const size_t length = strlen(file), size = strlen(ending);
    return length > size && strcasecmp(file + length - size, ending) == 0;
}

drape_status drape_fail_unsaid(drape_context *ctx, drape_status status, const char *pointer,
                               const char *format, ...)
{
    va_list args;
    if (!status || ctx->message[0])
        return status;
    va_start(args, format);
    fail(ctx, status, pointer, format, args);
    va_end(args);
    return status;
}

drape_status drape_fail_memory(drape_context *ctx, size_t bytes)
{
    return drape_fail(ctx, DRAPE_E_MEMORY, "out of memory: an allocation of %zu bytes failed", bytes);
}

drape_status drape_check_cancel(drape_context *ctx)
{
    if (!ctx->def.cancel || !ctx->def.cancel(ctx->def.cancel_user))
        return DRAPE_OK;
    return drape_fail(ctx, DRAPE_E_STOPPED, "cancelled");
}

drape_status drape_check_cancel_after(drape_context *ctx, size_t work)
{
    ctx->work += work;
    if (ctx->work >= BETWEEN_CANCELS && drape_check_cancel(ctx))
        return DRAPE_E_STOPPED;
    ctx->work %= BETWEEN_CANCELS;
    return DRAPE_OK;
}

void drape_context_set_message(drape_context *ctx, const char *format, ...)
{
    va_list args;
    if (!ctx || !format)
        return;
    va_start(args, format);
    fail(ctx, DRAPE_OK, "", format, args);
    va_end(args);
}

void drape_log(drape_context *ctx, drape_log_level level, const char *format, ...)
{
    char text[DRAPE_MESSAGE_SIZE];
    if (!ctx->def.log || !format)
        return;
    locale_t old = drape_locale_enter();
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    drape_make_printable(text);
    drape_locale_leave(old);
    ctx->def.log(ctx->def.log_user, level, text);
}

/* In glibc newlocale on the predefined "C" needs no memory: it returns a static object. */
locale_t drape_locale_enter(void)
{
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return c ? uselocale(c) : (locale_t)0;
}

void drape_locale_leave(locale_t old)
{
    if (old)
        freelocale(uselocale(old));
}
