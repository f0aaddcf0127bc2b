/*
 * json.h: building JSON with jansson.
 *
 * jansson refuses to set a value that is NULL and passes NULL on, so a failed allocation anywhere ends as
 * NULL at the top: only the finished value needs a check. Where NULL also stands for a value that is left
 * out, set errno to 0 before, and check drape_memory_ran_out() too.
 */
#ifndef DRAPE_IO_JSON_H
#define DRAPE_IO_JSON_H

#include "io/file.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>

/* Adds a member to an object. Takes both references; returns the object, or NULL if either is NULL. */
static inline json_t *drape_json_with(json_t *object, const char *key, json_t *value)
{
    if (json_object_set_new(object, key, value) == 0)
        return object;
    json_decref(object);
    return NULL;
}

/* Adds an item to an array. Takes both references; returns the array, or NULL if either is NULL. */
static inline json_t *drape_json_append(json_t *array, json_t *value)
{
    if (json_array_append_new(array, value) == 0)
        return array;
    json_decref(array);
    return NULL;
}

/* Adds a list to an object unless it is empty. Takes both references, as above. */
static inline json_t *drape_json_with_list(json_t *object, const char *key, json_t *list)
{
    if (json_array_size(list) > 0 || !list)
        return drape_json_with(object, key, list);
    json_decref(list);
    return object;
}

static inline int drape_json_put_piece(const char *bytes, size_t size, void *file)
{
    drape_file_put(file, bytes, size);
    return 0; /* the file keeps its first failure */
}

/* Adds a value to a file. NULL, and out of memory here, count as a failed write. */
static inline void drape_json_put(drape_file *file, const json_t *value, size_t flags)
{
    if (json_dump_callback(value, drape_json_put_piece, file, flags) && !file->error)
        file->error = ENOMEM;
}

/* JSON has no NaN and no infinity: null stands for both. */
static inline json_t *drape_json_number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

/* Several counts, or numbers, of an object: DRAPE_JSON_COUNTS(object, {"nodes", 3}, {"dofs", 9}). */
typedef struct drape_json_count {
    const char *key;
    int64_t value;
} drape_json_count;

typedef struct drape_json_real {
    const char *key;
    double value;
} drape_json_real;

#define DRAPE_JSON_COUNTS(object, ...)                                                                       \
    drape_json_with_counts(object, (const drape_json_count[]){__VA_ARGS__, {NULL, 0}})
#define DRAPE_JSON_REALS(object, ...)                                                                        \
    drape_json_with_reals(object, (const drape_json_real[]){__VA_ARGS__, {NULL, 0}})

static inline json_t *drape_json_with_counts(json_t *object, const drape_json_count *items)
{
    for (; items->key; items++)
        object = drape_json_with(object, items->key, json_integer((json_int_t)items->value));
    return object;
}

static inline json_t *drape_json_with_reals(json_t *object, const drape_json_real *items)
{
    for (; items->key; items++)
        object = drape_json_with(object, items->key, drape_json_number(items->value));
    return object;
}

static inline json_t *drape_json_numbers(const double *values, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        array = drape_json_append(array, drape_json_number(values[i]));
    return array;
}

/* A path may be in any encoding, and a message may be cut within a character: a text that is not UTF-8 gets
 * question marks for all bytes beyond ASCII. */
static inline json_t *drape_json_text(const char *bytes)
{
    char copy[DRAPE_MESSAGE_SIZE];
    json_t *string = json_string(bytes);
    if (string)
        return string;
    snprintf(copy, sizeof copy, "%s", bytes);
    for (char *c = copy; *c; c++)
        if ((unsigned char)*c > 127)
            *c = '?';
    return json_string(copy);
}

#endif
