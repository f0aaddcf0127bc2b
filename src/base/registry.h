/*
 * registry.h: what is chosen by name. A registry is a table of entries, with what messages and `drape list`
 * call it. src/meson.build generates one for each kind of implementation, from the names in the folders'
 * meson.build.
 *
 * An index counts the built-in entries, in the order of the table, and then those that the user of a context
 * defined. ctx may be NULL everywhere but in drape_registry_choose: built-in entries alone.
 */
#ifndef DRAPE_BASE_REGISTRY_H
#define DRAPE_BASE_REGISTRY_H

#include "base/context.h"

typedef struct drape_registry {
    const char *noun;                  /* what an entry is, in messages: "term" */
    const char *key, *title;           /* of the table in `drape list`: "terms", "Terms" */
    const char *place;                 /* where a scene names an entry, in words; "" for nowhere */
    const drape_entry *const *entries; /* built in, NULL-ended */
    /* User-defined entry `index` of a context; NULL past the last. NULL: only built-in entries. */
    const drape_entry *(*user_defined)(const drape_context *ctx, int index);
} drape_registry;

int drape_registry_count(const drape_registry *registry); /* of built-in entries */

/* NULL past the last. */
const drape_entry *drape_registry_entry(const drape_registry *registry, const drape_context *ctx, int index);

/* The index of a name; -1: there is no such entry. */
int drape_registry_find(const drape_registry *registry, const drape_context *ctx, const char *name);

/* The message that all unknown names have: `there is no term "streth"; there are bend, stretch; did you mean
 * "stretch"?` */
#define DRAPE_UNKNOWN_SIZE 1024
void drape_registry_unknown(const drape_registry *registry, const drape_context *ctx, const char *name,
                            char text[DRAPE_UNKNOWN_SIZE]);

/* drape_registry_find, which reports an unknown name at a JSON pointer, "" for none. Errors:
 * DRAPE_E_ARGUMENT. */
drape_status drape_registry_choose(drape_context *ctx, const drape_registry *registry, const char *pointer,
                                   const char *name, int *index);

#endif
