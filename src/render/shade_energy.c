/* shade_energy.c: the field of that name in colours. */
#include "render/shading.h"

extern const drape_field_ops drape_field_energy;

const drape_shading drape_shading_energy = {
    .entry = {.name = "energy", .summary = "in colours with a legend: elastic energy stored in the sheet"},
    .source = drape_shading_field_source,
    .field = &drape_field_energy,
};
