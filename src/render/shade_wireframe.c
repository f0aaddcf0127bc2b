/* shade_wireframe.c: the mesh as it is. */
#include "render/shading.h"

const drape_shading drape_shading_wireframe = {
    .entry = {.name = "wireframe",
              .summary = "the mesh as it is: its edges red, pinned nodes cyan, hidden lines hidden"},
    .source = "vec3 shade(Surface s) {\n"
              "    return mix(vec3(0.90, 0.91, 0.92), vec3(0.80, 0.78, 0.75), s.side < 0.0 ? 1.0 : 0.0) *\n"
              "           (0.72 + 0.28 * max(0.0, dot(s.n, s.v))) * mix(0.7, 1.0, s.open);\n"
              "}\n",
    .wires = true,
};
