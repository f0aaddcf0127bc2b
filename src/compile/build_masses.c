/* build_masses.c: nodes with masses of their own, beside or in place of what the material gives them. */
#include "compile/select.h"
#include "compile/stages.h"

#include <math.h>
#include <string.h>

/* One item of "masses". */
typedef struct mass_item {
    const drape_mass_def *def;
    double *mass;   /* (node_count) [kg] so far */
    uint8_t *taken; /* (node_count) 1: the item has changed this node: one that is listed twice counts once */
} mass_item;

static drape_status take_node(void *user, const char *key, int32_t local)
{
    const mass_item *item = user;
    (void)key;
    if (!item->taken[local])
        item->mass[local] = isnan(item->def->add) ? item->def->mass : item->mass[local] + item->def->add;
    item->taken[local] = 1;
    return DRAPE_OK;
}

drape_status drape_compile_masses(drape_model *model, const char *pointer, const drape_cloth_def *def,
                                  drape_cloth *cloth)
{
    const size_t count = (size_t)cloth->mesh.node_count;
    if (def->mass_count == 0)
        return DRAPE_OK;
    cloth->node_mass = drape_arena_take(&model->arena, count, sizeof *cloth->node_mass);
    mass_item item = {.mass = cloth->node_mass, .taken = drape_arena_take(&model->scratch, count, 1)};
    if (!item.mass || !item.taken)
        return DRAPE_E_MEMORY;
    memcpy(item.mass, cloth->material_mass, count * sizeof *item.mass);
    for (size_t i = 0; i < def->mass_count; i++) {
        const char *at = DRAPE_FORMAT("%s/masses/%zu", pointer, i);
        item.def = &def->masses[i];
        memset(item.taken, 0, count);
        if (isnan(item.def->add) == isnan(item.def->mass))
            return drape_refuse(model->ctx, at, "exactly one of add, mass is needed; given: %s",
                                isnan(item.def->add) ? "none" : "both");
        DRAPE_TRY(drape_select_nodes(&(drape_selection){.ctx = model->ctx,
                                                        .pointer = at,
                                                        .form = &drape_form_mass,
                                                        .mesh = &cloth->mesh,
                                                        DRAPE_SELECTED_BY(item.def),
                                                        .take = take_node,
                                                        .user = &item}));
    }
    return DRAPE_OK;
}
