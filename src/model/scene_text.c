/* scene_text.c: see scene_text.h. jansson keeps no positions of values. Only a fault needs them, so the text
 * is scanned again after a fault rather than indexed for every scene. */
#include "model/scene_text.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>

#define BYTE_ORDER_MARK "\xEF\xBB\xBF"

/* ---- JSON pointers ---- */

static void push_text(drape_pointer *pointer, const char *text)
{
    size_t space = sizeof pointer->text - pointer->length;
    int wanted = snprintf(pointer->text + pointer->length, space, "%s", text);
    pointer->length += (size_t)wanted < space ? (size_t)wanted : space - 1;
}

void drape_pointer_push(drape_pointer *pointer, const char *key)
{
    push_text(pointer, "/");
    for (; *key; key++) {
        char one[2] = {*key, 0};
        push_text(pointer, *key == '~' ? "~0" : *key == '/' ? "~1" : one);
    }
    drape_text_mend_end(pointer->text);
    pointer->length = strlen(pointer->text);
}

void drape_pointer_push_index(drape_pointer *pointer, size_t index)
{
    const char *text = DRAPE_FORMAT("/%zu", index);
    push_text(pointer, text);
}

void drape_pointer_cut(drape_pointer *pointer, size_t length)
{
    pointer->length = length;
    pointer->text[length] = 0;
}

const char *drape_pointer_next(const char *pointer, char key[DRAPE_POINTER_SIZE])
{
    size_t used = 0;
    if (*pointer != '/')
        return NULL;
    for (pointer++; *pointer && *pointer != '/'; pointer++) {
        char c = *pointer;
        if (c == '~') {
            if (pointer[1] != '0' && pointer[1] != '1')
                return NULL;
            c = *++pointer == '0' ? '~' : '/';
        }
        if (used + 1 == DRAPE_POINTER_SIZE)
            return NULL;
        key[used++] = c;
    }
    key[used] = 0;
    return pointer;
}

bool drape_pointer_index(const char *key, size_t *index)
{
    size_t digits = strspn(key, "0123456789");
    if (digits == 0 || digits > 18 || key[digits] || (*key == '0' && digits > 1))
        return false;
    *index = 0;
    for (; *key; key++)
        *index = 10 * *index + (size_t)(*key - '0');
    return true;
}

/* ---- Tokens ---- */

static bool starts_comment(const char *p)
{
    return p[0] == '/' && (p[1] == '/' || p[1] == '*');
}

/* Skips white space and comments, up to a comment that is not closed. */
static const char *skip_space(const char *p)
{
    for (;;) {
        p += strspn(p, " \t\r\n");
        if (!starts_comment(p))
            return p;
        const char *end = p[1] == '/' ? p + strcspn(p, "\n") : strstr(p + 2, "*/");
        if (!end)
            return p;
        p = p[1] == '/' ? end : end + 2;
    }
}

static const char *first_token(const char *text)
{
    bool marked = strncmp(text, BYTE_ORDER_MARK, 3) == 0;
    return skip_space(marked ? text + 3 : text);
}

/* A string ends with its line, so that a missing quote does not invert the meaning of the remaining text. */
static const char *string_end(const char *p)
{
    for (p++; *p && *p != '"' && *p != '\n'; p++)
        if (*p == '\\' && p[1] && p[1] != '\n')
            p++;
    return *p == '"' ? p + 1 : p;
}

/* p must be at the start of a token, not at the end of the text. */
static const char *token_end(const char *p)
{
    const char *delimiters = " \t\r\n{}[],:\"";
    if (*p == '"')
        return string_end(p);
    if (strchr(delimiters, *p))
        return p + 1;
    do
        p++;
    while (*p && !strchr(delimiters, *p) && !starts_comment(p));
    return p;
}

static const char *value_end(const char *p)
{
    size_t depth = 0;
    do {
        p = skip_space(p);
        if (*p == '{' || *p == '[')
            depth++;
        else if ((*p == '}' || *p == ']') && depth > 0)
            depth--;
        else if (!*p)
            return p;
        p = token_end(p);
    } while (depth > 0);
    return p;
}

bool drape_text_blank_comments(char *text, size_t *offset)
{
    char *blank = text;
    const char *token = first_token(text);
    for (;;) {
        for (; blank < token; blank++)
            if (*blank != '\n')
                *blank = ' ';
        if (starts_comment(token)) {
            *offset = (size_t)(token - text);
            return false;
        }
        if (!*token)
            return true;
        const char *end = token_end(token);
        blank = text + (end - text);
        token = skip_space(end);
    }
}

size_t drape_text_token(const char *text, size_t consumed, bool its_end)
{
    const char *token = first_token(text), *end = token;
    for (const char *p = token; *p && p < text + consumed; p = skip_space(end)) {
        token = p;
        end = token_end(p);
    }
    return (size_t)((its_end ? end : token) - text);
}

/* ---- Places ---- */

static bool continues_character(char c)
{
    return ((unsigned char)c & 0xC0) == 0x80;
}

void drape_text_place(const char *text, size_t offset, size_t *line, size_t *column)
{
    size_t start = strncmp(text, BYTE_ORDER_MARK, 3) == 0 ? 3 : 0;
    *line = 1;
    *column = 1;
    for (size_t i = start; i < offset && text[i]; i++) {
        if (text[i] == '\n') {
            *line += 1;
            *column = 1;
        } else if (!continues_character(text[i])) {
            *column += 1;
        }
    }
}

/* Whether the string from p to end equals key. */
static bool says(const char *p, const char *end, const char *key)
{
    size_t length = (size_t)(end - p);
    if (!memchr(p, '\\', length))
        return length == strlen(key) + 2 && memcmp(p + 1, key, length - 2) == 0;
    json_t *string = json_loadb(p, length, JSON_DECODE_ANY, NULL);
    bool same = string && strcmp(json_string_value(string), key) == 0;
    json_decref(string);
    return same;
}

/* Finds the value of a member of the object at p, and the place of its key. Returns NULL if there is none. */
static const char *find_member(const char *p, const char *key, const char **place)
{
    for (p = skip_space(p + 1); *p == '"'; p = skip_space(p)) {
        const char *end = string_end(p), *colon = skip_space(end);
        const char *value = skip_space(*colon == ':' ? colon + 1 : colon);
        if (says(p, end, key)) {
            *place = p;
            return value;
        }
        p = skip_space(value_end(value));
        if (*p == ',')
            p++;
    }
    return NULL;
}

static const char *find_element(const char *p, const char *key, const char **place)
{
    size_t index;
    if (!drape_pointer_index(key, &index))
        return NULL;
    for (p = skip_space(p + 1); *p && *p != ']' && index > 0; index--) {
        p = skip_space(value_end(p));
        if (*p == ',')
            p = skip_space(p + 1);
    }
    *place = p;
    return *p && *p != ']' ? p : NULL;
}

bool drape_text_find(const char *text, const char *pointer, size_t *offset)
{
    const char *value = first_token(text), *place;
    char key[DRAPE_POINTER_SIZE];
    *offset = (size_t)(value - text);
    while (*pointer) {
        pointer = drape_pointer_next(pointer, key);
        if (!pointer)
            return false;
        value = *value == '{'   ? find_member(value, key, &place)
                : *value == '[' ? find_element(value, key, &place)
                                : NULL;
        if (!value)
            return false;
        *offset = (size_t)(place - text);
    }
    return true;
}

void drape_text_mend_end(char *text)
{
    size_t length = strlen(text), tail = 0;
    while (tail < 3 && tail < length && continues_character(text[length - 1 - tail]))
        tail++;
    if (tail == length)
        return;
    unsigned char lead = (unsigned char)text[length - 1 - tail];
    size_t wanted = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC0 ? 1 : 0;
    if (tail < wanted)
        text[length - 1 - tail] = 0;
}
