/*
 * rescue.h: what may happen after a failed step besides a smaller one. The driver of a step (step.c) asks
 * these functions and knows no more of it. src/realtime/ has the only ones: of advances with a time budget,
 * and of cloth that bodies leave no room.
 */
#ifndef DRAPE_SIM_RESCUE_H
#define DRAPE_SIM_RESCUE_H

#include "sim/sim.h"
#include "sim/warnings.h"

/* Where a collider is sent; velocities may be NULL, and so may the rotation (3 x 3). */
typedef struct drape_sent {
    const double *displacement, *velocity, *rotation, *angular_velocity;
} drape_sent;

typedef struct drape_rescue_ops {
    /* ---- Of a sim that has asked for it: drape_sim.rescue ---- */

    /* Called before the integrator makes an attempt at a step to t1, and after it, whether or not it
     * succeeded. */
    void (*begin)(drape_sim *sim, double t1);
    void (*solved)(drape_sim *sim, const drape_step_info *info);
    /* Whether any step is better than none, however far from solved it is. */
    bool (*takes_any)(const drape_sim *sim);
    /* The controller gave this verdict, RETRY or STOP, on an attempt at a step to t1. Returns it, or what
     * becomes of the attempt instead: REPEAT; SUBSTITUTE, with another step in the next state, described by
     * trial->info, and trial->h_next; STOP. */
    drape_verdict (*failed)(drape_sim *sim, double t1, drape_trial *trial, drape_verdict verdict);
    /* A step was accepted. */
    void (*accepted)(drape_sim *sim);
    /* The next steps are those of an advance without a budget. */
    void (*leave)(drape_sim *sim);

    /* ---- Of any sim ---- */

    /* Sets drape_sim.rescue, unless it is set. Errors: DRAPE_E_MEMORY. */
    drape_status (*open)(drape_sim *sim);
    /* Whether it would help where an attempt did not, as a clause for its message; else "". Errors:
     * DRAPE_E_MEMORY. */
    drape_status (*advise)(drape_sim *sim, const drape_attempt *last, char *text, size_t size);
    void (*archive)(drape_sim *sim, drape_archive *a);
    /* A sim goes on where another one was: of the same cloth, with colliders that had the numbers `before`
     * (collider_count) there; -1: it is new. Errors: DRAPE_E_MEMORY. */
    drape_status (*go_on)(drape_sim *to, const drape_sim *from, const int32_t *before);
    /* Before pins, or a collider, are sent on: if they are faster than the sim's teleport_speed, places their
     * cloth, or the collider, where they are sent to, as drape_sim_move_pins says. Errors: as
     * drape_sim_place_parts. */
    drape_status (*send_pins)(drape_sim *sim, int32_t count, const int32_t *nodes, double seconds,
                              const double *positions, const double *velocities);
    drape_status (*send_collider)(drape_sim *sim, int32_t collider, double seconds, const drape_sent *to);
    const drape_warning_check *warnings; /* of those that have asked for it; ended by one without a name */
} drape_rescue_ops;

extern const drape_rescue_ops drape_realtime_rescue; /* realtime/rescue.c */

#endif
