/* reason.c: see reason.h. */
#include "base/reason.h"

#include <string.h>

#define ENTRY(constant, name_, by, meaning)                                                                  \
    &(const drape_entry){.name = name_, .summary = meaning, .reference = by},
static const drape_entry *const reasons[DRAPE_REASON_COUNT + 1] = {DRAPE_REASONS(ENTRY)};

const drape_registry drape_reason_registry = {
    "reason", "reasons", "Reasons", "`reason` in steps.csv, summary.json and drape_attempt", reasons, NULL};

const char *drape_reason_name(drape_reason reason)
{
    return reasons[reason]->name;
}

drape_reason drape_reason_named(const char *name)
{
    int i = 0;
    while (i < DRAPE_REASON_COUNT && strcmp(reasons[i]->name, name) != 0)
        i++;
    return (drape_reason)i;
}
