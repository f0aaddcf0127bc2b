/* shade_refraction.c: glass. */
#include "render/shading.h"

const drape_shading drape_shading_refraction = {
    .entry =
        {.name = "refraction",
         .summary =
             "glass: what is behind it, refracted at the surface, and the surroundings mirrored at its rim",
         .reference = "Wyman 2005, with one surface"},
    .reads = DRAPE_READS_ENVIRONMENT | DRAPE_READS_BEHIND,
    .source =
        "// The refracted ray continues for a part of the scene's size and shows the picture behind the\n"
        "// cloth at that point; red, green and blue are refracted differently.\n"
        "vec3 shade(Surface s) {\n"
        "    vec3 bent = vec3(1.0 / 1.22, 1.0 / 1.25, 1.0 / 1.28), through;\n"
        "    through.r = seen_at(s.p + reach * refract(-s.v, s.n, bent.r)).r;\n"
        "    through.g = seen_at(s.p + reach * refract(-s.v, s.n, bent.g)).g;\n"
        "    through.b = seen_at(s.p + reach * refract(-s.v, s.n, bent.b)).b;\n"
        "    float f = schlick(dot(s.n, s.v), 0.06), steep = 1.0 - dot(s.n, s.v);\n"
        "    vec3 h = normalize(light + s.v), glass = mix(vec3(0.86, 0.95, 0.97), vec3(0.42, 0.68, "
        "0.74), steep * steep);\n"
        "    return mix(through * glass, world(reflect(-s.v, s.n), 0.0), f) +\n"
        "           0.6 * power(dot(s.n, h), 200.0) * s.sun;\n"
        "}\n",
    .clear = 0.62f,
};
