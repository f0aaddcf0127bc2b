/*
 * schedule.h: which steps a fixed-step method takes. Steps end at start + k dt, counted and never summed. An
 * interval between two such times may be split in 2^level equal parts after a rejection; the parts end at
 * exact fractions of it. Only the end of an advance cuts an interval, and a remainder below 1e-9 dt joins the
 * interval before.
 */
#ifndef DRAPE_SIM_SCHEDULE_H
#define DRAPE_SIM_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct drape_schedule {
    double dt;         /* [s] 0: the integrator chooses its own steps */
    double now, limit; /* where it came with them; an upper bound after a rejection */
    double start;      /* [s] intervals are counted from here */
    int64_t count;     /* intervals done since start */
    int level;         /* the interval has 2^level parts */
    int64_t part;      /* parts of it done */
    double end;        /* [s] of this advance */
    double interval_start, interval_end, interval_size;
    bool cut; /* the interval is shorter than dt: the next count starts at its end */
} drape_schedule;

void drape_schedule_init(drape_schedule *schedule, double dt, double start);

/* Sets the end of an advance. now: the time of the state. An interval that was left half done is given up:
 * counting starts at now. */
void drape_schedule_aim(drape_schedule *schedule, double now, double end);

/* The next step: its end and its size. False when the end is reached. */
bool drape_schedule_next(drape_schedule *schedule, double *t1, double *h);

/* A step to t1 was accepted. */
void drape_schedule_accept(drape_schedule *schedule, double t1);

/* A step of size h was rejected. */
void drape_schedule_halve(drape_schedule *schedule, double h);

#endif
