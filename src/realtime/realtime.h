/* realtime.h: what a sim keeps for advances with a time budget, and for steps that are rescued (rescue.c). */
#ifndef DRAPE_REALTIME_REALTIME_H
#define DRAPE_REALTIME_REALTIME_H

#include "sim/rescue.h"
#include "sim/sim.h"

/* Kept between calls. */
typedef struct drape_realtime_memory {
    bool active;                 /* the last advance was one with a budget */
    double dt, longest;          /* [s] nominal step; longest step to keep up with */
    double debt, dropped;        /* [s] time left over for the next call; total time dropped */
    double behind, pins_behind;  /* [s] of motion that a host sends beyond the time simulated (catch_up.h):
                                       of bodies relative to the pins, and of what all pins have in common */
    double cost[2];              /* [s] expected for an attempt, by level of effort; 0: unknown */
    double ending;               /* [s] expected from the end of the integrator's work in an attempt on */
    int effort;                  /* the integrator's level of effort: 0, or 1 where steps are to be cheap */
    bool stretched;              /* steps were longer than dt, or time was left over */
    bool touches;                /* the last attempt of a call ended in contact */
    double cap;                  /* [s] longer steps were rejected recently; INFINITY: no limit */
    int64_t inaccurate;          /* calls that were not accurate */
    int64_t crossings;           /* edges through triangles of the cloth after the last call, */
    double apart_at, apart_wait; /* [s] they are taken apart from then on, after having waited so long */
    int64_t most_crossings;      /* the largest number of them so far, */
    int64_t crossed;             /* and the calls with any */
    int64_t failed;              /* attempts at the present step that failed */
    int64_t held_up;             /* attempts that failed since held_up_from */
    double held_up_from;         /* [s] from there on no whole dt was made */
    /* Not archived: read in the call or after the attempt that sets it. */
    bool meets;             /* a longer step of this call might meet something */
    bool unchecked;         /* pins have moved apart in this call */
    bool relaxed_again;     /* after the last attempt cloth was relaxed */
    double solved_at;       /* [s of drape_clock_seconds] the integrator's work in the last attempt ended, */
    double further_seconds; /* [s] and what of it see drape_step_info */
} drape_realtime_memory;

/* Sets the integrator's level of effort. */
void drape_realtime_set_effort(drape_sim *sim, int effort);

/* Returns to the scene's own steps and the best level of effort, without left-over time. */
void drape_realtime_leave(drape_sim *sim);

/* See send_pins and send_collider in sim/rescue.h. */
drape_status drape_teleport_pins(drape_sim *sim, int32_t count, const int32_t *nodes, double seconds,
                                 const double *positions, const double *velocities);
drape_status drape_teleport_collider(drape_sim *sim, int32_t collider, double seconds, const drape_sent *to);

extern const drape_warning_check drape_realtime_warnings[];

#endif
