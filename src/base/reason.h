/* reason.h: why an attempt at a step was accepted or rejected: the reasons in steps.csv, in summary.json and
 * in drape_attempt. One table has all of those that Drape itself reports, each with its meaning; `drape list
 * reasons` prints it. User-defined terms report reasons of their own, which a system numbers from
 * DRAPE_REASON_COUNT on (drape_system_reason). */
#ifndef DRAPE_BASE_REASON_H
#define DRAPE_BASE_REASON_H

#include "base/registry.h"

/* The names of the constants, names, who reports them, meanings. */
#define DRAPE_REASONS(X)                                                                                     \
    X(CONVERGED, "converged", "all integrators", "accepted: the residual is within `tolerance`")             \
    X(ROUNDING, "rounding", "Newton",                                                                        \
      "accepted: the residual is above `tolerance`, but within the rounding error of the forces that it "    \
      "sums")                                                                                                \
    X(LOCAL_ERROR, "local_error", "Newton",                                                                  \
      "accepted: the residual is above the default `tolerance`, but what is left is small beside the "       \
      "step's own error")                                                                                    \
    X(CORRECTION, "correction", "newton_k",                                                                  \
      "accepted: the residual is above `tolerance`, but what is left is estimated within `error`")           \
    X(ITERATIONS, "iterations", "newton_k",                                                                  \
      "accepted after the given number of iterations, with a residual above `tolerance`")                    \
    X(HELD, "held", "time budget",                                                                           \
      "accepted: the step failed again and again, and the cloth was held where it was, or went with its "    \
      "pins")                                                                                                \
    X(RESIDUAL, "residual", "Newton, newton_k, the sim", "the residual is too large after all iterations")   \
    X(STAGNATION, "stagnation", "KINSOL",                                                                    \
      "corrections became too small to change the state, short of the tolerance")                            \
    X(MAX_ITERATIONS, "max_iterations", "KINSOL", "not converged after `max_iterations`")                    \
    X(LINE_SEARCH, "line_search", "KINSOL", "no step along the correction makes the residual smaller")       \
    X(NEWTON_STEP, "newton_step", "KINSOL", "five corrections in a row had the largest allowed size")        \
    X(NEWTON, "newton", "ida, radau", "Newton's corrections do not converge at this step size")              \
    X(SINGULAR, "singular", "KINSOL, IDA, newton_k, radau", "a factorisation or a linear solve failed")      \
    X(SOLVER, "solver", "KINSOL, IDA", "any other failure that these libraries report")                      \
    X(MEMORY, "memory", "Newton, newton_k, dirk", "memory for the factors, or for the first step, ran out")  \
    X(NONFINITE, "nonfinite", "all integrators",                                                             \
      "an infinity or NaN in the residual, the Jacobian or the new state")                                   \
    X(ERROR_TEST, "error_test", "integrators with steps of their own, the controller error",                 \
      "the local error is above the tolerance")                                                              \
    X(ROUND_OFF, "round_off", "integrators with steps of their own",                                         \
      "the tolerance is below the rounding error of the state")                                              \
    X(MAX_STEPS, "max_steps", "integrators with steps of their own",                                         \
      "more steps in a second of simulated time than `max_steps`")                                           \
    X(MAX_SUBSTEPS, "max_substeps", "verlet",                                                                \
      "more than 10000 substeps in a step whose number is not given")                                        \
    X(MOVE, "move", "the controller strain", "a node moved further in one step than `max_move` allows")      \
    X(STRETCH, "stretch", "the controller strain",                                                           \
      "the strain of an edge changed more in one step than `max_stretch` allows")                            \
    X(UNSTABLE, "unstable", "the controller stable", "the step is beyond the explicit stability limit")      \
    X(BLOW_UP, "blow_up", "verlet", "a node is faster than 1e6 m/s")                                         \
    X(STALLED, "stalled", "static",                                                                          \
      "no direction lowers the energy further, and the state is not an equilibrium")                         \
    X(ENERGY, "energy", "the energy audit", "the step, or the run so far, created energy")                   \
    X(EDGE_COLLAPSE, "edge_collapse", "stretch.edge", "an edge shrank below 1e-6 of its length at rest")     \
    X(ALTITUDE_COLLAPSE, "altitude_collapse", "bend.hinge, bend.midedge",                                    \
      "an altitude of a triangle shrank below 1e-6 of one at rest")                                          \
    X(AREA_COLLAPSE, "area_collapse", "stretch.cst", "a triangle shrank below 1e-6 of its area at rest")     \
    X(SPRING_COLLAPSE, "spring_collapse", "springs", "a spring shrank below 1e-6 of its length at rest")     \
    X(HINGE_BRANCH, "hinge_branch", "bend.hinge, bend.midedge",                                              \
      "a hinge turned so far in one step that its angle is ambiguous")                                       \
    X(STRAIN_LIMIT, "strain_limit", "limit.strain", "an edge is beyond `limit`")                             \
    X(PENETRATION, "penetration", "contact", "cloth is deeper in a collider than allowed")                   \
    X(COLLISION, "collision", "contact",                                                                     \
      "a piece passed through another between the start and the end of the step")                            \
    X(EVENT, "event", "the sim",                                                                             \
      "an event that acts lies within the step, which is repeated so that it ends there")                    \
    X(CANCELLED, "cancelled", "the host", "`drape_sim_cancel` was called during the attempt")                \
    X(OTHER, "other", "statistics", "all reasons of user-defined terms beyond the 31st")

#define DRAPE_REASON_CONSTANT(constant, name, by, meaning) DRAPE_REASON_##constant,
typedef enum drape_reason { DRAPE_REASONS(DRAPE_REASON_CONSTANT) DRAPE_REASON_COUNT } drape_reason;

/* The name of a reason, static: "converged". */
const char *drape_reason_name(drape_reason reason);

/* The reason of that name; DRAPE_REASON_COUNT: none is called so. */
drape_reason drape_reason_named(const char *name);

extern const drape_registry
    drape_reason_registry; /* in the order of drape_reason; reference: who reports it */

#endif
