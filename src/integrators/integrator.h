/*
 * integrator.h: time integrators, the entries of one table. An integrator is the constant
 * drape_integrator_<name> of <name>.c. step(in, out) never writes in: rejecting a step is forgetting out.
 */
#ifndef DRAPE_INTEGRATORS_INTEGRATOR_H
#define DRAPE_INTEGRATORS_INTEGRATOR_H

#include "base/param.h"
#include "base/registry.h"
#include "nonlinear/report.h"

/* What a step reports. */
typedef struct drape_step_info {
    const char *reason; /* "converged", or why not; static text */
    double h;           /* [s] the step that was taken; set by integrators that choose their own */
    int iterations;
    double residual, tolerance; /* [N] */
    bool lenient, usable;       /* see drape_solve_report */
    double dissipated;          /* [J] work that dissipative terms took in this step */
    double pin_work;            /* [J] work that moving pins put in */
    bool committed;             /* out->internal is set; its elements were checked on the way */
    drape_diagnostic diagnostic;
} drape_step_info;

/* How large an explicit integrator may step at a state: what the fastest wave of the forces there allows. */
typedef struct drape_stability {
    double omega;   /* [rad/s] largest eigenfrequency, of M^-1 K */
    double damping; /* [1/s] largest rate of M^-1 D */
    double limit;   /* [s] in a longer substep the smallest disturbance grows; INFINITY where nothing pulls */
    double substep; /* [s] of a step of the size asked for */
    double step;    /* [s] largest stable step: as many substeps of `limit`; INFINITY where their number
                       follows the limit */
} drape_stability;

typedef struct drape_integrator_ops {
    drape_entry entry; /* one of its parameters is dt */
    int order;         /* of convergence in h */
    /* values in the order of params. Takes all memory that stepping needs: from the arena, which outlives it,
     * or such that destroy frees it. After a failure, too, *state is destroyed unless it is NULL. */
    drape_status (*create)(drape_arena *arena, drape_system *system, const double *values, void **state);
    /* It chooses its own steps: h is the time left to the end of the advance or, after a rejection, an upper
     * bound; out->t is the end of the advance, which a step may reach and not pass, and is set to where the
     * step ends. */
    bool own_steps;
    /* Energy that a run may gain without a source, as a share of the energy that the scene had to offer; 0: a
     * tenth, for integrators that conserve energy and let it swing. */
    double gain;
    /* Between the states of a step there is no motion, so no frames. */
    bool steady_state;
    /* It keeps contact and limits by moving nodes: forces that stand for them (contact of the model, terms
     * that are a constraint) must not act beside it. The sim makes its system without them. */
    bool projects_contact;
    /* From in to out, whose t is set: h = the nominal size of the step, exact where out->t - in->t is
     * rounded. Fills in out->x and out->v. */
    drape_status (*step)(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info);
    /* The next step starts anew from a state that this integrator did not make, or after a rejection. */
    void (*restart)(void *state, const drape_state *from);
    /* Its next step relies on forces that are smooth from step to step: where they jump it must start
     * anew. */
    bool smooth_forces;
    /* The stability limit at a state, for steps of size h: a function of the state alone. NULL: stable for
     * any h. */
    void (*stability)(void *state, const drape_state *at, double h, drape_stability *out);
    /* Positions (node_count x 3) at a time within the last step. NULL: cubic Hermite interpolation between
     * the states serves. */
    void (*interpolate)(void *state, double t, double *x);
    /* F of the free DOFs (3 free_count [N]) where the solver of the last step left it. NULL: it solves no
     * equation. */
    const double *(*residual)(const void *state);
    /* How much work a step may take, for a mode that must meet a deadline: from 0, as the parameters say, to
     * efforts - 1, the cheapest. NULL: there is one effort. */
    int efforts;
    void (*set_effort)(void *state, int effort);
    drape_work (*work)(const void *state);
    /* All that the next steps depend on besides the state they start from, and the work done: into an archive
     * or, where this was just made for a system of the same model with the same pattern, out of it. What has
     * the same bits however it came about is left out. */
    void (*archive)(void *state, drape_archive *a);
    /* Bytes outside of the arena: factors, vectors of SUNDIALS. NULL: none. */
    size_t (*bytes)(const void *state);
    /* Frees what is not the arena's. NULL: there is nothing. */
    void (*destroy)(void **state);
} drape_integrator_ops;

extern const drape_integrator_ops *const drape_integrators[]; /* NULL-ended */
extern const drape_registry drape_integrator_registry;

#endif
