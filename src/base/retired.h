/* retired.h: settings that scenes for earlier versions may name, in one table. The schema of a scene has them
 * no more. */
#ifndef DRAPE_BASE_RETIRED_H
#define DRAPE_BASE_RETIRED_H

#include "base/context.h"

/* Whether the name is that of a former setting; logs a warning at the pointer if so, unless ctx is NULL.
 * of: the name of the entry that had it, or "integrator" and "controller" for all of theirs. */
bool drape_retired(drape_context *ctx, const char *pointer, const char *of, const char *name);

/* Whether a pointer into a scene, such as "/integrator/predictor", is to a former setting. */
bool drape_is_retired(const char *pointer);

#endif
