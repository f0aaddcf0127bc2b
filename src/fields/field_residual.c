/* field_residual.c: the residual of a free node's equation that the solver left at the end of the last
 * step. */
#include "fields/fields.h"

#include "base/vec3.h"

#include <string.h>

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    const drape_model *m = sim->model;
    const drape_integrator_ops *ops = sim->chosen.integrator;
    (void)x;
    memset(values, 0, (size_t)m->node_count * sizeof *values);
    if (!ops->residual)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "residual: the integrator \"%s\" does not solve its steps by Newton's method",
                          ops->entry.name);
    const double *f = ops->residual(sim->integrator);
    for (int32_t i = 0; sim->statistics.steps_accepted > 0 && i < m->free_count; i++)
        values[m->node_of_free[i]] = vec3_norm(f + 3 * (size_t)i);
    return DRAPE_OK;
}

const drape_field_ops drape_field_residual = {
    .entry = {.name = "residual",
              .summary = "residual of the equation of motion of a node at the end of the last step"},
    .unit = "N",
    .shown = 1,
    .shown_unit = "N",
    .of_steps = true,
    .measure = measure,
};
