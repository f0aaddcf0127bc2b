/* shade_pbr.c: metallic-roughness. */
#include "render/shading.h"

const drape_shading drape_shading_pbr = {
    .entry = {.name = "pbr",
              .summary = "metallic-roughness: silk with threads of gold where the height map has metal",
              .reference = "Cook & Torrance 1982; GGX, Walter et al. 2007"},
    .reads = DRAPE_READS_HEIGHTS | DRAPE_READS_ENVIRONMENT,
    .source =
        "// Trowbridge and Reitz's distribution of facets, Smith's joint shadowing, Schlick's Fresnel term.\n"
        "vec3 shade(Surface s) {\n"
        "    float metal = texture(heights, s.at).a;\n"
        "    vec3 n = bumped(s, 0.005), h = normalize(light + s.v);\n"
        "    vec3 base = mix(tint(s) * vec3(0.42, 0.30, 0.55), vec3(1.00, 0.72, 0.30), metal);\n"
        "    float rough = mix(0.55, 0.30, metal), a2 = widened(rough * rough * rough * rough, n);\n"
        "    rough = pow(a2, 0.25);\n"
        "    float nl = max(dot(n, light), 0.0), nv = max(dot(n, s.v), 0.02), nh = max(dot(n, h), 0.0);\n"
        "    float d = nh * nh * (a2 - 1.0) + 1.0;\n"
        "    float facets = a2 / (PI * d * d);\n"
        "    float seen = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2) "
        "+ 1e-4);\n"
        "    vec3 f0 = mix(vec3(0.045), base, metal);\n"
        "    vec3 f = f0 + (1.0 - f0) * power(1.0 - max(dot(h, s.v), 0.0), 5.0);\n"
        "    vec3 matt = (1.0 - metal) * base / PI;\n"
        "    vec3 direct = (matt * (1.0 - f) + f * facets * seen) * nl * LAMP * 2.2 * s.sun;\n"
        "    vec3 rim = f0 + (max(vec3(1.0 - rough), f0) - f0) * power(1.0 - nv, 5.0);\n"
        "    return direct + s.open * (matt * room(n) * 2.2 + rim * world(reflect(-s.v, n), min(1.0, 1.6 * "
        "rough)) * 1.25);\n"
        "}\n",
};
