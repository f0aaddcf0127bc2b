/* field_energy.c: the density of elastic energy. */
#include "fields/fields.h"

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    drape_sim_energy_density_at(sim, x, values);
    return DRAPE_OK;
}

const drape_field_ops drape_field_energy = {
    .entry = {.name = "energy", .summary = "elastic energy of the sheet per area"},
    .unit = "J/m2",
    .shown = 1,
    .shown_unit = "J/m²",
    .measure = measure,
};
