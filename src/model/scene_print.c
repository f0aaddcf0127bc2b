/*
 * scene_print.c: the tree of a scene as readable JSON text: whatever fits on a line stays on one line, and
 * numbers have the fewest digits that read back as the same number. jansson's own printers break every vector
 * over four lines and print 0.050000000000000003.
 */
#include "model/scene_json.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_WIDTH 110
#define INDENT     2

typedef struct printer {
    drape_text_sink *put;
    void *user;
    size_t column;
} printer;

static void print_value(printer *p, json_t *value, size_t indent);

static void put(printer *p, const char *text, size_t size)
{
    p->put(p->user, text, size);
    p->column += size;
}

static void put_text(printer *p, const char *text)
{
    put(p, text, strlen(text));
}

static void new_line(printer *p, size_t indent)
{
    put_text(p, "\n");
    p->column = 0;
    for (size_t i = 0; i < indent; i++)
        put_text(p, " ");
}

/* JSON has neither infinity nor NaN. */
static void print_number(printer *p, double number)
{
    char text[40];
    for (int digits = 1; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, number);
        if (strtod(text, NULL) == number)
            break;
    }
    if (!strchr(text, 'e') || number != (double)(long)number || number > 1e6 || number < -1e6)
        put_text(p, text);
    else { /* write 100, not 1e+02 */
        snprintf(text, sizeof text, "%ld", (long)number);
        put_text(p, text);
    }
}

static void print_string(printer *p, const char *string, size_t size)
{
    put_text(p, "\"");
    for (size_t i = 0; i < size; i++) {
        char text[8];
        const unsigned char c = (unsigned char)string[i];
        snprintf(text, sizeof text, c < ' ' ? "\\u%04x" : c == '"' || c == '\\' ? "\\%c" : "%c", c);
        put_text(p, text);
    }
    put_text(p, "\"");
}

/* ---- Width ---- */

static void count(void *user, const char *text, size_t size)
{
    (void)text;
    *(size_t *)user += size;
}

/* Long lists of numbers stay on one line, as one number per line would be no more readable. */
static bool is_one_line(const printer *p, json_t *value)
{
    bool scalars = !json_is_object(value);
    for (size_t i = 0; scalars && i < json_array_size(value); i++) {
        const json_t *one = json_array_get(value, i);
        scalars = !json_is_array(one) && !json_is_object(one);
    }
    if (scalars || p->put == count)
        return true;
    size_t size = 0;
    printer measure = {.put = count, .user = &size};
    print_value(&measure, value, 0);
    return p->column + size <= LINE_WIDTH;
}

/* ---- Values ---- */

/* Writes the separator before an element: nothing before the first one on the same line. */
static void separate(printer *p, bool first, bool one_line, size_t indent)
{
    if (!first)
        put_text(p, one_line ? ", " : ",");
    if (!one_line)
        new_line(p, indent + INDENT);
}

static void print_value(printer *p, json_t *value, size_t indent)
{
    const bool one_line = is_one_line(p, value);
    bool first = true;
    switch (json_typeof(value)) {
    case JSON_OBJECT:
        put_text(p, "{");
        for (void *it = json_object_iter(value); it; it = json_object_iter_next(value, it)) {
            const char *key = json_object_iter_key(it);
            separate(p, first, one_line, indent);
            print_string(p, key, strlen(key));
            put_text(p, ": ");
            print_value(p, json_object_iter_value(it), indent + INDENT);
            first = false;
        }
        if (!one_line)
            new_line(p, indent);
        put_text(p, "}");
        break;
    case JSON_ARRAY:
        put_text(p, "[");
        for (size_t i = 0; i < json_array_size(value); i++) {
            separate(p, i == 0, one_line, indent);
            print_value(p, json_array_get(value, i), indent + INDENT);
        }
        if (!one_line)
            new_line(p, indent);
        put_text(p, "]");
        break;
    case JSON_STRING:
        print_string(p, json_string_value(value), json_string_length(value));
        break;
    case JSON_INTEGER:
    case JSON_REAL:
        print_number(p, json_number_value(value));
        break;
    case JSON_TRUE:
        put_text(p, "true");
        break;
    case JSON_FALSE:
        put_text(p, "false");
        break;
    case JSON_NULL:
        put_text(p, "null");
    }
}

void drape_json_print(json_t *value, drape_text_sink *sink, void *user)
{
    printer p = {.put = sink, .user = user};
    print_value(&p, value, 0);
    new_line(&p, 0);
}
