/*
 * integrator.h: time integrators, the entries of one table. An integrator is the constant
 * drape_integrator_<name> of <name>.c. step(in, out) never writes to in, so a step is rejected by
 * discarding out.
 */
#ifndef DRAPE_INTEGRATORS_INTEGRATOR_H
#define DRAPE_INTEGRATORS_INTEGRATOR_H

#include "base/param.h"
#include "base/registry.h"
#include "nonlinear/solve_report.h"

/* The report of a step. */
typedef struct drape_step_info {
    drape_reason reason; /* DRAPE_REASON_CONVERGED, or why not */
    double h;            /* [s] the step taken; set by integrators that choose their own steps */
    double retry;        /* [s] after a failed error test: the size of the next attempt; 0: half of h */
    int iterations;
    bool laborious;             /* see drape_solve_report */
    double residual, tolerance; /* [N] */
    double error;               /* [m] estimated RMS distance of the nodes of `out` to the solution of the
                                   step's equation; NaN: the integrator estimates none */
    double left, own; /* [J] what is left to gain, and the local error by the same measure; NaN: no estimate
                         (nonlinear/stopping.h) */
    bool solved, by_error;  /* see drape_solve_report */
    double further_seconds; /* [s] spent on work beyond the least, which set_deadline limits */
    bool lenient, usable;   /* see drape_solve_report */
    double dissipated;      /* [J] work of dissipative terms in this step; drape_system_work has the others */
    double law_work;        /* [J] of that of colliders: by laws of contact that changed within the step */
    double open_work;       /* [J] by how much that of changing loads may be wrong; set by the sim */
    double residual_work;   /* [J] of the residual that is left, F d with the displacement d; 0 if negative */
    bool committed;         /* out->internal is set, and its elements were checked during the step */
    drape_diagnostic diagnostic;
} drape_step_info;

/* The stable step size of an explicit integrator at a state, given by the fastest wave of the forces
 * there. */
typedef struct drape_stability {
    double omega;   /* [rad/s] largest eigenfrequency, of M^-1 K */
    double damping; /* [1/s] largest rate of M^-1 D */
    double limit;   /* [s] in longer substeps the smallest disturbance grows; INFINITY without elastic
                       forces */
    double substep; /* [s] substep of a step of the requested size */
    double step;    /* [s] largest stable step: all its substeps of length `limit`; INFINITY if their
                       number adapts to the limit */
} drape_stability;

typedef struct drape_integrator_ops {
    drape_entry entry; /* one of its parameters is dt */
    int order;         /* of convergence in h */
    /* values: in the order of params. Takes all memory that stepping needs: from the arena, which outlives
     * it, or such that destroy frees it. If it fails, *state must still be destroyed unless it is NULL. */
    drape_status (*create)(drape_arena *arena, drape_system *system, const double *values, void **state);
    /* It chooses its own steps: h is then the time left to the end of the advance or, after a rejection, an
     * upper bound; out->t is the end of the advance, which a step may reach but not pass, and is set to the
     * time at which the step ends. */
    bool own_steps;
    /* The parameter that fixes its order, which by default depends on rtol. NULL: it does not, or the
     * integrator chooses its order as it goes. */
    const char *order_parameter;
    /* Energy that a run may gain without a source, as a share of the energy available in the scene; 0: a
     * tenth, for integrators that conserve energy up to oscillations. */
    double gain;
    /* There is no motion between the states of a step, so there are no frames. */
    bool steady_state;
    /* It damps nothing by itself: waves that its steps do not resolve persist. */
    bool conservative;
    /* It is explicit, and its steps would have to resolve the losses of measured fabrics, so these must not
     * act: the sim creates its system without them. */
    bool leaves_losses;
    /* It enforces contact and limits by moving nodes, so the forces that stand for them (contact of the
     * model, terms that are a constraint) must not act, too: the sim creates its system without them. */
    bool projects_contact;

    /* The velocities of a state are the means of the step that led to it, not those of its time: the
     * surfaces of colliders that turn have theirs with them. */
    bool mean_velocities;
    /* Terms may have energies of motion: it steps their momenta, or nothing moves. */
    bool momenta;
    bool by_ranks; /* it can step a model that several ranks share (base/ranks.h) */
    /* It moves supports itself. If not, it steps in their frame (drape_system_to_frame), where they rest. */
    bool in_space;
    /* Steps from in to out, whose t is set. h: the nominal size of the step, exact, while out->t - in->t is
     * rounded. Sets out->x and out->v. */
    drape_status (*step)(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info);
    /* The next step restarts from a state that this integrator did not compute, or after a rejection. */
    void (*restart)(void *state, const drape_state *from);
    /* Its next step assumes forces that are smooth between steps: if they jump, it must be restarted. */
    bool smooth_forces;
    /* The stability limit at a state for steps of size h, which is a function of the state alone. NULL:
     * stable for any h. */
    void (*stability)(void *state, const drape_state *at, double h, drape_stability *out);
    /* Positions (node_count x 3) at a time within the last step. NULL: cubic Hermite interpolation between
     * the states is used. */
    void (*interpolate)(void *state, double t, double *x);
    /* The velocities of the free nodes (node_count x 3) at such a time, as well; the rest of v is unchanged.
     * NULL: an interpolant of the states is used. */
    void (*interpolate_velocities)(void *state, double t, double *v);
    /* F of the free DOFs (3 free_count [N]) that the solver of the last step left. NULL: it solves no
     * equation. */
    const double *(*residual)(const void *state);
    /* The bound on the weighted norm of F that it uses [N] (nonlinear/residual_bound.h). NULL: none. */
    double (*tolerance)(const void *state);
    /* The bound on `error` up to which it does more work [m]. NULL: it estimates none. */
    double (*error_bound)(const void *state);
    /* Work beyond the least is not begun after this time [s of
     * drape_clock_seconds], nor, if it only reduces the error, where it would not end by then; INFINITY, at
     * first: there is no deadline. NULL: it does no such work. */
    void (*set_deadline)(void *state, double seconds);
    /* From now on steps are as cheap as they can be, or as the parameters say, as at first. NULL: they are
     * that already. */
    void (*set_cheap)(void *state, bool cheap);
    drape_work (*work)(const void *state);
    /* Writes everything that the next steps depend on besides the state that they start from, and the work
     * done, to an archive or, if this was just created for a system of the same model with the same
     * pattern, reads it back. Data with the same bits whenever they are computed are left out. */
    void (*archive)(void *state, drape_archive *a);
    /* Bytes outside the arena: factors, vectors of SUNDIALS. NULL: none. */
    size_t (*bytes)(const void *state);
    /* Frees what is not in the arena. NULL: everything is in the arena. */
    void (*destroy)(void **state);
} drape_integrator_ops;

extern const drape_integrator_ops *const drape_integrators[]; /* NULL-ended */
extern const drape_registry drape_integrator_registry;

#endif
