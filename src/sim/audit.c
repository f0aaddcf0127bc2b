/*
 * audit.c: the energy account of a run. Kinetic, elastic and gravitational energy are functions of the
 * state; the integrators sum what damping terms dissipated and the work of pins, colliders and loads over
 * accepted steps; the remainder is the numerical dissipation of the integrator. Loads with a potential have
 * it in `gravity` here: it is available to the motion.
 *
 * Kinetic energy is that of the free nodes. The motion of pinned nodes is prescribed: the energy that
 * accelerates them is not part of the account. For a pin that jumps it would be so large that everything
 * else would be lost in its rounding error.
 */
#include "integrators/tolerance.h"
#include "sim/rescue.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* In an explosion, kinetic energy grows by more than JUMP, and more than SHARE of it has no known source. */
#define JUMP  4.0 /* factor of the kinetic energy in one step */
#define SHARE 0.5 /* fraction of the kinetic energy at the end of the step */
/* Fraction of the energies at hand: smaller gains are below what adaptive integrators resolve. Where cloth
 * turns round in contact its kinetic energy passes through 0, and any error is large beside it. */
#define UNNOTICED 1e-4
/* Fraction of the energy available to the run: smaller gains are rounding errors. Not proportional to the
 * step size: small steps gain little each. */
#define ROUNDED (4096 * DBL_EPSILON)
#define AT_REST 1e-3 /* fraction of the scene's own energy, below which a run is at rest */
/* Fraction of the scene's own energy: motion at 1e-8 of the scene's speed is rounding error. */
#define QUIET DBL_EPSILON

/* Limits relative to the energy available to the run so far. Integrators that conserve energy, or bound an
 * error, let it oscillate by some per cent. */
#define STEP_GAIN 0.25 /* gained in one step */
/* gained since numerical dissipation was largest, where an integrator does not set another limit; or left to
 * gain in a step that is not solved */
#define RUN_GAIN 0.1
/* The same of a solver that stops before it converges, with the work of the residuals that it left: F d in a
 * step of displacement d, with which a step of backward Euler ends as if F were a force of the host. For a
 * convex energy that bounds what the step can gain, so such a gain is an error that the next steps take back,
 * not an instability of the method; but a run that has gained half of what was ever available is running
 * away, whatever its residuals. */
#define UNCONVERGED_GAIN 0.5

static double kinetic(const drape_model *model, const double *v)
{
    double sum = 0;
    for (int32_t f = 0; f < model->free_count; f++) {
        size_t i = (size_t)model->node_of_free[f];
        sum += model->mass[i] *
               (v[3 * i] * v[3 * i] + v[3 * i + 1] * v[3 * i + 1] + v[3 * i + 2] * v[3 * i + 2]);
    }
    return 0.5 * drape_ranks_sum(drape_model_ranks(model), sum);
}

/* The energy of a state, given the internal variables of the state before it and the work so far. */
static drape_energy measure_at(const drape_sim *sim, const drape_point *point)
{
    drape_energy e = {.kinetic = kinetic(sim->model, point->v)};
    drape_system_energy(sim->system, point, &e.elastic, &e.gravity);
    e.contact = drape_system_contact_energy(sim->system, point);
    if (sim->model->has_kinetic) {
        double of_terms = 0, potential = 0;
        drape_system_motion_energy(sim->system, point, &of_terms, &potential);
        e.kinetic += of_terms;
        e.gravity += potential;
    }
    return e;
}

static drape_energy measure(const drape_sim *sim, const drape_state *state, const double *internal,
                            double dissipated, double work)
{
    drape_energy e =
        measure_at(sim, &(drape_point){.x = state->x, .v = state->v, .internal = internal, .t = state->t});
    e.dissipated = dissipated;
    e.numerical = sim->audit.start + work - dissipated - (e.kinetic + e.elastic + e.gravity + e.contact);
    return e;
}

drape_energy drape_sim_energy_of(const drape_sim *sim, double t, const double *x, const double *v)
{
    return measure_at(sim,
                      &(drape_point){.x = x, .v = v, .internal = drape_sim_state(sim)->internal, .t = t});
}

/* The work of all so far, or in a step; or that of terms that have no energy, such as wind. */
static double sum_work(const drape_sim *sim, const double *work, bool driven)
{
    double sum = 0;
    for (int32_t i = 0; i < DRAPE_BY_TERMS + sim->model->term_count; i++)
        if (!driven || (i >= DRAPE_BY_TERMS && sim->model->terms[i - DRAPE_BY_TERMS].ops->dissipation))
            sum += work[i];
    return sum;
}

static double step_work(const drape_sim *sim, bool driven)
{
    return sum_work(sim, drape_system_work(sim->system), driven);
}

drape_energy drape_sim_account(drape_sim *sim)
{
    const drape_state *state = drape_sim_state(sim);
    if (!sim->energy_known)
        sim->energy =
            measure(sim, state, state->internal, sim->audit.dissipated, sum_work(sim, sim->work, false));
    sim->energy_known = !isnan(sim->energy.contact);
    return sim->energy;
}

drape_energy drape_sim_energy(drape_sim *sim)
{
    if (!sim)
        return (drape_energy){0};
    drape_energy e = drape_sim_account(sim);
    const drape_state *state = drape_sim_state(sim);
    const drape_point point = {.x = state->x, .internal = state->internal, .t = state->t};
    e.gravity -= drape_system_measure_loads(sim->system, &point, sim->potential);
    return e;
}

void drape_sim_energy_density_at(drape_sim *sim, const double *x, double *density)
{
    const drape_state *state = drape_sim_state(sim);
    const drape_point point = {.x = x, .v = state->v, .internal = state->internal, .t = state->t};
    drape_system_node_energy(sim->system, &point, density);
    for (int32_t c = 0; c < sim->model->cloth_count; c++) {
        const drape_cloth *cloth = &sim->model->cloths[c];
        for (int32_t i = 0; i < cloth->mesh.node_count; i++)
            density[cloth->first_node + i] /= cloth->mesh.node_area[i];
    }
}

void drape_sim_energy_density(drape_sim *sim, double *density)
{
    if (sim && density)
        drape_sim_energy_density_at(sim, drape_sim_state(sim)->x, density);
}

static double sum_of(const drape_energy *e)
{
    return e->kinetic + e->elastic + e->gravity + e->contact;
}

void drape_sim_reset_energy(drape_sim *sim)
{
    const double known = sim->audit.offered + sim->audit.start_gravity - sim->audit.lowest;
    sim->audit = (drape_audit){0};
    sim->energy_known = false;
    const drape_energy e = drape_sim_account(sim);
    sim->audit.start_weight = drape_sim_energy(sim).gravity;
    memcpy(sim->work, sim->potential, drape_system_work_count(sim->system) * sizeof *sim->work);
    sim->audit.start = sum_of(&e) - sum_work(sim, sim->work, false);
    sim->audit.offered = fmax(known, e.kinetic + fabs(e.elastic) + fabs(e.contact));
    sim->audit.start_gravity = sim->audit.lowest = e.gravity;
    sim->energy_known = false;
}

void drape_sim_shift_energy(drape_sim *sim, const drape_energy *before, int worker)
{
    drape_audit *audit = &sim->audit;
    sim->energy_known = sim->attempted_known = false;
    const drape_energy now = drape_sim_account(sim);
    const double given = sum_of(&now) - sum_of(before), lifted = now.gravity - before->gravity;
    sim->work[worker] += given;
    audit->start_gravity += lifted;
    audit->lowest += lifted;
    audit->offered += fmax(given - lifted, 0);
    sim->energy_known = false;
}

/* The kinetic energy of the scene's mass at the scene's speed: the unit for the rounding errors that may
 * move a sheet at rest. */
static double scene_energy(const drape_model *m)
{
    double mass = 0, atol_x = NAN, atol_v = NAN;
    drape_derive_tolerances(m, 1, &atol_x, &atol_v);
    for (int32_t i = 0; i < m->node_count; i++)
        mass += drape_model_owns(m, i) ? m->mass[i] : 0;
    mass = drape_ranks_sum(drape_model_ranks(m), mass);
    return 0.5 * mass * atol_v * atol_v;
}

double drape_sim_energy_received(drape_sim *sim)
{
    const drape_energy e = drape_sim_energy(sim);
    double work, sum = e.kinetic + e.elastic + e.contact + e.numerical + fmax(e.dissipated, 0) +
                       fmax(e.gravity - sim->audit.start_weight, 0);
    for (int i = 0; drape_sim_work(sim, i, &work); i++)
        sum += fmax(-work, 0);
    return sum > AT_REST * scene_energy(sim->model) ? sum : 0;
}

/* The node with the largest kinetic energy. */
static int32_t hottest(const drape_model *m, const double *v, double *most)
{
    int32_t node = 0;
    double max = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *u = v + 3 * (size_t)i;
        double energy = m->mass[i] * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        if (energy > max) {
            max = energy;
            node = i;
        }
    }
    *most = max;
    return node;
}

static drape_diagnostic gain_at(drape_sim *sim, const double *v, const char *what, double value, double limit)
{
    const drape_model *m = sim->model;
    double most;
    const int32_t node = hottest(m, v, &most);
    drape_diagnostic gain = {.what = what,
                             .term = "",
                             .element = -1,
                             .node = {node, -1, -1, -1},
                             .cloth = drape_model_cloth_of(m, node),
                             .value = value,
                             .limit = limit};
    drape_system_agree_largest(sim->system, most, &gain);
    return gain;
}

/* Whether kinetic energy exploded in one step; e is the energy at its beginning. What contact has stored in
 * the step is not kinetic: where a collider meets cloth at rest, integrators that take its work at the middle
 * of the step, before contact begins, see no source of it. Nor do those that take the forces at the end of a
 * step see when in it a load has changed: open_work is what that leaves open. */
static bool exploded(const drape_energy *e, const drape_energy *attempted, double gain, double open_work,
                     double quiet)
{
    const double stored = fmax(attempted->contact - e->contact, 0) + open_work;
    if (!(attempted->kinetic > JUMP * e->kinetic && gain - stored > SHARE * (attempted->kinetic + stored)))
        return false;
    double size = attempted->kinetic + fabs(attempted->elastic) + fabs(attempted->gravity) +
                  fabs(e->elastic) + fabs(e->gravity) + e->contact;
    return gain > UNNOTICED * size + QUIET * quiet;
}

/* The energy available to the run so far: the initial energy, the largest fall in gravity, the work of pins
 * and damping (whose sums have errors of their own), and, for starts at rest, the energy of the scene's
 * mass at the scene's speed. */
static double offered(const drape_sim *sim, const drape_energy *attempted, const drape_step_info *info,
                      double quiet)
{
    const drape_audit *audit = &sim->audit;
    return audit->offered + fabs(step_work(sim, false)) + fabs(info->dissipated) + audit->start_gravity -
           fmin(audit->lowest, attempted->gravity) + quiet;
}

static drape_energy attempt(const drape_sim *sim, const drape_state *out, const drape_step_info *info)
{
    return measure(sim, out, drape_sim_state(sim)->internal, sim->audit.dissipated + info->dissipated,
                   sum_work(sim, sim->work, false) + step_work(sim, false));
}

bool drape_sim_ran_away(drape_sim *sim, const drape_state *out, drape_step_info *info)
{
    const drape_model *m = sim->model;
    const drape_audit *audit = &sim->audit;
    const drape_energy e = drape_sim_account(sim);
    const drape_energy attempted = sim->attempted_known ? sim->attempted : attempt(sim, out, info);
    const double max_gain = sim->chosen.integrator->gain > 0 ? sim->chosen.integrator->gain : RUN_GAIN;
    const double quiet = scene_energy(m), gain = e.numerical - attempted.numerical,
                 scale = offered(sim, &attempted, info, quiet), run = audit->best - attempted.numerical,
                 unexplained = audit->best_unexplained - attempted.numerical - audit->residual_work -
                               info->residual_work;
    sim->attempted = attempted;
    sim->attempted_known = true;
    if (drape_model_all_free(m) ==
        0) /* all motion is prescribed: a gain is only an error in the sum of the pins'
                               work */
        return false;
    if (exploded(&e, &attempted, gain, info->open_work, quiet))
        info->diagnostic =
            gain_at(sim, out->v, "energy gained / kinetic energy", gain / attempted.kinetic, SHARE);
    else if (gain - info->residual_work > STEP_GAIN * scale)
        info->diagnostic = gain_at(sim, out->v, "energy gained / energy available to the run",
                                   (gain - info->residual_work) / scale, STEP_GAIN);
    else if (gain > ROUNDED * scale && unexplained > max_gain * scale)
        info->diagnostic =
            gain_at(sim, out->v, "energy gained since its minimum / energy available to the run",
                    unexplained / scale, max_gain);
    else if (gain > ROUNDED * scale && run > fmax(UNCONVERGED_GAIN, max_gain) * scale)
        info->diagnostic =
            gain_at(sim, out->v, "energy gained by unconverged steps / energy available to the run",
                    run / scale, UNCONVERGED_GAIN);
    else
        return false;
    return true;
}

/* What a step may leave is measured by energies that contact and pins do not feed: a body that gives cloth no
 * room can press any energy into it. */
bool drape_sim_left_too_much(drape_sim *sim, const drape_state *out, drape_step_info *info)
{
    const drape_energy *e = &sim->attempted;
    const double scale = scene_energy(sim->model) + e->kinetic + fabs(e->elastic);
    if (info->solved || (sim->rescue && sim->rescue->takes_any(sim)) || !(info->left > RUN_GAIN * scale))
        return false;
    info->diagnostic =
        gain_at(sim, out->v, "energy left to gain / energy of the motion", info->left / scale, RUN_GAIN);
    return true;
}

/* The mean velocity of the free nodes, by mass, and their kinetic energy relative to it. With supports,
 * which take momentum and allow no other velocity, it is 0. */
static double internal_kinetic(const drape_model *m, const double *v, double mean[3])
{
    double mass = 0, moving = 0;
    for (int32_t f = 0; f < m->free_count; f++) {
        const size_t i = (size_t)m->node_of_free[f];
        mass += m->mass[i];
        for (size_t k = 0; k < 3; k++)
            mean[k] += m->mass[i] * v[3 * i + k];
    }
    for (size_t k = 0; k < 3; k++) {
        mean[k] = m->support_count > 0 ? 0 : mean[k] / mass;
        moving += 0.5 * mass * mean[k] * mean[k];
    }
    return kinetic(m, v) - moving;
}

/* Takes kinetic energy from the motion of the free nodes about their mean, so that their momentum stays.
 * Returns how much. */
static double take_back(const drape_model *m, double energy, double *v)
{
    double mean[3] = {0};
    const double motion = internal_kinetic(m, v, mean), taken = fmin(energy, motion);
    if (!(taken > 0))
        return 0;
    const double share = sqrt(1 - taken / motion);
    for (int32_t f = 0; f < m->free_count; f++) {
        double *u = v + 3 * (size_t)m->node_of_free[f];
        for (int k = 0; k < 3; k++)
            u[k] = mean[k] + share * (u[k] - mean[k]);
    }
    return taken;
}

/* The dissipation is that of forces at the end of the step, which the residual drives, too: its work may go
 * there and never have been in the motion. Taking back goes by what the motion has lost altogether. In
 * contact these forces may be balanced by those of the barrier, however large: a pair that began within the
 * step and separates at its end by the mean velocity of a body that turns pushes with next to nothing, and
 * restitution times the whole displacement was 6.6 J where contact stored 0.14 and the body did 0.02. Methods
 * that choose their steps sum the power of dissipation at some points of a step, and where it begins or ends
 * within the step count several times what it took: of the steps of dirk in contact that the guard refused
 * at rtol 0.1, half were refused for it. So no more is counted than there was. What is left of a gain is one
 * of the motion: drape_sim_ran_away sees it, whatever a step says that it dissipated. */
void drape_sim_settle_work(drape_sim *sim, drape_state *out, drape_step_info *info)
{
    const drape_audit *audit = &sim->audit;
    const double left = audit->residual_work + info->residual_work, before = drape_sim_account(sim).numerical;
    const double most = fmin(info->dissipated, info->dissipated - step_work(sim, true));
    const bool summed = sim->chosen.integrator->own_steps && most > 0;
    if (!(left > 0 || summed) || drape_model_all_free(sim->model) == 0)
        return;
    drape_energy e = attempt(sim, out, info);
    if (sim->rescue && sim->rescue->takes_any(sim)) {
        const double lost =
                         e.numerical + e.dissipated - sum_work(sim, sim->work, true) - step_work(sim, true),
                     taken = take_back(sim->model, fmin(audit->most_lost - lost, left), out->v);
        e.kinetic -= taken;
        e.numerical += taken;
    }
    /* of a step that is solved to its tolerance, what is dissipated is what the method says */
    const bool solved = info->residual <= info->tolerance;
    const double gained = before - e.numerical,
                 never = fmin(solved ? fmin(gained, info->residual_work) : gained, most);
    if (never > 0) {
        info->dissipated -= never;
        e.dissipated -= never;
        e.numerical += never;
    }
    sim->attempted = e;
    sim->attempted_known = true;
}

void drape_sim_add_contact_work(drape_sim *sim)
{
    const double work = drape_system_take_contact_work(sim->system);
    sim->work[DRAPE_BY_COLLIDERS] += work;
    sim->audit.offered += fmax(work, 0);
    sim->energy.contact += work;
}

drape_status drape_sim_begin_reading(drape_sim *sim)
{
    if (sim->before >= 0)
        return DRAPE_OK;
    const drape_status status = drape_system_begin_reading(sim->system, drape_sim_state(sim));
    drape_sim_add_contact_work(sim);
    return status;
}

void drape_sim_add_work(drape_sim *sim, const drape_step_info *info)
{
    drape_audit *audit = &sim->audit;
    audit->dissipated += info->dissipated;
    for (size_t i = 0; i < drape_system_work_count(sim->system); i++)
        sim->work[i] += drape_system_work(sim->system)[i];
    audit->residual_work += info->residual_work;
    audit->offered += fabs(step_work(sim, false)) + fabs(info->dissipated);
    /* with internal variables, committing the step changes the energy */
    sim->energy_known = sim->attempted_known && drape_model_whole(sim->model)->internal_count == 0;
    if (!sim->attempted_known)
        return;
    sim->energy = sim->attempted;
    sim->attempted_known = false;
    audit->lowest = fmin(audit->lowest, sim->attempted.gravity);
    audit->best = fmax(audit->best, sim->attempted.numerical);
    audit->most_lost = fmax(audit->most_lost, sim->attempted.numerical + sim->attempted.dissipated -
                                                  sum_work(sim, sim->work, true));
    audit->best_unexplained = fmax(audit->best_unexplained, sim->attempted.numerical + audit->residual_work);
}
