/* sim.h: a running simulation. */
#ifndef DRAPE_SIM_SIM_H
#define DRAPE_SIM_SIM_H

#include "base/archive.h"
#include "base/arena.h"
#include "geometry/bvh.h"
#include "sim/choose.h"
#include "sim/event_set.h"
#include "sim/schedule.h"

#define DRAPE_PENETRATION_TOLERANCE 1e-9 /* [m] a point that is less deep in a collider is on its surface */
#define DRAPE_MAX_OBSERVERS         8
#define DRAPE_MAX_HOST_EVENTS       64

typedef struct drape_reason_total {
    drape_reason reason;
    int64_t count;
} drape_reason_total;

/* The energy account of a run [J], kept over accepted steps. */
typedef struct drape_audit {
    double start, start_gravity; /* energies of the first state */
    double start_weight;         /* of that of gravity, without the potential of loads */
    double dissipated;           /* so far */
    double offered;              /* energy at the start plus the magnitudes of all work */
    double lowest;               /* lowest energy of gravity so far */
    double best;                 /* largest numerical dissipation so far */
    double residual_work;        /* of the residuals that unconverged steps left, so far */
    double most_lost;            /* the same with what was dissipated and what wind took: all that was lost */
    double best_unexplained;     /* largest numerical dissipation with that work as a source */
} drape_audit;

/* Where drape_sim_warning continues, so that each test is made once for all indices from 0. Not archived. */
typedef struct drape_warning_cursor {
    int index;        /* of the next warning */
    size_t check;     /* the test that may find it */
    int64_t attempts; /* made by the sim when this was set: after more of them it is out of date */
} drape_warning_cursor;

/* What steps left of the solution of their equation, by estimate (nonlinear/stopping.h). */
typedef struct drape_left {
    double largest, last; /* [J] of the accepted steps; NaN: not estimated */
    int64_t by_error;     /* accepted steps that were solved to their local error */
    int64_t above_own;    /* accepted steps that were not solved, and left more than that */
} drape_left;

struct drape_sim {
    drape_context *ctx;
    drape_arena *arena; /* holds all memory of the sim and stays at its address: see drape_sim_read */
    size_t state_bytes, integrator_bytes; /* in the arena, after create */
    const drape_model *model;
    drape_model
        *own_model;     /* the model, if other nodes are pinned than in the one that was compiled, or nodes
                               have other masses; NULL: it is that one */
    uint8_t *pinned;    /* (node_count) the nodes that own_model pins; NULL: those of the compiled model */
    double *masses;     /* (node_count) [kg] of own_model; NULL: those of the compiled model */
    drape_work earlier; /* done by the integrators that went before, each until the model changed */
    drape_chosen chosen;
    drape_system *system;
    void *integrator;      /* state of chosen.integrator */
    drape_state states[4]; /* as many as needed: 2, and the earlier ones that the controller wants */
    int now, next;         /* states[now] is the last accepted one, states[next] is computed by attempts */
    int before;        /* the state in which the last step began; -1 before the first step, and after a later
                   attempt overwrote it */
    int past[2];       /* the states before `before`; -1: none */
    double scratch[2]; /* the controller's memory */
    drape_schedule schedule;
    int64_t max_attempts; /* of the controller */
    double frame_rate;
    double realtime_step;  /* [s] the longest step with a time budget; 0: not set. As the next one, a setting
                              of the host, which a restored sim keeps */
    double teleport_speed; /* [m/s] above which the host's pins carry their cloth; 0: never */
    int64_t next_frame;
    double *frame, *frame_velocity; /* (node_count x 3) interpolated positions and velocities */
    double *query_scratch;          /* (node_count x 3) for queries between steps */
    drape_bvh query_tree; /* of all triangles, for queries that fit it to the state; branches NULL: not yet
                             made. Not archived: it is the same for all states */
    int64_t attempts;
    drape_statistics statistics; /* counted by the driver; the integrator has the others */
    drape_left left;
    /* in the order of their first count */
    drape_reason_total reasons[DRAPE_REASON_COUNT + DRAPE_OWN_REASONS];
    int reason_count;
    /* of the last attempt in this advance. Not archived: no advance needs an earlier one */
    drape_reason reason;
    drape_audit audit;
    /* (drape_system_work_count) [J] the work so far, and of loads the potential at the start that they have
     * lost since; these potentials at the last drape_sim_energy, not archived; scratch */
    double *work, *potential, *work_scratch;
    const char **workers;                   /* (drape_system_work_count) their names; NULL: it does none */
    const struct drape_rescue_ops *rescue;  /* of steps that fail (rescue.h); NULL: there is none */
    struct drape_realtime_memory *realtime; /* what rescue keeps, */
    drape_arena rescue_arena;               /* and its memory */
    bool untangle_due;                      /* the scene asks for it, and the first step was not made yet */
    bool untangled;                         /* `untangling` is known */
    drape_untangling untangling;            /* the last one; its seconds are those of this machine */
    double *untangled_move;                 /* (cloth_count) [m] the largest displacement of a node in it */
    drape_event_set events;
    drape_energy energy, attempted;     /* of the present state; of the last attempted one */
    bool energy_known, attempted_known; /* whether these two are valid */
    drape_warning_cursor warning_cursor;
    bool warning_failed; /* memory was out for a test of drape_sim_warning, or it was cancelled */
    uint64_t model_hash, choices_hash; /* identify what a checkpoint belongs to; valid if identity_known */
    bool identity_known;
    /* The members from here on stay in place when a restored sim replaces the others (checkpoint.c). */
    atomic_bool cancel;      /* stops the running advance, or the next one */
    drape_model *kept_model; /* compiled for this sim by drape_sim_change; NULL: the model is the host's */
    drape_observer *observers[DRAPE_MAX_OBSERVERS];
    void *observer_users[DRAPE_MAX_OBSERVERS];
    int observer_count;
    bool notifying; /* an observer is being called */
    bool advancing; /* between steps and within them: functions of the host are called */
};

/* Refuses a call that would change the sim at a wrong time. Errors: DRAPE_E_ARGUMENT (sim is NULL, or the
 * call comes from one of its observers, or from a wind, a term or an event while it advances). */
drape_status drape_sim_guard(drape_sim *sim, const char *function);

/* Checks a list of nodes that a host gives to a function. Errors: DRAPE_E_ARGUMENT. */
drape_status drape_sim_check_nodes(const drape_sim *sim, const char *function, int32_t count,
                                   const int32_t *nodes);

/* Creates a new sim of a compiled model with these choices, and otherwise those of `like`, at the beginning
 * and without an energy account, which the caller copies or reads. pinned (node_count): the nodes that are
 * pinned; masses (node_count) [kg]; NULL: those of the model. */
drape_status drape_sim_create_like(const drape_sim *like, const drape_chosen *chosen,
                                   const drape_model *model, const uint8_t *pinned, const double *masses,
                                   drape_sim **out);

/* Exchanges the contents of two sims, except what belongs to the host and stays with `sim`: observers, the
 * cancel flag, the wind. Afterwards `other` has the former contents of `sim` and is only fit to be
 * destroyed. */
void drape_sim_exchange(drape_sim *sim, drape_sim *other);

/* Puts a new sim in the place of the present one, as which it goes on: of the same cloth, with other pins,
 * masses, terms or colliders; arguments as for drape_sim_create_like. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER, DRAPE_E_ARGUMENT (a pin is to be elsewhere), DRAPE_E_STOPPED (the context's cancel
 * function); then the sim is unchanged. */
drape_status drape_sim_remake(drape_sim *sim, const drape_model *model, const uint8_t *pinned,
                              const double *masses);

/* Goes on by the method, the controller and the settings of a def, from the present state. Frames within the
 * last step must have been emitted. Errors: those of drape_sim_create; then the sim is unchanged. */
drape_status drape_sim_continue_by(drape_sim *sim, const drape_sim_def *def);

/* Pins these nodes (node_count) and no others: nodes that become free go on with the velocity of their
 * pins, those that become pinned are held where they are. Errors: those of drape_sim_remake. */
drape_status drape_sim_repin(drape_sim *sim, const uint8_t *pinned);
/* Pins these nodes (count), or lets them go (pin 0), if they are not so already. */
drape_status drape_sim_set_pins(drape_sim *sim, int32_t count, const int32_t *nodes, uint8_t pin);

/* The model as it was compiled, with its own pins. */
static inline const drape_model *drape_sim_base_model(const drape_sim *sim)
{
    return sim->model->base ? sim->model->base : sim->model;
}

/* Writes everything that the next steps, frames and statistics depend on, besides the model and the
 * choices, to an archive or, if the sim was just created, reads it back. */
void drape_sim_archive(drape_sim *sim, drape_archive *a);

/* Archives the identity of the model, the choices and the build that a checkpoint belongs to. Reading fails
 * if they differ. */
void drape_sim_archive_identity(drape_sim *sim, drape_archive *a);

/* The solvers and the versions of libraries that the bits of results depend on. */
void drape_sim_describe_libraries(char *text, size_t size);

/* Reads a sim from a checkpoint in memory into *sim, by creating it beside *sim, so that a failure leaves
 * *sim unchanged. The rest of the archive is the caller's. */
drape_status drape_sim_read(drape_sim *sim, drape_archive *a);

static inline const drape_state *drape_sim_state(const drape_sim *sim)
{
    return &sim->states[sim->now];
}

/* The bound on the residual that the integrator uses [N]; NaN: it has none. */
double drape_sim_tolerance(const drape_sim *sim);

/* The bound on the estimated error of a step [m]; NaN: the integrator estimates none. */
double drape_sim_error_bound(const drape_sim *sim);

/* Whether out has energy that neither the state before nor the work on it can account for, in this step or
 * since the beginning of the run; info->diagnostic then says how much. */
bool drape_sim_ran_away(drape_sim *sim, const drape_state *out, drape_step_info *info);

/* Whether a step to `out` that was not solved left more than a share of the energies of the motion. Then the
 * diagnostic says so. With a time budget any step is better than none. To be called after drape_sim_ran_away,
 * which measures these energies. */
bool drape_sim_left_too_much(drape_sim *sim, const drape_state *out, drape_step_info *info);

/* Settles what the residual of a step to `out` did. Work of the residual that damping took in the same step,
 * and what a method of own steps counts beyond what the motion lost, is subtracted from info->dissipated.
 * With a time budget, what the residuals so far have put into the motion is taken back from it: its energy
 * never rises but by known work. */
void drape_sim_settle_work(drape_sim *sim, drape_state *out, drape_step_info *info);

/* drape_sim_energy with the potentials of loads in `gravity`, as by them gains are judged. */
drape_energy drape_sim_account(drape_sim *sim);

/* Names what does work, before any is added. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_create_work(drape_sim *sim);

/* drape_sim_account at positions and velocities (node_count x 3) at time t, with the internal variables of
 * the present state; `dissipated` and `numerical` are 0. */
drape_energy drape_sim_energy_of(const drape_sim *sim, double t, const double *x, const double *v);

/* The status of forces that were read: a pending request to cancel the next advance is not an error of
 * reading. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_read_status(const drape_sim *sim);

/* drape_sim_reactions at another point. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_reactions_at(drape_sim *sim, const drape_point *point, double *forces);

/* drape_sim_energy_density at other positions (node_count x 3), with the internal variables of the present
 * state. */
void drape_sim_energy_density_at(drape_sim *sim, const double *x, double *density);

/* What integrators, controllers and events remember of earlier steps is of another motion: they begin anew
 * from the present state. */
void drape_sim_forget_past(drape_sim *sim);

/* Adds the energy that contact gained by becoming stiffer at the beginning of a step, which stays whether
 * or not the step is accepted. */
void drape_sim_add_contact_work(drape_sim *sim);

/* For forces in the present state: where no step has led to it, drape_system_begin_reading, with the work
 * of the laws of contact that it changes in the account; otherwise the last step has begun for them
 * already. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_begin_reading(drape_sim *sim);

/* Adds the work of an accepted step to the energy account. */
void drape_sim_add_work(drape_sim *sim, const drape_step_info *info);

/* The energy [J] that went into the run so far: at the start, by the fall, and by each whose work is
 * positive. It is all that became of it, with what was lifted and what the others took. 0: so little that it
 * is rounding of a scene at rest. */
double drape_sim_energy_received(drape_sim *sim);

/* Starts the energy account from the present state. What was available to the run before is still: a state
 * that is set is no more suspicious than the same state that was reached. */
void drape_sim_reset_energy(drape_sim *sim);

/* Takes all that has changed since the account `before` as the work of one, such as the host who placed cloth
 * elsewhere: numerical dissipation stays as it was, and what was available to the run still is. */
void drape_sim_shift_energy(drape_sim *sim, const drape_energy *before, int worker);

/* If the present state is badly distorted, a clause for a message that names its most distorted edge or
 * triangle; otherwise "". */
void drape_sim_describe_distortion(const drape_sim *sim, char *text, size_t size);

/* Makes one attempt at the step that the schedule returned, judges it, and reports it with its frames.
 * *attempt describes it. */
drape_status drape_sim_step(drape_sim *sim, double t1, double h, drape_attempt *attempt);

/* Returns DRAPE_E_STEP_TOO_SMALL, with its message, if one more attempt within one dt would exceed the
 * limit. last: the attempt before, if there was one in this advance. */
drape_status drape_sim_check_attempts(drape_sim *sim, const drape_attempt *last);

/* Ends the advance if it was cancelled, and resets the flag: returns DRAPE_E_STOPPED, with its message. */
drape_status drape_sim_check_cancel(drape_sim *sim);

/* Notifies the observers. 0: continue; otherwise the negative status to stop with. */
drape_status drape_sim_notify(drape_sim *sim, const drape_event *event);

/* Passes the frames that are due up to the present state to the observers. After a stop, the next call
 * continues with the rest. */
drape_status drape_sim_emit_frames(drape_sim *sim);

#endif
