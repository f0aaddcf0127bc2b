/* shade_silk.c: satin with a long highlight across its threads. */
#include "render/shading.h"

const drape_shading drape_shading_silk = {
    .entry = {.name = "silk",
              .summary = "silk satin: smooth threads, whose highlight runs across them",
              .reference = "Ward 1992; Walter 2005"},
    .source = "// Ward's anisotropic highlight: narrow along the threads' normal plane, wide across.\n"
              "float gloss(vec3 n, vec3 t, vec3 v, vec3 l, float along, float across) {\n"
              "    vec3 h = normalize(l + v), b = cross(n, t);\n"
              "    float nl = dot(n, l), nv = max(dot(n, v), 0.05), hn = max(dot(h, n), 1e-3);\n"
              "    if (nl <= 0.0) return 0.0;\n"
              "    float x = dot(h, t) / along, y = dot(h, b) / across;\n"
              "    return nl * exp(-(x * x + y * y) / (hn * hn)) / (4.0 * PI * along * across * sqrt(nl * nv "
              "+ 0.02));\n"
              "}\n"
              "vec3 shade(Surface s) {\n"
              "    vec3 base = s.side > 0.0 ? vec3(0.095, 0.190, 0.205) : vec3(0.150, 0.230, 0.235);\n"
              "    float threads = noise(vec2(s.at.x * 6.0, s.at.y * 420.0)) - 0.5;\n"
              "    vec3 n = normalize(s.n + 0.05 * fine(s.at, 420.0) * threads * cross(s.n, s.t));\n"
              "    float shine = gloss(n, s.t, s.v, light, 0.42, 0.20), far = gloss(n, s.t, s.v, window, "
              "0.55, 0.30);\n"
              "    float rim = schlick(dot(n, s.v), 0.04);\n"
              "    vec3 glow = mix(base, vec3(0.80, 0.88, 0.86), 0.45);\n"
              "    return base * arriving(s, n) / PI * 1.35 + glow * (0.40 * shine * LAMP * s.sun + 0.20 * "
              "far * s.open * vec3(0.9, 1.0, 1.1)) + rim * s.open * room(n) * 0.42;\n"
              "}\n",
};
