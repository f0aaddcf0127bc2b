/*
 * spring.structural: springs that resist stretching: from each node to the next along its row and its column
 * on a grid of rectangles; along all edges of any other mesh.
 */
#include "terms/spring.h"

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    if (cloth->rectangular)
        return drape_spring_build_kind(cloth, DRAPE_SPRING_STRUCTURAL, values, builder);
    return drape_spring_build(&(drape_spring_set){.cloth = cloth}, values, builder);
}

const drape_term_ops drape_term_spring_structural = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "spring.structural",
              .summary =
                  "springs to the next node along rows and columns, on other meshes along edges: E = 1/2 k "
                  "(l - L)^2",
              DRAPE_SPRING_ENTRY},
    .build = build,
    DRAPE_SPRING_OPS,
};
