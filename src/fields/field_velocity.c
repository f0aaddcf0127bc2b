/* field_velocity.c: |v|. */
#include "fields/fields.h"

#include "base/vec3.h"

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    const double *v = drape_sim_state(sim)->v;
    (void)x;
    for (size_t i = 0; i < (size_t)sim->model->node_count; i++)
        values[i] = vec3_norm(v + 3 * i);
    return DRAPE_OK;
}

const drape_field_ops drape_field_velocity = {
    .entry = {.name = "velocity", .summary = "speed"},
    .unit = "m/s",
    .shown = 1,
    .shown_unit = "m/s",
    .measure = measure,
};
