/*
 * ivp.h: the test set of initial value problems: scenes with a horizon, up to which they are predictable,
 * and a reference on which two unrelated families of methods agree. Beside DIR/NAME.json of a scene stand
 *
 *     DIR/references/NAME.npy   positions, (times x nodes x 3) float64, at k/frame_rate for k = 1 to the end
 *     DIR/references/NAME.json  {"scene_hash", "data_hash", "times_s", "size_m", "error", "method", ...}
 *     DIR/horizons/NAME.json    {"scene_hash", "horizon_s", "t_s", "growth", ...}
 *
 * The size of a scene, to which errors are relative, is the diagonal of its rest bounding box. Errors are
 * root mean squares over the free nodes of their distances.
 */
#ifndef DRAPE_LAB_IVP_H
#define DRAPE_LAB_IVP_H

#include "drape/lab.h"
#include "integrators/integrator.h"
#include "lab/trace.h"

#include <jansson.h>
#include <stdio.h>

/* A scene of the set, or one that may become one. Its memory is in the arena that it was opened with. */
typedef struct lab_ivp {
    drape_arena *arena;
    const char *path, *stem; /* "DIR/NAME.json", "NAME" */
    const char *name;        /* the same, printable */
    drape_lab_def def;       /* of runs of the scene; the caller may set def.cancel */
    char hash[17];           /* of the scene and the files that it names */
    drape_model *model;      /* to be closed */
    double size;             /* [m] */
    double node_mass;        /* [kg] mean */
    bool contact;            /* with colliders or of cloth with itself */
    double interval;         /* [s] between the times */
    double *times;           /* (time_count) [s] */
    size_t time_count;
    lab_trace reference; /* a frame for each time; none: not read */
    double error;        /* of the reference, relative to the size */
} lab_ivp;

/* Loads and compiles a scene. Call lab_ivp_close in any case. Errors: those of loading; DRAPE_E_ARGUMENT (its
 * duration is not a whole number of frames, 2 to 1000). */
drape_status lab_ivp_open(drape_arena *arena, const char *path, lab_ivp *s);
void lab_ivp_close(lab_ivp *s);

/* Reads the reference. Errors: DRAPE_E_FILE, DRAPE_E_PARSE (it is of another version of the scene, or its
 * data are not those that its JSON describes). */
drape_status lab_ivp_read_reference(lab_ivp *s);

/* Reads the horizon as JSON, NULL if there is none for this version of the scene. The caller owns it. */
json_t *lab_ivp_read_horizon(const lab_ivp *s);

/* Whether an integrator solves the equations of the scene: not if it moves nodes out of contact. */
bool lab_ivp_admits(const lab_ivp *s, const drape_integrator_ops *integrator);

/* A bound on the residual of a node [N] under which what Newton's method leaves in each step is small beside
 * the error of a method of that order with steps of dt: it falls as dt^order. */
double lab_ivp_tolerance(const lab_ivp *s, int order, double dt);

/* Computes the reference with every family of methods that the build has and that admits the scene, and
 * prints what each reached. seconds: CPU time that a family may take. check: compares it with the one that
 * is stored; else stores it. Errors: those of running, DRAPE_E_SOLVER (no two families agree to 1e-8, or
 * with contact to 1e-5, or the stored one differs by more than both errors together), DRAPE_E_FILE. */
drape_status lab_ivp_reference(lab_ivp *s, double seconds, bool check, FILE *out);

/* Measures the growth of a perturbation of 1e-10 of the size over twice the duration, stores it, and
 * prints the horizon: the time up to which it grows less than 1e4-fold. *within: whether the duration is.
 * Errors: those of running, DRAPE_E_FILE. */
drape_status lab_ivp_horizon(const lab_ivp *s, bool *within, FILE *out);

/* Compares positions in an NPY file, (times x nodes x 3) float64 at the times of the reference, or with the
 * start before, with the reference, and prints their errors, as text or as JSON. Errors: DRAPE_E_FILE,
 * DRAPE_E_PARSE (another shape or type), DRAPE_E_MEMORY. */
drape_status lab_ivp_score(const lab_ivp *s, const char *path, bool json, FILE *out);

/* Writes what another program needs into a folder: start.obj, nodes.csv, pins.csv, times.csv, scene.json,
 * reference.npy. Errors: DRAPE_E_FILE, DRAPE_E_ARGUMENT (the folder has files of others). */
drape_status lab_ivp_export(const lab_ivp *s, const char *folder, FILE *out);

#endif
