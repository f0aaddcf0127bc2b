/* field_contact.c: the magnitude of the force of contact and friction on a node. */
#include "fields/fields.h"

#include "base/vec3.h"

#include <string.h>

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    const drape_model *m = sim->model;
    const drape_state *s = drape_sim_state(sim);
    (void)x; /* forces this stiff are meaningful only at the end of a step */
    memset(values, 0, (size_t)m->node_count * sizeof *values);
    if (sim->chosen.integrator->projects_contact && (m->collider_count || m->contact.self))
        return drape_fail(
            sim->ctx, DRAPE_E_ARGUMENT,
            "contact: the integrator \"%s\" resolves contact by moving nodes and has no contact force",
            sim->chosen.integrator->entry.name);
    if (!drape_system_contact(sim->system))
        return DRAPE_OK;
    const drape_status status = drape_sim_begin_reading(sim);
    if (status)
        return status;
    double *g = drape_alloc(sim->ctx, (size_t)m->node_count, 3 * sizeof *g);
    if (!g)
        return DRAPE_E_MEMORY;
    const drape_point point = {
        .x = s->x, .v = s->v, .internal = s->internal, .t = s->t, .span = {s->t, s->t}};
    drape_system_contact_part(sim->system, &point, true, g, NULL);
    for (size_t i = 0; i < (size_t)m->node_count; i++)
        values[i] = vec3_norm(g + 3 * i);
    drape_free(sim->ctx, g);
    return drape_system_status(sim->system);
}

const drape_field_ops drape_field_contact = {
    .entry = {.name = "contact", .summary = "force of contact and friction on a node"},
    .unit = "N",
    .shown = 1,
    .shown_unit = "N",
    .measure = measure,
};
