/* shade_linen.c: a plain weave of uneven threads. */
#include "render/shading.h"

const drape_shading drape_shading_linen = {
    .entry = {.name = "linen",
              .summary = "linen: a plain weave of uneven threads, matt with a soft outline",
              .reference = "sheen: Estevez & Kulla 2017"},
    .source = "// A plain weave: threads along u over and under those along v. Some threads are thicker and "
              "lighter.\n"
              "vec3 shade(Surface s) {\n"
              "    const float COUNT = 190.0; // threads along the longer side\n"
              "    vec2 q = s.at * COUNT, c = floor(q), f = q - c - 0.5;\n"
              "    bool over = mod(c.x + c.y, 2.0) < 1.0;\n"
              "    float across = over ? f.y : f.x, thread = 1.0 - 1.7 * across * across;\n"
              "    float seen = fine(s.at, COUNT);\n"
              "    float slub = noise(vec2(s.at.x * 9.0, c.y * 0.71)) + noise(vec2(c.x * 0.71, s.at.y * 9.0 "
              "+ 40.0));\n"
              "    float cloudy = noise(s.at * vec2(30.0, 160.0)) + noise(s.at * vec2(160.0, 30.0) + 7.0);\n"
              "    float tone = mix(1.0, 0.62 + 0.42 * thread, 0.55 * seen) * (0.88 + 0.075 * slub + 0.055 * "
              "cloudy);\n"
              "    vec3 undyed = s.side > 0.0 ? vec3(0.640, 0.540, 0.415) : vec3(0.560, 0.465, 0.350);\n"
              "    vec3 base = (s.piece < 0.5 ? undyed : 1.2 * tint(s)) * tone; // further cloths are dyed\n"
              "    vec3 lit = base * arriving(s) / PI * 1.40;\n"
              "    return lit + base * (0.55 * fuzz(s.n, s.v, 0.55) * LAMP * s.sun + 0.10 * s.open * "
              "power(1.0 - dot(s.n, s.v), 3.0));\n"
              "}\n",
};
