/*
 * view.c: see view.h. Models are constant: a change sets a value of the scene, compiles a new model, and sets
 * a new sim to the former state.
 */
#include "cli/view.h"

#include "base/clock.h"
#include "model/scene.h"
#include "model/track.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOVE_TIME  0.1  /* duration of a displacement by a key [s] */
#define DRAG_RATE  60.0 /* angular frequency of DRAG_NODES nodes on the drag spring [1/s] */
#define DRAG_NODES 40.0 /* number of nodes that the drag spring is meant to move */

/* ---- Opening ---- */

static void note(cli_view *v, const char *text)
{
    snprintf(v->message, sizeof v->message, "%s", text);
}

static void add_movable(cli_view *v, const char *pointer, const char *name, const drape_track_key *keys,
                        size_t count)
{
    if (v->movable_count == VIEW_MOVABLES)
        return;
    view_movable *m = &v->movables[v->movable_count++];
    snprintf(m->pointer, sizeof m->pointer, "%s", pointer);
    snprintf(m->name, sizeof m->name, "%.60s", name);
    if (count > 0)
        drape_track_displacement(keys, count, drape_sim_time(v->in.sim), m->displacement);
}

static void list_movables(cli_view *v)
{
    drape_scene_def def;
    char pointer[64], name[100];
    v->movable_count = 0;
    if (drape_scene_to_def(v->in.scene, &def))
        return;
    for (size_t i = 0; i < def.collider_count; i++) {
        snprintf(pointer, sizeof pointer, "/colliders/%zu/track", i);
        snprintf(name, sizeof name, "%.50s", v->in.model->colliders[i].name);
        add_movable(v, pointer, name, def.colliders[i].track, def.colliders[i].key_count);
    }
    for (size_t c = 0; c < def.cloth_count; c++)
        for (size_t p = 0; p < def.cloths[c].pin_count; p++) {
            snprintf(pointer, sizeof pointer, "/cloth/%zu/pins/%zu/track", c, p);
            snprintf(name, sizeof name, "pin %zu of %.40s", p, v->in.model->cloths[c].name);
            add_movable(v, pointer, name, def.cloths[c].pins[p].track, def.cloths[c].pins[p].key_count);
        }
}

int view_open(const cli_command *command, cli_view *v)
{
    *v = (cli_view){.command = command, .factors = {1, 1, 1}, .dragged = -1, .paused = true};
    int code = cli_scene_load(command, command->operand, &v->in);
    if (code == CLI_GO_ON)
        list_movables(v);
    return code;
}

/* ---- Running ---- */

void view_advance(cli_view *v, bool one_step)
{
    drape_sim *sim = v->in.sim;
    double t = drape_sim_time(sim), start = drape_clock_seconds();
    int64_t before = drape_sim_statistics(sim).newton_iterations;
    double ahead = one_step ? view_dt(v) : 1 / drape_model_frame_rate(v->in.model);
    drape_status status = drape_sim_advance(sim, t + ahead);
    v->step_seconds = drape_clock_seconds() - start;
    v->iterations = drape_sim_statistics(sim).newton_iterations - before;
    v->message[0] = 0;
    if (!status)
        return;
    note(v, drape_context_message(v->in.ctx));
    v->paused = true;
}

static drape_status set_drag_spring(cli_view *v, drape_sim *sim)
{
    const drape_model *m = v->in.model;
    double mass = v->dragged >= 0 ? m->mass[v->dragged] : 0;
    return v->dragged < 0 ? DRAPE_OK
                          : drape_sim_set_drag_spring(
                                sim, v->dragged, DRAG_NODES * mass * DRAG_RATE * DRAG_RATE, v->drag_target);
}

/* Compiles the scene as it is now and makes a sim, in the former state or at the start. */
static drape_status rebuild(cli_view *v, bool keep_state)
{
    drape_model *model = NULL;
    drape_sim *sim = NULL, *old = v->in.sim;
    drape_sim_def def;
    drape_sim_def_init(&def, sizeof def);
    def.threads = v->command->threads ? v->command->threads : 1;
    drape_status status = drape_scene_compile(v->in.scene, &model);
    if (!status)
        status = drape_sim_create(v->in.ctx, model, &def, &sim);
    if (!status && keep_state)
        status = drape_sim_set_state(sim, drape_sim_time(old), drape_sim_positions(old),
                                     drape_sim_velocities(old));
    if (status) {
        drape_sim_destroy(&sim);
        drape_model_destroy(&model);
        return status;
    }
    drape_sim_destroy(&v->in.sim);
    drape_model_destroy(&v->in.model);
    v->in.model = model;
    v->in.sim = sim;
    return set_drag_spring(v, sim);
}

void view_reset(cli_view *v)
{
    v->dragged = -1;
    v->message[0] = 0;
    if (rebuild(v, false))
        note(v, drape_context_message(v->in.ctx));
}

/* ---- Changes ---- */

static drape_status set_number(cli_view *v, const char *pointer, double value)
{
    char text[40];
    snprintf(text, sizeof text, "%.17g", value);
    return drape_scene_set(v->in.scene, pointer, text);
}

/* Scales the parameters of this name of all terms, each term at its place in the scene. Gravity, which is not
 * listed there, comes last and has no parameters. */
static drape_status scale_terms(cli_view *v, const char *name, double factor, int *changed)
{
    const drape_model *m = v->in.model;
    drape_status status = DRAPE_OK;
    int place = 0;
    for (int32_t i = 0; i < m->term_count && !status; i++) {
        const drape_term *term = &m->terms[i];
        place = i > 0 && m->terms[i - 1].cloth == term->cloth && m->terms[i - 1].seam < 0 ? place + 1 : 0;
        for (int p = 0; p < term->ops->entry.param_count && !status; p++) {
            char pointer[120];
            if (strcmp(term->ops->entry.params[p].name, name) != 0 ||
                term->ops->entry.params[p].kind != DRAPE_PARAM_NUMBER || isnan(term->params[p]))
                continue;
            if (term->seam < 0)
                snprintf(pointer, sizeof pointer, "/cloth/%d/terms/%d/%s", (int)term->cloth, place, name);
            else
                snprintf(pointer, sizeof pointer, "/seams/%d/%s", (int)term->seam, name);
            status = set_number(v, pointer, factor * term->params[p]);
            *changed += !status;
        }
    }
    return status;
}

/* After values were set: makes the model with them. If it is refused, the caller sets the former values
 * again, which the former model still has. */
static bool commit(cli_view *v, drape_status status, int changed, const char *what)
{
    v->message[0] = 0;
    if (!status && changed == 0) {
        snprintf(v->message, sizeof v->message, "this scene has no %s to change", what);
        return false;
    }
    if (!status)
        status = rebuild(v, true);
    if (status)
        note(v, drape_context_message(v->in.ctx));
    return !status;
}

static drape_status set_stiffness(cli_view *v, double factor, int *changed)
{
    const drape_model *m = v->in.model;
    drape_status status = scale_terms(v, "stiffness", factor, changed);
    for (int32_t c = 0; c < m->cloth_count && !status; c++) {
        char pointer[80];
        snprintf(pointer, sizeof pointer, "/cloth/%d/material/young_modulus", (int)c);
        status = set_number(v, pointer, factor * m->cloths[c].material.young_modulus);
        *changed += !status;
    }
    return status;
}

static drape_status set_damping(cli_view *v, double factor, int *changed)
{
    static const char *const names[] = {"beta", "damping", "coefficient"};
    drape_status status = DRAPE_OK;
    for (size_t i = 0; i < sizeof names / sizeof *names && !status; i++)
        status = scale_terms(v, names[i], factor, changed);
    return status;
}

static drape_status set_gravity(cli_view *v, double factor, int *changed)
{
    const double *g = v->in.model->gravity;
    char text[120];
    *changed += g[0] != 0 || g[1] != 0 || g[2] != 0;
    snprintf(text, sizeof text, "[%.17g, %.17g, %.17g]", factor * g[0], factor * g[1], factor * g[2]);
    return drape_scene_set(v->in.scene, "/gravity", text);
}

bool view_scale(cli_view *v, view_value value, double factor)
{
    static const struct {
        drape_status (*set)(cli_view *v, double factor, int *changed); /* factor: on the present values */
        const char *name;
    } values[] = {[VIEW_STIFFNESS] = {set_stiffness, "stiffness"},
                  [VIEW_DAMPING] = {set_damping, "damping"},
                  [VIEW_GRAVITY] = {set_gravity, "gravity"}};
    int changed = 0;
    drape_status status = values[value].set(v, factor, &changed);
    const bool good = commit(v, status, changed, values[value].name);
    if (good)
        v->factors[value] *= factor;
    else
        values[value].set(v, 1, &changed);
    return good;
}

double view_dt(const cli_view *v)
{
    return drape_chosen_integrator_value(&v->in.sim->chosen, "dt", 1 / drape_model_frame_rate(v->in.model));
}

const char *view_integrator(const cli_view *v)
{
    return v->in.sim->chosen.integrator->entry.name;
}

bool view_scale_dt(cli_view *v, double factor)
{
    double dt = view_dt(v);
    bool good = commit(v, set_number(v, "/integrator/dt", factor * dt), 1, "dt");
    if (!good)
        set_number(v, "/integrator/dt", dt);
    return good;
}

/* Skips integrators that only find a steady state. */
bool view_next_integrator(cli_view *v, int step)
{
    const char *before = view_integrator(v);
    const int count = drape_registry_count(&drape_integrator_registry);
    int at = drape_registry_find(&drape_integrator_registry, NULL, before);
    do
        at = (at + step + count) % count;
    while (drape_integrators[at]->steady_state);
    bool good =
        commit(v, drape_scene_set(v->in.scene, "/integrator/method", drape_integrators[at]->entry.name), 1,
               "integrator");
    if (!good)
        drape_scene_set(v->in.scene, "/integrator/method", before);
    return good;
}

static drape_status set_track(cli_view *v, const view_movable *m, const double *to)
{
    double t = drape_sim_time(v->in.sim);
    const double *from = m->displacement;
    char text[300];
    snprintf(text, sizeof text, "[[%.17g, [%.17g, %.17g, %.17g]], [%.17g, [%.17g, %.17g, %.17g]]]", t,
             from[0], from[1], from[2], t + MOVE_TIME, to[0], to[1], to[2]);
    return drape_scene_set(v->in.scene, m->pointer, text);
}

bool view_move(cli_view *v, const double by[3])
{
    double to[3];
    if (v->movable_count == 0)
        return commit(v, DRAPE_OK, 0, "colliders and pins");
    list_movables(v); /* where their tracks have them now, as they may be moving */
    const view_movable m = v->movables[v->moved];
    for (int k = 0; k < 3; k++)
        to[k] = m.displacement[k] + by[k];
    bool good = commit(v, set_track(v, &m, to), 1, "track");
    if (!good)
        set_track(v, &m, m.displacement);
    return good;
}

void view_drag(cli_view *v, int32_t node, const double target[3])
{
    const double nowhere[3] = {0};
    if (v->dragged >= 0 && v->dragged != node)
        drape_sim_set_drag_spring(v->in.sim, v->dragged, 0, nowhere);
    v->dragged = node;
    if (node < 0)
        return;
    memcpy(v->drag_target, target, sizeof v->drag_target);
    if (set_drag_spring(v, v->in.sim)) {
        note(v, drape_context_message(v->in.ctx));
        v->dragged = -1;
    }
}
