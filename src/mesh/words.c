/* words.c: see words.h. The byte after the text is 0, so looking one character ahead is always safe. */
#include "mesh/words.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_SHOWN_WORD 40

drape_words drape_words_open(const char *data, size_t size)
{
    static const char mark[] = "\xEF\xBB\xBF";
    const bool marked = size >= 3 && memcmp(data, mark, 3) == 0;
    return (drape_words){.at = data + (marked ? 3 : 0), .end = data + size, .line = 1};
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

/* Returns the number of bytes of a line end at this place; 0: there is none. */
static int line_end(const drape_words *text, const char *at)
{
    if (at >= text->end)
        return 0;
    if (*at == '\r')
        return at + 1 < text->end && at[1] == '\n' ? 2 : 1;
    return *at == '\n';
}

/* Returns the number of bytes of a backslash and the line end after it; 0: there is none here. */
static int continued_end(const drape_words *text, const char *at)
{
    if (!text->continuation || *at != '\\')
        return 0;
    const int end = line_end(text, at + 1);
    return end ? 1 + end : 0;
}

bool drape_words_next(drape_words *text, drape_word *word)
{
    for (int continued; text->at < text->end; text->at += continued ? continued : 1) {
        continued = continued_end(text, text->at);
        if (!continued && !is_blank(*text->at))
            break;
        text->line += continued > 0;
    }
    const char *at = text->at;
    if (text->comment && *at == text->comment)
        return false;
    while (at < text->end && !is_blank(*at) && !line_end(text, at) && !continued_end(text, at))
        at++;
    *word = (drape_word){.start = text->at, .length = (size_t)(at - text->at)};
    text->at = at;
    return word->length > 0;
}

bool drape_words_next_line(drape_words *text)
{
    drape_word rest;
    while (drape_words_next(text, &rest)) {
    }
    while (text->at < text->end && !line_end(text, text->at)) /* skip a comment */
        text->at++;
    if (text->at == text->end)
        return false;
    text->at += line_end(text, text->at);
    text->line++;
    return true;
}

bool drape_word_is(drape_word word, const char *name)
{
    return strlen(name) == word.length && memcmp(word.start, name, word.length) == 0;
}

bool drape_word_number(drape_word word, double *value)
{
    char *end = NULL;
    *value = strtod(word.start, &end);
    return word.length > 0 && end == word.start + word.length && isfinite(*value);
}

bool drape_word_integer(drape_word word, int64_t *value)
{
    const bool negative = word.length > 0 && word.start[0] == '-';
    const size_t first = negative || (word.length > 0 && word.start[0] == '+');
    int64_t sum = 0;
    for (size_t i = first; i < word.length; i++) {
        const char c = word.start[i];
        if (c < '0' || c > '9' || sum > (INT64_MAX - 9) / 10)
            return false;
        sum = 10 * sum + (c - '0');
    }
    *value = negative ? -sum : sum;
    return word.length > first;
}

int drape_word_shown(drape_word word)
{
    return word.length < MAX_SHOWN_WORD ? (int)word.length : MAX_SHOWN_WORD;
}
