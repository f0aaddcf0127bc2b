/* frames.c: see frames.h. */
#include "cli/frames.h"

#include "cli/progress.h"
#include "cli/signals.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* ---- Opening ---- */

bool cli_is_folder(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

static int report(const cli_source *s, int code)
{
    fprintf(stderr, "%s\n", drape_context_message(s->in.ctx));
    return code;
}

/* "runs/be/" -> "be", "a/sphere_drape.json" -> "sphere_drape" */
static void make_label(const char *operand, char *label, size_t size)
{
    const char *end = operand + strlen(operand), *begin;
    while (end > operand && end[-1] == '/')
        end--;
    for (begin = end; begin > operand && begin[-1] != '/'; begin--)
        ;
    if (end - begin > 5 && strncmp(end - 5, ".json", 5) == 0)
        end -= 5;
    snprintf(label, size, "%.*s", (int)(end - begin), begin);
}

static int open_run(const cli_command *command, cli_source *s)
{
    char *path = NULL;
    if (command->setting_count > 0)
        return cli_misuse(command->verb,
                          "--%s is of a simulation, and %s is a finished run; give its scene, which is "
                          "simulated again: %s/scene.json",
                          command->settings[0].option, s->operand, s->operand);
    drape_context *ctx = NULL;
    if (cli_context_create(&ctx))
        return cli_misuse(command->verb, "out of memory");
    int code = drape_record_scene(ctx, s->operand, &path) == DRAPE_OK
                   ? cli_scene_load_from(command, path, &s->in)
                   : cli_misuse(command->verb, "%s", drape_context_message(ctx));
    drape_free(ctx, path);
    drape_context_destroy(&ctx);
    if (code == CLI_GO_ON && drape_record_open(s->in.ctx, s->operand, s->in.model->node_count, &s->run))
        code = report(s, CLI_BAD_INPUT);
    return code;
}

static int check_def(const cli_command *command, const cli_frames_def *def, const cli_source *s)
{
    if (def->one >= 0 && s->run.frames > 0 && def->one >= s->run.frames)
        return cli_misuse(command->verb, "--frame %d: %s has the frames 0 to %" PRId64, def->one, s->operand,
                          s->run.frames - 1);
    if (def->field && def->field->of_steps && s->run.frames > 0)
        return cli_misuse(command->verb,
                          "--shade %s: a run's frames do not have it; give the scene, which is "
                          "simulated again: %s/scene.json",
                          def->field->entry.name, s->operand);
    return CLI_GO_ON;
}

int cli_source_open(const cli_command *command, const char *operand, const cli_frames_def *def,
                    cli_source *out)
{
    *out = (cli_source){.operand = operand};
    make_label(operand, out->label, sizeof out->label);
    int code =
        cli_is_folder(operand) ? open_run(command, out) : cli_scene_load_from(command, operand, &out->in);
    if (code == CLI_GO_ON)
        code = check_def(command, def, out);
    if (code == CLI_GO_ON &&
        drape_reel_create(out->in.ctx, (size_t)out->in.model->node_count, def->field, &out->reel))
        code = report(out, CLI_BAD_INPUT);
    return code;
}

void cli_source_free(cli_source *source)
{
    drape_reel_free(&source->reel);
    drape_record_close(&source->run);
    cli_scene_free(&source->in);
}

/* ---- From a run ---- */

/* Velocities between the frames beside this one, for fields that want them. */
static drape_status put_state(cli_source *s, int64_t frame, double *x, double *v, double *beside)
{
    drape_record *run = &s->run;
    int64_t before = frame > 0 ? frame - 1 : frame, after = frame + 1 < run->frames ? frame + 1 : frame;
    double span = run->times[after] - run->times[before];
    drape_status status = drape_record_read(run, after, v);
    if (!status)
        status = drape_record_read(run, before, beside);
    if (!status)
        status = drape_record_read(run, frame, x);
    for (size_t i = 0; i < 3 * (size_t)run->nodes; i++)
        v[i] = span > 0 ? (v[i] - beside[i]) / span : 0;
    return status ? status : drape_sim_set_state(s->in.sim, run->times[frame], x, v);
}

static drape_status read_frame(const cli_frames_def *def, cli_source *s, int64_t frame, double *room)
{
    size_t n = 3 * (size_t)s->run.nodes;
    drape_status status = def->field ? put_state(s, frame, room, room + n, room + 2 * n)
                                     : drape_record_read(&s->run, frame, room);
    return status ? status : drape_reel_add(&s->reel, s->run.times[frame], room, s->in.sim, def->field);
}

static int read_frames(const cli_frames_def *def, cli_source *s)
{
    double *room = drape_alloc(s->in.ctx, 9 * (size_t)s->run.nodes, sizeof *room);
    drape_status status = room ? DRAPE_OK : DRAPE_E_MEMORY;
    int64_t last = s->run.frames - 1, only = def->one == CLI_LAST_FRAME ? last : def->one;
    if (!status && def->one != -1)
        status = read_frame(def, s, only, room);
    for (int64_t i = 0; def->one == -1 && i <= last && !status && !cli_interrupted(); i += def->every)
        status = read_frame(def, s, i, room);
    drape_free(s->in.ctx, room);
    if (cli_interrupted())
        return cli_tell_interrupted("render");
    return status ? report(s, CLI_FAILED) : CLI_GO_ON;
}

/* ---- From a simulation ---- */

typedef struct watch {
    const cli_frames_def *def;
    cli_source *source;
    cli_progress progress;
    double last; /* [s] of the last frame, kept or not */
    bool enough; /* the one frame is there */
} watch;

static drape_status keep(watch *w, double t, const double *x)
{
    return drape_reel_add(&w->source->reel, t, x, w->source->in.sim, w->def->field);
}

static drape_status observe(void *user, const drape_event *event)
{
    watch *w = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT) {
        if (w->progress.on)
            cli_progress_show(&w->progress, drape_sim_time(event->sim),
                              drape_sim_statistics(event->sim).steps_rejected);
        if (!cli_interrupted())
            return DRAPE_OK;
        drape_context_set_message(w->source->in.ctx, "t=%.9g: interrupted", drape_sim_time(event->sim));
        return DRAPE_E_STOPPED;
    }
    w->last = event->time;
    if (w->def->one == CLI_LAST_FRAME || (w->def->one >= 0 && event->frame != w->def->one) ||
        event->frame % w->def->every != 0)
        return DRAPE_OK;
    drape_status status = keep(w, event->time, event->positions);
    w->enough = w->def->one >= 0;
    return status ? status : w->enough ? DRAPE_E_STOPPED : DRAPE_OK;
}

/* The state that the simulation ends with, unless the last frame has it. */
static drape_status keep_end(watch *w)
{
    double t = drape_sim_time(w->source->in.sim);
    bool due =
        w->def->one == CLI_LAST_FRAME || (w->def->one == -1 && (w->source->reel.count == 0 || t > w->last));
    return due ? keep(w, t, drape_sim_positions(w->source->in.sim)) : DRAPE_OK;
}

static int simulate(const cli_frames_def *def, cli_source *s)
{
    watch w = {.def = def, .source = s};
    double end = drape_model_duration(s->in.model);
    drape_status status = drape_sim_observe(s->in.sim, observe, &w);
    cli_progress_begin(&w.progress, 0, end);
    if (!status)
        status = drape_sim_advance(s->in.sim, end);
    cli_progress_clear(&w.progress);
    if (w.enough)
        return CLI_GO_ON;
    s->incomplete = status != DRAPE_OK;
    if (cli_interrupted())
        return status == DRAPE_E_STOPPED ? report(s, CLI_INTERRUPTED) : cli_tell_interrupted("render");
    if (status)
        report(s, CLI_FAILED);
    if (status == DRAPE_E_ARGUMENT || status == DRAPE_E_MEMORY)
        return CLI_FAILED;
    if (keep_end(&w))
        return report(s, CLI_FAILED);
    if (s->reel.count > 0)
        return CLI_GO_ON;
    fprintf(stderr, "--frame %d: %s has fewer frames\n", def->one, s->operand);
    return CLI_BAD_INPUT;
}

int cli_source_fill(const cli_frames_def *def, cli_source *source)
{
    return source->run.frames > 0 ? read_frames(def, source) : simulate(def, source);
}
