/* frames.c: see frames.h. */
#include "cli/frames.h"

#include "cli/progress.h"
#include "render/shading.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define DEFAULT_SHADE "linen"

/* ---- Opening ---- */

int cli_find_shading(const cli_command *command, const char *name, int *index)
{
    char text[DRAPE_UNKNOWN_SIZE];
    *index = drape_registry_find(&drape_shading_registry, NULL, name ? name : DEFAULT_SHADE);
    if (*index >= 0)
        return CLI_GO_ON;
    drape_registry_unknown(&drape_shading_registry, NULL, name, text);
    return cli_misuse(command->verb, "--shade: %s", text);
}

/* The label: "runs/be/" -> "be", "a/sphere_drape.json" -> "sphere_drape" */
int cli_source_open(const cli_command *command, const char *operand, const cli_frames_def *def,
                    cli_source *out)
{
    const char *end = operand + strlen(operand), *begin;
    *out = (cli_source){.command = command, .operand = operand};
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

void cli_source_free(cli_source *source)
{
    drape_reel_free(&source->reel);
    drape_record_close(&source->run);
    cli_scene_free(&source->in);
}

/* ---- From a run ---- */

/* Adds a frame to the reel. A field is that of the sim, set to the frame; it may need velocities: they are
 * differences of the frames before and after it. scratch: (9 nodes) */
static drape_status read_frame(const cli_frames_def *def, cli_source *s, int64_t frame, double *scratch)
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

static int read_frames(const cli_frames_def *def, cli_source *s)
{
    double *scratch = drape_alloc(s->in.ctx, 9 * (size_t)s->run.nodes, sizeof *scratch);
    drape_status status = scratch ? DRAPE_OK : DRAPE_E_MEMORY;
    const bool all = def->one == CLI_ALL_FRAMES;
    const int64_t end = s->run.frames - 1, first = all ? 0 : def->one == CLI_LAST_FRAME ? end : def->one;
    for (int64_t i = first; i <= (all ? end : first) && !status && !cli_interrupted(); i += def->every)
        status = read_frame(def, s, i, scratch);
    drape_free(s->in.ctx, scratch);
    if (cli_interrupted())
        return cli_report_interrupted(s->command->verb);
    return status ? cli_report(s->command, CLI_FAILED) : CLI_GO_ON;
}

/* ---- From a simulation ---- */

typedef struct watch {
    const cli_frames_def *def;
    cli_source *source;
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
    if (w->def->one == CLI_LAST_FRAME || (w->def->one >= 0 && event->frame != w->def->one) ||
        event->frame % w->def->every != 0)
        return DRAPE_OK;
    drape_status status = keep(w, event->time, event->positions);
    w->found = w->def->one >= 0;
    return status ? status : w->found ? DRAPE_E_STOPPED : DRAPE_OK;
}

static int simulate(const cli_frames_def *def, cli_source *s)
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
    if ((def->one == CLI_LAST_FRAME || (def->one == CLI_ALL_FRAMES && (s->reel.count == 0 || t > w.last))) &&
        keep(&w, t, drape_sim_positions(s->in.sim)))
        return cli_report(s->command, CLI_FAILED);
    if (s->reel.count > 0)
        return CLI_GO_ON;
    return cli_misuse(s->command->verb, "--frame %d: %s has fewer frames", def->one, s->operand);
}

int cli_source_fill(const cli_frames_def *def, cli_source *source)
{
    return source->run.frames > 0 ? read_frames(def, source) : simulate(def, source);
}
