/*
 * units.c: see units.h. A pointer says in which table a name is to be looked for, "/cloth/0/terms/2/stiffness" in that of
 * terms, not in which term: that is in the scene. Where entries that have the name give it different units, there is none.
 */
#include "lab/units.h"

#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "integrators/integrator.h"
#include "mesh/mesh.h"
#include "terms/terms.h"

#include <string.h>

static const struct {
    const char *part; /* of the pointer */
    const drape_registry *registry;
} tables[] = {{"/mesh/", &drape_grid_registry},
              {"/material/", &drape_material_registry},
              {"/terms/", &drape_term_registry},
              {"/colliders/", &drape_collider_registry},
              {"/contact/", &drape_contact_registry},
              {"/self_contact/", &drape_self_contact_registry},
              {"/integrator/", &drape_integrator_registry},
              {"/controller/", &drape_controller_registry}};

/* Values of the scene that are not in a table, by how their pointers begin. */
static const struct {
    const char *start, *unit;
} plain[] = {{"/gravity", "m/s2"}, {"/duration", "s"}, {"/frame_rate", "1/s"}};

static const char *unit_in(const drape_registry *registry, const char *name)
{
    const char *unit = NULL;
    const drape_entry *entry;
    for (int i = 0; (entry = registry->entries[i]) != NULL; i++)
        for (int p = 0; p < entry->param_count; p++) {
            if (strcmp(entry->params[p].name, name) != 0)
                continue;
            if (unit && strcmp(unit, entry->params[p].unit) != 0)
                return "";
            unit = entry->params[p].unit;
        }
    return unit && strcmp(unit, "1") != 0 ? unit : "";
}

const char *lab_unit(const char *pointer)
{
    for (size_t i = 0; i < sizeof plain / sizeof *plain; i++)
        if (strncmp(pointer, plain[i].start, strlen(plain[i].start)) == 0)
            return plain[i].unit;
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++)
        if (strstr(pointer, tables[i].part))
            return unit_in(tables[i].registry, strrchr(pointer, '/') + 1);
    return "";
}
