/* spring.shear: springs along both diagonals of each cell of a square grid. Springs along rows and columns
 * alone do not resist shear. */
#include "terms/spring.h"

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    return drape_spring_build_kind(cloth, DRAPE_SPRING_SHEAR, values, builder);
}

const drape_term_ops drape_term_spring_shear = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "spring.shear",
              .summary = "springs along both diagonals of each cell of a square grid: E = 1/2 k (l - L)^2",
              DRAPE_SPRING_ENTRY},
    .build = build,
    DRAPE_SPRING_OPS,
};
