/*
 * profile.h: measures what a sim costs, part by part: bytes, nonzeros, and the time of one Newton
 * iteration. The sim itself is not changed.
 */
#ifndef DRAPE_SIM_PROFILE_H
#define DRAPE_SIM_PROFILE_H

#include "sim/sim.h"

/* One term of the model. Times are 0 if there is nothing to do. */
typedef struct drape_profile_term {
    int64_t acts_on;  /* law: the number of strain measures that it acts on, whose time includes its own;
                         otherwise 0 */
    int64_t nonzeros; /* entries of the Jacobian of the free DOFs that its elements couple */
    size_t bytes;     /* its nodes, rest data, slots in the Jacobian, internal variables */
    double residual_seconds, jacobian_seconds;
} drape_profile_term;

/* Times are those of one evaluation, the shortest of several, at a slightly deformed and moving state. */
typedef struct drape_profile {
    drape_profile_term *terms;   /* one for each term of the model; owned by the caller */
    bool implicit;               /* the integrator has a linear solver; otherwise only the residual is
                                    measured */
    const char *linear_solver;   /* name of the requested solver; "" for none */
    const char *linear_picked;   /* name of the solver in use: that one, or the one it picked for this size */
    char linear_why[96];         /* why it was picked; "" if nothing was picked */
    const char *linear_fallback; /* name of the fallback measured because the matrix is not of the solver's
                                    kind; "": none */
    double dt;                   /* [s] step size that weights the Jacobian */
    double residual_seconds, jacobian_seconds, factor_seconds, solve_seconds;
    drape_status factor_status; /* DRAPE_RETRY_LINEAR: there were no factors to measure */
    size_t model_bytes, mesh_bytes, pattern_bytes, system_bytes, integrator_bytes, state_bytes;
} drape_profile;

/* terms: an array with an element for each term of the model. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER,
 * DRAPE_E_STOPPED. */
drape_status drape_profile_measure(drape_context *ctx, const drape_sim *sim, drape_profile_term *terms,
                                   drape_profile *out);

/* The time of one Newton iteration: residual, Jacobian, factor, solve. */
double drape_profile_seconds(const drape_profile *profile);

/* All memory, factors included. */
size_t drape_profile_bytes(const drape_profile *profile);

#endif
