/* shade_strain.c: the field of that name in colours. */
#include "render/shading.h"

extern const drape_field_ops drape_field_strain;

const drape_shading drape_shading_strain = {
    .entry = {.name = "strain", .summary = "in colours with a legend: how far the sheet is stretched"},
    .source = drape_shading_field_source,
    .field = &drape_field_strain,
};
