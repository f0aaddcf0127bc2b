/* spring.bend: springs from each node to the second next along its row and its column, which resist bending
 * as bending shortens them. They shorten with the square of the curvature, so their energy grows with its
 * fourth power, and a flat sheet has no bending stiffness at all. */
#include "terms/spring.h"

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    return drape_spring_build_kind(cloth, DRAPE_SPRING_BEND, values, builder);
}

const drape_term_ops drape_term_spring_bend = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "spring.bend",
              .summary = "springs to the second next node along rows and columns of a square grid: E = 1/2 k "
                         "(l - L)^2",
              DRAPE_SPRING_ENTRY},
    .build = build,
    DRAPE_SPRING_OPS,
};
