/* cmd_view.c: `drape view`: a window that shows a running scene. */
#include "cli/frames.h"
#include "cli/view.h"

#include "base/clock.h"
#include "render/painter.h"
#include "render/reel.h"
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

/* The place of a node of the simulation, which the surface that is drawn may not have. */
static const float *node_place(const window_view *w, int32_t node, float place[3])
{
    for (int k = 0; k < 3; k++)
        place[k] = (float)drape_sim_positions(w->v.in.sim)[3 * (size_t)node + (size_t)k];
    return place;
}

/* Draws the drag spring, from its node to its target. */
static void mark_drag_spring(window_view *w)
{
    static const float blue[4] = {0.05f, 0.30f, 0.75f, 0.95f};
    drape_overlay *o = drape_painter_overlay(w->painter);
    const drape_view view = view_of(w);
    float place[3];
    const float *from = node_place(w, w->v.dragged, place);
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

static void forget_range(window_view *w)
{
    w->low = 0;
    w->high = 0;
}

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
    if (key == 'D')
        redraw(w, view_scale_dt(&w->v, factor));
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
        view_reset(v);
        forget_range(w);
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
        forget_range(w);
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
        float place[3], px, py, pz;
        if (m->pinned[i] || !project(w, &view, node_place(w, i, place), &px, &py, &pz))
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

static void take_inputs(window_view *w)
{
    drape_input in;
    while (drape_window_next(w->window, &in)) {
        if (in.kind == DRAPE_INPUT_KEY)
            on_key(w, in.key, in.shift);
        else if (in.kind == DRAPE_INPUT_PRESS)
            on_press(w, &in);
        else if (in.kind == DRAPE_INPUT_MOVE)
            on_move(w, &in);
        else if (in.kind == DRAPE_INPUT_RELEASE) {
            if (w->drag == DRAG_NODE)
                view_drag(&w->v, -1, NULL);
            w->drag = DRAG_NONE;
            w->changed = true;
        } else {
            w->camera.distance *= powf(NOTCH, (float)in.y);
            w->changed = true;
        }
    }
}

/* ---- The loop ---- */

static drape_status loop(window_view *w)
{
    drape_status status = DRAPE_OK;
    int width, height;
    while (!status && !w->quit && !drape_window_closed(w->window) && !cli_interrupted()) {
        double start = drape_clock_seconds();
        bool idle = w->v.paused && !w->changed;
        drape_window_poll(w->window, idle ? IDLE : 0);
        take_inputs(w);
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

static drape_status set_up(window_view *w, int width, int height)
{
    char title[200];
    snprintf(title, sizeof title, "drape: %.150s", w->request->command.operand);
    drape_status status = drape_window_create(w->ctx, title, width, height, &w->window);
    if (!status)
        status = make_painter(w);
    if (!status)
        status = drape_reel_create(w->ctx, w->v.in.model, true, &w->reel);
    if (!status)
        status = make_stage(w);
    if (!status)
        status = take_frame(w);
    if (!status)
        set_camera(w);
    return status;
}

static int show(window_view *w)
{
    int width = WIDTH, height = HEIGHT;
    char end;
    if (w->request->size &&
        (sscanf(w->request->size, "%5dx%5d%c", &width, &height, &end) != 2 || width < 160 || height < 120 ||
         width > DRAPE_MAX_PICTURE || height > DRAPE_MAX_PICTURE))
        return cli_misuse("view", "--size \"%.60s\": must be WIDTHxHEIGHT, from 160x120 to %d a side",
                          w->request->size, DRAPE_MAX_PICTURE);
    int code = cli_find_shading(&w->request->command, w->request->shade, &w->shading);
    if (code == CLI_GO_ON)
        code = view_open(&w->request->command, &w->v);
    if (code != CLI_GO_ON)
        return code;
    if (set_up(w, width, height))
        return cli_report(&w->request->command, CLI_BAD_INPUT);
    w->v.paused = !w->request->running;
    if (loop(w))
        return cli_report(&w->request->command, CLI_FAILED);
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
    window_view w = {.request = request, .ctx = request->command.ctx};
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
