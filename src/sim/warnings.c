/*
 * warnings.c: drape_sim_warning: runs that complete and are yet unlikely to be what was wanted. Each
 * check is a function that describes what it found; none of them changes the sim.
 */
#include "sim/warnings.h"

#include "colliders/deformed.h"
#include "compile/compile.h"
#include "sim/inside.h"
#include "sim/rescue.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MOST     0.5  /* of the energy, of the time */
#define MUCH     0.05 /* of the energy, for an integrator that bounds its error */
#define GAINED   0.1  /* of the energy: those that conserve it let it oscillate by some per cent */
#define MANY     3.0  /* Newton iterations an attempt */
#define TOO_MANY 10.0 /* Newton iterations an attempt: smaller steps hardly cost more */
#define THIN     5.0  /* activation distances in a step of a collider */
#define LARGE    20.0 /* [m] across */

/* A cloth of which nothing but its weight is modelled falls like dust. */
static bool has_no_terms(drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    int bare = 0, first = -1;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        int count = 0;
        for (int32_t i = 0; i < m->term_count; i++)
            count += m->terms[i].cloth == c && m->terms[i].seam < 0 && !m->terms[i].ops->from_scene_gravity;
        if (count > 0)
            continue;
        first = bare++ ? first : c;
    }
    if (bare == 0)
        return false;
    snprintf(text, size,
             "/cloth/%d: %s has no \"terms\": nothing resists stretching or bending%s; stretch.cst and "
             "bend.hinge do",
             first, m->cloths[first].name, bare > 1 ? ", as with other cloths of this scene" : "");
    return true;
}

static bool takes_curves(const drape_model *m, int32_t cloth)
{
    bool takes = false;
    for (int32_t i = 0; i < m->term_count; i++)
        takes = takes || (m->terms[i].cloth == cloth && m->terms[i].ops->takes_curves);
    return takes;
}

/* Measured curves that change nothing. */
static bool has_unused_curve(drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    const drape_entry *material = &drape_material_entry;
    for (int32_t c = 0; c < m->cloth_count; c++)
        for (int p = 0; p < material->param_count && !takes_curves(m, c); p++) {
            const double points = m->cloths[c].material_values[drape_param_place(material->params, p)];
            if (material->params[p].kind != DRAPE_PARAM_POINTS || isnan(points))
                continue;
            snprintf(text, size, "/cloth/%d/material/%s: no term of %s reads it; stretch.curve does", (int)c,
                     material->params[p].name, m->cloths[c].name);
            return true;
        }
    return false;
}

static bool takes_clamps(const drape_model *m, int32_t cloth)
{
    bool takes = false;
    for (int32_t i = 0; i < m->term_count; i++)
        takes = takes || (m->terms[i].cloth == cloth && m->terms[i].ops->takes_clamps);
    return takes;
}

/* Clamps that keep no direction. */
static bool has_unused_clamp(drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    for (int32_t p = 0; p < m->pin_count; p++) {
        const drape_pin *pin = &m->pins[p];
        const drape_cloth *cloth = &m->cloths[pin->cloth];
        const bool read = takes_clamps(m, pin->cloth);
        bool clamps = false;
        for (int32_t e = 0;
             pin->clamps && read && cloth->edge_clamped && !clamps && e < cloth->mesh.edge_count; e++)
            clamps = cloth->edge_clamped[e];
        if (!pin->clamps || (read && clamps))
            continue;
        snprintf(text, size,
                 read ? "the pins \"%.60s\" of %s clamp no edge: both nodes of an edge must be pinned"
                      : "the pins \"%.60s\" of %s clamp its edges, and none of its terms reads that; "
                        "bend.midedge does",
                 pin->name, cloth->name);
        return true;
    }
    return false;
}

/* Histories that change nothing. */
static bool has_unused_history(drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    for (int32_t h = 0; h < m->history_count; h++) {
        bool used = false;
        for (int32_t i = 0; i < m->term_count; i++)
            used = used || m->terms[i].history == &m->histories[h];
        if (used)
            continue;
        snprintf(text, size, "/histories/%d: \"%.60s\" is the history of no load, and changes nothing",
                 (int)h, m->histories[h].name);
        return true;
    }
    return false;
}

/* The setting that makes steps smaller. */
static const char *smaller_steps(const drape_sim *sim)
{
    const drape_chosen *c = &sim->chosen;
    if (sim->model->accuracy.value > 0)
        return "a smaller \"accuracy\"";
    if (c->integrator->own_steps)
        return isnan(drape_chosen_integrator_value(c, "fixed_step", NAN)) ? "a smaller rtol"
                                                                          : "a smaller fixed_step";
    return isnan(drape_chosen_controller_value(c, "rtol", NAN)) ? "a smaller dt"
                                                                : "a smaller rtol of the controller";
}

/* Not where integrator or controller choose their own steps, or substeps. */
static bool has_few_steps(drape_sim *sim, char *text, size_t size)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    const double dt = drape_chosen_integrator_value(&sim->chosen, "dt", NAN),
                 steps = sim->model->duration / dt;
    if (integrator->own_steps || sim->chosen.controller->own_steps ||
        drape_chosen_integrator_value(&sim->chosen, "substeps", NAN) == 0 ||
        !(steps < DRAPE_FEW_STEPS * (1 - 1e-9)))
        return false;
    snprintf(text, size,
             "the duration of %.4g s is only %.3g steps of dt = %.4g s: for motion that is resolved, choose "
             "%s",
             sim->model->duration, ceil(steps), dt, smaller_steps(sim));
    return true;
}

/* Meshes of clothes are often in centimetres. */
static bool has_large_file(drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
        for (int32_t i = 0; cloth->file && i < 3 * cloth->mesh.node_count; i++) {
            const double x = m->rest[3 * (size_t)cloth->first_node + (size_t)i];
            low[i % 3] = fmin(low[i % 3], x);
            high[i % 3] = fmax(high[i % 3], x);
        }
        const double edge[3] = {high[0] - low[0], high[1] - low[1], high[2] - low[2]};
        const double across = sqrt(edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]);
        if (!cloth->file || !(across > LARGE))
            continue;
        const char *slash = strrchr(cloth->file, '/');
        snprintf(text, size,
                 "/cloth/%d/mesh: %.100s is %.3g m across: is it in centimetres? A mesh in centimetres needs "
                 "\"transform\": {\"scale\": 0.01}",
                 (int)c, slash ? slash + 1 : cloth->file, across);
        return true;
    }
    return false;
}

/* Free nodes of the cloth inside a collider. A pinned node may be there on purpose, and faces of which
 * only the middle is inside do not count: some contact is kept at nodes only. -1: it was cancelled. */
static int32_t free_nodes_inside(drape_context *ctx, const drape_model *m, const drape_collider *collider,
                                 const drape_collider_pose *pose, const double *x, double *deepest)
{
    int32_t count = 0;
    *deepest = 0;
    for (int32_t f = 0; f < m->free_count; f++) {
        if (drape_check_cancel_after(ctx, 100 + (size_t)collider->shape.triangle_count))
            return -1;
        const double *at = x + 3 * (size_t)m->node_of_free[f];
        if (drape_model_ignores(m, collider->index, m->node_of_free[f]))
            continue;
        const double depth = -drape_collider_distance(collider, pose, at, NULL, NULL);
        count += depth > DRAPE_PENETRATION_TOLERANCE;
        *deepest = fmax(*deepest, depth);
    }
    return count;
}

/* Whether free nodes at x are inside a collider, or it pierces faces of the cloth; writes the text for the
 * first such collider. */
static bool describe_inside(drape_sim *sim, const double *x, bool start, char *text, size_t size)
{
    const drape_model *m = sim->model;
    const char *what = start ? "start" : "end", *advice = start ? ": move the cloth or the collider" : "";
    for (int32_t c = 0; c < m->collider_count; c++) {
        drape_collider_pose pose = drape_collider_pose_at(&m->colliders[c], 0);
        const double t = drape_sim_time(sim);
        int32_t pierced = 0;
        if (!start)
            drape_motion_pose(drape_system_motion(sim->system), c, t, t, &pose);
        double deepest;
        const drape_collider *body;
        drape_arena arena = drape_arena_of(sim->ctx);
        if (drape_deformed_at(&arena, m, start ? NULL : drape_system_motion(sim->system), c, pose.t, &body)) {
            drape_arena_free(&arena);
            sim->warning_failed = true;
            return false;
        }
        const int32_t count = free_nodes_inside(sim->ctx, m, body, &pose, x, &deepest);
        if (count > 0)
            snprintf(text, size,
                     "/colliders/%d: %d free node%s of the cloth %s%s inside %s, up to %.3g m deep%s", (int)c,
                     (int)count, count == 1 ? "" : "s", what, count == 1 ? "s" : "", m->colliders[c].name,
                     deepest, advice);
        else if (count < 0 || drape_find_pierced(sim->ctx, m, body, &pose, x, &pierced))
            sim->warning_failed = true;
        else if (pierced > 0)
            snprintf(text, size, "/colliders/%d: %d triangle%s of the cloth %s%s pierced by %s%s", (int)c,
                     (int)pierced, pierced == 1 ? "" : "s", what, pierced == 1 ? "s" : "",
                     m->colliders[c].name, advice);
        drape_arena_free(&arena);
        if (count > 0 || pierced > 0)
            return true;
    }
    return false;
}

/* The report of an untangled start says what was inside. */
static bool starts_inside(drape_sim *sim, char *text, size_t size)
{
    return !sim->model->untangle.given && describe_inside(sim, sim->model->start, true, text, size);
}

static bool ends_inside(drape_sim *sim, char *text, size_t size)
{
    return sim->statistics.steps_accepted > 0 &&
           describe_inside(sim, drape_sim_positions(sim), false, text, size);
}

/* Energy that the integrator took, as a share of all that went in: by gravity, pins, colliders, hosts and
 * wind. With dt = 1/60 s over 1 s, be, bdf2 and trbdf2 take 65, 32 and 34 % in four_pins of examples/scenes,
 * 68, 45 and 11 % in sphere_drape. Where cloth is in contact it has met something, and lost energy there.
 *
 * An integrator that bounds its error promises the motion, and rtol does not bound what it takes: errors
 * of each step that are small in positions and velocities are stresses of stiff cloth, whose waves it
 * damps. On the undamped sheet swing.json of examples/ivp over 0.5 s, ida at rtol 1e-3 takes 1 % at
 * E h = 1e5 N/m and is off by 0.3 % of the size, 6 % and 0.8 % at 1e7, 11 % and 2.6 % at 1e9, 25 % and 10 %
 * at 1e11. Over 1 s it takes 22 % in four_pins of examples/scenes, 8 % in box_edge, 1 % at most in others. */
static bool dissipates_most(drape_sim *sim, char *text, size_t size)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    if (integrator->steady_state || sim->statistics.steps_accepted == 0)
        return false;
    const drape_energy e = drape_sim_energy(sim);
    const double in = drape_sim_energy_received(sim), share = e.numerical / in;
    if (!(in > 0) || !(share > (integrator->own_steps ? MUCH : MOST)))
        return false;
    snprintf(text, size,
             "%s dissipated %.0f %% of the energy that went in, %.3g of %.3g J%s: %s%s dissipates less",
             integrator->entry.name, 100 * share, e.numerical, in,
             e.contact > 0 ? ", part of it on impact" : "", smaller_steps(sim),
             integrator->order == 1 ? ", or an integrator of second order such as trbdf2 or bdf2," : "");
    return true;
}

/* Energy out of nothing. The check of each step compares with all that loads could give, as they are
 * potentials; here it is what they did give. examples/scenes/airbag.json under midpoint, whose pressure
 * rises: 23 J, where only 12 J are the work of the pressure. */
static bool gains_energy(drape_sim *sim, char *text, size_t size)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    if (integrator->steady_state || sim->statistics.steps_accepted == 0)
        return false;
    const double gained = -drape_sim_energy(sim).numerical, in = drape_sim_energy_received(sim);
    if (!(in > 0) || !(gained > GAINED * in))
        return false;
    snprintf(
        text, size,
        "%s gained %.3g J out of nothing, beside %.3g J that went in: %s, or an integrator that damps what "
        "it does not resolve, such as trbdf2 or be, does not",
        integrator->entry.name, gained, in, smaller_steps(sim));
    return true;
}

/* Newton iterations an attempt; NaN before the first one. */
static double iterations(const drape_statistics *s)
{
    return (double)s->newton_iterations / (double)(s->steps_accepted + s->steps_rejected);
}

/* Steps too large for Newton's method, where half a step takes about half of the iterations. In 19 drawn
 * scenes in which be at 1/60 s took more than ten iterations a step, all of cloth that buckles, a quarter of
 * the step took 0.4 to 4.4 times the CPU time, the median 1.2. */
static bool iterates_long(drape_sim *sim, char *text, size_t size)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    const drape_statistics s = drape_sim_statistics(sim);
    if (integrator->order != 1 || isnan(drape_chosen_integrator_value(&sim->chosen, "max_iterations", NAN)) ||
        integrator->steady_state || sim->chosen.controller->own_steps || !(iterations(&s) > TOO_MANY))
        return false;
    snprintf(
        text, size,
        "%s took %.3g Newton iterations an attempt, as where cloth buckles: %s is more accurate there and "
        "often takes hardly longer",
        integrator->entry.name, iterations(&s), smaller_steps(sim));
    return true;
}

/* Contact that takes most of the time, and longer than the motion lasts, where a setting is known to
 * help. Measured on examples/scenes over 0.4 or 0.5 s: without self-contact, contact of sphere_drape takes a
 * sixth; with 14 x 14 nodes instead of 20 x 20, that of crumple takes a quarter. newton_k takes a third of
 * the time of crumple, half of that of sphere_drape. */
static bool is_contact_slow(drape_sim *sim, char *text, size_t size)
{
    const drape_statistics s = drape_sim_statistics(sim);
    const double motion = drape_sim_time(sim);
    if (!(s.wall_contact > MOST * s.wall_steps) || !(s.wall_contact > motion) || !(iterations(&s) > MANY))
        return false;
    snprintf(text, size,
             "contact takes %.0f %% of the time of the steps, %.3g s for %.3g s of motion: it takes less "
             "with %sa coarser mesh%s",
             100 * s.wall_contact / s.wall_steps, s.wall_contact, motion,
             sim->model->contact.self ? "no \"self_contact\" if layers never meet, or " : "",
             sim->chosen.integrator->error_bound
                 ? ""
                 : "; \"newton_k\" takes less time and is far less accurate (docs/realtime.md)");
    return true;
}

/* By its own estimate, of which the last step tells how far off the end of the run is. */
static bool is_inaccurate(drape_sim *sim, char *text, size_t size)
{
    const drape_statistics s = drape_sim_statistics(sim);
    const bool last = s.error_last > s.error_bound;
    if (!last && (double)sim->left.above_own > MOST * (double)s.steps_accepted) {
        snprintf(text, size,
                 "%s: %lld of %lld steps were accepted although they left more than the local error of the "
                 "method, up to %.3g J: %s comes nearer, and \"be\" solves its steps",
                 sim->chosen.integrator->entry.name, (long long)sim->left.above_own,
                 (long long)s.steps_accepted, sim->left.largest, smaller_steps(sim));
        return true;
    }
    if (!last && !((double)s.steps_above_error > MOST * (double)s.steps_accepted))
        return false;
    snprintf(
        text, size,
        "%s: %lld of %lld steps%s ended further from the solution of their equation than \"error\", %.3g m, "
        "by estimate up to %.3g m: %s comes nearer, with a budget more time a frame; \"be\" converges",
        sim->chosen.integrator->entry.name, (long long)s.steps_above_error, (long long)s.steps_accepted,
        last ? ", the last among them," : "", s.error_bound, s.error_max, smaller_steps(sim));
    return true;
}

/* A run that goes on although its start did not come apart. */
static bool is_tangled(drape_sim *sim, char *text, size_t size)
{
    const drape_untangling *u = &sim->untangling;
    if (!sim->untangled || u->clear)
        return false;
    snprintf(
        text, size,
        "the cloth did not come apart at t=%.9g in %d sweeps: %lld of %lld pairs of an edge and a triangle "
        "still pass through each other, %d of %d triangles reach into colliders, and the smallest gap is "
        "%.3g of the least that contact allows",
        u->time, u->sweeps, (long long)u->pairs, (long long)u->pairs_before, (int)u->inside,
        (int)u->inside_before, u->least_gap);
    return true;
}

/* Bodies that cross the scene's activation distance in a small part of a step accelerate cloth all at once. A
 * hung sheet under newton_k at 1/60 s, swept by a ball at 2 m/s, 33 mm a step, had 58 % strain and 5 rejected
 * steps in 2 s at a distance of 10 mm, and 203 % and 27 at 3 mm. */
static bool is_contact_thin(drape_sim *sim, char *text, size_t size)
{
    const double path = drape_contact_longest_path(drape_system_contact(sim->system)),
                 distance = sim->model->contact.distance;
    if (!sim->model->contact.distance_given || !(path > THIN * distance))
        return false;
    snprintf(text, size,
             "/contact/distance: a collider moved by %.3g m against the mean of the cloth in a step, for an "
             "activation distance of %.3g m: "
             "leave it out, so that it follows the motion, or take %s",
             path, distance, smaller_steps(sim));
    return true;
}

static const drape_warning_check checks[] = {{"no_terms", has_no_terms},
                                             {"unused_curve", has_unused_curve},
                                             {"unused_clamp", has_unused_clamp},
                                             {"unused_history", has_unused_history},
                                             {"few_steps", has_few_steps},
                                             {"large_mesh", has_large_file},
                                             {"starts_inside", starts_inside},
                                             {"ends_inside", ends_inside},
                                             {"tangled", is_tangled},
                                             {"numerical_dissipation", dissipates_most},
                                             {"energy_gained", gains_energy},
                                             {"many_iterations", iterates_long},
                                             {"slow_contact", is_contact_slow},
                                             {"contact_distance", is_contact_thin},
                                             {"inaccurate", is_inaccurate}};

/* NULL: there are no more. */
static const drape_warning_check *check_at(const drape_sim *sim, size_t index)
{
    const size_t own = sizeof checks / sizeof *checks;
    if (index < own)
        return &checks[index];
    const drape_warning_check *more = sim->rescue ? &sim->rescue->warnings[index - own] : NULL;
    return more && more->name ? more : NULL;
}

bool drape_sim_take_warning_failure(drape_sim *sim)
{
    const bool failed = sim->warning_failed;
    sim->warning_failed = false;
    return failed;
}

bool drape_sim_warning(drape_sim *sim, int index, drape_warning *out)
{
    drape_warning_cursor c = {0};
    if (sim && sim->model->part) /* what is known here may be no reason, and all ranks must agree */
        sim = NULL;
    if (sim && index > 0 && sim->warning_cursor.index <= index &&
        sim->warning_cursor.attempts == sim->attempts)
        c = sim->warning_cursor;
    const drape_warning_check *check;
    while (sim && out && index >= 0 && (check = check_at(sim, c.check))) {
        c.check++;
        if (check->applies(sim, out->text, sizeof out->text) && c.index++ == index) {
            out->name = check->name;
            drape_make_printable(out->text);
            c.attempts = sim->attempts;
            sim->warning_cursor = c;
            return true;
        }
    }
    if (out)
        *out = (drape_warning){.name = ""};
    return false;
}
