/*
 * registry.h: implementations that are chosen by name. A registry is a table of entries, together with its
 * names in messages and in `drape list`. src/meson.build generates one for each kind of implementation, from
 * the names in the meson.build of the folders.
 *
 * An index counts the built-in entries in the order of the table, then the user-defined entries of a context.
 * ctx may be NULL everywhere except in drape_registry_choose: then only built-in entries are considered.
 */
#ifndef DRAPE_BASE_REGISTRY_H
#define DRAPE_BASE_REGISTRY_H

#include "base/context.h"

typedef struct drape_registry {
    const char *noun;                  /* name of an entry in messages: "term" */
    const char *key, *title;           /* name of the table in `drape list`: "terms", "Terms" */
    const char *place;                 /* where a scene names an entry, as text; "": nowhere */
    const drape_entry *const *entries; /* built-in, NULL-terminated */
    /* Returns user-defined entry number `index` of a context; NULL past the last. If this is NULL, there are
     * only built-in entries. */
    const drape_entry *(*user_defined)(const drape_context *ctx, int index);
} drape_registry;

int drape_registry_count(const drape_registry *registry); /* number of built-in entries */

/* Returns NULL past the last entry. */
const drape_entry *drape_registry_entry(const drape_registry *registry, const drape_context *ctx, int index);

/* Returns the index of a name; -1 if there is no such entry. */
int drape_registry_find(const drape_registry *registry, const drape_context *ctx, const char *name);

/* Size of the message for an unknown name: `there is no term "streth"; there are bend, stretch; did you mean
 * "stretch"?` */
#define DRAPE_UNKNOWN_SIZE 1024
void drape_registry_unknown(const drape_registry *registry, const drape_context *ctx, const char *name,
                            char text[DRAPE_UNKNOWN_SIZE]);

/* drape_registry_find that reports an unknown name at a JSON pointer ("": no place). Errors:
 * DRAPE_E_ARGUMENT. */
drape_status drape_registry_choose(drape_context *ctx, const drape_registry *registry, const char *pointer,
                                   const char *name, int *index);

#endif
