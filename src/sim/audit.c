/*
 * audit.c: where the energy goes. Kinetic, elastic and gravitational energy are of the state; what damping
 * terms took and moving pins put in is summed over accepted steps by the integrators; the remainder is the
 * integrator's own.
 */
#include "integrators/tolerance.h"
#include "sim/sim.h"

#include <math.h>

#define JUMP      4.0   /* a kinetic energy that grew by less is no explosion */
#define SHARE     0.5   /* nor one of which less than this came from nowhere */
#define UNNOTICED 1e-6  /* of the energies that are compared: less is below what adaptive rows resolve */
#define QUIET     1e-16 /* of the scene's own energy: motion at 1e-8 of its speed is rounding */

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
    const drape_point point = {.x = state->x, .v = state->v, .internal = state->internal, .t = state->t};
    drape_system_energy(sim->system, &point, &e.elastic, &e.gravity);
    e.contact = drape_system_contact_energy(sim->system, &point);
    e.numerical =
        sim->start_energy + sim->pin_work - e.dissipated - (e.kinetic + e.elastic + e.gravity + e.contact);
    sim->energy = e;
    sim->energy_known = true;
    return e;
}

void drape_sim_reset_energy(drape_sim *sim)
{
    sim->dissipated = sim->pin_work = 0;
    sim->energy_known = false;
    drape_energy e = drape_sim_energy(sim);
    sim->start_energy = e.kinetic + e.elastic + e.gravity + e.contact;
    sim->energy_known = false;
}

/* The energy of the scene's mass at the scene's speed: the unit in which rounding may move a sheet at
 * rest. */
static double scene_energy(const drape_model *m)
{
    double mass = 0, atol_x = NAN, atol_v = NAN;
    drape_derive_tolerances(m, 1, &atol_x, &atol_v);
    for (int32_t i = 0; i < m->node_count; i++)
        mass += m->mass[i];
    return 0.5 * mass * atol_v * atol_v;
}

/* The node that moves with the most energy. */
static int32_t hottest(const drape_model *m, const double *v)
{
    int32_t node = 0;
    double most = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *u = v + 3 * (size_t)i;
        double energy = m->mass[i] * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        if (energy > most) {
            most = energy;
            node = i;
        }
    }
    return node;
}

bool drape_sim_ran_away(drape_sim *sim, const drape_state *out, const drape_step_info *info,
                        drape_worst *worst)
{
    const drape_state *in = drape_sim_state(sim);
    double before = kinetic(sim->model, in->v), after = kinetic(sim->model, out->v), elastic, gravity;
    if (!(after > JUMP * before))
        return false;
    drape_energy e = drape_sim_energy(sim);
    const drape_point point = {.x = out->x, .v = out->v, .internal = in->internal, .t = out->t};
    drape_system_energy(sim->system, &point, &elastic, &gravity);
    double gain = after + elastic + gravity + drape_system_contact_energy(sim->system, &point) +
                  info->dissipated - info->pin_work - (e.kinetic + e.elastic + e.gravity + e.contact);
    double size = after + fabs(elastic) + fabs(gravity) + fabs(e.elastic) + fabs(e.gravity);
    if (!(gain > SHARE * after && gain > UNNOTICED * size + QUIET * scene_energy(sim->model)))
        return false;
    int32_t node = hottest(sim->model, out->v);
    *worst = (drape_worst){.what = "energy from nowhere / kinetic energy",
                           .term = "",
                           .element = -1,
                           .node = {node, -1, -1, -1},
                           .cloth = drape_model_cloth_of(sim->model, node),
                           .value = gain / after,
                           .limit = SHARE};
    return true;
}
