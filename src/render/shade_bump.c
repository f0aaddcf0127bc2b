/* shade_bump.c: matt, with the slopes of the height map. */
#include "render/shading.h"

const drape_shading drape_shading_bump = {
    .entry = {.name = "bump",
              .summary = "matt, with the slopes of the height map: --height, or a woven relief",
              .reference = "Blinn 1978"},
    .reads = DRAPE_READS_HEIGHTS,
    .source =
        "vec3 shade(Surface s) {\n"
        "    vec3 n = bumped(s, 0.007);\n"
        "    vec3 h = normalize(light + s.v);\n"
        "    return tint(s) * arriving(s, n) / PI * 1.55 + 0.22 * LAMP / 2.6 * power(dot(n, h), 40.0) * "
        "s.sun;\n"
        "}\n",
};
