/* shade_velocity.c: the field of that name in colours. */
#include "render/shading.h"

extern const drape_field_ops drape_field_velocity;

const drape_shading drape_shading_velocity = {
    .entry = {.name = "velocity", .summary = "in colours with a legend: speed"},
    .source = drape_shading_field_source,
    .field = &drape_field_velocity,
};
