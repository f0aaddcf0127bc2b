/* fabric.h: the virtual tests of measured fabrics: each is a row of their table alone, and gives back what it says. */
#ifndef DRAPE_LAB_FABRIC_H
#define DRAPE_LAB_FABRIC_H

#include "compile/fabrics.h"
#include "compile/fabrics_table.h"
#include "lab/validate.h"

#define FABRIC_GRAVITY 9.81 /* [m/s2] */

extern const double
    fabric_places[]; /* (DRAPE_FABRIC_COUNT) 1, 2 ...: places in the table, parameters of cases */

const drape_fabric *fabric_at(double place);

/* ASTM D1388: a strip along the warp or the weft, of twice the bending length (B/(rho g))^(1/3), pushed over an edge. */
int fabric_cantilever(double place, bool weft, char *text, size_t size);

/* The angle [degree] of the chord to its end: that of G = rho g L^3/B = 8 by the rod, and in the scene. */
double fabric_chord(double place);
drape_status fabric_measure_chord(drape_reference_run *run, double *value);

/* A strip of 1 m that hangs from its upper edge, along the warp or the weft, under gravity and a pull at its lower edge
 * [N/m]. */
int fabric_hung(double place, bool weft, double gravity, double pull, char *text, size_t size);

/* How much longer it became: the mean over its lower edge [m]. */
drape_status fabric_measure_lengthening(drape_reference_run *run, double *value);

/* The stretch less 1 of Green's strain, K l (l^2 - 1)/2 = force per width. */
double fabric_strain(double stiffness, double force);

/* What rows of these tests have in common. */
#define FABRIC_CASES                                                                                         \
    .parameter = "fabric, by its place", .parameters = fabric_places, .case_count = DRAPE_FABRIC_COUNT

/* The same of the two cantilevers. */
#define FABRIC_CANTILEVER                                                                                    \
    .unit = "degree", FABRIC_CASES, .model = "stretch.cst, bend.midedge; irregular",                         \
    .entry.reference = "ASTM D1388; the fabric's own", .tolerance = 0.005, .expected = fabric_chord,         \
    .measure = fabric_measure_chord

#endif
