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

#endif
