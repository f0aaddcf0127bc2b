/* sim.h: a running simulation. */
#ifndef DRAPE_SIM_SIM_H
#define DRAPE_SIM_SIM_H

#include "base/archive.h"
#include "base/arena.h"
#include "sim/choose.h"
#include "sim/schedule.h"

#define DRAPE_MAX_OBSERVERS 8
#define DRAPE_MAX_REASONS   32 /* of which the last is "other" where there are more */

typedef struct drape_reason_total {
    const char *reason; /* static text */
    int64_t count;
} drape_reason_total;

/* The energy account of a run [J]. */
typedef struct drape_audit {
    double start, start_gravity; /* energies of the first state */
    double dissipated, pin_work; /* so far */
    double offered;              /* energy at the start plus the magnitudes of all work */
    double lowest;               /* gravity so far */
    double best;                 /* largest numerical dissipation so far */
} drape_audit;

#define DRAPE_MAX_EFFORTS 8

/* The state of the mode with a budget, from call to call. */
typedef struct drape_realtime_memory {
    bool active;                    /* the last advance was one of these */
    double dt, longest;             /* [s] nominal step, and the longest to keep up with */
    double longest_asked;           /* [s] from the def; 0: not set */
    double debt, dropped;           /* [s] left to the next call; dropped so far */
    double cost[DRAPE_MAX_EFFORTS]; /* [s] expected of an attempt; 0: unknown */
    int effort;                     /* level of effort of the integrator, 0 the best */
    bool stretched;                 /* steps were longer than dt, or time was left over */
    double cap;                     /* [s] longer steps were rejected lately; INFINITY: no limit */
} drape_realtime_memory;

struct drape_sim {
    drape_context *ctx;
    drape_arena *arena; /* holds all the sim's memory, at an address that stays: see drape_sim_read */
    size_t state_bytes, integrator_bytes; /* of the arena's, after create */
    const drape_model *model;
    drape_chosen chosen;
    drape_system *system;
    void *integrator;      /* state of chosen.integrator */
    drape_state states[4]; /* as many as are needed: 2, and those before that the controller asks for */
    int now, next;         /* states[now] is the last accepted one, states[next] is being made */
    int before; /* the state that the last step began with; -1 before the first step and after a later attempt
                   overwrote it */
    int past[2];       /* the states before that; -1: none */
    double scratch[2]; /* the controller's memory */
    drape_schedule schedule;
    double max_attempts; /* the controller's max_attempts; INFINITY: it has none */
    double frame_rate;
    int64_t next_frame;
    double *frame, *frame_velocity; /* (node_count x 3) interpolated positions and velocities */
    double *read;                   /* (node_count x 3) scratch of queries between steps */
    int64_t attempts;
    drape_statistics statistics; /* counted by the driver; the integrator has the rest */
    drape_reason_total reasons[DRAPE_MAX_REASONS];
    int reason_count;
    drape_audit audit;
    drape_realtime_memory realtime;
    drape_energy energy, made;         /* of the present state; of the one that was attempted last */
    bool energy_known, made_known;     /* whether the two are valid */
    uint64_t model_hash, choices_hash; /* what a checkpoint belongs to; valid if identity_known */
    bool identity_known;
    /* The members from here on stay in place when a restored sim replaces the others (checkpoint.c). */
    atomic_bool cancel; /* stops the advance that runs, or the next one */
    drape_observer *observers[DRAPE_MAX_OBSERVERS];
    void *observer_users[DRAPE_MAX_OBSERVERS];
    int observer_count;
    bool notifying; /* an observer is running */
};

/* Refuses a call that changes the sim at a wrong time. Errors: DRAPE_E_ARGUMENT (no sim; from an observer of
 * it). */
drape_status drape_sim_guard(drape_sim *sim, const char *function);

/* A new sim with the same choices, at the beginning. */
drape_status drape_sim_create_like(const drape_sim *like, drape_sim **out);

/* Writes all that the next steps, frames and statistics depend on besides the model and the choices into an
 * archive or, where the sim was just made, reads it. */
void drape_sim_archive(drape_sim *sim, drape_archive *a);

/* The model, the choices and the build that a checkpoint belongs to. Reading fails where they differ. */
void drape_sim_archive_identity(drape_sim *sim, drape_archive *a);

/* What results depend on in a build, to the bit: compiler, solvers and their versions. */
void drape_sim_describe_build(char *text, size_t size);

/* drape_sim_archive of a checkpoint in memory that begins with a sim, into *sim: made anew beside it, so that
 * after a failure *sim is as it was. What follows in the archive is the caller's. */
drape_status drape_sim_read(drape_sim *sim, drape_archive *a);

static inline const drape_state *drape_sim_state(const drape_sim *sim)
{
    return &sim->states[sim->now];
}

/* Whether out has energy that neither in nor the work on it can account for, or the run has by now: then
 * info->diagnostic says how much. */
bool drape_sim_ran_away(drape_sim *sim, const drape_state *out, drape_step_info *info);

/* drape_sim_energy_density at other positions (node_count x 3), internal variables those of the present
 * state. */
void drape_sim_energy_density_at(drape_sim *sim, const double *x, double *density);

/* Adds the work of an accepted step to the energy account. */
void drape_sim_add_work(drape_sim *sim, const drape_step_info *info);

/* Starts the energy account from the present state. */
void drape_sim_reset_energy(drape_sim *sim);

/* If the present state is badly distorted: the clause of a message that names its most distorted edge or
 * triangle; else "". */
void drape_sim_describe_distortion(const drape_sim *sim, char *text, size_t size);

/* One attempt at the step that the schedule returned: it is judged and reported, with its frames. *attempt
 * describes it. */
drape_status drape_sim_step(drape_sim *sim, double t1, double h, drape_attempt *attempt);

/* DRAPE_E_STEP_TOO_SMALL, with its message, if one more attempt within one dt would be too many. last: the
 * one before, if there was one in this advance. */
drape_status drape_sim_check_attempts(drape_sim *sim, const drape_attempt *last);

/* Ends the advance if it was cancelled, and resets the flag: DRAPE_E_STOPPED, with its
 * message. */
drape_status drape_sim_check_cancel(drape_sim *sim);

/* Back to the scene's own steps and the best effort, without left-over time. */
void drape_sim_leave_realtime(drape_sim *sim);

/* Notifies the observers. 0 to continue, else the negative status to stop with. */
drape_status drape_sim_notify(drape_sim *sim, const drape_event *event);

/* Passes the frames that are due up to the present state to the observers. A stop leaves the rest for the
 * next call. */
drape_status drape_sim_emit_frames(drape_sim *sim);

#endif
