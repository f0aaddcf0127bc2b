/* reason.c: see reason.h. */
#include "base/reason.h"

#define REASON(name_, by, meaning) (&(const drape_entry){.name = name_, .summary = meaning, .reference = by})

static const drape_entry *const reasons[DRAPE_REASON_COUNT + 1] = {
    [DRAPE_REASON_CONVERGED] =
        REASON("converged", "all integrators", "accepted: the residual is within `tolerance`"),
    [DRAPE_REASON_ROUNDING] =
        REASON("rounding", "Newton",
               "accepted: the residual is above `tolerance`, but within the rounding error of "
               "the forces that it sums"),
    [DRAPE_REASON_LOCAL_ERROR] =
        REASON("local_error", "Newton",
               "accepted: the residual is above the default `tolerance`, but what is left is small beside "
               "the step's own error"),
    [DRAPE_REASON_CORRECTION] =
        REASON("correction", "newton_k",
               "accepted: the residual is above `tolerance`, but what is left is estimated within `error`"),
    [DRAPE_REASON_ITERATIONS] =
        REASON("iterations", "newton_k",
               "accepted after the given number of iterations, with a residual above `tolerance`"),
    [DRAPE_REASON_HELD] =
        REASON("held", "time budget",
               "accepted: the step failed again and again, and the cloth was held where it was, or went "
               "with its pins"),
    [DRAPE_REASON_RESIDUAL] =
        REASON("residual", "Newton, newton_k", "the residual is too large after all iterations"),
    [DRAPE_REASON_STAGNATION] = REASON(
        "stagnation", "KINSOL", "corrections became too small to change the state, short of the tolerance"),
    [DRAPE_REASON_MAX_ITERATIONS] =
        REASON("max_iterations", "KINSOL", "not converged after `max_iterations`"),
    [DRAPE_REASON_LINE_SEARCH] =
        REASON("line_search", "KINSOL", "no step along the correction makes the residual smaller"),
    [DRAPE_REASON_NEWTON_STEP] =
        REASON("newton_step", "KINSOL", "five corrections in a row had the largest allowed size"),
    [DRAPE_REASON_NEWTON] =
        REASON("newton", "ida, radau", "Newton's corrections do not converge at this step size"),
    [DRAPE_REASON_SINGULAR] =
        REASON("singular", "KINSOL, IDA, newton_k, radau", "a factorisation or a linear solve failed"),
    [DRAPE_REASON_SOLVER] = REASON("solver", "KINSOL, IDA", "any other failure that these libraries report"),
    [DRAPE_REASON_MEMORY] =
        REASON("memory", "Newton, newton_k, dirk", "memory for the factors, or for the first step, ran out"),
    [DRAPE_REASON_NONFINITE] = REASON("nonfinite", "all integrators",
                                      "an infinity or NaN in the residual, the Jacobian or the new state"),
    [DRAPE_REASON_ERROR_TEST] =
        REASON("error_test", "integrators with steps of their own, the controller error",
               "the local error is above the tolerance"),
    [DRAPE_REASON_ROUND_OFF] = REASON("round_off", "integrators with steps of their own",
                                      "the tolerance is below the rounding error of the state"),
    [DRAPE_REASON_MAX_STEPS] = REASON("max_steps", "integrators with steps of their own",
                                      "more steps in a second of simulated time than `max_steps`"),
    [DRAPE_REASON_MAX_SUBSTEPS] =
        REASON("max_substeps", "verlet", "more than 10000 substeps in a step whose number is not given"),
    [DRAPE_REASON_MOVE] =
        REASON("move", "the controller strain", "a node moved further in one step than `max_move` allows"),
    [DRAPE_REASON_STRETCH] =
        REASON("stretch", "the controller strain",
               "the strain of an edge changed more in one step than `max_stretch` allows"),
    [DRAPE_REASON_UNSTABLE] =
        REASON("unstable", "the controller stable", "the step is beyond the explicit stability limit"),
    [DRAPE_REASON_BLOW_UP] = REASON("blow_up", "verlet", "a node is faster than 1e6 m/s"),
    [DRAPE_REASON_STALLED] = REASON(
        "stalled", "static", "no direction lowers the energy further, and the state is not an equilibrium"),
    [DRAPE_REASON_ENERGY] =
        REASON("energy", "the energy audit", "the step, or the run so far, created energy"),
    [DRAPE_REASON_EDGE_COLLAPSE] =
        REASON("edge_collapse", "stretch.edge", "an edge shrank below 1e-6 of its length at rest"),
    [DRAPE_REASON_ALTITUDE_COLLAPSE] = REASON("altitude_collapse", "bend.hinge, bend.midedge",
                                              "an altitude of a triangle shrank below 1e-6 of one at rest"),
    [DRAPE_REASON_AREA_COLLAPSE] =
        REASON("area_collapse", "stretch.cst", "a triangle shrank below 1e-6 of its area at rest"),
    [DRAPE_REASON_SPRING_COLLAPSE] =
        REASON("spring_collapse", "springs", "a spring shrank below 1e-6 of its length at rest"),
    [DRAPE_REASON_HINGE_BRANCH] = REASON("hinge_branch", "bend.hinge, bend.midedge",
                                         "a hinge turned so far in one step that its angle is ambiguous"),
    [DRAPE_REASON_STRAIN_LIMIT] = REASON("strain_limit", "limit.strain", "an edge is beyond `limit`"),
    [DRAPE_REASON_PENETRATION] =
        REASON("penetration", "contact", "cloth is deeper in a collider than allowed"),
    [DRAPE_REASON_COLLISION] = REASON(
        "collision", "contact", "a piece passed through another between the start and the end of the step"),
    [DRAPE_REASON_EVENT] =
        REASON("event", "the sim",
               "an event that acts lies within the step, which is repeated so that it ends there"),
    [DRAPE_REASON_CANCELLED] =
        REASON("cancelled", "the host", "`drape_sim_cancel` was called during the attempt"),
    [DRAPE_REASON_OTHER] = REASON("other", "statistics", "all reasons beyond the 31st"),
};

const drape_registry drape_reason_registry = {
    "reason", "reasons", "Reasons", "`reason` in steps.csv, summary.json and drape_attempt", reasons, NULL};

const char *drape_reason_name(drape_reason reason)
{
    return reasons[reason]->name;
}
