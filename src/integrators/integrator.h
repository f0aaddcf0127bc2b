/*
 * integrator.h: time integrators as rows of one table. A row is the constant drape_integrator_<word> of
 * <word>.c. step(in, out) never writes in: rejecting a step is forgetting out.
 */
#ifndef DRAPE_INTEGRATORS_INTEGRATOR_H
#define DRAPE_INTEGRATORS_INTEGRATOR_H

#include "assemble/system.h"
#include "base/archive.h"
#include "base/param.h"

/* What a step has to say of itself. */
typedef struct drape_step_info {
    const char *reason; /* "converged", or why not; static text */
    double h;           /* [s] the step that was taken; a row that chooses its own sets it */
    int iterations;
    double residual, tolerance; /* [N] */
    bool
        lenient; /* the caller asked for no guard but that numbers are finite and nothing passes through anything
                   * (on_failure accept) */
    bool usable; /* with a status > 0: the caller asked to go on with what there is (on_failure accept) */
    double dissipated; /* [J] work that dissipative terms took in this step */
    double pin_work;   /* [J] work that moving pins put in */
    bool committed;    /* out->internal is set, its elements were checked along the way */
    drape_worst worst;
} drape_step_info;

/* How large an explicit row may step at a state: what the fastest wave of the forces there allows. */
typedef struct drape_stability {
    double omega;   /* [rad/s] largest eigenfrequency, of M^-1 K */
    double damping; /* [1/s] largest rate of M^-1 D */
    double limit;   /* [s] a longer substep grows what is smallest; INFINITY where nothing pulls */
    double substep; /* [s] of a step of the size asked for */
    double step;    /* [s] largest stable step: as many substeps of `limit`; INFINITY where their number
                       follows the limit */
} drape_stability;

/* Work done so far. */
typedef struct drape_work {
    bool stability_known;   /* of an equilibrium */
    int64_t unstable_modes; /* negative eigenvalues of the Hessian there */
    int64_t newton_iterations, jacobians, factorizations, linear_iterations, residuals;
    double residual_seconds, jacobian_seconds, factor_seconds, solve_seconds, contact_seconds;
} drape_work;

void drape_work_archive(drape_work *work, drape_archive *a);

typedef struct drape_integrator_ops {
    const char *name, *summary, *reference;
    int order;                 /* of convergence in h */
    const drape_param *params; /* one of them is dt */
    int param_count;
    /* values in the order of params. Takes all memory that stepping needs. */
    drape_status (*create)(drape_arena *arena, drape_system *system, const double *values, void **state);
    /* The row chooses its own steps: h is the way to the end of the advance or, after a rejection, an
     * upper bound, out->t the end of the advance, which a step may reach and not pass; the row sets out->t
     * to where it came. */
    bool own_steps;
    /* What a run may gain from nowhere, as a share of the energy that the scene had to offer; 0: a tenth, for
     * rows that conserve energy and let it swing. */
    double gain;
    /* Between the states of a step there is no motion, so no frames. */
    bool timeless;
    /* The row keeps contact and limits by moving nodes: forces that stand for them (contact of the model,
     * terms that are a constraint) must not act beside it. The sim makes its system without them. */
    bool projects_contact;
    /* From in to out, whose t is set: h = the nominal size of the step, exact where out->t - in->t has
     * rounding. Fills out->x and out->v. */
    drape_status (*step)(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info);
    /* The next step starts anew from a state that this integrator did not make, or after a rejection. */
    void (*restart)(void *state, const drape_state *from);
    /* Its next step relies on forces that are smooth from step to step: where they jump it must start anew. */
    bool smooth_forces;
    /* The stability limit at a state, for steps of size h: a function of the state alone. NULL: stable for any
     * h. */
    void (*stability)(void *state, const drape_state *at, double h, drape_stability *out);
    /* Positions (node_count x 3) at a time within the last step. NULL: cubic Hermite between the states
     * serves. */
    void (*interpolate)(void *state, double t, double *x);
    /* F of the free DOFs (3 free_count [N]) where the solver of the last step left it. NULL: it solves for none. */
    const double *(*residual)(const void *state);
    /* How hard a step tries, for a mode that must keep a deadline: 0, as the parameters say, to efforts - 1, the
     * cheapest. NULL: there is one effort. */
    int efforts;
    void (*set_effort)(void *state, int effort);
    drape_work (*work)(const void *state);
    /* All that the next steps depend on besides the state they start from, and the work done: into an archive or,
     * where this was just made for a system of the same model with the same pattern, out of it. What has the same
     * bits however it came about is left out. */
    void (*archive)(void *state, drape_archive *a);
    size_t (*bytes)(const void *state);
    void (*destroy)(void **state);
} drape_integrator_ops;

extern const drape_integrator_ops *const drape_integrators[]; /* NULL-ended */
extern const char *const drape_integrators_words[];

#endif
