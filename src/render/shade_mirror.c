/* shade_mirror.c: a mirror of the surroundings. */
#include "render/shading.h"

const drape_shading drape_shading_mirror = {
    .entry = {.name = "mirror",
              .summary = "a mirror of its surroundings: --environment, or a room with lamps",
              .reference = "Blinn & Newell 1976"},
    .reads = DRAPE_READS_ENVIRONMENT,
    .source = "vec3 shade(Surface s) {\n"
              "    vec3 c = world(reflect(-s.v, s.n), 0.0);\n"
              "    float f = schlick(dot(s.n, s.v), 0.86);\n"
              "    return f * c * mix(0.72, 1.0, s.sun) * mix(0.6, 1.0, s.open) * vec3(0.98, 0.97, 0.95);\n"
              "}\n",
};
