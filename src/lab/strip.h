/* strip.h: what references on strips and plates share: scenes, and where ends are. */
#ifndef DRAPE_LAB_STRIP_H
#define DRAPE_LAB_STRIP_H

#include "lab/validate.h"

#define STRIP_RIGIDITY 1e-4 /* B = E h^3/12 [N m] of all strips here; their length is 1 m */
#define STRIP_DENSITY  0.1  /* [kg/m2] */

/* A strip along x on an irregular mesh, its left end clamped, at rest under loads. */
typedef struct strip {
    int columns, rows;
    double width, thickness, poisson, tolerance;
    const char *orientation; /* "horizontal", or "vertical": its width stands upright */
    double gravity[3];       /* [m/s2] */
    const char *terms;       /* after stretch.cst and bend.midedge, each after a comma */
    const char *bend;        /* bend.midedge with settings; NULL: without */
} strip;

int strip_scene(const strip *s, char *text, size_t size);

/* The gravity that makes G = rho g L^3/B. */
double strip_gravity(double weight);

/* Advances to the end of the scene. */
drape_status lab_advance(drape_reference_run *run);

/* The equilibrium that is near the state of the sim, by "static", into x (node_count x 3). */
drape_status lab_settle(drape_reference_run *run, double *x);

/* The mean position of the nodes that had the largest x at rest. */
void lab_tip(const drape_reference_run *run, double tip[3]);

/* Of the equilibrium that was found: how many modes are unstable; DRAPE_E_SOLVER if it is not known. */
drape_status lab_unstable_modes(drape_reference_run *run, double *value);

/* The deflection along -y in the middle (x, z) of a plate: of the quadratic through the nodes around. */
double lab_deflection(const drape_reference_run *run, double x, double z);

#endif
