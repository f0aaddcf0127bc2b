/* shade_diffuse.c: matt. */
#include "render/shading.h"

const drape_shading drape_shading_diffuse = {
    .entry = {.name = "diffuse",
              .summary = "matt: brightness by the angle to the light",
              .reference = "Lambert 1760"},
    .source = "vec3 shade(Surface s) { return tint(s) * arriving(s) / PI * 1.55; }\n",
};
