/*
 * series.h: experiments whose cases are integrators over a value of their settings, the knob: how such cases
 * are planned, and how they are read once they are done. A series is an integrator, with what else it is run
 * with, over one knob; its cases stand side by side.
 */
#ifndef DRAPE_LAB_SERIES_H
#define DRAPE_LAB_SERIES_H

#include "lab/figure.h"

/* ---- Plans ---- */

/* A value of a knob. Cases of low rank are run first. */
typedef struct lab_level {
    double value;
    int rank; /* below 0: as 0 */
} lab_level;

typedef struct lab_levels {
    const lab_level *at;
    size_t count;
} lab_levels;

/* Those of an array. */
#define LAB_LEVELS(array)                                                                                    \
    {                                                                                                        \
        array, sizeof(array) / sizeof *(array)                                                               \
    }

/* A case. */
typedef struct lab_point {
    const char *scene; /* its name; NULL: there is only one */
    const char *series;
    const char *integrator;
    const char *pointer; /* to the value of the scene that the knob sets; NULL: `more` does that */
    const char *knob;    /* its name; NULL: the last part of the pointer */
    lab_level level;
    json_t *more; /* further settings; the reference is taken */
} lab_point;

drape_status lab_add_point(lab *l, const lab_point *point);

/* The values that integrators are run with: those that choose their steps over rtol, at every order that they
 * are limited to; others over dt, and over rtol under each controller that bounds an error. */
typedef struct lab_grid {
    const char *scene, *knob; /* as of a point */
    lab_levels rtols, steps, controlled;
    double first_step;     /* [s] dt under a controller */
    bool only_if_implicit; /* no controllers for explicit integrators */
    /* Adds settings of a method of fixed steps, dt or, under a controller with rtol, dt = NAN. NULL: there
     * are none. */
    void (*add)(const void *user, const drape_integrator_ops *integrator, double dt, double rtol,
                json_t *settings);
    const void *user;
} lab_grid;

drape_status lab_add_integrator(lab *l, const lab_grid *grid, const drape_integrator_ops *integrator);

/* ---- Results ---- */

typedef struct lab_series {
    const char *scene, *name, *integrator, *knob;
    size_t variant;         /* how many series of the same integrator come right before it */
    const json_t **results; /* (count) of its cases that were run, in the order of the plan */
    size_t count;
} lab_series;

/* The series of a scene, or of all (NULL), in the order of the plan. In the arena; NULL: out of memory. */
lab_series *lab_list_series(lab *l, const char *scene, size_t *count);

/* A figure of series, a curve each, over logarithmic axes. */
typedef struct lab_chart {
    const char *name, *title, *caption; /* NULL: no title; the caption is y_label */
    const char *x, *y;                  /* the results that are shown */
    const char *knob; /* only series over this one, over its values instead of x; NULL: all */
    const char *x_label, *y_label;
    const char *negative; /* what y < 0 means: open markers at its magnitude; NULL: these are left out */
    int orders;           /* as of lab_figure_fit */
    bool (*shows)(const json_t *result);
} lab_chart;

drape_status lab_draw_series(lab *l, const lab_chart *chart, const lab_series *list, size_t count);

/* "dt 1/60 s", "rtol 0.001" */
void lab_knob_text(const json_t *result, char text[64]);

#endif
