/* shade_texture.c: a picture on the cloth. */
#include "render/shading.h"

const drape_shading drape_shading_texture = {
    .entry = {.name = "texture",
              .summary = "a picture on the cloth: --texture, by default checks with a letter"},
    .reads = DRAPE_READS_PATTERN,
    .source = "vec3 shade(Surface s) { return texture(picture, s.at).rgb * arriving(s) / PI * 1.75; }\n",
};
