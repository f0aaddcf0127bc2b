/* words.h: reads words and numbers from a text line by line and keeps the line number. */
#ifndef DRAPE_MESH_WORDS_H
#define DRAPE_MESH_WORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A position in a text. Lines end with LF, CR LF or CR. */
typedef struct drape_words {
    const char *at, *end; /* the remaining text; *end is a 0 byte */
    int64_t line;         /* line number of `at`, from 1 */
    char comment;         /* starts a comment at the beginning of a word; 0: no comments */
    bool continuation;    /* a backslash at the end of a line joins the next line to it */
} drape_words;

/* Characters between blanks. Not terminated by a 0 byte, but followed by a blank, a line end or 0. */
typedef struct drape_word {
    const char *start;
    size_t length;
} drape_word;

/* Opens a text of size bytes, followed by a 0 byte; skips a byte order mark. */
drape_words drape_words_open(const char *data, size_t size);

/* Takes the next word of this line; returns false at the end of the line. */
bool drape_words_next(drape_words *text, drape_word *word);

/* Moves past the end of this line; returns false if the text ends with it. */
bool drape_words_next_line(drape_words *text);

bool drape_word_is(drape_word word, const char *name);

/* Convert the whole word to a finite number (in the locale of the caller, who has switched to the C locale),
 * or to an integer with an optional sign; return false if the word is something else. */
bool drape_word_number(drape_word word, double *value);
bool drape_word_integer(drape_word word, int64_t *value);

/* A word in a message, for "%.*s": how many characters of it to show, and where they are. */
#define DRAPE_WORD(word) drape_word_shown(word), (word).start
int drape_word_shown(drape_word word);

#endif
