/*
 * strain.h: what the membranes of triangles share. Their energy is A/2 e' C e of a strain e = (E11, E22, 2
 * E12) of the triangle, C the law of orthotropic.h. C = sum k l l', so E = A/2 sum k (q - q0)^2, and each
 * square is an element, three per triangle, one after the other. Its first nodes are those of the triangle.
 */
#ifndef DRAPE_TERMS_STRAIN_H
#define DRAPE_TERMS_STRAIN_H

#include "terms/orthotropic.h"
#include "terms/terms.h"

enum { DRAPE_STRAIN_LIST = DRAPE_ORTHOTROPIC_DIRECTION + 1 }; /* the direction is one entry, not three */

#define DRAPE_STRAIN_PARAMS                                                                                  \
    DRAPE_ORTHOTROPIC_PARAMS("N/m", "of the material: its fabric, or E h", "shear",                          \
                             "shear stiffness, a force per length")

/* The first rest data of an element. */
enum { DRAPE_STRAIN_K, DRAPE_STRAIN_Q0, DRAPE_STRAIN_AREA, DRAPE_STRAIN_COUNT };

/* Announces three elements per triangle, and finds the squares k (3), l (3 x 3) of the law C (3 x 3) of a
 * cloth [N/m]. */
drape_status drape_strain_begin(const drape_cloth_view *cloth, const double *values,
                                drape_term_builder *builder, int rest_count, double c[9], double k[3],
                                double l[9]);

/* Weights with which l . e = 1/2 (w11 d1.d1 + w22 d2.d2) + w12 d1.d2 - q0 for a triangle with the sides d1 =
 * x1 - x0, d2 = x2 - x0, from its corners in its plane at rest, flat (3 x 2): w = (w11, w12, w22). */
void drape_strain_weights(const double l[3], const double flat[6], double w[3]);

/* The function check of the term: the area of triangles. */
drape_status drape_strain_check(const drape_elements *el, const double *x, const double *before,
                                const double *internal, drape_fault *fault);

#endif
