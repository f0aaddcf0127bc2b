/* text.h: reads words and numbers of a text line by line, and knows the number of the line. */
#ifndef DRAPE_MESH_TEXT_H
#define DRAPE_MESH_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A place in a text. Lines end with LF, CR LF or CR. */
typedef struct drape_text {
    const char *at, *end; /* what is left; *end is a 0 byte */
    int64_t line;         /* number of the line that at is on, from 1 */
    char comment;         /* a word that begins with it ends its line; 0: none does */
    bool continuation;    /* a backslash at the end of a line makes a blank of that end */
} drape_text;

/* Characters between blanks; not ended by a 0 byte, but what follows it is a blank, a line end or 0. */
typedef struct drape_word {
    const char *start;
    size_t length;
} drape_word;

/* The start of a text of size bytes that a 0 byte follows; a byte order mark is passed over. */
drape_text drape_text_open(const char *data, size_t size);

/* Takes the next word of this line; false at its end. */
bool drape_text_next_word(drape_text *text, drape_word *word);

/* Goes past the end of this line; false if the text ends with it. */
bool drape_text_next_line(drape_text *text);

bool drape_word_is(drape_word word, const char *name);

/* The whole word as a finite number (in the locale of the caller, who has entered the C locale), or as a
 * whole number with a sign or none; false if it is not one. */
bool drape_word_number(drape_word word, double *value);
bool drape_word_integer(drape_word word, int64_t *value);

/* How many characters of the word to show in a message, for "%.*s". */
int drape_word_shown(drape_word word);

#endif
