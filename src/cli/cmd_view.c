/* cmd_view.c: `drape view`: a window on a scene that runs. */
#include "cli/signals.h"
#include "cli/view.h"

#include "base/clock.h"
#include "base/param.h"
#include "render/painter.h"
#include "render/reel.h"
#include "render/window.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define WIDTH  1280
#define HEIGHT 720
#define REACH  22.0f /* pixels at 720 rows: how near a node is taken */
#define TURN   0.4f  /* degrees a pixel */
#define NOTCH  0.9f  /* of the distance, a notch of the wheel */
#define STEP   0.04  /* of the scene's size: of a movable */
#define SCALE  1.5
#define IDLE   0.05 /* [s] that a paused window waits for input */
#define LINES  16
#define LINE   120
#define COLUMN 320   /* pixels at 720 rows: of the state or the keys, at the left */
#define WIDEST 0.42f /* of the window, at most */

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
    drape_context *ctx; /* of all that is drawn */
    drape_window *window;
    drape_painter *painter;
    drape_stage stage;
    drape_reel reel;
    drape_camera camera, home;
    int shading;      /* index of its row */
    double low, high; /* of its field, as far as it was seen */
    drag drag;
    double x, y; /* of the pointer */
    float depth; /* [m] of the dragged node from the eye */
    side shown;  /* at the left */
    bool changed, quit;
    double frame_seconds, step_seconds; /* of the last frame that was shown */
} window_view;

/* ---- What is drawn ---- */

static const drape_shading *shading_of(const window_view *w)
{
    return drape_shadings[w->shading];
}

static int report(const window_view *w, int code)
{
    fprintf(stderr, "drape view: %s\n", drape_context_message(w->ctx));
    return code;
}

static drape_status make_painter(window_view *w)
{
    drape_painter_def def = {.width = WIDTH, .height = HEIGHT};
    drape_window_size(w->window, &def.width, &def.height);
    drape_painter_destroy(&w->painter);
    return drape_painter_create(w->ctx, &def, &w->painter);
}

/* The present state, and the field of the shading. A field that the integrator does not have is told and not shown. */
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

/* The stage of a new model; where it stands and how large it is stay what they were. */
static drape_status make_stage(window_view *w)
{
    const drape_stage old = w->stage;
    drape_status status = drape_stage_create(w->ctx, w->v.in.model, &w->stage);
    if (status)
        return status;
    if (old.radius > 0) {
        memcpy(w->stage.center, old.center, sizeof old.center);
        w->stage.radius = old.radius;
        w->stage.floor = old.floor;
    }
    drape_stage copy = old;
    drape_stage_free(&copy);
    w->changed = true;
    return DRAPE_OK;
}

/* Of one panel, without its lines. */
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

/* The start has to fit, and as far as it may hang down. */
static void set_camera(window_view *w)
{
    const drape_picture picture = picture_of(w, NULL);
    float aspect = drape_painter_aspect(w->painter, &picture);
    drape_framing framing = drape_framing_begin(DRAPE_CAMERA_AZIMUTH, DRAPE_CAMERA_ELEVATION, aspect);
    const float *x = drape_reel_positions(&w->reel, 0);
    drape_stage_frame(&w->stage, &framing, 0, x);
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
    drape_sim_pull_force(v->in.sim, force);
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
    snprintf(lines[n++], LINE, "stiffness\tx %.3g", v->stiffness);
    snprintf(lines[n++], LINE, "damping\tx %.3g", v->damping);
    snprintf(lines[n++], LINE, "gravity\tx %.3g", v->gravity);
    snprintf(lines[n++], LINE, "shading\t%s", shading_of(w)->name);
    if (v->movable_count > 0)
        snprintf(lines[n++], LINE, "arrows\tmove %s", v->movables[v->moved].name);
    if (v->pulled >= 0)
        snprintf(lines[n++], LINE, "pull\t%.3g N on node %d",
                 sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]), (int)v->pulled);
    if (v->message[0])
        snprintf(lines[n++], LINE, "! %.100s", v->message);
    lines[n][0] = 0;
}

static const char *const help_lines[] = {"space, P\trun or pause",
                                         "N\tone step",
                                         "R\tfrom the start",
                                         "Esc, Q\tquit",
                                         "left drag\tpull a node; beside it turn",
                                         "right drag\tpan",
                                         "wheel\tzoom",
                                         "C\tcamera back",
                                         "S\tnext shading",
                                         "I\tnext integrator",
                                         "D K B G\ttime step, stiffness, damping, gravity: less",
                                         "shift\tmore, or back",
                                         "tab\tnext collider or pin",
                                         "arrows\tmove it, page keys up and down",
                                         "H\thide this; once more: show the state",
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

/* The spring, from the node to where it is pulled. */
static void mark_pull(window_view *w)
{
    static const float blue[4] = {0.05f, 0.30f, 0.75f, 0.95f};
    drape_overlay *o = drape_painter_overlay(w->painter);
    const drape_view view = view_of(w);
    const float *from = drape_reel_positions(&w->reel, 0) + 3 * (size_t)w->v.pulled;
    const float to[3] = {(float)w->v.pull[0], (float)w->v.pull[1], (float)w->v.pull[2]};
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
    if (w->v.pulled >= 0)
        mark_pull(w);
    drape_status status = drape_painter_draw(w->painter, &picture);
    int width, height;
    drape_window_size(w->window, &width, &height);
    drape_canvas_show(drape_painter_canvas(w->painter), width, height);
    drape_window_swap(w->window);
    return status;
}

/* ---- What the user does ---- */

static void forget_range(window_view *w)
{
    w->low = 0;
    w->high = 0;
}

static void new_model(window_view *w, bool changed)
{
    w->changed = true;
    if (changed && make_stage(w))
        w->quit = true;
}

static void choose_shading(window_view *w, int step)
{
    int count = 0;
    while (drape_shadings[count])
        count++;
    w->shading = (w->shading + step + count) % count;
    forget_range(w);
}

static void move_movable(window_view *w, int axis, double sign)
{
    double way[3] = {0};
    way[axis] = sign * STEP * w->v.in.model->length;
    new_model(w, view_move(&w->v, way));
}

/* A key and what it does; with shift the other way. */
static void toggle_pause(window_view *w, int sign)
{
    (void)sign;
    w->v.paused = !w->v.paused;
}
static void single_step(window_view *w, int sign)
{
    (void)sign;
    w->v.paused = true;
    view_advance(&w->v, true);
}
static void start_again(window_view *w, int sign)
{
    (void)sign;
    view_reset(&w->v);
    forget_range(w);
    new_model(w, true);
}
static void quit(window_view *w, int sign)
{
    (void)sign;
    w->quit = true;
}
static void camera_back(window_view *w, int sign)
{
    (void)sign;
    w->camera = w->home;
}
static void next_panel(window_view *w, int sign)
{
    (void)sign;
    w->shown = (w->shown + 1) % PANEL_COUNT;
}
static void next_shading(window_view *w, int sign)
{
    choose_shading(w, -sign);
}
static void next_integrator(window_view *w, int sign)
{
    new_model(w, view_next_integrator(&w->v, -sign));
}
static void scale_dt(window_view *w, int sign)
{
    new_model(w, view_scale_dt(&w->v, pow(SCALE, sign)));
}
static void scale_stiffness(window_view *w, int sign)
{
    new_model(w, view_scale_stiffness(&w->v, pow(SCALE, sign)));
}
static void scale_damping(window_view *w, int sign)
{
    new_model(w, view_scale_damping(&w->v, pow(SCALE, sign)));
}
static void scale_gravity(window_view *w, int sign)
{
    new_model(w, view_scale_gravity(&w->v, pow(SCALE, sign)));
}
static void next_movable(window_view *w, int sign)
{
    if (w->v.movable_count > 0)
        w->v.moved = (w->v.moved - sign + w->v.movable_count) % w->v.movable_count;
}
static void move_left(window_view *w, int sign)
{
    (void)sign;
    move_movable(w, 0, -1);
}
static void move_right(window_view *w, int sign)
{
    (void)sign;
    move_movable(w, 0, 1);
}
static void move_away(window_view *w, int sign)
{
    (void)sign;
    move_movable(w, 2, -1);
}
static void move_near(window_view *w, int sign)
{
    (void)sign;
    move_movable(w, 2, 1);
}
static void move_up(window_view *w, int sign)
{
    (void)sign;
    move_movable(w, 1, 1);
}
static void move_down(window_view *w, int sign)
{
    (void)sign;
    move_movable(w, 1, -1);
}

/* sign: -1, with shift 1. */
static const struct {
    int key;
    void (*act)(window_view *w, int sign);
} keys[] = {{' ', toggle_pause},
            {'P', toggle_pause},
            {'N', single_step},
            {'R', start_again},
            {'Q', quit},
            {DRAPE_KEY_ESCAPE, quit},
            {'C', camera_back},
            {'H', next_panel},
            {'S', next_shading},
            {'I', next_integrator},
            {'D', scale_dt},
            {'K', scale_stiffness},
            {'B', scale_damping},
            {'G', scale_gravity},
            {DRAPE_KEY_TAB, next_movable},
            {DRAPE_KEY_LEFT, move_left},
            {DRAPE_KEY_RIGHT, move_right},
            {DRAPE_KEY_UP, move_away},
            {DRAPE_KEY_DOWN, move_near},
            {DRAPE_KEY_PAGE_UP, move_up},
            {DRAPE_KEY_PAGE_DOWN, move_down}};

static void on_key(window_view *w, const drape_input *in)
{
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (keys[i].key == in->key)
            keys[i].act(w, in->shift ? 1 : -1);
    w->changed = true;
}

/* The free node nearest to the eye of those near the pointer; -1: none. */
static int32_t node_at(const window_view *w, double x, double y, float *depth)
{
    const drape_view view = view_of(w);
    const drape_model *m = w->v.in.model;
    float reach = REACH * drape_painter_overlay(w->painter)->unit, best = INFINITY;
    int32_t found = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        float px, py, pz;
        if (m->pinned[i] ||
            !project(w, &view, drape_reel_positions(&w->reel, 0) + 3 * (size_t)i, &px, &py, &pz))
            continue;
        float away = hypotf(px - (float)x, py - (float)y);
        if (away < reach && pz * (1 + away / reach * 0.02f) < best) {
            best = pz * (1 + away / reach * 0.02f);
            *depth = pz;
            found = i;
        }
    }
    return found;
}

/* Where the pointer is in the plane of this depth before the eye. */
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
    view_pull(&w->v, node, target);
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
    } else if (w->drag == DRAG_NODE && w->v.pulled >= 0) {
        point_at(w, in->x, in->y, w->depth, target);
        view_pull(&w->v, w->v.pulled, target);
    }
    w->changed |= w->drag != DRAG_NONE;
}

static void on_release(window_view *w)
{
    if (w->drag == DRAG_NODE)
        view_pull(&w->v, -1, NULL);
    w->drag = DRAG_NONE;
    w->changed = true;
}

static void take_inputs(window_view *w)
{
    drape_input in;
    while (drape_window_next(w->window, &in)) {
        if (in.kind == DRAPE_INPUT_KEY)
            on_key(w, &in);
        else if (in.kind == DRAPE_INPUT_PRESS)
            on_press(w, &in);
        else if (in.kind == DRAPE_INPUT_RELEASE)
            on_release(w);
        else if (in.kind == DRAPE_INPUT_MOVE)
            on_move(w, &in);
        else {
            w->camera.distance *= powf(NOTCH, (float)in.y);
            w->changed = true;
        }
    }
}

static drape_status follow_size(window_view *w)
{
    int width, height;
    const drape_canvas *canvas = drape_painter_canvas(w->painter);
    drape_window_size(w->window, &width, &height);
    if ((width == canvas->width && height == canvas->height) || width < 16 || height < 16)
        return DRAPE_OK;
    w->changed = true;
    return make_painter(w);
}

/* ---- The loop ---- */

static drape_status loop(window_view *w)
{
    drape_status status = DRAPE_OK;
    while (!status && !w->quit && !drape_window_closed(w->window) && !cli_interrupted()) {
        double start = drape_clock_seconds();
        bool idle = w->v.paused && !w->changed;
        drape_window_poll(w->window, idle ? IDLE : 0);
        take_inputs(w);
        status = follow_size(w);
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
        status = drape_reel_create(w->ctx, (size_t)w->v.in.model->node_count, true, &w->reel);
    if (!status)
        status = make_stage(w);
    if (!status)
        status = take_frame(w);
    if (!status)
        set_camera(w);
    return status;
}

static int read_shade(window_view *w)
{
    const char *name = w->request->shade ? w->request->shade : "diffuse";
    for (w->shading = 0; drape_shadings[w->shading]; w->shading++)
        if (strcmp(drape_shadings[w->shading]->name, name) == 0)
            return CLI_GO_ON;
    return cli_misuse("view", "--shade \"%.60s\": there is no such shading; `drape list shadings` shows all",
                      name);
}

/* What it came to, for whoever closed the window. */
static void print_end(const window_view *w)
{
    drape_statistics s = drape_sim_statistics(w->v.in.sim);
    printf("t = %.6g s, %s, dt = %.6g s, %lld steps, %lld rejected, shade %s, stiffness x %.4g, gravity x "
           "%.4g\n",
           drape_sim_time(w->v.in.sim), view_integrator(&w->v), view_dt(&w->v), (long long)s.steps_accepted,
           (long long)s.steps_rejected, shading_of(w)->name, w->v.stiffness, w->v.gravity);
}

static int run(window_view *w)
{
    int width = WIDTH, height = HEIGHT;
    char end;
    if (w->request->size &&
        (sscanf(w->request->size, "%5dx%5d%c", &width, &height, &end) != 2 || width < 160 || height < 120 ||
         width > DRAPE_MAX_PICTURE || height > DRAPE_MAX_PICTURE))
        return cli_misuse("view", "--size \"%.60s\": it is WIDTHxHEIGHT, from 160x120 to %d a side",
                          w->request->size, DRAPE_MAX_PICTURE);
    int code = read_shade(w);
    if (code == CLI_GO_ON)
        code = view_open(&w->request->command, &w->v);
    if (code != CLI_GO_ON)
        return code;
    if (set_up(w, width, height))
        return report(w, CLI_BAD_INPUT);
    w->v.paused = !w->request->running;
    if (loop(w))
        return report(w, CLI_FAILED);
    print_end(w);
    return cli_interrupted() ? cli_tell_interrupted("view") : CLI_DONE;
}

static const cli_option options[] = {
    {"shade", CLI_TEXT, "ROW", "how cloth is coloured; `drape list shadings` shows all",
     offsetof(view_request, shade), 0, NULL},
    {"size", CLI_TEXT, "WxH", "pixels of the window, 1280x720 without it", offsetof(view_request, size), 0,
     NULL},
    {"running", CLI_FLAG, NULL, "starts at once, not paused", offsetof(view_request, running), 0, NULL},
};

static int main_view(int argc, char **argv);

const drape_verb drape_verb_view = {
    .name = "view",
    .operand = "SCENE",
    .takes_scene = true,
    .summary = "a window on a scene that runs: turn it, pull at it, change it",
    .details = "Opens a window, paused. Space runs and pauses, N makes one step, R starts again, Esc quits, "
               "H shows all\n"
               "keys. Drag a node with the left button; drag beside the cloth turns the camera.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .run = main_view,
};

static int main_view(int argc, char **argv)
{
    view_request request = {.shade = NULL};
    window_view w = {.request = &request};
    int code = cli_parse(&drape_verb_view, argc, argv, &request.command);
    if (code == CLI_GO_ON && cli_context_create(&w.ctx))
        code = cli_misuse("view", "out of memory");
    if (code == CLI_GO_ON) {
        code = run(&w);
        drape_stage_free(&w.stage);
        drape_reel_free(&w.reel);
        drape_painter_destroy(&w.painter);
        drape_window_destroy(&w.window);
        view_free(&w.v);
    }
    drape_context_destroy(&w.ctx);
    cli_command_free(&request.command);
    return code;
}
