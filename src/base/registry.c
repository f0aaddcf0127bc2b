/* registry.c: see registry.h. */
#include "base/registry.h"

#include "base/param.h"

#include <stdio.h>
#include <string.h>

#define MAX_NAMES  128 /* maximum number of names that a message lists */
#define NAMES_SIZE 800 /* bytes of their list; DRAPE_UNKNOWN_SIZE has some more, for a suggestion after it */

int drape_registry_count(const drape_registry *registry)
{
    int count = 0;
    while (registry->entries[count])
        count++;
    return count;
}

const drape_entry *drape_registry_entry(const drape_registry *registry, const drape_context *ctx, int index)
{
    const int built_in = drape_registry_count(registry);
    if (index < built_in)
        return registry->entries[index];
    return ctx && registry->user_defined ? registry->user_defined(ctx, index - built_in) : NULL;
}

int drape_registry_find(const drape_registry *registry, const drape_context *ctx, const char *name)
{
    const drape_entry *entry;
    for (int i = 0; (entry = drape_registry_entry(registry, ctx, i)) != NULL; i++)
        if (strcmp(entry->name, name) == 0)
            return i;
    return -1;
}

void drape_registry_unknown(const drape_registry *registry, const drape_context *ctx, const char *name,
                            char text[DRAPE_UNKNOWN_SIZE])
{
    const char *names[MAX_NAMES];
    char list[NAMES_SIZE] = "";
    size_t count = 0;
    const drape_entry *entry;
    for (; count < MAX_NAMES && (entry = drape_registry_entry(registry, ctx, (int)count)) != NULL; count++) {
        names[count] = entry->name;
        drape_list_add(list, sizeof list, entry->name);
    }
    const char *meant = drape_did_you_mean(name, names, count);
    snprintf(text, DRAPE_UNKNOWN_SIZE, "there is no %s \"%.60s\"; there are %s%s%s%s", registry->noun, name,
             list, DRAPE_DID_YOU_MEAN(meant));
}

drape_status drape_registry_choose(drape_context *ctx, const drape_registry *registry, const char *pointer,
                                   const char *name, int *index)
{
    char text[DRAPE_UNKNOWN_SIZE];
    *index = drape_registry_find(registry, ctx, name);
    if (*index >= 0)
        return DRAPE_OK;
    drape_registry_unknown(registry, ctx, name, text);
    return drape_refuse(ctx, pointer, "%s", text);
}
