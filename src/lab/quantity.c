/* quantity.c: see quantity.h. */
#include "lab/quantity.h"

#define QUANTITY(id, unit_text, text)                                                                        \
    &((const lab_quantity){.entry = {.name = id, .summary = text}, .unit = unit_text}).entry

static const drape_entry *const entries[] = {
    QUANTITY("energy_drift", "", "energy that the method gained (negative) or lost / largest kinetic energy"),
    QUANTITY("energy_numerical_J", "J", "energy that the method gained (negative) or lost"),
    QUANTITY("strain_max", "", "largest strain of an edge"),
    QUANTITY("strain_min", "", "smallest strain of an edge"),
    QUANTITY("accepted", "", "accepted steps"),
    QUANTITY("rejected", "", "rejected attempts at steps"),
    QUANTITY("rejected_share", "", "rejected attempts / all attempts"),
    QUANTITY("unconverged", "", "steps accepted although they had not converged"),
    QUANTITY("iterations", "", "iterations of Newton's method"),
    QUANTITY("iterations_per_step", "", "iterations of Newton's method / accepted steps"),
    QUANTITY("residuals", "", "evaluations of the residual"),
    QUANTITY("jacobians", "", "Jacobian matrices"),
    QUANTITY("factorizations", "", "factorisations"),
    QUANTITY("linear_iterations", "", "iterations of the linear solver"),
    QUANTITY("cpu_s", "s", "CPU time of the steps"),
    QUANTITY("wall_s", "s", "wall-clock time of the steps"),
    QUANTITY("h_min_s", "s", "smallest accepted step"),
    QUANTITY("h_max_s", "s", "largest accepted step"),
    QUANTITY("explicit_limit_s", "s", "stability limit of an explicit method at the start"),
    NULL,
};

const drape_registry lab_quantity_registry = {
    .noun = "result", .key = "results", .title = "Results", .place = "", .entries = entries};

const lab_quantity *lab_quantity_at(int index)
{
    /* The entry is the first member. */
    return (const lab_quantity *)(const void *)drape_registry_entry(&lab_quantity_registry, NULL, index);
}
