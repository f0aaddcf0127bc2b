/* scene_text.h: places in the text of a scene: comments, tokens, JSON pointers, lines and columns.
 *
 * Texts end with a zero byte and hold no other. Offsets count bytes. Lines and columns count from 1; a column
 * is one Unicode character, a tab too, and a byte order mark none. */
#ifndef DRAPE_MODEL_SCENE_TEXT_H
#define DRAPE_MODEL_SCENE_TEXT_H

#include <stdbool.h>
#include <stddef.h>

/* ---- JSON pointers (RFC 6901) ------------------------------------------------------------------------ */

#define DRAPE_POINTER_SIZE 256 /* with its zero byte: as much as a context keeps of one */

/* A pointer that grows and shrinks with the walk through a scene. What does not fit is cut off. */
typedef struct drape_pointer {
    char text[DRAPE_POINTER_SIZE];
    size_t length;
} drape_pointer;

void drape_pointer_push(drape_pointer *pointer, const char *key); /* escapes ~ and / */
void drape_pointer_push_index(drape_pointer *pointer, size_t index);
void drape_pointer_cut(drape_pointer *pointer, size_t length); /* back to an earlier length */

/* Copies the first key of a pointer to key, without its escapes; the result is the rest of the pointer, ""
 * after the last key, NULL if it is not a pointer. */
const char *drape_pointer_next(const char *pointer, char key[DRAPE_POINTER_SIZE]);

/* The number that an array index says; false for anything but digits without a leading zero. */
bool drape_pointer_index(const char *key, size_t *index);

/* ---- The text ---------------------------------------------------------------------------------------- */

/* Overwrites comments with spaces, so that every byte keeps its offset and line. False: a comment is not
 * closed; *offset is where it starts. */
bool drape_text_blank_comments(char *text, size_t *offset);

void drape_text_place(const char *text, size_t offset, size_t *line, size_t *column);

/* The token that a parser has read when it has consumed `consumed` bytes: where it starts, or where it ends.
 */
size_t drape_text_token(const char *text, size_t consumed, bool its_end);

/* Looks up a pointer in the text of a valid JSON value, which may have comments. *offset is that of the key
 * of a member, that of the value of an array element; of the nearest ancestor that is there if the result is
 * false. */
bool drape_text_find(const char *text, const char *pointer, size_t *offset);

/* For what was cut off anywhere: removes the beginning of a UTF-8 character that has lost its end. */
void drape_text_mend_end(char *text);

#endif
