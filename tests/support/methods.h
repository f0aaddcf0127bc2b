/*
 * methods.h: for tests that run a scene with contact by every integrator that has steps in time and forces of
 * contact: their names, from the table.
 */
#ifndef DRAPE_TESTS_METHODS_H
#define DRAPE_TESTS_METHODS_H

#include "integrators/integrator.h"

static const char *methods[64];
static size_t method_count;

__attribute__((constructor)) static void list_methods(void)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (!drape_integrators[i]->steady_state && !drape_integrators[i]->projects_contact)
            methods[method_count++] = drape_integrators[i]->entry.name;
}

#define METHODS method_count

#endif
