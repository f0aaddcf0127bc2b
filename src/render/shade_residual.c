/* shade_residual.c: the field of that name in colours. */
#include "render/shading.h"

extern const drape_field_ops drape_field_residual;

const drape_shading drape_shading_residual = {
    .entry = {.name = "residual",
              .summary = "in colours with a legend: what is left of the equations of motion"},
    .source = drape_shading_field_source,
    .field = &drape_field_residual,
};
