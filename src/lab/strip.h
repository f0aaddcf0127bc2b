/* strip.h: what several references share: scenes of strips, and measurements. */
#ifndef DRAPE_LAB_STRIP_H
#define DRAPE_LAB_STRIP_H

#include "lab/validate.h"

#define STRIP_RIGIDITY 1e-4 /* B = E h^3/12 [N m] of all strips here; their length is 1 m */
#define STRIP_DENSITY  0.1  /* [kg/m2] */

/* A strip along x on an irregular mesh, its left end clamped, at rest under loads. */
typedef struct strip {
    int columns, rows;
    double width, thickness, poisson, tolerance;
    bool upright;      /* its width is vertical */
    double gravity[3]; /* [m/s2] */
    const char *terms; /* besides stretch.cst; NULL: bend.midedge */
} strip;

int strip_scene(const strip *s, char text[DRAPE_LAB_TEXT]);
#define STRIP_SCENE(text, ...) strip_scene(&(strip){__VA_ARGS__}, text)

/* The gravity that makes G = rho g L^3/B. */
double strip_gravity(double weight);

/* Advances to the end of the scene. */
drape_status lab_advance(drape_reference_run *run);

/* The same, and the mean position of the nodes that had the largest x at rest; its -y; its angle [degree]
 * below the x axis. */
drape_status lab_tip(drape_reference_run *run, double tip[3]);
drape_status lab_sinking(drape_reference_run *run, double *value);
drape_status lab_chord(drape_reference_run *run, double *value);

/* Sets the sim to the equilibrium near its state, found by "static", with velocities v (node_count x 3). */
drape_status lab_settle(drape_reference_run *run, const double *v);

/* Advances, and counts the unstable modes of the equilibrium that was found; DRAPE_E_SOLVER if that is not
 * known. */
drape_status lab_unstable_modes(drape_reference_run *run, double *value);

#endif
