/* fabrics.h: measured fabrics that a material may name. */
#ifndef DRAPE_COMPILE_FABRICS_H
#define DRAPE_COMPILE_FABRICS_H

typedef struct drape_fabric {
    const char *name;
    double areal_density;        /* [kg/m2] */
    double warp, weft, diagonal; /* bending rigidity of strips [N m] */
} drape_fabric;

extern const drape_fabric drape_fabrics[]; /* the first is none */
extern const char *const drape_fabric_names[];

double drape_fabric_twist(const drape_fabric *fabric); /* torsional rigidity [N m] */

#endif
