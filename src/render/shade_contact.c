/* shade_contact.c: the field of that name in colours. */
#include "render/shading.h"

extern const drape_field_ops drape_field_contact;

const drape_shading drape_shading_contact = {
    .entry = {.name = "contact", .summary = "in colours with a legend: force of contact"},
    .source = drape_shading_field_source,
    .field = &drape_field_contact,
};
