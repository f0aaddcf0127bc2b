/* sheet.h: what references share: the text of a scene of one cloth, and measurements. */
#ifndef DRAPE_LAB_SHEET_H
#define DRAPE_LAB_SHEET_H

#include "base/pi.h"
#include "drape/lab.h"
#include "lab/reference.h"

#define DEGREE  (DRAPE_PI / 180)
#define GRAVITY 9.81 /* [m/s2] */

/* A scene of one cloth. Members that are 0 have the defaults given here, or are not in the scene. Texts are
 * JSON, in which ' stands for ", and go into the text of the scene as they are. */
struct lab_sheet {
    const char *grid; /* default: irregular */
    int columns, rows;
    double width, height; /* [m] of the grid */
    const char *mesh;     /* its other members */
    /* Of the material, all four of them if there is a modulus. */
    double young_modulus, poisson_ratio, thickness, areal_density;
    const char *material; /* its other members */
    const char *terms;    /* default: 'stretch.cst', 'bend.midedge' */
    const char *pins, *velocity;
    double gravity[3];
    const char *integrator; /* its members other than dt and tolerance; default: 'method': 'static' */
    double dt, tolerance;
    const char *others; /* other members of the scene */
    double duration;    /* default: 1 */
    /* In what the cases of a reference differ: the parameter or, of a threshold, the load, times this
     * factor. It is each @ in the texts, or the number at this offset in the sheet. */
    double factor;
    size_t varied;
};

/* Writes the text for a parameter or load; returns its length. */
int lab_sheet_text(const lab_sheet *sheet, double value, char text[DRAPE_LAB_TEXT]);

/* The sheet of all cases, in an initialiser of drape_reference; of one, in its function `scene`. */
#define SHEET(...)            .sheet = (&(const lab_sheet){__VA_ARGS__})
#define SHEET_TEXT(text, ...) lab_sheet_text(&(lab_sheet){__VA_ARGS__}, 1, text)
#define VARIED(member, by)    .varied = offsetof(lab_sheet, member), .factor = (by)

/* A member of a sheet with values in it, valid to the end of the block. */
const char *lab_sheet_format(char text[400], const char *format, ...) __attribute__((format(printf, 2, 3)));
#define SHEET_FORMAT(...) lab_sheet_format((char[400]){0}, __VA_ARGS__)

/* Members of the sheet of a strip along x, of length 1 m, thickness h and rigidity B = E h^3/12; clamped at
 * its left end. */
#define STRIP_RIGIDITY 1e-4 /* [N m] */
#define STRIP_DENSITY  0.1  /* [kg/m2] */
#define FREE_STRIP(h)                                                                                        \
    .width = 1, .young_modulus = 12 * STRIP_RIGIDITY / ((h) * (h) * (h)), .thickness = (h),                  \
    .areal_density = STRIP_DENSITY
#define STRIP(h) FREE_STRIP(h), .pins = "{'edge': 'left', 'clamp': true}"

/* The angle [degree] below the horizontal of the chord to the tip of an inextensible rod of G = 8, clamped
 * horizontally. */
#define ROD_CHORD 41.487302559378328

/* The gravity that makes G = rho g L^3/B. */
#define STRIP_GRAVITY(weight) ((weight)*STRIP_RIGIDITY / STRIP_DENSITY)

/* Advances to the end of the scene. */
drape_status lab_advance(drape_reference_run *run);

/* The mean position of the nodes that had the largest x at rest; its y; its -y; its angle [degree] below the
 * x axis. */
void lab_tip(const drape_reference_run *run, double tip[3]);
double lab_rise(const drape_reference_run *run);
double lab_sinking(const drape_reference_run *run);
double lab_chord(const drape_reference_run *run);

/* The mean over all nodes of component k of positions or velocities (node_count x 3). */
double lab_mean(const drape_reference_run *run, const double *values, size_t k);

/* The displacement of a node along an axis. The constants are pairs, one of each case:
 * the node, and the axis as 1, 2 or 3, below 0 for the displacement against it. */
double lab_displacement(const drape_reference_run *run);

/* The sum of the forces of the pins [N] on the nodes whose component k was `at` at rest. */
drape_status lab_pull(drape_reference_run *run, size_t k, double at, double force[3]);

/* Sets the sim to the equilibrium near its state, found by "static", with velocities v (node_count x 3). */
drape_status lab_settle(drape_reference_run *run, const double *v);

/* Advances, and counts the unstable modes of the equilibrium that was found; DRAPE_E_SOLVER if that is not
 * known. */
drape_status lab_unstable_modes(drape_reference_run *run, double *value);

/* Advances, and measures omega [rad/s] of the mode whose number is the parameter, of those that move the
 * scene along an axis. Constants: the axis (1, 2 or 3; 0: all modes count), how many modes are computed, and
 * by what omega is multiplied. */
drape_status lab_omega(drape_reference_run *run, double *value);

#endif
