/*
 * units.c: lab_unit of text.h. A pointer says in which table a name is to be looked for, "/cloth/0/terms/2/stiffness" in that of
 * the terms, but not in which entry: that is in the scene. Where entries give the name different units, there is none.
 */
#include "lab/text.h"

#include "base/param.h"
#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "integrators/integrator.h"
#include "mesh/mesh.h"
#include "terms/terms.h"

#include <string.h>

/* The unit so far (NULL: the name was not found), and that of another list of parameters. */
static const char *common_unit(const char *unit, const drape_param *params, int count, const char *name)
{
    const int i = drape_param_find(params, count, name);
    return i < 0 ? unit : !unit || strcmp(unit, params[i].unit) == 0 ? params[i].unit : "";
}

#define LOOK_IN(table)                                                                                       \
    for (int i = 0; (table)[i]; i++)                                                                         \
    unit = common_unit(unit, (table)[i]->entry.params, (table)[i]->entry.param_count, name)

const char *lab_unit(const char *pointer)
{
    const char *name = strrchr(pointer, '/') + 1, *unit = NULL;
    if (strncmp(pointer, "/gravity", strlen("/gravity")) == 0)
        return "m/s2";
    if (strcmp(pointer, "/duration") == 0)
        return "s";
    if (strcmp(pointer, "/frame_rate") == 0)
        return "1/s";
    if (strstr(pointer, "/mesh/"))
        LOOK_IN(drape_grids);
    else if (strstr(pointer, "/material/"))
        unit = common_unit(NULL, drape_material_params, DRAPE_MATERIAL_PARAM_COUNT, name);
    else if (strstr(pointer, "/terms/"))
        LOOK_IN(drape_terms);
    else if (strstr(pointer, "/colliders/"))
        LOOK_IN(drape_colliders);
    else if (strstr(pointer, "/contact/"))
        unit = common_unit(NULL, drape_contact_params, DRAPE_CONTACT_PARAM_COUNT, name);
    else if (strstr(pointer, "/self_contact/"))
        unit = common_unit(NULL, drape_self_contact_params, DRAPE_SELF_PARAM_COUNT, name);
    else if (strstr(pointer, "/integrator/"))
        LOOK_IN(drape_integrators);
    else if (strstr(pointer, "/controller/"))
        LOOK_IN(drape_controllers);
    return unit && strcmp(unit, "1") != 0 ? unit : "";
}
