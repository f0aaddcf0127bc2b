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
        double warp, weft, diagonal; /* rigidity of strips [N m] */
    } bending;
    double drape; /* drape coefficient from a drape tester [1] */
} drape_fabric;

extern const drape_fabric drape_fabrics[]; /* the first is "none"; terminated by one whose name is NULL */
extern const char *const drape_fabric_names[];

/* Compute the values that terms use. Unpublished ones are derived: tension 1e4 N/m, shear 34.4 N/m, no
 * coupling, and the twist of an isotropic sheet. */
void drape_fabric_tension(const drape_fabric *fabric, drape_woven *tension);
void drape_fabric_bending(const drape_fabric *fabric, drape_woven *bending);

#endif
