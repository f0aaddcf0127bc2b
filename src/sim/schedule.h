/*
 * schedule.h: the steps that a sim takes.
 *
 * Counted: steps end at start + k dt, computed from the count and never summed. An interval between two
 * such times may be split into 2^level equal parts after a rejection; the parts end at exact fractions of
 * it. Only the end of an advance cuts an interval, and a remainder below 1e-9 dt is joined to the interval
 * before it.
 *
 * Proposed: the controller sets the size of the next step; only the end of an advance cuts it.
 *
 * Free: the integrator chooses its steps. It is given the end and, after a rejection, a bound on its next
 * step.
 */
#ifndef DRAPE_SIM_SCHEDULE_H
#define DRAPE_SIM_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

#define DRAPE_SCHEDULE_LEVELS 60 /* the number of parts of an interval is a 64-bit integer */

typedef enum drape_stepping { DRAPE_STEPS_COUNTED, DRAPE_STEPS_PROPOSED, DRAPE_STEPS_FREE } drape_stepping;

typedef struct drape_schedule {
    drape_stepping stepping;
    double end;    /* [s] of this advance */
    double now;    /* [s] the end of the last accepted step */
    double dt;     /* [s] counted: the interval; proposed: the first step */
    double limit;  /* [s] proposed: the next step; free: an upper bound */
    double tried;  /* [s] the size of the last step returned */
    double start;  /* [s] counted: the time at which count is 0 */
    int64_t count; /* intervals completed since start */
    int level;     /* the interval has 2^level parts */
    int64_t part;  /* completed parts of the interval */
    double interval_start, interval_end, interval_size;
    bool stepped;   /* a step was accepted, to which a remainder can be joined */
    bool anew;      /* the interval does not end at a counted time, so counting restarts at its end */
    bool cut;       /* the next steps end at cut_end, and an interval that is cut ends there */
    double cut_end; /* [s] */
    /* Attempts within one dt. They belong to one advance: the next one starts from 0, and checkpoints do
     * not contain them. */
    int64_t tries;
    double tries_from; /* [s] */
} drape_schedule;

void drape_schedule_init(drape_schedule *schedule, drape_stepping stepping, double dt, double start);

/* Sets the end of an advance. A partly completed or cut interval is continued if the end is the same;
 * otherwise it is abandoned, and counting restarts at the present time. */
void drape_schedule_aim(drape_schedule *schedule, double end);

/* The next step: its end and its size. False if the end is reached. */
bool drape_schedule_next(drape_schedule *schedule, double *t1, double *h);

/* A step to t1 was accepted. h_next is used only if steps are proposed, and grow, which lets the parts of an
 * interval become larger again, only if they are counted. */
void drape_schedule_accept(drape_schedule *schedule, double t1, double h_next, bool grow);

/* A step was rejected; the next one has the size h_next or, if steps are counted, half of the rejected one.
 * Returns false if no step is left to try: an interval cannot be split further (2^60 parts), or h_next is
 * not smaller than the rejected step. So a step is never retried at the same size, whatever a controller
 * returns. */
bool drape_schedule_retry(drape_schedule *schedule, double h_next);

/* A step is not accepted because it shall end at another time, after the present one: the next steps lead
 * there. Counting then restarts there, as at the end of an advance. */
void drape_schedule_cut(drape_schedule *schedule, double end);

/* A step was rejected, and the same one is tried again because its equations have changed. */
void drape_schedule_repeat(drape_schedule *schedule);

#endif
