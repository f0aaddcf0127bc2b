/* sim.c: reading a sim, and what all files of the room ask of it. */
#include "sim/sim.h"

#include <math.h>

double drape_sim_time(const drape_sim *sim)
{
    return sim ? drape_sim_state(sim)->t : 0;
}

const double *drape_sim_positions(const drape_sim *sim)
{
    return sim ? drape_sim_state(sim)->x : NULL;
}

const double *drape_sim_velocities(const drape_sim *sim)
{
    return sim ? drape_sim_state(sim)->v : NULL;
}

void drape_sim_normals(const drape_sim *sim, double *normals)
{
    if (sim)
        drape_model_normals(sim->model, drape_sim_state(sim)->x, normals);
}

/* A store to an atomic without a lock: safe in a signal handler. */
void drape_sim_cancel(drape_sim *sim)
{
    if (sim)
        atomic_store(&sim->cancel, true);
}

drape_status drape_sim_check_cancel(drape_sim *sim)
{
    if (!drape_ranks_any(drape_model_ranks(sim->model), atomic_exchange(&sim->cancel, false)))
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_STOPPED, "t=%.9g: cancelled", drape_sim_state(sim)->t);
}

const drape_model *drape_sim_model(const drape_sim *sim)
{
    return sim ? sim->model : NULL;
}

uint64_t drape_sim_hash(const drape_sim *sim)
{
    return sim ? drape_state_hash(sim->model, drape_sim_state(sim)) : 0;
}

double drape_sim_tolerance(const drape_sim *sim)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    return integrator->tolerance ? integrator->tolerance(sim->integrator) : NAN;
}

double drape_sim_error_bound(const drape_sim *sim)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    return integrator->error_bound ? integrator->error_bound(sim->integrator) : NAN;
}

drape_statistics drape_sim_statistics(const drape_sim *sim)
{
    if (!sim)
        return (drape_statistics){0};
    drape_statistics s = sim->statistics;
    drape_work work = drape_work_sum(sim->chosen.integrator->work(sim->integrator), &sim->earlier);
    s.newton_iterations = work.newton_iterations;
    s.jacobians = work.jacobians;
    s.factorizations = work.factorizations;
    s.linear_iterations = work.linear_iterations;
    s.residuals = work.residuals;
    s.stability_known = work.stability_known;
    s.unstable_modes = work.unstable_modes;
    s.tolerance = drape_sim_tolerance(sim);
    s.error_bound = drape_sim_error_bound(sim);
    s.wall_residual = work.residual_seconds;
    s.wall_jacobian = work.jacobian_seconds;
    s.wall_factor = work.factor_seconds;
    s.wall_solve = work.solve_seconds;
    return s;
}

const char *drape_sim_reason(const drape_sim *sim, int index, int64_t *count)
{
    bool there = sim && index >= 0 && index < sim->reason_count;
    if (count)
        *count = there ? sim->reasons[index].count : 0;
    return there ? drape_system_reason_name(sim->system, sim->reasons[index].reason) : NULL;
}

drape_status drape_sim_observe(drape_sim *sim, drape_observer *observer, void *user)
{
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (!observer)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_observe: the function is NULL");
    if (sim->observer_count == DRAPE_MAX_OBSERVERS)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "a sim has at most %d observers", DRAPE_MAX_OBSERVERS);
    sim->observers[sim->observer_count] = observer;
    sim->observer_users[sim->observer_count++] = user;
    return DRAPE_OK;
}

drape_status drape_sim_guard(drape_sim *sim, const char *function)
{
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (sim->notifying)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "%s: an observer must not call it while the sim advances", function);
    if (sim->advancing)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "%s: a wind, a term or an event must not call it while the sim advances", function);
    return DRAPE_OK;
}

drape_status drape_sim_check_nodes(const drape_sim *sim, const char *function, int32_t count,
                                   const int32_t *nodes)
{
    if (count < 0 || (count > 0 && !nodes))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: %d nodes, but no list of them", function,
                          (int)count);
    for (int32_t i = 0; i < count; i++)
        if (nodes[i] < 0 || nodes[i] >= sim->model->node_count)
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: node %d; there are 0 to %d", function,
                              (int)nodes[i], (int)sim->model->node_count - 1);
    return DRAPE_OK;
}

drape_status drape_sim_read_status(const drape_sim *sim)
{
    drape_status status = drape_system_status(sim->system);
    return status == DRAPE_E_STOPPED ? DRAPE_OK : status;
}

drape_status drape_sim_reactions_at(drape_sim *sim, const drape_point *point, double *forces)
{
    drape_system_reactions(sim->system, point, forces);
    return drape_sim_read_status(sim);
}

drape_status drape_sim_notify(drape_sim *sim, const drape_event *event)
{
    for (int i = 0; i < sim->observer_count; i++) {
        sim->notifying = true;
        drape_status status = sim->observers[i](sim->observer_users[i], event);
        sim->notifying = false;
        status = drape_ranks_agree(drape_model_ranks(sim->model), sim->ctx, status);
        if (status > 0)
            return drape_fail(sim->ctx, DRAPE_E_STOPPED, "t=%.9g: an observer asked to stop",
                              drape_sim_state(sim)->t);
        if (status < 0)
            return drape_fail_unsaid(sim->ctx, status, "", "t=%.9g: an observer stopped the run with %s",
                                     drape_sim_state(sim)->t, drape_status_name(status));
    }
    return DRAPE_OK;
}
