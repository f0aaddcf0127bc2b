/*
 * units.c: lab_unit of text.h. A pointer says in which table a name is to be looked for,
 * "/cloth/0/terms/2/stiffness" in that of the terms, but not in which entry: that is in the scene. If
 * entries give the name different units, lab_unit returns "".
 */
#include "lab/text.h"

#include "base/param.h"
#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "integrators/integrator.h"
#include "mesh/mesh.h"
#include "model/scene.h"
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
              {"/untangle/", &drape_untangle_registry},
              {"/integrator/", &drape_integrator_registry},
              {"/controller/", &drape_controller_registry}};

static const char *unit_in(const drape_registry *registry, const char *name)
{
    const char *unit = NULL;
    const drape_entry *entry;
    for (int i = 0; (entry = drape_registry_entry(registry, NULL, i)) != NULL; i++) {
        const int p = drape_param_find(entry->params, entry->param_count, name);
        if (p >= 0 && unit && strcmp(unit, entry->params[p].unit) != 0)
            return "";
        if (p >= 0)
            unit = entry->params[p].unit;
    }
    return unit && strcmp(unit, "1") != 0 ? unit : "";
}

const char *lab_unit(const char *pointer)
{
    const drape_scene_key *key = drape_scene_key_at(pointer);
    if (key && key->shape == DRAPE_SCENE_VALUE)
        return strcmp(key->param.unit, "1") != 0 ? key->param.unit : "";
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++)
        if (strstr(pointer, tables[i].part))
            return unit_in(tables[i].registry, strrchr(pointer, '/') + 1);
    return "";
}
