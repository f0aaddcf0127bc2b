/* shade_refraction.c: glass. */
#include "render/shading.h"

const drape_shading drape_shading_refraction = {
    .name = "refraction",
    .summary = "glass: the world around, bent at the surface and mirrored at its rim",
    .reads = DRAPE_READS_ENVIRONMENT,
    .source = "vec3 shade(Surface s) {\n"
              "    float f = schlick(dot(s.n, s.v), 0.06);\n"
              "    vec3 through = vec3(world(refract(-s.v, s.n, 1.0 / 1.42), 0.06).r, world(refract(-s.v, "
              "s.n, 1.0 / 1.45), 0.06).g,\n"
              "                        world(refract(-s.v, s.n, 1.0 / 1.48), 0.06).b);\n"
              "    vec3 h = normalize(light + s.v);\n"
              "    return mix(1.25 * through * vec3(0.62, 0.90, 0.96), world(reflect(-s.v, s.n), 0.0), f) + "
              "0.6 * power(dot(s.n, h), 200.0) * s.sun;\n"
              "}\n",
};
