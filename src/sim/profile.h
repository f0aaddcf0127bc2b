/*
 * profile.h: what a sim costs, part by part: bytes, nonzeros, and the time of one Newton iteration, measured.
 * The sim itself is left as it is.
 */
#ifndef DRAPE_SIM_PROFILE_H
#define DRAPE_SIM_PROFILE_H

#include "sim/sim.h"

/* One term of the model. Times are 0 where there is nothing to do. */
typedef struct drape_profile_term {
    int64_t acts_on;  /* law: strain measures that it acts on, whose time includes its own; else 0 */
    int64_t nonzeros; /* entries of the Jacobian of the free DOFs that its elements couple */
    size_t bytes;     /* its nodes, rest data, places in the Jacobian, internal variables */
    double residual_seconds, jacobian_seconds;
} drape_profile_term;

/* Times are of one evaluation, the shortest of several, at a slightly deformed and moving state. */
typedef struct drape_profile {
    drape_profile_term *terms;   /* one for each term of the model; the caller's */
    bool implicit;               /* the integrator has a linear solver; else only the residual is measured */
    const char *linear_solver;   /* the row that was asked for; "" for none */
    const char *linear_picked;   /* the row that solves: it, or what it picked for this size */
    char linear_why[96];         /* it was picked; "" where nothing was */
    const char *linear_fallback; /* the row that was measured where the matrix was not for its method; "": it
                                    was */
    double dt;                   /* [s] that weights the Jacobian */
    double residual_seconds, jacobian_seconds, factor_seconds, solve_seconds;
    drape_status factor_status; /* DRAPE_RETRY_LINEAR: there were no factors to measure */
    size_t model_bytes, mesh_bytes, pattern_bytes, system_bytes, integrator_bytes, state_bytes;
} drape_profile;

/* terms: room for the terms of the model. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER, DRAPE_E_STOPPED. */
drape_status drape_profile_measure(drape_context *ctx, const drape_sim *sim, drape_profile_term *terms,
                                   drape_profile *out);

/* Of one Newton iteration: residual, Jacobian, factor, solve. */
double drape_profile_seconds(const drape_profile *profile);

/* All memory, factors included. */
size_t drape_profile_bytes(const drape_profile *profile);

#endif
