/* test_archive.c: archives: what their checksum detects, and arrays whose rows are written in another order,
 * as ranks do. */
#include "base/archive.h"
#include "base/ranks.h"
#include "support/bytes.h"
#include "support/suite.h"

#include <stdio.h>
#include <string.h>

#define ITEMS 37
#define WIDTH 3

/* What is archived: parts of all sizes before and after two arrays. */
typedef struct object {
    bool flag;
    int32_t number;
    double value, array[ITEMS * WIDTH], other[ITEMS * WIDTH];
    char text[16];
} object;

static object make_object(void)
{
    object o = {.flag = true, .number = -7, .value = 0.1, .text = "cloth"};
    for (int i = 0; i < ITEMS * WIDTH; i++) {
        o.array[i] = 1.0 / (i + 1);
        o.other[i] = -i;
    }
    return o;
}

/* ---- Rows ---- */

static void archive_array(drape_archive *a, double *values)
{
    drape_archive_align(a);
    if (!a->write_rows || a->reading)
        drape_archive_doubles(a, values, ITEMS * WIDTH);
    else
        drape_archive_rows(a, &(drape_rows){.values = values, .width = WIDTH, .count = ITEMS, .all = ITEMS},
                           ITEMS * WIDTH * sizeof *values);
}

static void archive_object(drape_archive *a, object *o)
{
    drape_archive_mark(a, "object");
    drape_archive_bool(a, &o->flag);
    archive_array(a, o->array);
    drape_archive_int32(a, &o->number);
    archive_array(a, o->other);
    drape_archive_double(a, &o->value);
    drape_archive_text(a, o->text, sizeof o->text);
}

/* Every third item, from the last one on, then those beside it, as if three ranks had them. */
static void keep_rows(void *user, uint64_t offset, uint64_t size, const drape_rows *rows, uint64_t *sum)
{
    static const char nothing[ITEMS * WIDTH * sizeof(double)];
    const size_t item = WIDTH * sizeof(double);
    bytes *b = user;
    ck_assert_uint_eq(offset, b->size);
    ck_assert_uint_eq(offset % 8, 0);
    ck_assert_uint_eq(size, sizeof nothing);
    bytes_keep(b, nothing, sizeof nothing);
    *sum = 0;
    for (int rank = 2; rank >= 0; rank--)
        for (int i = ITEMS - 1; i >= 0; i--)
            if (i % 3 == rank) {
                memcpy(b->data + offset + item * (size_t)i, rows->values + (size_t)i * WIDTH, item);
                *sum +=
                    drape_checksum_bytes(offset + item * (size_t)i, rows->values + (size_t)i * WIDTH, item);
            }
}

static bytes write_object(drape_context *ctx, drape_write_rows *write_rows)
{
    drape_archive a;
    bytes b = {0};
    object o = make_object();
    drape_archive_write_to(&a, ctx, "object", bytes_keep, write_rows, &b);
    archive_object(&a, &o);
    ck_assert_int_eq(drape_archive_end(&a), DRAPE_OK);
    return b;
}

TEST(rows_in_any_order_make_the_same_bytes)
{
    scoped_context *ctx = make_context();
    scoped_bytes one = write_object(ctx, NULL), rows = write_object(ctx, keep_rows);
    ck_assert_uint_eq(rows.size, one.size);
    ck_assert_mem_eq(rows.data, one.data, one.size);
    drape_archive a;
    object o = {0}, expected = make_object();
    ck_assert_int_eq(drape_archive_read_from(&a, ctx, "object", rows.data, rows.size), DRAPE_OK);
    archive_object(&a, &o);
    ck_assert_int_eq(drape_archive_end(&a), DRAPE_OK);
    ck_assert_mem_eq(o.array, expected.array, sizeof o.array);
    ck_assert_mem_eq(o.other, expected.other, sizeof o.other);
    ck_assert(o.flag && o.number == expected.number && o.value == expected.value);
}

/* ---- The checksum ---- */

static void refused(drape_context *ctx, const unsigned char *data, size_t size, drape_status status,
                    const char *what, size_t at)
{
    drape_archive a;
    ck_assert_msg(drape_archive_read_from(&a, ctx, "object", data, size) == status, "%s at %zu: %d, %s", what,
                  at, (int)a.status, drape_context_message(ctx));
    ck_assert_ptr_null(drape_archive_next(&a, 1));
}

/* All 255 other values of each byte; those of the format's number are of another format, if its checksum is
 * right or was another one. */
TEST(each_changed_byte_is_detected)
{
    scoped_context *ctx = make_context();
    scoped_bytes b = write_object(ctx, NULL);
    for (size_t at = 0; at < b.size; at++) {
        const unsigned char before = b.data[at];
        for (int value = 0; value < 256; value++) {
            b.data[at] = (unsigned char)value;
            if (b.data[at] != before)
                refused(ctx, b.data, b.size, at == 8 && value == 1 ? DRAPE_E_VERSION : DRAPE_E_PARSE, "byte",
                        at);
        }
        b.data[at] = before;
    }
}

/* A sum of words without their places would not see that two of them change places. */
TEST(words_that_change_places_are_detected)
{
    scoped_context *ctx = make_context();
    scoped_bytes b = write_object(ctx, NULL);
    unsigned char *copy = malloc(b.size);
    ck_assert_ptr_nonnull(copy);
    size_t swaps = 0;
    for (size_t i = 16; i + 8 <= b.size; i += 8)
        for (size_t k = 16; k < i; k += 8) {
            if (memcmp(b.data + i, b.data + k, 8) == 0)
                continue;
            memcpy(copy, b.data, b.size);
            memcpy(copy + i, b.data + k, 8);
            memcpy(copy + k, b.data + i, 8);
            refused(ctx, copy, b.size, DRAPE_E_PARSE, "words", i);
            swaps++;
        }
    ck_assert_uint_gt(swaps, 20000);
    free(copy);
}

/* Also by zeros, which the sum of the last word is padded with. */
TEST(other_lengths_are_detected)
{
    scoped_context *ctx = make_context();
    scoped_bytes b = write_object(ctx, NULL);
    unsigned char *copy = calloc(b.size + 64, 1);
    ck_assert_ptr_nonnull(copy);
    memcpy(copy, b.data, b.size);
    for (size_t size = 0; size < b.size + 64; size++)
        if (size != b.size)
            refused(ctx, copy, size, DRAPE_E_PARSE, "length", size);
    for (size_t cut = 8; cut < b.size - 40; cut += 8) { /* the end stays */
        memcpy(copy, b.data, 16);
        memcpy(copy + 16, b.data + 16 + cut, b.size - 16 - cut);
        refused(ctx, copy, b.size - cut, DRAPE_E_PARSE, "gap", cut);
    }
    free(copy);
}
