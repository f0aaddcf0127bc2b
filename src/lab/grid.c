/* grid.c: see grid.h. */
#include "lab/grid.h"

#include <string.h>

bool lab_has_param(const drape_param *params, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (strcmp(params[i].name, name) == 0)
            return true;
    return false;
}

const drape_integrator_ops *lab_find_integrator(const char *name)
{
    const int i = drape_registry_find(&drape_integrator_registry, NULL, name);
    return i < 0 ? NULL : drape_integrators[i];
}

bool lab_ignores(const drape_integrator_ops *row, const char *pointer)
{
    const char *prefix = "/integrator/";
    size_t length = strlen(prefix);
    return strncmp(pointer, prefix, length) == 0 && strcmp(pointer + length, "method") != 0 &&
           !lab_has_param(row->entry.params, row->entry.param_count, pointer + length);
}
