/*
 * audit.c: where the energy goes. Kinetic, elastic and gravitational energy are of the state; what damping
 * terms took and moving pins put in is summed over accepted steps by the integrators; the remainder is the
 * integrator's own.
 */
#include "sim/sim.h"

#include <math.h>

#define JUMP      4.0  /* a kinetic energy that grew by less is no explosion */
#define SHARE     0.5  /* nor one of which less than this came from nowhere */
#define UNNOTICED 1e-6 /* of the energies that are compared: less is below what adaptive rows resolve */

static double kinetic(const drape_model *model, const double *v)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)model->node_count; i++)
        sum += model->mass[i] *
               (v[3 * i] * v[3 * i] + v[3 * i + 1] * v[3 * i + 1] + v[3 * i + 2] * v[3 * i + 2]);
    return 0.5 * sum;
}

drape_energy drape_sim_energy(drape_sim *sim)
{
    if (!sim)
        return (drape_energy){0};
    const drape_state *state = drape_sim_state(sim);
    if (sim->energy_known)
        return sim->energy;
    drape_energy e = {.kinetic = kinetic(sim->model, state->v), .dissipated = sim->dissipated};
    const drape_point point = {.x = state->x, .v = state->v, .internal = state->internal};
    drape_system_energy(sim->system, &point, &e.elastic, &e.gravity);
    e.numerical = sim->start_energy + sim->pin_work - e.dissipated - (e.kinetic + e.elastic + e.gravity);
    sim->energy = e;
    sim->energy_known = true;
    return e;
}

bool drape_sim_ran_away(drape_sim *sim, const drape_state *out, const drape_step_info *info,
                        drape_worst *worst)
{
    const drape_state *in = drape_sim_state(sim);
    double before = kinetic(sim->model, in->v), after = kinetic(sim->model, out->v), elastic, gravity;
    if (!(after > JUMP * before))
        return false;
    drape_energy e = drape_sim_energy(sim);
    const drape_point point = {.x = out->x, .v = out->v, .internal = in->internal};
    drape_system_energy(sim->system, &point, &elastic, &gravity);
    double gain =
        after + elastic + gravity + info->dissipated - info->pin_work - (e.kinetic + e.elastic + e.gravity);
    double size = after + fabs(elastic) + fabs(gravity) + fabs(e.elastic) + fabs(e.gravity);
    if (!(gain > SHARE * after && gain > UNNOTICED * size))
        return false;
    *worst = (drape_worst){.what = "energy from nowhere / kinetic energy",
                           .term = "",
                           .element = -1,
                           .node = {-1, -1, -1, -1},
                           .cloth = -1,
                           .value = gain / after,
                           .limit = SHARE};
    return true;
}
