/*
 * units.c: see units.h. A pointer says in which table a name is to be looked for, "/cloth/0/terms/2/stiffness" in that of
 * terms, not in which row: that is in the scene. Where rows that have the name give it different units, there is none.
 */
#include "lab/units.h"

#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "integrators/integrator.h"
#include "mesh/mesh.h"
#include "model/scene.h"
#include "terms/terms.h"

#include <string.h>

/* The parameters of one row of a table; NULL: there are no more rows. */
typedef const drape_param *params_of(int row, int *count);

#define PARAMS_OF(name, table)                                                                               \
    static const drape_param *name(int row, int *count)                                                      \
    {                                                                                                        \
        static const drape_param none;                                                                       \
        if (!(table)[row])                                                                                   \
            return NULL;                                                                                     \
        *count = (table)[row]->param_count;                                                                  \
        return (table)[row]->params ? (table)[row]->params : &none;                                          \
    }

PARAMS_OF(grids, drape_grids)
PARAMS_OF(terms, drape_terms)
PARAMS_OF(colliders, drape_colliders)
PARAMS_OF(integrators, drape_integrators)
PARAMS_OF(controllers, drape_controllers)

static const drape_param *materials(int row, int *count)
{
    *count = drape_material_param_count;
    return row == 0 ? drape_material_params : NULL;
}

static const drape_param *contacts(int row, int *count)
{
    *count = DRAPE_CONTACT_PARAM_COUNT;
    return row == 0 ? drape_contact_params : NULL;
}

static const drape_param *self_contacts(int row, int *count)
{
    *count = DRAPE_SELF_PARAM_COUNT;
    return row == 0 ? drape_self_contact_params : NULL;
}

static const struct {
    const char *part; /* of the pointer */
    params_of *params;
} tables[] = {{"/mesh/", grids},
              {"/material/", materials},
              {"/terms/", terms},
              {"/colliders/", colliders},
              {"/contact/", contacts},
              {"/self_contact/", self_contacts},
              {"/integrator/", integrators},
              {"/controller/", controllers}};

static const char *unit_in(params_of *params, const char *name)
{
    const char *unit = NULL;
    const drape_param *list;
    int count;
    for (int row = 0; (list = params(row, &count)); row++)
        for (int p = 0; p < count; p++) {
            if (strcmp(list[p].name, name) != 0)
                continue;
            if (unit && strcmp(unit, list[p].unit) != 0)
                return "";
            unit = list[p].unit;
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
            return unit_in(tables[i].params, strrchr(pointer, '/') + 1);
    return "";
}
