/* fabrics.h: measured fabrics that a material may name. */
#ifndef DRAPE_COMPILE_FABRICS_H
#define DRAPE_COMPILE_FABRICS_H

#include "drape/extend.h"

/* The published data of a fabric; NaN: not published. */
typedef struct drape_fabric {
    const char *name, *what, *source;
    double areal_density; /* [kg/m2] */
    struct {
        double warp, weft, coupling, shear; /* C for Green's strain (E11, E22, 2 E12) [N/m] */
    } tension;
    struct {
        double warp, weft; /* the same of strips that are stretched by 1/6 along warp and weft */
    } stretched;
    struct {
        double warp, weft, diagonal; /* rigidity of strips [N m] */
        double friction;             /* HB, the moment of friction per width [N] */
    } bending;
    double drape; /* drape coefficient from a drape tester [1] */
} drape_fabric;

extern const drape_fabric drape_fabrics[]; /* the first is "none"; terminated by one whose name is NULL */
extern const char *const drape_fabric_names[];

/* Compute the values that terms use. Unpublished ones are derived: tension 1e4 N/m, shear 34.4 N/m, no
 * coupling, and the twist of an isotropic sheet. */
void drape_fabric_tension(const drape_fabric *fabric, drape_woven *tension);
void drape_fabric_bending(const drape_fabric *fabric, drape_woven *bending);

/* The loss factor [1], what a cycle loses over 2 pi times what it stores, and the frequency [rad/s] at which
 * the fabric has it in the model, that of a cantilever as long as bending and weight are equally stiff. Their
 * ratio is the retardation time of damp.kelvin_voigt [s], whose loss factor is proportional to the
 * frequency. */
double drape_fabric_loss(const drape_fabric *fabric);
double drape_fabric_frequency(const drape_fabric *fabric);

/* The points of the tension curve along warp and weft, strain and force per width, of a fabric of which more
 * was measured than the stiffness at rest; returns false for others. */
#define DRAPE_FABRIC_POINTS 16
bool drape_fabric_curves(const drape_fabric *fabric, double warp[2 * DRAPE_FABRIC_POINTS],
                         double weft[2 * DRAPE_FABRIC_POINTS]);

#endif
