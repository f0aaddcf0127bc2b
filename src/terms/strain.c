/* strain.c: see strain.h. */
#include "terms/strain.h"

#include "base/vec3.h"

drape_status drape_strain_begin(const drape_cloth_view *cloth, const double *values,
                                drape_term_builder *builder, int rest_count, double c[9], double k[3],
                                double l[9])
{
    if (cloth->triangle_count > INT32_MAX / 3)
        return drape_term_refuse(builder, "the mesh has %d triangles; at most %d", (int)cloth->triangle_count,
                                 INT32_MAX / 3);
    drape_orthotropic_law(values, cloth->tension, cloth->material->membrane_stiffness,
                          cloth->material->poisson_ratio, c);
    drape_orthotropic_squares(c, 3, k, l);
    return drape_term_reserve(builder, 3 * cloth->triangle_count, rest_count);
}

void drape_strain_weights(const double l[3], const double flat[6], double w[3])
{
    const double twice = flat[2] * flat[5] - flat[3] * flat[4];
    const double b1[2] = {flat[5] / twice, -flat[4] / twice}, b2[2] = {-flat[3] / twice, flat[2] / twice};
    w[0] = l[0] * b1[0] * b1[0] + l[1] * b1[1] * b1[1] + 2 * l[2] * b1[0] * b1[1];
    w[1] = l[0] * b1[0] * b2[0] + l[1] * b1[1] * b2[1] + l[2] * (b1[0] * b2[1] + b1[1] * b2[0]);
    w[2] = l[0] * b2[0] * b2[0] + l[1] * b2[1] * b2[1] + 2 * l[2] * b2[0] * b2[1];
}

/* Area over rest area. */
static double ratio_of(const drape_elements *el, int32_t element, const double *x)
{
    const int32_t *node = el->node + (size_t)element * (size_t)el->nodes;
    double area[3];
    vec3_triangle_area(node, x, area);
    return vec3_norm(area) / 2 / drape_rest_of(el, DRAPE_STRAIN_AREA, element);
}

drape_status drape_strain_check(const drape_elements *el, const double *x, const double *before,
                                const double *internal, drape_fault *fault)
{
    (void)internal;
    return drape_check_ratios(el, x, before, 3, ratio_of, DRAPE_REASON_AREA_COLLAPSE, "area / rest area",
                              fault);
}
