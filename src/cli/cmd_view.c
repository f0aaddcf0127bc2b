/* cmd_view.c: `drape view`: a window that shows a running scene, which can be changed: models are constant,
 * so a change sets a value of the scene, compiles a new model, and sets a new sim to the former state. */
#include "cli/cli.h"

#include "base/clock.h"
#include "model/scene.h"
#include "model/track.h"
#include "render/painter.h"
#include "render/reel.h"
#include "render/shading.h"
#include "render/window.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define WIDTH  1280
#define HEIGHT 720
#define REACH  22.0f /* largest distance of a node from the pointer that grabs it [pixels at 720 rows] */
#define TURN   0.4f  /* [degrees per pixel] */
#define NOTCH  0.9f  /* factor on the distance for a notch of the wheel */
#define STEP   0.04  /* displacement by an arrow key over the size of the scene */
#define SCALE  1.5   /* factor on values that keys change */
#define IDLE   0.05  /* how long a paused window waits for input [s] */
#define LINES  16
#define LINE   120
#define COLUMN 320   /* width of the state or the keys at the left [pixels at 720 rows] */
#define WIDEST 0.42f /* largest share of the window for them */

/* ---- The scene; no window and no OpenGL here ---- */

#define VIEW_MOVABLES 64

/* Values that keys scale. */
typedef enum view_value { VIEW_STIFFNESS, VIEW_DAMPING, VIEW_GRAVITY, VIEW_SCALES } view_value;

/* A collider or a pin of the scene that keys can move. */
typedef struct view_movable {
    char pointer[64]; /* of its track */
    char name[64];
    double displacement[3]; /* [m] at the present time */
} view_movable;

typedef struct cli_view {
    const cli_command *command;
    cli_scene in;
    double factors[VIEW_SCALES]; /* on the values of the scene */
    view_movable movables[VIEW_MOVABLES];
    int movable_count, moved; /* moved: the one that keys move */
    int32_t dragged;          /* node on the drag spring; -1: none */
    double drag_target[3];    /* [m] of the drag spring */
    bool paused;
    int64_t iterations; /* of the last advance */
    double step_seconds;
    char message[200]; /* the last error, or "" */
} cli_view;

#define MOVE_TIME  0.1  /* duration of a displacement by a key [s] */
#define DRAG_RATE  60.0 /* angular frequency of DRAG_NODES nodes on the drag spring [1/s] */
#define DRAG_NODES 40.0 /* number of nodes that the drag spring is meant to move */

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

/* ---- Running ---- */

static double view_dt(const cli_view *v)
{
    return drape_chosen_integrator_value(&v->in.sim->chosen, "dt", 1 / drape_model_frame_rate(v->in.model));
}

/* Advances by one frame, or one step. If the simulation fails it is paused, with a message. */
static void view_advance(cli_view *v, bool one_step)
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

/* The functions that change the scene return whether the model is now a new one, in the same state. A change
 * that the scene refuses leaves everything as it was, with a message. */

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

static bool view_scale(cli_view *v, view_value value, double factor)
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

static const char *view_integrator(const cli_view *v)
{
    return v->in.sim->chosen.integrator->entry.name;
}

/* Skips integrators that only find a steady state. */
static bool view_next_integrator(cli_view *v, int step)
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

/* Moves the chosen movable by [m], over a tenth of a second. */
static bool view_move(cli_view *v, const double by[3])
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

/* Drags a node towards a point. node -1 releases it. */
static void view_drag(cli_view *v, int32_t node, const double target[3])
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

/* ---- The window ---- */

typedef struct view_request {
    cli_command command;
    const char *shade, *size;
    bool running;
} view_request;

typedef enum side { PANEL_STATE, PANEL_KEYS, PANEL_NONE, PANEL_COUNT } side;

typedef enum drag { DRAG_NONE, DRAG_TURN, DRAG_PAN, DRAG_NODE } drag;

typedef struct window_view {
    const view_request *request;
    cli_view v;
    drape_context *ctx;
    drape_window *window;
    drape_painter *painter;
    drape_stage stage;
    drape_reel reel;
    drape_camera camera, home;
    int shading;      /* index in drape_shadings */
    double low, high; /* range of its field so far */
    drag drag;
    double x, y; /* of the pointer */
    float depth; /* of the dragged node in front of the eye [m] */
    side shown;  /* at the left */
    bool changed, quit;
    double frame_seconds, step_seconds; /* of the last frame */
} window_view;

/* ---- Drawing ---- */

static const drape_shading *shading_of(const window_view *w)
{
    return drape_shadings[w->shading];
}

static drape_status make_painter(window_view *w)
{
    drape_painter_def def = {.width = WIDTH, .height = HEIGHT, .fine = 1};
    drape_window_size(w->window, &def.width, &def.height);
    drape_painter_destroy(&w->painter);
    return drape_painter_create(w->ctx, &def, &w->painter);
}

/* Puts the present state and the field of the shading into the reel. If the integrator does not have the
 * field, a message says so and its values are 0. */
static drape_status take_frame(window_view *w)
{
    drape_sim *sim = w->v.in.sim;
    const drape_field_ops *field = shading_of(w)->field;
    drape_reel_clear(&w->reel);
    drape_status status = drape_reel_add(&w->reel, drape_sim_time(sim), drape_sim_positions(sim), sim, field);
    if (status == DRAPE_E_ARGUMENT) {
        snprintf(w->v.message, sizeof w->v.message, "%s", drape_context_message(w->v.in.ctx));
        memset(w->reel.values, 0, w->reel.nodes * sizeof *w->reel.values);
        w->reel.count = 1;
        return DRAPE_OK;
    }
    if (field && !status) {
        w->low = fmin(w->low, w->reel.low);
        w->high = fmax(w->high, w->reel.high);
    }
    return status;
}

/* Makes the stage of a new model. The size of the scene stays as it was, so that the view does not jump. */
static drape_status make_stage(window_view *w)
{
    drape_stage old = w->stage;
    drape_status status = drape_stage_create(w->ctx, w->v.in.model, &w->stage);
    if (status)
        return status;
    if (old.radius > 0) {
        memcpy(w->stage.center, old.center, sizeof old.center);
        w->stage.radius = old.radius;
        w->stage.floor = old.floor;
    }
    drape_stage_free(&old);
    w->changed = true;
    return DRAPE_OK;
}

/* The picture of one panel, without its lines. */
static drape_picture picture_of(const window_view *w, const drape_panel *panel)
{
    const drape_overlay *o = drape_painter_overlay(w->painter);
    float column = w->shown == PANEL_NONE ? 0 : fminf(COLUMN * o->unit, WIDEST * (float)o->width);
    return (drape_picture){.panels = panel,
                           .panel_count = 1,
                           .shading = shading_of(w),
                           .low = w->low,
                           .high = w->high > w->low ? w->high : w->low + 1e-9,
                           .camera = w->camera,
                           .column = column};
}

/* Frames the start, with room for cloth to hang down. */
static void set_camera(window_view *w)
{
    const drape_picture picture = picture_of(w, NULL);
    float aspect = drape_painter_aspect(w->painter, &picture);
    drape_framing framing = drape_framing_begin(DRAPE_CAMERA_AZIMUTH, DRAPE_CAMERA_ELEVATION, aspect);
    const float *x = drape_reel_positions(&w->reel, 0);
    drape_stage_frame(&w->stage, &framing, 0, x, (const float[3]){0});
    drape_stage_add(&w->stage, x);
    if (!w->stage.has_ground) {
        float low[3] = {0};
        size_t lowest = 0;
        for (size_t i = 1; i < w->reel.nodes; i++)
            if (x[3 * i + 1] < x[3 * lowest + 1])
                lowest = i;
        memcpy(low, x + 3 * lowest, sizeof low);
        low[1] -= 0.5f * (float)w->v.in.model->length;
        drape_framing_add(&framing, low, 1, (const float[3]){0});
        for (int k = 0; k < 3; k++)
            w->stage.low[k] = fminf(w->stage.low[k], low[k]);
    }
    drape_stage_finish(&w->stage);
    w->home = w->camera = drape_framing_end(&framing, DRAPE_CAMERA_AZIMUTH, DRAPE_CAMERA_ELEVATION, 1);
}

static drape_view view_of(const window_view *w)
{
    const drape_panel panel = {.stage = (drape_stage *)&w->stage};
    drape_picture picture = picture_of(w, &panel);
    return drape_painter_view(w->painter, &picture, 0);
}

static void put_lines(const window_view *w, char lines[LINES][LINE])
{
    const cli_view *v = &w->v;
    drape_statistics s = drape_sim_statistics(v->in.sim);
    drape_energy e = drape_sim_energy(v->in.sim);
    double force[3];
    int n = 0;
    drape_sim_drag_spring_force(v->in.sim, force);
    snprintf(lines[n++], LINE, "%s\tt = %.3f s", v->paused ? "paused" : "running", drape_sim_time(v->in.sim));
    snprintf(lines[n++], LINE, "integrator\t%s, dt = %.4g s", view_integrator(v), view_dt(v));
    snprintf(lines[n++], LINE, "frame\t%.1f ms, of it steps %.1f", 1e3 * w->frame_seconds,
             1e3 * w->step_seconds);
    snprintf(lines[n++], LINE, "steps\t%lld, rejected %lld", (long long)s.steps_accepted,
             (long long)s.steps_rejected);
    snprintf(lines[n++], LINE, "iterations\t%lld, last frame %lld", (long long)s.newton_iterations,
             (long long)v->iterations);
    snprintf(lines[n++], LINE, "energy\t%.4g J", e.kinetic + e.elastic + e.gravity + e.contact);
    snprintf(lines[n++], LINE, "\tkinetic %.3g, elastic %.3g, gravity %.3g, contact %.3g", e.kinetic,
             e.elastic, e.gravity, e.contact);
    snprintf(lines[n++], LINE, "stiffness\tx %.3g", v->factors[VIEW_STIFFNESS]);
    snprintf(lines[n++], LINE, "damping\tx %.3g", v->factors[VIEW_DAMPING]);
    snprintf(lines[n++], LINE, "gravity\tx %.3g", v->factors[VIEW_GRAVITY]);
    snprintf(lines[n++], LINE, "shading\t%s", shading_of(w)->entry.name);
    if (v->movable_count > 0)
        snprintf(lines[n++], LINE, "arrows\tmove %s", v->movables[v->moved].name);
    if (v->dragged >= 0)
        snprintf(lines[n++], LINE, "drag\t%.3g N on node %d",
                 sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]), (int)v->dragged);
    if (v->message[0])
        snprintf(lines[n++], LINE, "! %.100s", v->message);
    lines[n][0] = 0;
}

static const char *const help_lines[] = {"space, P\trun or pause",
                                         "N\tone step",
                                         "R\tstart again",
                                         "Esc, Q\tquit",
                                         "left drag\ta node; elsewhere: rotate",
                                         "right drag\tpan",
                                         "wheel\tzoom",
                                         "C\treset the camera",
                                         "S\tnext shading",
                                         "I\tnext integrator",
                                         "D K B G\ttime step, stiffness, damping, gravity: less",
                                         "shift\tmore, or previous",
                                         "tab\tnext collider or pin",
                                         "arrows\tmove it, page keys up and down",
                                         "H\thide this; again: show the state",
                                         NULL};

static bool project(const window_view *w, const drape_view *view, const float *p, float *x, float *y,
                    float *depth)
{
    const drape_canvas *canvas = drape_painter_canvas(w->painter);
    const float *m = view->matrix.m;
    float q[4];
    for (int r = 0; r < 4; r++)
        q[r] = m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
    *x = (0.5f + 0.5f * q[0] / q[3]) * (float)canvas->width;
    *y = (0.5f - 0.5f * q[1] / q[3]) * (float)canvas->height;
    *depth = q[3];
    return q[3] > 0;
}

/* Draws the drag spring, from its node to its target. */
static void mark_drag_spring(window_view *w)
{
    static const float blue[4] = {0.05f, 0.30f, 0.75f, 0.95f};
    drape_overlay *o = drape_painter_overlay(w->painter);
    const drape_view view = view_of(w);
    const double *node = drape_sim_positions(w->v.in.sim) + 3 * (size_t)w->v.dragged;
    const float from[3] = {(float)node[0], (float)node[1], (float)node[2]};
    const float to[3] = {(float)w->v.drag_target[0], (float)w->v.drag_target[1], (float)w->v.drag_target[2]};
    float a[3], b[3], size = 3 * o->unit;
    if (!project(w, &view, from, &a[0], &a[1], &a[2]) || !project(w, &view, to, &b[0], &b[1], &b[2]))
        return;
    for (int i = 0; i <= 24; i++) {
        float s = (float)i / 24, x = a[0] + s * (b[0] - a[0]), y = a[1] + s * (b[1] - a[1]);
        float d = i == 0 || i == 24 ? 2 * size : size / 1.5f;
        drape_overlay_box(o, x - d / 2, y - d / 2, d, d, blue);
    }
}

static drape_status draw(window_view *w)
{
    char text[LINES][LINE];
    const char *state[LINES + 1];
    int count = 0;
    put_lines(w, text);
    for (; text[count][0]; count++)
        state[count] = text[count];
    state[count] = NULL;
    const char *const *const panels[PANEL_COUNT] = {[PANEL_STATE] = state, [PANEL_KEYS] = help_lines};
    const drape_panel panel = {.stage = &w->stage,
                               .moment = {.t = w->reel.times[0],
                                          .positions = drape_reel_positions(&w->reel, 0),
                                          .values = drape_reel_values(&w->reel, 0)}};
    drape_picture picture = picture_of(w, &panel);
    picture.lines = panels[w->shown];
    picture.caption = w->shown == PANEL_KEYS ? NULL : "H: keys";
    if (w->v.dragged >= 0)
        mark_drag_spring(w);
    drape_status status = drape_painter_draw(w->painter, &picture);
    int width, height;
    drape_window_size(w->window, &width, &height);
    drape_canvas_show(drape_painter_canvas(w->painter), width, height);
    drape_window_swap(w->window);
    return status;
}

/* ---- Input ---- */

/* After a change; a new model needs a new stage. */
static void redraw(window_view *w, bool new_model)
{
    w->changed = true;
    if (new_model && make_stage(w))
        w->quit = true;
}

/* Keys that scale a value and keys that move a collider or pin. */
static void scale_or_move(window_view *w, int key, double factor)
{
    static const char scales[VIEW_SCALES] = {
        [VIEW_STIFFNESS] = 'K', [VIEW_DAMPING] = 'B', [VIEW_GRAVITY] = 'G'};
    static const struct {
        int key, axis;
        double sign;
    } moves[] = {{DRAPE_KEY_LEFT, 0, -1}, {DRAPE_KEY_RIGHT, 0, 1},   {DRAPE_KEY_UP, 2, -1},
                 {DRAPE_KEY_DOWN, 2, 1},  {DRAPE_KEY_PAGE_UP, 1, 1}, {DRAPE_KEY_PAGE_DOWN, 1, -1}};
    const double dt = view_dt(&w->v);
    if (key == 'D') {
        const bool good = commit(&w->v, set_number(&w->v, "/integrator/dt", factor * dt), 1, "dt");
        if (!good)
            set_number(&w->v, "/integrator/dt", dt);
        redraw(w, good);
    }
    for (view_value i = 0; i < VIEW_SCALES; i++)
        if (scales[i] == key)
            redraw(w, view_scale(&w->v, i, factor));
    for (size_t i = 0; i < sizeof moves / sizeof *moves; i++)
        if (moves[i].key == key) {
            double displacement[3] = {0};
            displacement[moves[i].axis] = moves[i].sign * STEP * w->v.in.model->length;
            redraw(w, view_move(&w->v, displacement));
        }
}

/* back: shift is held, and the key does the opposite. */
static void on_key(window_view *w, int key, bool back)
{
    w->changed = true;
    const int step = back ? -1 : 1, shadings = drape_registry_count(&drape_shading_registry);
    cli_view *v = &w->v;
    switch (key) {
    case ' ':
    case 'P':
        v->paused = !v->paused;
        break;
    case 'N':
        v->paused = true;
        view_advance(v, true);
        break;
    case 'R':
        v->dragged = -1; /* back to the start, with all changes */
        v->message[0] = 0;
        if (rebuild(v, false))
            note(v, drape_context_message(v->in.ctx));
        w->low = w->high = 0;
        redraw(w, true);
        break;
    case 'Q':
    case DRAPE_KEY_ESCAPE:
        w->quit = true;
        break;
    case 'C':
        w->camera = w->home;
        break;
    case 'H':
        w->shown = (w->shown + 1) % PANEL_COUNT;
        break;
    case 'S':
        w->shading = (w->shading + step + shadings) % shadings;
        w->low = w->high = 0;
        break;
    case 'I':
        redraw(w, view_next_integrator(v, step));
        break;
    case DRAPE_KEY_TAB:
        if (v->movable_count > 0)
            v->moved = (v->moved + step + v->movable_count) % v->movable_count;
        break;
    default:
        scale_or_move(w, key, back ? SCALE : 1 / SCALE);
    }
}

/* The node nearest to the eye of those near the pointer that are not pinned; -1: none. */
static int32_t node_at(const window_view *w, double x, double y, float *depth)
{
    const drape_view view = view_of(w);
    const drape_model *m = w->v.in.model;
    float reach = REACH * drape_painter_overlay(w->painter)->unit, best = INFINITY;
    int32_t found = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *node = drape_sim_positions(w->v.in.sim) + 3 * (size_t)i;
        const float place[3] = {(float)node[0], (float)node[1], (float)node[2]};
        float px, py, pz;
        if (m->pinned[i] || !project(w, &view, place, &px, &py, &pz))
            continue;
        float offset = hypotf(px - (float)x, py - (float)y);
        if (offset < reach && pz * (1 + offset / reach * 0.02f) < best) {
            best = pz * (1 + offset / reach * 0.02f);
            *depth = pz;
            found = i;
        }
    }
    return found;
}

/* The point under the pointer, at a depth in front of the eye. */
static void point_at(const window_view *w, double x, double y, float depth, double *p)
{
    const drape_view view = view_of(w);
    const drape_canvas *canvas = drape_painter_canvas(w->painter);
    float across = (2 * (float)x / (float)canvas->width - 1 - view.center[0]) * view.tx * depth;
    float upright = (1 - 2 * (float)y / (float)canvas->height - view.center[1]) * view.ty * depth;
    for (int k = 0; k < 3; k++)
        p[k] = (double)(view.eye[k] + across * view.axes[0][k] + upright * view.axes[1][k] -
                        depth * view.axes[2][k]);
}

static void on_press(window_view *w, const drape_input *in)
{
    w->x = in->x;
    w->y = in->y;
    if (in->button != DRAPE_BUTTON_LEFT || in->ctrl) {
        w->drag = DRAG_PAN;
        return;
    }
    int32_t node = in->shift ? -1 : node_at(w, in->x, in->y, &w->depth);
    w->drag = node >= 0 ? DRAG_NODE : DRAG_TURN;
    if (node < 0)
        return;
    double target[3];
    point_at(w, in->x, in->y, w->depth, target);
    view_drag(&w->v, node, target);
}

static void on_move(window_view *w, const drape_input *in)
{
    const drape_view view = view_of(w);
    float dx = (float)(in->x - w->x), dy = (float)(in->y - w->y);
    float metre = 2 * view.ty * w->camera.distance / (float)drape_painter_canvas(w->painter)->height;
    double target[3];
    w->x = in->x;
    w->y = in->y;
    if (w->drag == DRAG_TURN) {
        w->camera.azimuth -= TURN * dx;
        w->camera.elevation = fminf(fmaxf(w->camera.elevation + TURN * dy, -89), 89);
    } else if (w->drag == DRAG_PAN) {
        for (int k = 0; k < 3; k++)
            w->camera.target[k] += metre * (dy * view.axes[1][k] - dx * view.axes[0][k]);
    } else if (w->drag == DRAG_NODE && w->v.dragged >= 0) {
        point_at(w, in->x, in->y, w->depth, target);
        view_drag(&w->v, w->v.dragged, target);
    }
    w->changed |= w->drag != DRAG_NONE;
}

static void take_input(window_view *w, const drape_input *in)
{
    if (in->kind == DRAPE_INPUT_KEY)
        on_key(w, in->key, in->shift);
    else if (in->kind == DRAPE_INPUT_PRESS)
        on_press(w, in);
    else if (in->kind == DRAPE_INPUT_MOVE)
        on_move(w, in);
    else if (in->kind == DRAPE_INPUT_RELEASE) {
        if (w->drag == DRAG_NODE)
            view_drag(&w->v, -1, NULL);
        w->drag = DRAG_NONE;
        w->changed = true;
    } else {
        w->camera.distance *= powf(NOTCH, (float)in->y);
        w->changed = true;
    }
}

/* ---- The loop ---- */

static drape_status loop(window_view *w)
{
    drape_status status = DRAPE_OK;
    int width, height;
    drape_input in;
    while (!status && !w->quit && !drape_window_closed(w->window) && !cli_interrupted()) {
        double start = drape_clock_seconds();
        bool idle = w->v.paused && !w->changed;
        drape_window_poll(w->window, idle ? IDLE : 0);
        while (drape_window_next(w->window, &in))
            take_input(w, &in);
        drape_window_size(w->window, &width, &height);
        const drape_canvas *canvas = drape_painter_canvas(w->painter);
        if ((width != canvas->width || height != canvas->height) && width >= 16 && height >= 16) {
            w->changed = true;
            status = make_painter(w);
        }
        if (status || (w->v.paused && !w->changed))
            continue;
        w->changed = false;
        bool ran = !w->v.paused;
        if (ran)
            view_advance(&w->v, false);
        status = take_frame(w);
        if (!status)
            status = draw(w);
        w->frame_seconds = drape_clock_seconds() - start;
        w->step_seconds = ran ? w->v.step_seconds : 0;
    }
    return status;
}

static int show(window_view *w)
{
    const cli_command *command = &w->request->command;
    int width = WIDTH, height = HEIGHT;
    char end, title[200];
    if (w->request->size &&
        (sscanf(w->request->size, "%5dx%5d%c", &width, &height, &end) != 2 || width < 160 || height < 120 ||
         width > DRAPE_MAX_PICTURE || height > DRAPE_MAX_PICTURE))
        return cli_misuse("view", "--size \"%.60s\": must be WIDTHxHEIGHT, from 160x120 to %d a side",
                          w->request->size, DRAPE_MAX_PICTURE);
    int code = cli_find_shading(command, w->request->shade, &w->shading);
    if (code == CLI_GO_ON)
        code = cli_scene_load(command, command->operand, &w->v.in);
    if (code != CLI_GO_ON)
        return code;
    list_movables(&w->v);
    snprintf(title, sizeof title, "drape: %.150s", command->operand);
    drape_status status = drape_window_create(w->ctx, title, width, height, &w->window);
    if (!status)
        status = make_painter(w);
    if (!status)
        status = drape_reel_create(w->ctx, w->v.in.model, true, &w->reel);
    if (!status)
        status = make_stage(w);
    if (!status)
        status = take_frame(w);
    if (status)
        return cli_report(command, CLI_BAD_INPUT);
    set_camera(w);
    if (loop(w))
        return cli_report(command, CLI_FAILED);
    drape_statistics s = drape_sim_statistics(w->v.in.sim);
    printf("t = %.6g s, %s, dt = %.6g s, %lld steps, %lld rejected, shade %s, stiffness x %.4g, gravity x "
           "%.4g\n",
           drape_sim_time(w->v.in.sim), view_integrator(&w->v), view_dt(&w->v), (long long)s.steps_accepted,
           (long long)s.steps_rejected, shading_of(w)->entry.name, w->v.factors[VIEW_STIFFNESS],
           w->v.factors[VIEW_GRAVITY]);
    return cli_interrupted() ? cli_report_interrupted("view") : CLI_DONE;
}

static int run(const void *command)
{
    const view_request *request = command;
    window_view w = {
        .request = request,
        .ctx = request->command.ctx,
        .v = {
            .command = &request->command, .factors = {1, 1, 1}, .dragged = -1, .paused = !request->running}};
    int code = show(&w);
    drape_stage_free(&w.stage);
    drape_reel_free(&w.reel);
    drape_painter_destroy(&w.painter);
    drape_window_destroy(&w.window);
    cli_scene_free(&w.v.in);
    return code;
}

#define AT(member) offsetof(view_request, member)
static const cli_option options[] = {
    {"shade", CLI_TEXT, "NAME", "how cloth is coloured (default linen); `drape list shadings` shows all",
     AT(shade)},
    {"size", CLI_TEXT, "WxH", "pixels of the window (default 1280x720)", AT(size)},
    {"running", CLI_FLAG, NULL, "start running, not paused", AT(running)},
};

const drape_verb drape_verb_view = {
    .entry = {.name = "view",
              .summary = "open a window on a running scene: rotate the camera, drag nodes, change values"},
    .operand = "SCENE",
    .takes_scene = true,
    .details = "Opens a window, paused. Space runs and pauses, N makes one step, R starts again, Esc quits, "
               "H shows all\n"
               "keys. Drag a node with the left button; dragging elsewhere rotates the camera.",
    CLI_OPTIONS(options, view_request),
    .run = run,
};
