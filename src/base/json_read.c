/* json_read.c: see json_read.h. */
#include "base/json_read.h"

#include "base/context.h"

#include <string.h>

typedef struct source {
    const char *text;
    size_t left;
    bool failed;
} source;

/* jansson asks for the next character after it has stored one, and before it converts a number, which clears
 * errno: with one character a call, no failed allocation is missed. */
static size_t next(void *buffer, size_t space, void *user)
{
    source *s = user;
    (void)space;
    s->failed |= drape_memory_ran_out();
    if (s->failed || s->left == 0)
        return 0;
    s->left--;
    memcpy(buffer, s->text++, 1);
    return 1;
}

json_t *drape_json_read(const char *text, size_t size, size_t flags, json_error_t *error)
{
    source s = {text, size, false};
    errno = 0;
    json_t *root = json_load_callback(next, &s, flags, error);
    if (!s.failed && !drape_memory_ran_out())
        return root;
    json_decref(root);
    error->text[JSON_ERROR_TEXT_LENGTH - 1] = json_error_out_of_memory; /* where json_error_code finds it */
    return NULL;
}
