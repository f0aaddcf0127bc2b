/* shade_blinn_phong.c: matt with a highlight. */
#include "render/shading.h"

const drape_shading drape_shading_blinn_phong = {
    .entry = {.name = "blinn_phong", .summary = "matt with a highlight", .reference = "Blinn 1977"},
    .source =
        "vec3 shade(Surface s) {\n"
        "    vec3 h = normalize(light + s.v);\n"
        "    float shine = 0.55 * power(dot(s.n, h), 48.0) * s.sun + 0.10 * power(dot(s.n, s.v), 24.0);\n"
        "    return tint(s) * arriving(s) / PI * 1.45 + shine * LAMP / 2.6;\n"
        "}\n",
};
