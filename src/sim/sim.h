/* sim.h: a running simulation. */
#ifndef DRAPE_SIM_SIM_H
#define DRAPE_SIM_SIM_H

#include "base/archive.h"
#include "base/arena.h"
#include "sim/choose.h"
#include "sim/schedule.h"

#define DRAPE_MAX_OBSERVERS 8
#define DRAPE_MAX_REASONS   32 /* of which the last is "other" where there are more */

typedef struct drape_reason {
    const char *reason; /* static text */
    int64_t count;
} drape_reason;

/* What the audit of energy keeps of a run [J]. */
typedef struct drape_audit {
    double start, start_gravity; /* energy of the first state */
    double dissipated, pin_work; /* so far */
    double offered;              /* what the run started with and what work brought or took, without signs */
    double lowest;               /* gravity so far */
    double best;                 /* largest numerical dissipation so far */
} drape_audit;

#define DRAPE_MAX_EFFORTS 8

/* What the mode with a budget keeps from call to call. */
typedef struct drape_realtime_memory {
    bool active;                    /* the last advance was one of these */
    double dt, longest;             /* [s] nominal step, and the longest to keep up with */
    double longest_asked;           /* [s] of the def; 0: it did not say */
    double debt, dropped;           /* [s] owed to the next call; dropped so far */
    double cost[DRAPE_MAX_EFFORTS]; /* [s] expected of an attempt; 0: unknown */
    int effort;                     /* of the integrator, 0 the hardest */
    bool stretched;                 /* steps were longer than dt, or time was left over */
    double cap;                     /* [s] longer steps were rejected lately; INFINITY: none were */
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
    int before; /* the one that the last step began with; -1 before the first, and where a later attempt was made over it */
    int past[2];       /* the ones before; -1: there is none */
    double scratch[2]; /* the controller's memory */
    drape_schedule schedule;
    double most_attempts; /* the controller's max_attempts; INFINITY: it has none */
    double frame_rate;
    int64_t next_frame;
    double *frame, *frame_velocity; /* (node_count x 3) interpolated positions and velocities */
    double *read;                   /* (node_count x 3) scratch of what is read between steps */
    int64_t attempts;
    drape_statistics statistics; /* what the driver counts; the integrator has the rest */
    drape_reason reasons[DRAPE_MAX_REASONS];
    int reason_count;
    drape_audit audit;
    drape_realtime_memory realtime;
    drape_energy energy, made;         /* of the present state; of the one that was attempted last */
    bool energy_known, made_known;     /* whether they are */
    uint64_t model_hash, choices_hash; /* of what a checkpoint is of; identity_known: they are */
    bool identity_known;
    /* From here on it stays where a restored sim takes the place of the rest (checkpoint.c). */
    atomic_bool cancel; /* the advance that runs, or the next, is to stop */
    drape_observer *observers[DRAPE_MAX_OBSERVERS];
    void *observer_users[DRAPE_MAX_OBSERVERS];
    int observer_count;
    bool telling; /* an observer is running */
};

/* Whether a host may change the sim now. Errors: DRAPE_E_ARGUMENT (no sim; from an observer of it). */
drape_status drape_sim_guard(drape_sim *sim, const char *function);

/* Another one with the same choices, at the beginning. */
drape_status drape_sim_create_like(const drape_sim *like, drape_sim **out);

/* All that the next steps, frames and statistics depend on besides the model and the choices: into an archive or, where
 * the sim was just made, out of it. */
void drape_sim_archive(drape_sim *sim, drape_archive *a);

/* What a checkpoint must be of: the model, the choices, the build. Reading fails where they are others. */
void drape_sim_archive_identity(drape_sim *sim, drape_archive *a);

/* The build, as far as bits depend on it: compiler, solvers and their versions. */
void drape_sim_describe_build(char *text, size_t size);

/* drape_sim_archive of a checkpoint in memory that begins with a sim, into *sim: made anew beside it, so that *sim is as
 * it was after a failure. What follows in the archive is the caller's. */
drape_status drape_sim_read(drape_sim *sim, drape_archive *a);

static inline const drape_state *drape_sim_state(const drape_sim *sim)
{
    return &sim->states[sim->now];
}

/* Whether out has energy that neither in nor the work on it can account for, or the run has by now: then
 * info->worst says how much. */
bool drape_sim_ran_away(drape_sim *sim, const drape_state *out, drape_step_info *info);

/* drape_sim_energy_density at other positions (node_count x 3), internal variables those of the present state. */
void drape_sim_energy_density_at(drape_sim *sim, const double *x, double *density);

/* The step is accepted: its work counts. */
void drape_sim_book(drape_sim *sim, const drape_step_info *info);

/* The energy of the present state is the one that the audit starts from. */
void drape_sim_reset_energy(drape_sim *sim);

/* Of a badly distorted present state: the clause of a message that names its worst edge or triangle; else "". */
void drape_sim_describe_distortion(const drape_sim *sim, char *text, size_t size);

/* One attempt at the step that the schedule handed out, judged and told, with its frames. *attempt: what it was. */
drape_status drape_sim_step(drape_sim *sim, double t1, double h, drape_attempt *attempt);

/* DRAPE_E_STEP_TOO_SMALL, with its message, where one more attempt within one dt is too many. last: the one
 * before, if there was one in this advance. */
drape_status drape_sim_bound(drape_sim *sim, const drape_attempt *last);

/* Ends the advance if somebody has cancelled it, and takes the cancelling back: DRAPE_E_STOPPED, with its message. */
drape_status drape_sim_heed(drape_sim *sim);

/* Back to the scene's own steps and all efforts, and no time is owed. */
void drape_sim_leave_realtime(drape_sim *sim);

/* Tells the observers. 0 to go on, else the negative status to stop with. */
drape_status drape_sim_tell(drape_sim *sim, const drape_event *event);

/* The frames that are due up to the present state and were not told yet. A stop leaves the rest for the
 * next call. */
drape_status drape_sim_emit_frames(drape_sim *sim);

#endif
