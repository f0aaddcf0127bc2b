/* cmd_render.c: `drape render`: draws pictures and films of scenes and finished runs. */
#include "cli/cli.h"

#include "base/param.h"
#include "io/export.h"
#include "io/scene_copy.h"
#include "render/film.h"
#include "render/images.h"
#include "render/offscreen.h"
#include "render/painter.h"
#include "render/reel.h"
#include "render/shading.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define DEFAULT_WIDTH  1280
#define DEFAULT_HEIGHT 720
#define MAX_SLOW       1000
#define MAX_FINE       4  /* largest --fine */
#define TURN_ANGLES    24 /* at which a turntable is framed */
#define MIN_SIDE       16
#define MIN_RANGE      1e-9 /* of a field whose values are all the same */
#define PICTURE        "frame_%05zu.png"
#define PICTURES       "frame_#####.png" /* pattern of these names (drape_folder_matches) */
#define PICTURE_NAME   32                /* upper bound of the bytes of "frame_00000.png" */

/* Which frames are wanted. */
typedef struct frames_def {
    int every;                    /* every n-th frame; not used with `one` */
    int one;                      /* number of a single frame, from 0; ALL_FRAMES; LAST_FRAME */
    const drape_field_ops *field; /* NULL: none */
} frames_def;

enum { ALL_FRAMES = -1, LAST_FRAME = -2 };

typedef struct source {
    const cli_command *command;
    const char *operand;
    char label[80]; /* name shown in the picture */
    cli_scene in;
    drape_record run; /* of a folder; without frames: the scene is simulated */
    drape_reel reel;  /* of its frames */
    bool incomplete;  /* the simulation stopped early: the reel has the frames up to then */
} source;

typedef struct render_request {
    cli_command command;
    const char *out, *shade, *size, *camera, *range, *frame, *texture, *height, *environment;
    int every, slow, fine;
    bool compare, small, turntable;
} render_request;

typedef struct render {
    const render_request *request;
    const cli_drawing *drawing; /* the frame shows these distances; NULL: what the request says */
    frames_def frames;
    int width, height;
    int fine;                        /* pixels that are drawn along a side of one of the picture */
    double azimuth, elevation, zoom; /* of the camera */
    double low, high;                /* range of the field; NaN: that of its values */
    const drape_shading *shading;
    bool film, picture;   /* to be made; neither: a folder of pictures */
    drape_folder *folder; /* of pictures; NULL: there is one picture or a film */
    drape_film *making;   /* NULL: it is not begun */
    source *sources;
    int source_count;
    drape_context *ctx;
    drape_offscreen *offscreen;
    drape_painter *painter;
    drape_stage *stages;
    drape_camera view;
    uint8_t *drawn, *pixels; /* fine^2 as many; of the picture */
} render;

/* ---- The command line ---- */

/* Between min and max numbers separated by commas, and nothing after them. */
static bool read_numbers(const char *text, double *values, int min, int max)
{
    int count = 0;
    while (count < max && (text = drape_number_read(text, &values[count]))) {
        count++;
        if (*text++ != ',')
            return text[-1] == 0 && count >= min;
    }
    return false;
}

static int read_shade_and_size(render *r)
{
    char end;
    int index;
    const int code = cli_find_shading(&r->request->command, r->request->shade, &index);
    if (code != CLI_GO_ON)
        return code;
    r->shading = drape_shadings[index];
    r->width = DEFAULT_WIDTH;
    r->height = DEFAULT_HEIGHT;
    if (r->request->size &&
        (sscanf(r->request->size, "%5dx%5d%c", &r->width, &r->height, &end) != 2 || r->width < MIN_SIDE ||
         r->height < MIN_SIDE || r->width > DRAPE_MAX_PICTURE || r->height > DRAPE_MAX_PICTURE))
        return cli_misuse("render", "--size \"%.60s\": must be WIDTHxHEIGHT, each %d to %d pixels",
                          r->request->size, MIN_SIDE, DRAPE_MAX_PICTURE);
    return CLI_GO_ON;
}

static int read_camera(render *r)
{
    double v[3] = {DRAPE_CAMERA_AZIMUTH, DRAPE_CAMERA_ELEVATION, 1};
    if (r->request->camera && (!read_numbers(r->request->camera, v, 2, 3) || fabs(v[1]) > 90 ||
                               fabs(v[0]) > 3600 || v[2] < 0.01 || v[2] > 100))
        return cli_misuse(
            "render",
            "--camera \"%.60s\": must be azimuth,elevation[,zoom]: degrees, elevation -90 to 90, "
            "zoom 0.01 to 100",
            r->request->camera);
    r->azimuth = v[0];
    r->elevation = v[1];
    r->zoom = v[2];
    return CLI_GO_ON;
}

static int read_range(render *r)
{
    double v[2] = {NAN, NAN};
    if (r->request->range && !r->shading->field)
        return cli_misuse("render", "--range: the shading \"%s\" shows no field", r->shading->entry.name);
    if (r->request->range && (!read_numbers(r->request->range, v, 2, 2) || v[0] >= v[1]))
        return cli_misuse("render", "--range \"%.60s\": must be low,high, in %s", r->request->range,
                          r->shading->field->shown_unit);
    double shown = r->shading->field ? r->shading->field->shown : 1;
    r->low = v[0] / shown;
    r->high = v[1] / shown;
    return CLI_GO_ON;
}

/* Refuses files that the shading does not read. */
static int read_images(render *r)
{
    const render_request *q = r->request;
    const struct {
        const char *option, *file;
        int reads;
    } images[] = {{"texture", q->texture, DRAPE_READS_PATTERN},
                  {"height", q->height, DRAPE_READS_HEIGHTS},
                  {"environment", q->environment, DRAPE_READS_ENVIRONMENT}};
    for (size_t i = 0; i < sizeof images / sizeof *images; i++) {
        char names[120] = "";
        size_t used = 0;
        if (!images[i].file || r->shading->reads & images[i].reads)
            continue;
        for (int k = 0; drape_shadings[k] && used < sizeof names; k++)
            if (drape_shadings[k]->reads & images[i].reads)
                used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "",
                                         drape_shadings[k]->entry.name);
        return cli_misuse("render", "--%s: the shading \"%s\" does not use it; these do: %s",
                          images[i].option, r->shading->entry.name, names);
    }
    return CLI_GO_ON;
}

/* ".mp4, .webm" ... */
static const char *film_endings(char *text, size_t size)
{
    size_t used = 0;
    for (int i = 0; drape_film_ending(i) && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, "%s%s", i ? ", " : "", drape_film_ending(i));
    return text;
}

/* The ending of the name says what is made. A folder that exists may have any name. */
static int read_kind(render *r)
{
    char films[80];
    const char *out = r->request->out;
    if (!out)
        return cli_misuse("render", "--out is missing: a picture (.png), a film (%s) or a folder",
                          film_endings(films, sizeof films));
    /* ".png" of "a.b/x.png"; "" if the name has no dot after its beginning or ends in a slash */
    const char *slash = strrchr(out, '/'), *name = slash ? slash + 1 : out;
    const char *dot = strrchr(name + strspn(name, "."), '.'), *ending = dot ? dot : "";
    r->film = drape_film_knows(out);
    r->picture = strcasecmp(ending, ".png") == 0;
    if (r->film || r->picture || !*ending || cli_is_folder(out))
        return CLI_GO_ON;
    return cli_misuse(
        "render",
        "--out \"%.200s\": there is no \"%.20s\"; .png is a picture, %s are films, and a folder "
        "for pictures has no ending, or a / at its end",
        out, ending, film_endings(films, sizeof films));
}

static int read_out(render *r)
{
    const render_request *q = r->request;
    char *end = NULL;
    long frame = q->frame ? strtol(q->frame, &end, 10) : LAST_FRAME;
    if (q->frame && (!*q->frame || *end || frame < 0 || frame > 1000000000))
        return cli_misuse("render", "--frame \"%.60s\": must be an integer, 0 or more", q->frame);
    if (q->frame && !r->picture)
        return cli_misuse("render", "--frame is for a picture: --out NAME.png");
    if (q->every && r->picture)
        return cli_misuse("render", "--every is for films and folders; --frame N is for a picture");
    if (q->slow && !r->film)
        return cli_misuse("render", "--slow is for films: pictures have no speed");
    if (q->turntable && r->picture)
        return cli_misuse("render", "--turntable is for films and folders: a picture has one view");
    if (!q->compare && q->command.operand_count > 1)
        return cli_misuse("render", "%d scenes or runs are given; --compare draws them side by side",
                          q->command.operand_count);
    if (r->film && drape_film_check(r->ctx))
        return cli_misuse("render", "%s", drape_context_message(r->ctx));
    r->fine = q->fine ? q->fine : r->picture ? 2 : 1;
    while (r->fine > 1 && (r->fine * r->width > DRAPE_MAX_PICTURE || r->fine * r->height > DRAPE_MAX_PICTURE))
        r->fine--;
    r->frames = (frames_def){.every = r->picture || !q->every ? 1 : q->every,
                             .one = r->picture ? (int)frame : ALL_FRAMES,
                             .field = r->shading->field};
    return CLI_GO_ON;
}

static int read_request(render *r)
{
    int (*const readers[])(render *) = {read_shade_and_size, read_camera, read_range,
                                        read_images,         read_kind,   read_out};
    int code = CLI_GO_ON;
    for (size_t i = 0; i < sizeof readers / sizeof *readers && code == CLI_GO_ON; i++)
        code = readers[i](r);
    return code;
}

/* ---- Frames: of a finished run, or of a scene, which is simulated ---- */

/* The label: "runs/be/" -> "be", "a/sphere_drape.json" -> "sphere_drape" */
static int open_source(const cli_command *command, const char *operand, const frames_def *def, source *out)
{
    const char *end = operand + strlen(operand), *begin;
    *out = (source){.command = command, .operand = operand};
    while (end > operand && end[-1] == '/')
        end--;
    for (begin = end; begin > operand && begin[-1] != '/'; begin--)
        ;
    if (end - begin > 5 && strncmp(end - 5, ".json", 5) == 0)
        end -= 5;
    snprintf(out->label, sizeof out->label, "%.*s", (int)(end - begin), begin);
    int code = cli_is_folder(operand) ? cli_run_load(command, operand, &out->in, &out->run)
                                      : cli_scene_load(command, operand, &out->in);
    if (code != CLI_GO_ON)
        return code;
    if (out->run.frames > 0 && def->one >= out->run.frames)
        return cli_misuse(command->verb, "--frame %d: %s has the frames 0 to %" PRId64, def->one, operand,
                          out->run.frames - 1);
    if (out->run.frames > 0 && def->field && def->field->of_steps)
        return cli_misuse(command->verb,
                          "--shade %s: the frames of a run do not have it; give the scene, which is "
                          "simulated again: %s/scene.json",
                          def->field->entry.name, operand);
    if (drape_reel_create(command->ctx, out->in.model, def->field, &out->reel))
        return cli_report(command, CLI_BAD_INPUT);
    return CLI_GO_ON;
}

/* ---- From a run ---- */

/* Adds a frame to the reel. A field is that of the sim, set to the frame; it may need velocities: they are
 * differences of the frames before and after it. scratch: (9 nodes) */
static drape_status read_frame(const frames_def *def, source *s, int64_t frame, double *scratch)
{
    drape_record *run = &s->run;
    const size_t n = 3 * (size_t)run->nodes;
    const int64_t before = frame > 0 ? frame - 1 : frame, after = frame + 1 < run->frames ? frame + 1 : frame;
    const double span = run->times[after] - run->times[before];
    double *x = scratch, *v = x + n, *other = v + n;
    drape_status status = drape_record_read(run, frame, x);
    if (!status && def->field)
        status = drape_record_read(run, after, v);
    if (!status && def->field)
        status = drape_record_read(run, before, other);
    for (size_t i = 0; !status && def->field && i < n; i++)
        v[i] = span > 0 ? (v[i] - other[i]) / span : 0;
    if (!status && def->field)
        status = drape_sim_set_state(s->in.sim, run->times[frame], x, v);
    return status ? status : drape_reel_add(&s->reel, run->times[frame], x, s->in.sim, def->field);
}

static int read_frames(const frames_def *def, source *s)
{
    double *scratch = drape_alloc(s->in.ctx, 9 * (size_t)s->run.nodes, sizeof *scratch);
    drape_status status = scratch ? DRAPE_OK : DRAPE_E_MEMORY;
    const bool all = def->one == ALL_FRAMES;
    const int64_t end = s->run.frames - 1, first = all ? 0 : def->one == LAST_FRAME ? end : def->one;
    for (int64_t i = first; i <= (all ? end : first) && !status && !cli_interrupted(); i += def->every)
        status = read_frame(def, s, i, scratch);
    drape_free(s->in.ctx, scratch);
    if (cli_interrupted())
        return cli_report_interrupted(s->command->verb);
    return status ? cli_report(s->command, CLI_FAILED) : CLI_GO_ON;
}

/* ---- From a simulation ---- */

typedef struct watch {
    const frames_def *def;
    source *source;
    cli_progress progress;
    double last; /* time of the last frame, kept or not [s] */
    bool found;  /* the single frame that is wanted */
} watch;

static drape_status keep(watch *w, double t, const double *x)
{
    return drape_reel_add(&w->source->reel, t, x, w->source->in.sim, w->def->field);
}

static drape_status observe(void *user, const drape_event *event)
{
    watch *w = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT) {
        cli_progress_show(&w->progress, event->sim);
        if (!cli_interrupted())
            return DRAPE_OK;
        drape_context_set_message(w->source->in.ctx, "t=%.9g: interrupted", drape_sim_time(event->sim));
        return DRAPE_E_STOPPED;
    }
    if (event->kind != DRAPE_EVENT_FRAME)
        return DRAPE_OK;
    w->last = event->time;
    if (w->def->one == LAST_FRAME || (w->def->one >= 0 && event->frame != w->def->one) ||
        event->frame % w->def->every != 0)
        return DRAPE_OK;
    drape_status status = keep(w, event->time, event->positions);
    w->found = w->def->one >= 0;
    return status ? status : w->found ? DRAPE_E_STOPPED : DRAPE_OK;
}

static int simulate(const frames_def *def, source *s)
{
    watch w = {.def = def, .source = s};
    double end = drape_model_duration(s->in.model), t;
    drape_status status = drape_sim_observe(s->in.sim, observe, &w);
    cli_progress_begin(&w.progress, s->in.sim, end);
    if (!status)
        status = drape_sim_advance(s->in.sim, end);
    cli_progress_clear(&w.progress);
    if (status == DRAPE_E_STOPPED && drape_sim_stopped_by(s->in.sim) >= 0)
        status = DRAPE_OK; /* as the scene says */
    if (w.found)
        return CLI_GO_ON;
    s->incomplete = status != DRAPE_OK;
    if (cli_interrupted())
        return status == DRAPE_E_STOPPED ? cli_report(s->command, CLI_INTERRUPTED)
                                         : cli_report_interrupted(s->command->verb);
    if (status)
        cli_report(s->command, CLI_FAILED);
    if (status == DRAPE_E_ARGUMENT || status == DRAPE_E_MEMORY)
        return CLI_FAILED;
    t = drape_sim_time(s->in.sim); /* the state at the end is a frame too, unless it is the last one */
    if ((def->one == LAST_FRAME || (def->one == ALL_FRAMES && (s->reel.count == 0 || t > w.last))) &&
        keep(&w, t, drape_sim_positions(s->in.sim)))
        return cli_report(s->command, CLI_FAILED);
    if (s->reel.count > 0)
        return CLI_GO_ON;
    return cli_misuse(s->command->verb, "--frame %d: %s has fewer frames", def->one, s->operand);
}

/* ---- Preparing ---- */

static int open_sources(render *r)
{
    const cli_command *command = &r->request->command;
    int code = CLI_GO_ON;
    r->sources = drape_arena_take(command->arena, (size_t)command->operand_count, sizeof *r->sources);
    if (!r->sources)
        return cli_report(&r->request->command, CLI_FAILED);
    for (int i = 0; i < command->operand_count && code == CLI_GO_ON; i++) {
        code = open_source(command, command->operands[i], &r->frames, &r->sources[i]);
        r->source_count++;
    }
    return code;
}

/* Sets the values of the frame that was read, and the shading that shows them. */
static int set_distances(render *r)
{
    static const drape_field_ops field = {.entry = {.name = "distance"}, .shown = 1e3, .shown_unit = "mm"};
    static const drape_shading shading = {
        .entry = {.name = "distance"}, .source = drape_shading_field_source, .field = &field};
    drape_reel *reel = &r->sources[0].reel;
    double *values = drape_arena_take(r->request->command.arena, reel->nodes, sizeof *values);
    reel->values = drape_arena_take(&reel->arena, reel->nodes, sizeof *reel->values);
    if (!values || !reel->values)
        return cli_report(&r->request->command, CLI_FAILED);
    r->shading = &shading;
    drape_render_values(reel->model, r->drawing->distances, 1, values);
    reel->with_values = true;
    for (size_t i = 0; i < reel->nodes; i++) {
        reel->values[i] = (float)values[i];
        reel->high = fmax(reel->high, values[i]);
    }
    return CLI_GO_ON;
}

/* Before anything is simulated, so that failures to draw are reported at once. */
static int open_painter(render *r)
{
    const size_t size = (size_t)r->width * (size_t)r->height, finer = (size_t)(r->fine * r->fine);
    const drape_painter_def def = {.width = r->fine * r->width,
                                   .height = r->fine * r->height,
                                   .fine = r->fine,
                                   .pattern = r->request->texture,
                                   .heights = r->request->height,
                                   .environment = r->request->environment};
    drape_status status = drape_offscreen_create(r->ctx, &r->offscreen);
    if (!status)
        status = drape_painter_create(r->ctx, &def, &r->painter);
    r->drawn = drape_arena_take(r->request->command.arena, finer * size, 4);
    r->pixels = finer == 1 ? r->drawn : drape_arena_take(r->request->command.arena, size, 4);
    return status || !r->drawn || !r->pixels ? cli_report(&r->request->command, CLI_BAD_INPUT) : CLI_GO_ON;
}

static int fill_sources(render *r)
{
    int code = CLI_GO_ON;
    for (int i = 0; i < r->source_count && code == CLI_GO_ON; i++)
        code = r->sources[i].run.frames > 0 ? read_frames(&r->frames, &r->sources[i])
                                            : simulate(&r->frames, &r->sources[i]);
    return code == CLI_GO_ON && r->drawing ? set_distances(r) : code;
}

/* Adds all frames of all runs to a framing. */
static void add_frames(render *r, drape_framing *framing, const float *offset)
{
    for (int i = 0; i < r->source_count; i++) {
        const drape_reel *reel = &r->sources[i].reel;
        for (size_t k = 0; k < reel->count; k++)
            drape_stage_frame(&r->stages[i], framing, reel->times[k], drape_reel_positions(reel, k), offset);
    }
}

/* One camera for all panels and all frames. That of a turntable is about the middle of the first stage, as
 * far as the angle that needs most. */
static int set_stages(render *r)
{
    const drape_picture picture = {.panel_count = r->source_count, .shading = r->shading};
    const float aspect = drape_painter_aspect(r->painter, &picture), azimuth = (float)r->azimuth,
                elevation = (float)r->elevation;
    float offset[3] = {0};
    r->stages = drape_arena_take(r->request->command.arena, (size_t)r->source_count, sizeof *r->stages);
    if (!r->stages)
        return cli_report(&r->request->command, CLI_FAILED);
    for (int i = 0; i < r->source_count; i++) {
        drape_stage *stage = &r->stages[i];
        const drape_reel *reel = &r->sources[i].reel;
        if (drape_stage_create(r->ctx, r->sources[i].in.model, stage))
            return cli_report(&r->request->command, CLI_FAILED);
        for (size_t k = 0; k < reel->count; k++)
            drape_stage_add(stage, drape_reel_positions(reel, k));
        drape_stage_finish(stage);
    }
    if (!r->request->turntable) {
        drape_framing framing = drape_framing_begin(azimuth, elevation, aspect);
        add_frames(r, &framing, offset);
        r->view = drape_framing_end(&framing, azimuth, elevation, (float)r->zoom);
        return CLI_GO_ON;
    }
    r->view = (drape_camera){.azimuth = azimuth, .elevation = elevation};
    for (int k = 0; k < 3; k++) {
        r->view.target[k] = r->stages[0].center[k];
        offset[k] = -r->view.target[k];
    }
    for (int i = 0; i < TURN_ANGLES; i++) {
        drape_framing framing =
            drape_framing_begin(azimuth + 360.0f * (float)i / TURN_ANGLES, elevation, aspect);
        add_frames(r, &framing, offset);
        r->view.distance = fmaxf(r->view.distance, drape_framing_distance(&framing) / (float)r->zoom);
    }
    return CLI_GO_ON;
}

/* ---- Drawing ---- */

/* Draws frame k of the first run, and the frames of the others at its time. */
static drape_status draw(render *r, size_t k)
{
    drape_panel panels[DRAPE_MAX_PANELS];
    char caption[48];
    double t = r->sources[0].reel.times[k];
    for (int i = 0; i < r->source_count; i++) {
        const source *s = &r->sources[i];
        size_t at = i == 0 ? k : drape_reel_at(&s->reel, t);
        panels[i] = (drape_panel){.stage = &r->stages[i],
                                  .moment = {.t = s->reel.times[at],
                                             .positions = drape_reel_positions(&s->reel, at),
                                             .values = drape_reel_values(&s->reel, at)},
                                  .label = r->source_count > 1 ? s->label : NULL};
    }
    snprintf(caption, sizeof caption, "t = %.3f s", t);
    drape_camera camera = r->view;
    if (r->request->turntable) /* the frame after the last one would be the first one again */
        camera.azimuth += 360.0f * (float)k / (float)r->sources[0].reel.count;
    const drape_picture picture = {.panels = panels,
                                   .panel_count = r->source_count,
                                   .shading = r->shading,
                                   .low = r->low,
                                   .high = r->high,
                                   .camera = camera,
                                   .caption = r->picture && !r->drawing ? NULL : caption};
    return drape_painter_draw(r->painter, &picture);
}

/* Averages the pixels that were drawn. */
static void average(render *r)
{
    const size_t fine = (size_t)r->fine, width = (size_t)r->width, count = fine * fine;
    for (size_t y = 0; fine > 1 && y < (size_t)r->height; y++)
        for (size_t i = 0; i < 4 * width; i++) {
            const uint8_t *from = r->drawn + 4 * fine * (y * fine * width + i / 4) + i % 4;
            size_t sum = count / 2;
            for (size_t k = 0; k < count; k++)
                sum += from[4 * (k / fine * fine * width + k % fine)];
            r->pixels[4 * width * y + i] = (uint8_t)(sum / count);
        }
}

/* The driver draws the next frame while this one is written. */
static drape_status draw_frames(render *r)
{
    size_t count = r->sources[0].reel.count;
    char name[PICTURE_NAME];
    drape_status status = draw(r, 0);
    for (size_t k = 0; k < count && !status && !cli_interrupted(); k++) {
        status = drape_canvas_read(r->ctx, drape_painter_canvas(r->painter), r->drawn);
        average(r);
        drape_status next = !status && k + 1 < count ? draw(r, k + 1) : DRAPE_OK;
        snprintf(name, sizeof name, PICTURE, k);
        if (!status && r->making)
            status = drape_film_add(r->making, r->pixels);
        else if (!status)
            status = drape_png_write(r->ctx, r->folder, r->folder ? name : r->request->out, r->pixels,
                                     r->width, r->height, r->request->small);
        status = status ? status : next;
    }
    return status;
}

static bool is_picture(const void *user, const char *name)
{
    (void)user;
    return drape_folder_matches(PICTURES, name, NULL);
}

/* ---- What must not be replaced ---- */

static drape_status check_input(void *user, const char *path, const char *pointer)
{
    render *r = user;
    (void)pointer;
    return r->folder ? drape_folder_protect(r->folder, path)
                     : drape_file_check_named(r->ctx, r->request->out, path);
}

/* Before anything is simulated: whether the output may be written where it should be. */
static int open_output(render *r)
{
    const render_request *q = r->request;
    const char *const images[] = {q->texture, q->height, q->environment};
    const bool folder = !r->film && !r->picture;
    drape_status status = folder ? drape_folder_open(r->ctx, r->request->out, false, &r->folder) : DRAPE_OK;
    for (size_t i = 0; i < sizeof images / sizeof *images && !status; i++)
        status = images[i] ? check_input(r, images[i], "") : DRAPE_OK;
    for (int i = 0; i < r->source_count && !status; i++) {
        const char *path = q->command.operands[i];
        status = check_input(r, path, "");
        if (!status)
            status = drape_scene_files(r->ctx, r->sources[i].in.model, path, check_input, r);
    }
    if (!status && folder)
        status = drape_folder_check(r->folder, is_picture, is_picture, NULL);
    return status ? cli_report(&r->request->command, status == DRAPE_E_ARGUMENT ? CLI_BAD_INPUT : CLI_FAILED)
                  : CLI_GO_ON;
}

/* Begins the output, draws and ends it. Pictures of an earlier call are removed from a folder, so that those
 * of two runs do not mix. */
static drape_status make_frames(render *r)
{
    char message[DRAPE_MESSAGE_SIZE];
    const double slow = r->request->slow ? r->request->slow : 1;
    const double rate = drape_model_frame_rate(r->sources[0].in.model) / r->frames.every / slow;
    drape_status status = DRAPE_OK;
    if (r->film)
        status = drape_film_begin(r->ctx, r->request->out, r->width, r->height, rate, &r->making);
    else if (r->folder)
        status = drape_folder_begin(r->folder, is_picture, NULL);
    if (!status)
        status = draw_frames(r);
    if (!r->making)
        return status;
    if (!status && !cli_interrupted())
        return drape_film_end(&r->making);
    snprintf(message, sizeof message, "%s", drape_context_message(r->ctx));
    drape_film_abandon(&r->making);
    return status ? drape_fail(r->ctx, status, "%s", message) : DRAPE_OK;
}

/* The range of a field is that of all values of all runs, extended to 0, unless one was given. */
static int make(render *r)
{
    const size_t count = r->sources[0].reel.count;
    double low = 0, high = 0;
    bool incomplete = false;
    for (int i = 0; i < r->source_count; i++) {
        low = fmin(low, r->sources[i].reel.low);
        high = fmax(high, r->sources[i].reel.high);
        incomplete |= r->sources[i].incomplete;
    }
    if (r->shading->field && isnan(r->low)) {
        r->low = low;
        r->high = high - low > MIN_RANGE ? high : low + MIN_RANGE;
    }
    if (make_frames(r))
        return cli_report(&r->request->command, CLI_FAILED);
    if (cli_interrupted() && !r->picture) /* a picture is complete */
        return cli_report_interrupted("render");
    if (!r->drawing)
        printf("%s: %zu frame%s, %d x %d, %s\n", CLI_SHOWN(r->request->out), count, count == 1 ? "" : "s",
               r->width, r->height, r->shading->entry.name);
    return incomplete ? CLI_FAILED : CLI_DONE;
}

static int render_request_of(const render_request *request, const cli_drawing *drawing)
{
    static int (*const stages[])(render *) = {read_request, open_sources, open_painter,
                                              open_output,  fill_sources, set_stages};
    render r = {.request = request, .drawing = drawing, .ctx = request->command.ctx};
    int code = CLI_GO_ON;
    for (size_t i = 0; i < sizeof stages / sizeof *stages && code == CLI_GO_ON; i++)
        code = stages[i](&r);
    if (code == CLI_GO_ON && cli_interrupted())
        code = cli_report_interrupted("render");
    if (code == CLI_GO_ON)
        code = make(&r);
    for (int i = 0; i < r.source_count; i++) {
        if (r.stages)
            drape_stage_free(&r.stages[i]);
        drape_reel_free(&r.sources[i].reel);
        drape_record_close(&r.sources[i].run);
        cli_scene_free(&r.sources[i].in);
    }
    drape_folder_close(&r.folder);
    drape_painter_destroy(&r.painter);
    drape_offscreen_destroy(&r.offscreen);
    return code;
}

static int run(const void *command)
{
    return render_request_of(command, NULL);
}

int cli_draw_distances(const cli_command *command, const cli_drawing *drawing)
{
    char frame[24], *operands[] = {drawing->folder};
    snprintf(frame, sizeof frame, "%" PRId64, drawing->frame);
    render_request request = {.command = *command, .out = drawing->out, .frame = frame};
    request.command.operand = drawing->folder;
    request.command.operands = operands;
    request.command.operand_count = 1;
    return render_request_of(&request, drawing);
}

#define AT(member) offsetof(render_request, member)
static const cli_option options[] = {
    {"out", CLI_TEXT, "FILE|DIR",
     "x.png: one frame; x.mp4, x.webm, x.gif, x.apng: a film, by ffmpeg; no ending: a folder of frames",
     AT(out)},
    {"frame", CLI_TEXT, "N", "the frame of a picture, from 0 (default: the last)", AT(frame)},
    {"every", CLI_NUMBER, "N", "every Nth frame in a film or folder", AT(every), 1000000},
    {"shade", CLI_TEXT, "NAME", "how cloth is coloured (default linen); `drape list shadings` shows all",
     AT(shade)},
    {"size", CLI_TEXT, "WxH", "pixels (default 1280x720)", AT(size)},
    {"camera", CLI_TEXT, "A,E[,Z]",
     "azimuth and elevation in degrees, zoom (default 32,24,1, which shows all)", AT(camera)},
    {"range", CLI_TEXT, "LOW,HIGH",
     "range of a field's colours, in the legend's unit (default: that of its values)", AT(range)},
    {"slow", CLI_NUMBER, "N", "make a film that runs N times slower than the scene", AT(slow), MAX_SLOW},
    {"turntable", CLI_FLAG, NULL, "turn the camera once around during a film", AT(turntable)},
    {"fine", CLI_NUMBER, "N",
     "draw N x N pixels for each and average them (default 2 for a picture, 1 for films and folders)",
     AT(fine), MAX_FINE},
    {"compare", CLI_FLAG, NULL, "draw several scenes or runs side by side, at equal times", AT(compare)},
    {"texture", CLI_TEXT, "PNG", "picture on the cloth", AT(texture)},
    {"height", CLI_TEXT, "PNG",
     "height map for bump, displacement and pbr: red is the height, alpha the metal of pbr", AT(height)},
    {"environment", CLI_TEXT, "PNG", "surroundings for mirror, refraction and pbr, longitude by latitude",
     AT(environment)},
    {"small", CLI_FLAG, NULL, "smaller PNG files, slower", AT(small)},
};

const drape_verb drape_verb_render = {
    .entry = {.name = "render", .summary = "draw pictures and films of a scene or a finished run"},
    .operand = "SCENE|RUN",
    .max_operands = DRAPE_MAX_PANELS,
    .takes_scene = true,
    .details =
        "Draws a scene, which it simulates, or a run, which `drape run --out` wrote. No display is needed.\n"
        "With --compare, several are drawn side by side in one picture or film.",
    CLI_OPTIONS(options, render_request),
    .run = run,
};
