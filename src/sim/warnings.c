/*
 * warnings.c: drape_sim_warning: runs that complete and are yet unlikely to be what was wanted. Each
 * check is a function that describes what it found; none of them changes the sim.
 */
#include "sim/warnings.h"

#include "colliders/colliders.h"
#include "sim/sim.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MOST   0.5  /* of the energy, of the time */
#define MANY   3.0  /* Newton iterations an attempt */
#define INSIDE 1e-9 /* [m] a node less deep than this is not inside: contact allows it */

/* A cloth of which nothing but its weight is modelled falls like dust. */
static bool has_no_terms(drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    int bare = 0, first = -1;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        int count = 0;
        for (int32_t i = 0; i < m->term_count; i++)
            count += m->terms[i].cloth == c && !m->terms[i].ops->from_scene_gravity;
        if (count > 0)
            continue;
        first = bare++ ? first : c;
    }
    if (bare == 0)
        return false;
    snprintf(text, size,
             "/cloth/%d: %s has no \"terms\": nothing resists stretching or bending%s; `drape list terms` "
             "shows them",
             first, m->cloths[first].name, bare > 1 ? ", as with other cloths of this scene" : "");
    return true;
}

static bool has_few_steps(drape_sim *sim, char *text, size_t size)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    const double dt = drape_chosen_integrator_value(&sim->chosen, "dt", NAN),
                 steps = sim->model->duration / dt;
    if (integrator->own_steps || !(steps < DRAPE_FEW_STEPS * (1 - 1e-9)))
        return false;
    snprintf(text, size,
             "the duration of %.4g s is only %.3g steps of dt = %.4g s: for motion that is resolved, choose "
             "a smaller dt",
             sim->model->duration, ceil(steps), dt);
    return true;
}

/* Whether free nodes at x are inside a collider, of the first of which it then writes the text. A pinned
 * node may be there on purpose, and faces of which only the middle is inside do not count: some contact is
 * kept at nodes only. */
static bool describe_inside(const drape_sim *sim, const double *x, bool start, char *text, size_t size)
{
    const drape_model *m = sim->model;
    for (int32_t c = 0; c < m->collider_count; c++) {
        drape_collider_pose pose = drape_collider_pose_at(&m->colliders[c], 0);
        const drape_collider_motion motion = drape_sim_collider(sim, c);
        if (!start)
            memcpy(pose.displacement, motion.displacement, sizeof pose.displacement);
        double deepest = 0;
        int32_t count = 0;
        for (int32_t f = 0; f < m->free_count; f++) {
            const double *at = x + 3 * (size_t)m->node_of_free[f];
            const double depth = -drape_collider_distance(&m->colliders[c], &pose, at, NULL, NULL);
            count += depth > INSIDE;
            deepest = fmax(deepest, depth);
        }
        if (count == 0)
            continue;
        snprintf(text, size, "/colliders/%d: %d free node%s of the cloth %s%s inside %s, up to %.3g m deep%s",
                 (int)c, (int)count, count == 1 ? "" : "s", start ? "start" : "end", count == 1 ? "s" : "",
                 m->colliders[c].name, deepest, start ? ": move the cloth or the collider" : "");
        return true;
    }
    return false;
}

static bool starts_inside(drape_sim *sim, char *text, size_t size)
{
    return describe_inside(sim, sim->model->rest, true, text, size);
}

static bool ends_inside(drape_sim *sim, char *text, size_t size)
{
    return sim->statistics.steps_accepted > 0 &&
           describe_inside(sim, drape_sim_positions(sim), false, text, size);
}

/* Energy that the integrator took, as a share of all that went in: by gravity, pins, colliders, hosts and
 * wind. */
static bool dissipates_most(drape_sim *sim, char *text, size_t size)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    if (integrator->steady_state || sim->statistics.steps_accepted == 0)
        return false;
    const drape_energy e = drape_sim_energy(sim);
    const double in = drape_sim_energy_received(sim), share = e.numerical / in;
    if (!(in > 0) || !(share > MOST))
        return false;
    snprintf(text, size,
             "%s dissipated %.0f %% of the energy that went in, %.3g of %.3g J: %s dissipates less",
             integrator->entry.name, 100 * share, e.numerical, in,
             integrator->own_steps    ? "a smaller rtol"
             : integrator->order == 1 ? "a smaller dt, or an integrator of second order such as bdf2,"
                                      : "a smaller dt");
    return true;
}

static bool has_implicit_friction(const drape_model *m)
{
    bool any = m->contact.self_friction > 0;
    for (int32_t c = 0; c < m->collider_count; c++)
        any |= m->colliders[c].friction > 0;
    return any && !m->contact.lagged;
}

/* Contact that takes most of the time, and longer than the motion lasts, where a setting is known to
 * help. Measured on examples/scenes over 0.5 s: lagged friction halves the time of crumple and fold;
 * newton_k takes a third of the time of crumple, a seventh of that of floor_drop, half of that of
 * sphere_drape. */
static bool is_contact_slow(drape_sim *sim, char *text, size_t size)
{
    const drape_statistics s = drape_sim_statistics(sim);
    const double attempts = (double)(s.steps_accepted + s.steps_rejected), motion = drape_sim_time(sim);
    const bool friction = s.newton_iterations > 0 && has_implicit_friction(sim->model);
    if (!(s.wall_contact > MOST * s.wall_steps) || !(s.wall_contact > motion) ||
        !(friction || (double)s.newton_iterations > MANY * attempts))
        return false;
    snprintf(text, size, "contact takes %.0f %% of the time of the steps, %.3g s for %.3g s of motion: %s",
             100 * s.wall_contact / s.wall_steps, s.wall_contact, motion,
             friction ? "\"friction\": \"lagged\" in \"contact\" takes less"
                      : "\"newton_k\", which makes few Newton iterations a step, takes less");
    return true;
}

static const struct {
    const char *name;
    bool (*applies)(drape_sim *sim, char *text, size_t size);
} checks[] = {{"no_terms", has_no_terms},
              {"few_steps", has_few_steps},
              {"starts_inside", starts_inside},
              {"ends_inside", ends_inside},
              {"numerical_dissipation", dissipates_most},
              {"slow_contact", is_contact_slow}};

bool drape_sim_warning(drape_sim *sim, int index, drape_warning *out)
{
    int found = 0;
    for (size_t i = 0; sim && out && index >= 0 && i < sizeof checks / sizeof *checks; i++)
        if (checks[i].applies(sim, out->text, sizeof out->text) && found++ == index) {
            out->name = checks[i].name;
            return true;
        }
    if (out)
        *out = (drape_warning){.name = ""};
    return false;
}
