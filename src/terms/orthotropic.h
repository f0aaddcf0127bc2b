/*
 * orthotropic.h: the elastic law of a woven sheet, in tension or in bending: energy per area 1/2 s' C s of
 * s = (s11, s22, 2 s12), with the axes along warp and weft,
 *     C = [c11 c12 0; c12 c22 0; 0 0 c66],
 *     c11 = warp/(1 - nu^2), c22 = weft/(1 - nu^2), c12 = nu sqrt(c11 c22)
 * where warp and weft are the stiffnesses of strips with free sides, as they are measured, and nu^2 = nu12
 * nu21. Equal stiffnesses and c66 = (1 - nu)/2 c11 are an isotropic sheet.
 */
#ifndef DRAPE_TERMS_ORTHOTROPIC_H
#define DRAPE_TERMS_ORTHOTROPIC_H

#include "drape/extend.h"

/* The parameters of the law among the values of a term. */
enum {
    DRAPE_ORTHOTROPIC_WARP,
    DRAPE_ORTHOTROPIC_WEFT,
    DRAPE_ORTHOTROPIC_SHEAR,
    DRAPE_ORTHOTROPIC_POISSON,
    DRAPE_ORTHOTROPIC_DIRECTION,
    DRAPE_ORTHOTROPIC_COUNT = DRAPE_ORTHOTROPIC_DIRECTION + 3
};

/* C (3 x 3) from values. Values that are NaN are replaced by measured ones; if measured is NULL, by those of
 * an isotropic sheet with the stiffness `strip` of a strip and the Poisson ratio. */
void drape_orthotropic_law(const double *values, const drape_woven *measured, double strip, double poisson,
                           double c[9]);

/* Two orthonormal axes (3 each) in the plane of a triangle at rest, the first along the projection of the
 * warp, and the corners in them (3 x 2), the first at 0. Returns false if the warp is normal to the plane,
 * unless the law is isotropic: then the first axis is along an edge. */
bool drape_orthotropic_frame(const double *values, const drape_cloth_view *cloth, int32_t triangle,
                             const double c[9], double axes[6], double flat[6]);

/* Reports that drape_orthotropic_frame returned false for a triangle. */
drape_status drape_orthotropic_refuse(drape_term_builder *builder, int32_t triangle);

/* C = sum k_i l_i l_i', by `rank` (at most 3) pairs k > 0, l (3), in the order of the largest pivots. */
void drape_orthotropic_squares(const double c[9], int rank, double k[3], double l[9]);

/* Replaces C by the law of the minimum of the energy over s + f t for all t (count, at most 2): the columns f
 * (count x 3) then do no work. */
void drape_orthotropic_release(double c[9], const double *f, int count);

/* The parameters: the unit of warp, weft and shear, and what they are by default. */
#define DRAPE_ORTHOTROPIC_PARAMS(unit, of, shear_name, shear_of)                                             \
    [DRAPE_ORTHOTROPIC_WARP] = DRAPE_NUMBER("warp", unit, DRAPE_DERIVED(of), DRAPE_ABOVE(0), 1e15,           \
                                            "stiffness of a strip along the warp, its sides free"),          \
    [DRAPE_ORTHOTROPIC_WEFT] = DRAPE_NUMBER("weft", unit, DRAPE_DERIVED(of), DRAPE_ABOVE(0), 1e15,           \
                                            "stiffness of a strip along the weft"),                          \
    [DRAPE_ORTHOTROPIC_SHEAR] =                                                                              \
        DRAPE_NUMBER(shear_name, unit,                                                                       \
                     DRAPE_DERIVED("of the fabric, or sqrt(warp weft)/(2 (1 + poisson)), as if isotropic"),  \
                     DRAPE_ABOVE(0), 1e15, shear_of),                                                        \
    [DRAPE_ORTHOTROPIC_POISSON] =                                                                            \
        DRAPE_NUMBER("poisson", "1", DRAPE_DERIVED("of the fabric, or poisson_ratio"), DRAPE_ABOVE(-1),      \
                     DRAPE_BELOW(1), "Poisson's ratio sqrt(nu12 nu21) of warp and weft"),                    \
    [DRAPE_ORTHOTROPIC_DIRECTION] =                                                                          \
        DRAPE_VECTOR("warp_direction", "1", 0, -1e9, 1e9, "direction of the warp at rest; 0 0 0: x")

#endif
