/* shade_denim.c: a twill of indigo and white threads. */
#include "render/shading.h"

const drape_shading drape_shading_denim = {
    .entry = {.name = "denim",
              .summary = "denim: a twill of indigo threads over white ones, which show on the back",
              .reference = "sheen: Estevez & Kulla 2017"},
    .source = "// A 3/1 twill: each thread along v passes over three along u and under one, shifted by one "
              "from thread to thread, which makes diagonal ridges.\n"
              "vec3 shade(Surface s) {\n"
              "    const float COUNT = 300.0; // threads along the longer side\n"
              "    vec2 q = s.at * COUNT, c = floor(q), f = q - c - 0.5;\n"
              "    bool under = mod(c.x + c.y, 4.0) < 1.0;\n"
              "    float ridge = 0.5 + 0.5 * cos(2.0 * PI * (s.at.x + s.at.y) * COUNT / 4.0), seen = "
              "fine(s.at, COUNT), ridges = fine(s.at, COUNT / 3.0);\n"
              "    vec3 indigo = vec3(0.040, 0.085, 0.190), white = vec3(0.52, 0.55, 0.58);\n"
              "    float worn = noise(vec2(c.x * 0.53, s.at.y * 14.0)) * 0.5 + noise(s.at * vec2(210.0, "
              "60.0)) * 0.5;\n"
              "    float weft = s.side > 0.0 ? 0.11 : 0.50;\n"
              "    float shown = mix(weft, under == (s.side > 0.0) ? 0.27 : weft * 0.75, 0.8 * seen);\n"
              "    vec3 base = mix(indigo, white, shown) * (0.72 + 0.5 * worn) * mix(1.0, 0.80 + 0.32 * "
              "ridge, ridges) * mix(1.0, 1.06 - 0.5 * f.x * f.x, seen);\n"
              "    vec3 lit = base * arriving(s) / PI * 1.75;\n"
              "    return lit + 0.045 * fuzz(s.n, s.v, 0.6) * LAMP * s.sun + 0.020 * s.open * power(1.0 - "
              "dot(s.n, s.v), 3.0);\n"
              "}\n",
};
