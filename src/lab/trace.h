/* trace.h: positions of a run, to compare others with: at its frames, or at material points. */
#ifndef DRAPE_LAB_TRACE_H
#define DRAPE_LAB_TRACE_H

#include "base/arena.h"

/* Frames of positions; all zero: none. */
typedef struct lab_trace {
    size_t size; /* doubles a frame */
    int64_t frames, room;
    double *x; /* in an arena */
} lab_trace;

drape_status lab_trace_create(drape_arena *arena, size_t size, int64_t room, lab_trace *trace);
void lab_trace_add(lab_trace *trace, const double *x); /* ignored if the trace is full */
const double *lab_trace_end(const lab_trace *trace);   /* the last frame; there is one */

/* Root of the mean, over the free nodes, of the square of the distance between two arrays of positions. */
double lab_distance(const drape_model *model, const double *a, const double *b);

/* The number of correct digits of x beside y as the test set of Bari has it (mescd; Mazzia & Magherini 2008):
 * -log10 of the largest component of the error, each relative to the size of the scene plus the
 * displacement. INFINITY: they are the same. */
double lab_correct_digits(const drape_model *model, const double *x, const double *y);

/* Material points: where the nodes of one mesh lie in the rest shape of another, finer one of the same
 * cloth. */
typedef struct lab_probe {
    size_t count;
    double *rest; /* (count x 3) [m], in an arena */
} lab_probe;

/* At the nodes of a model. Errors: DRAPE_E_MEMORY. */
drape_status lab_probe_create(drape_arena *arena, const drape_model *model, lab_probe *probe);

/* The position of point i: linear in the triangle that it lies in, or is nearest to, at rest. */
void lab_probe_take(const lab_probe *probe, size_t i, const drape_model *model, const double *x,
                    double out[3]);

#endif
