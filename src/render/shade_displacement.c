/* shade_displacement.c: matt, its points moved out by the height map. */
#include "render/shading.h"

const drape_shading drape_shading_displacement = {
    .entry = {.name = "displacement",
              .summary = "matt, its points moved out by the height map: --height, or a woven relief",
              .reference = "Cook 1984"},
    .reads = DRAPE_READS_HEIGHTS,
    .source = "vec3 shade(Surface s) {\n"
              "    vec3 n = bumped(s, 0.016);\n"
              "    float h = texture(heights, s.at).r;\n"
              "    return tint(s) * (0.70 + 0.45 * h) * arriving(s, n) / PI * 1.65;\n"
              "}\n",
    .displaced = true,
};
