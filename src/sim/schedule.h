/*
 * schedule.h: which steps a sim takes.
 *
 * Counted: steps end at start + k dt, counted and never summed. An interval between two such times may be
 * split in 2^level equal parts after a rejection; the parts end at exact fractions of it. Only the end of
 * an advance cuts an interval, and a remainder below 1e-9 dt joins the interval before.
 *
 * Proposed: the controller says how large the next step is; only the end of an advance cuts it.
 *
 * Free: the integrator chooses. It is told where the end is, and after a rejection a bound on its next step.
 */
#ifndef DRAPE_SIM_SCHEDULE_H
#define DRAPE_SIM_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

typedef enum drape_stepping { DRAPE_STEPS_COUNTED, DRAPE_STEPS_PROPOSED, DRAPE_STEPS_FREE } drape_stepping;

typedef struct drape_schedule {
    drape_stepping stepping;
    double end;    /* [s] of this advance */
    double now;    /* [s] where it came */
    double dt;     /* [s] counted: the interval; proposed: the first step */
    double limit;  /* [s] proposed: the next step; free: an upper bound */
    double tried;  /* [s] the step that was handed out last */
    double start;  /* [s] counted: intervals are counted from here */
    int64_t count; /* intervals done since start */
    int level;     /* the interval has 2^level parts */
    int64_t part;  /* parts of it done */
    double interval_start, interval_end, interval_size;
    bool stepped; /* a step was accepted: a remainder has a step to join */
    bool anew;    /* the interval ends at no counted time: the next count starts at its end */
    /* Steps tried within one dt; of an advance, so that it begins anew in the next one, and is in no
     * checkpoint. */
    int64_t tries;
    double tries_from; /* [s] */
} drape_schedule;

void drape_schedule_init(drape_schedule *schedule, drape_stepping stepping, double dt, double start);

/* Sets the end of an advance. An interval that was left half done goes on where the end is the same, else it
 * is given up: counting starts where it came. */
void drape_schedule_aim(drape_schedule *schedule, double end);

/* The next step: its end and its size. False when the end is reached. */
bool drape_schedule_next(drape_schedule *schedule, double *t1, double *h);

/* A step to t1 was accepted; h_next counts where steps are proposed. */
void drape_schedule_accept(drape_schedule *schedule, double t1, double h_next);

/* A step was rejected: h_next next, which is half of it where steps are counted. False where no step is left
 * to try: an interval cannot be split further (2^60 parts), or h_next is no smaller than what was rejected.
 * So whatever a controller says, a step is never tried again at its size. */
bool drape_schedule_retry(drape_schedule *schedule, double h_next);

#endif
