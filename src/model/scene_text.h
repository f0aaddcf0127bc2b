/* scene_text.h: places in the text of a scene: comments, tokens, JSON pointers, lines and columns.
 *
 * Texts end with a zero byte and contain no other. Offsets count bytes. Lines and columns count from 1. A
 * column is one Unicode character, including a tab; a byte order mark does not count. */
#ifndef DRAPE_MODEL_SCENE_TEXT_H
#define DRAPE_MODEL_SCENE_TEXT_H

#include "base/context.h"

/* ---- JSON pointers (RFC 6901) ------------------------------------------------------------------------ */

/* A pointer that grows and shrinks during the walk through a scene. Keys that do not fit are cut off. */
typedef struct drape_pointer {
    char text[DRAPE_POINTER_SIZE];
    size_t length;
} drape_pointer;

void drape_pointer_push(drape_pointer *pointer, const char *key); /* escapes ~ and / */
void drape_pointer_push_index(drape_pointer *pointer, size_t index);
void drape_pointer_cut(drape_pointer *pointer, size_t length); /* back to an earlier length */

/* Copies the first key of a pointer to key and removes its escapes. Returns the rest of the pointer: "" after
 * the last key, NULL if it is not a pointer. */
const char *drape_pointer_next(const char *pointer, char key[DRAPE_POINTER_SIZE]);

/* Parses an array index; returns false for anything but digits without a leading zero. */
bool drape_pointer_index(const char *key, size_t *index);

/* ---- The text ---------------------------------------------------------------------------------------- */

/* Overwrites comments with spaces, so that every byte keeps its offset and line. Returns false if a comment
 * is not closed; *offset is then where it starts. */
bool drape_text_blank_comments(char *text, size_t *offset);

void drape_text_place(const char *text, size_t offset, size_t *line, size_t *column);

/* Returns where the token that a parser has read after consuming `consumed` bytes starts, or where it
 * ends. */
size_t drape_text_token(const char *text, size_t consumed, bool its_end);

/* Looks up a pointer in the text of a valid JSON value, which may contain comments. *offset receives the
 * place of the key of a member, or of the value of an array element. If the result is false, it is the place
 * of the nearest ancestor. */
bool drape_text_find(const char *text, const char *pointer, size_t *offset);

/* For a text that was cut off: removes a trailing UTF-8 character that is incomplete. */
void drape_text_mend_end(char *text);

#endif
