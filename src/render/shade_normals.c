/* shade_normals.c: the direction of the normal as a colour. */
#include "render/shading.h"

const drape_shading drape_shading_normals = {
    .entry =
        {.name = "normals",
         .summary =
             "the direction of the normal as a colour: x red, y green, z blue, of the side that is seen"},
    .source = "vec3 shade(Surface s) {\n"
              "    vec3 c = 0.5 + 0.5 * s.n;\n"
              "    return pow(c, vec3(2.2)); // the picture is sRGB: readers see 0.5 + 0.5 n\n"
              "}\n",
};
