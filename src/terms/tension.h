/*
 * tension.h: the relaxed law of a membrane that wrinkles instead of bearing compression (Pipkin 1986, The
 * relaxed energy density for isotropic elastic membranes; Pipkin 1994, Relaxed energy densities for large
 * deformations of membranes; Steigmann 1990, Tension-field theory). With Green's strain e = (E11, E22, 2 E12)
 * and the law C of orthotropic.h,
 *     W(e) = min 1/2 (e + s)' C (e + s)  over all s that are positive semidefinite as matrices:
 * s is the strain that is taken up in wrinkles finer than any mesh. The stress T = C (e + s) at the minimum
 * is positive semidefinite, and T : s = 0. So the membrane is
 *     taut      s = 0            where C e is positive semidefinite,
 *     slack     s = -e, T = 0    where -e is, and
 *     wrinkled  s = a m m', T = t n n', a, t > 0, n normal to m, everywhere else.
 * W is convex with the gradient T, which is continuous. Its second derivative is C where taut, 0 where slack,
 * and where wrinkled, from the minimum over a and the direction of m,
 *     C - C B (B' C B + diag(0, 2 t/a))^-1 B' C,  B = (M, N), M = m m' and N = m n' + n m' as strains.
 */
#ifndef DRAPE_TERMS_TENSION_H
#define DRAPE_TERMS_TENSION_H

typedef enum drape_tension_state { DRAPE_TAUT, DRAPE_WRINKLED, DRAPE_SLACK } drape_tension_state;

typedef struct drape_tension {
    drape_tension_state state;
    double energy;     /* W [J/m2] */
    double stress[3];  /* T11, T22, T12 [N/m] */
    double tangent[9]; /* dT/de (3 x 3), positive semidefinite */
} drape_tension;

/* c (3 x 3) as of drape_orthotropic_law, e (3). */
void drape_tension_relax(const double c[9], const double e[3], drape_tension *out);

#endif
