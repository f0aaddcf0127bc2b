/* fabrics.h: measured fabrics that a material may name. */
#ifndef DRAPE_COMPILE_FABRICS_H
#define DRAPE_COMPILE_FABRICS_H

#include "drape/extend.h"

/* What was published of a fabric; NaN: it was not. */
typedef struct drape_fabric {
    const char *name, *what, *source;
    double areal_density; /* [kg/m2] */
    struct {
        double warp, weft, coupling, shear; /* C of Green's strain (E11, E22, 2 E12) [N/m] */
    } tension;
    struct {
        double warp, weft, diagonal; /* rigidity of strips [N m] */
    } bending;
    double drape; /* drape coefficient of the tester [1] */
} drape_fabric;

extern const drape_fabric drape_fabrics[]; /* the first is none, the last has no name */
extern const char *const drape_fabric_names[];

/* What terms take, with what was not published derived: tension 1e4 N/m, shear 34.4 N/m, no coupling; a twist
 * as that of an isotropic sheet. */
void drape_fabric_tension(const drape_fabric *fabric, drape_woven *tension);
void drape_fabric_bending(const drape_fabric *fabric, drape_woven *bending);

#endif
