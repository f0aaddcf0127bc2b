/* quantity.c: see quantity.h. */
#include "lab/quantity.h"

static const lab_quantity
    energy_drift = {{.name = "energy_drift",
                     .summary = "energy that the method gained (negative) or lost / largest kinetic energy"},
                    ""},
    energy_numerical = {{.name = "energy_numerical_J",
                         .summary = "energy that the method gained (negative) or lost"},
                        "J"},
    strain_max = {{.name = "strain_max", .summary = "largest strain of an edge"}, ""},
    strain_min = {{.name = "strain_min", .summary = "smallest strain of an edge"}, ""},
    accepted = {{.name = "accepted", .summary = "accepted steps"}, ""},
    rejected = {{.name = "rejected", .summary = "rejected attempts at steps"}, ""},
    rejected_share = {{.name = "rejected_share", .summary = "rejected attempts / all attempts"}, ""},
    unconverged = {{.name = "unconverged", .summary = "steps accepted although they had not converged"}, ""},
    iterations = {{.name = "iterations", .summary = "iterations of Newton's method"}, ""},
    iterations_per_step = {{.name = "iterations_per_step",
                            .summary = "iterations of Newton's method / accepted steps"},
                           ""},
    residuals = {{.name = "residuals", .summary = "evaluations of the residual"}, ""},
    jacobians = {{.name = "jacobians", .summary = "Jacobian matrices"}, ""},
    factorizations = {{.name = "factorizations", .summary = "factorisations"}, ""},
    linear_iterations = {{.name = "linear_iterations", .summary = "iterations of the linear solver"}, ""},
    cpu = {{.name = "cpu_s", .summary = "CPU time of the steps"}, "s"},
    wall = {{.name = "wall_s", .summary = "wall-clock time of the steps"}, "s"},
    h_min = {{.name = "h_min_s", .summary = "smallest accepted step"}, "s"},
    h_max = {{.name = "h_max_s", .summary = "largest accepted step"}, "s"},
    explicit_limit = {
        {.name = "explicit_limit_s", .summary = "stability limit of an explicit method at the start"}, "s"};

static const drape_entry *const entries[] = {&energy_drift.entry,
                                             &energy_numerical.entry,
                                             &strain_max.entry,
                                             &strain_min.entry,
                                             &accepted.entry,
                                             &rejected.entry,
                                             &rejected_share.entry,
                                             &unconverged.entry,
                                             &iterations.entry,
                                             &iterations_per_step.entry,
                                             &residuals.entry,
                                             &jacobians.entry,
                                             &factorizations.entry,
                                             &linear_iterations.entry,
                                             &cpu.entry,
                                             &wall.entry,
                                             &h_min.entry,
                                             &h_max.entry,
                                             &explicit_limit.entry,
                                             NULL};

const drape_registry lab_quantity_registry = {
    .noun = "result", .key = "results", .title = "Results", .place = "", .entries = entries};

const lab_quantity *lab_quantity_at(int index)
{
    /* The entry is the first member. */
    return (const lab_quantity *)(const void *)drape_registry_entry(&lab_quantity_registry, NULL, index);
}
