/* recorder.c: see recorder.h. */
#include "io/recorder.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "io/csv.h"
#include "io/export.h"
#include "io/scene_copy.h"
#include "io/summary.h"
#include "sim/sim.h"

/* Times closer than this are the same up to rounding: k / frame_rate and a sum of steps, which
 * are longer. */
#define SAME_TIME 1e-12

#define MAX_FRAMES INT64_C(1000000000000000)

typedef struct output {
    const drape_exporter_ops *ops;
    void *state;
} output;

struct drape_recorder {
    drape_context *ctx;
    drape_arena arena;
    drape_sim *sim;
    const drape_model *model; /* whole, with the pins of the start; the sim's own is freed when pins change */
    const drape_ranks *ranks; /* that share the model; NULL: none. Rank 0 writes all files */
    double *gathered; /* (node_count x 3, three times if fields are wanted, else once) of the whole model,
                                 on rank 0; NULL if all formats are written by the ranks together */
    drape_folder *folder;
    const char *const *also; /* of the def, until the recorder is made */
    size_t also_count;
    drape_export_def def; /* for the formats */
    output *outputs;
    size_t output_count;
    drape_frames frames;
    drape_file steps, energies, whole; /* whole: for the formats */
    drape_file checkpoint;             /* the file of the checkpoints; without a path none are written */
    drape_file *growing;               /* list of the tables and the files of the formats that grow */
    int64_t every; /* frames between checkpoints; 0: only drape_recorder_checkpoint writes them */
    double start;  /* [s] clock when the run began */
    drape_recorder_progress progress;
    double last_time;     /* [s] of the last frame */
    bool moved;           /* a step was accepted after the last frame */
    bool gathers;         /* ranks share the model, and a format is written by rank 0 */
    bool counted;         /* the caller gave the number of frames */
    bool live;            /* the files can be written */
    drape_status failure; /* the first one; DRAPE_OK: none */
    char message[DRAPE_MESSAGE_SIZE];
};

/* ---- Time and failures ---- */

/* Output takes place in the C locale, and its time is measured. */
typedef struct scope {
    locale_t locale;
    double start;
} scope;

static scope scope_enter(void)
{
    return (scope){.start = drape_clock_seconds(), .locale = drape_locale_enter()};
}

/* After the run has finished, time is no longer counted. */
static void scope_leave(drape_recorder *r, scope s)
{
    drape_locale_leave(s.locale);
    r->progress.seconds += r->progress.finished ? 0 : drape_clock_seconds() - s.start;
}

/* Keeps the first failure, which is also returned later. */
static void note(drape_recorder *r, drape_status status)
{
    if (!status || r->failure)
        return;
    r->failure = status;
    snprintf(r->message, sizeof r->message, "%s", drape_context_message(r->ctx));
}

/* Where ranks share the model, all stop when one cannot write; collective. */
static drape_status report(drape_recorder *r)
{
    drape_status status = r->failure ? drape_fail(r->ctx, r->failure, "%s", r->message) : DRAPE_OK;
    status = drape_ranks_agree(r->ranks, r->ctx, status);
    note(r, status);
    return status;
}

/* ---- Frames ---- */

/* Whether the ranks write the frames of a format together. */
static bool is_shared(const drape_recorder *r, const output *o)
{
    return r->ranks && o->ops->shared && !r->model->surface.bound;
}

/* What this rank has of an array of nodes. */
static drape_rows rows_of(const drape_model *m, const double *values, int width)
{
    return (drape_rows){values, width, m->node_count, m->part->all_nodes, m->part->own, m->part->node};
}

/* Where ranks share the model, gathers an array of nodes: *values, here that of this rank, becomes that of
 * the whole model on rank 0. It stays as it is if no format needs it there. */
static void gather(drape_recorder *r, int array, int width, const double **values)
{
    double *all = r->gathered ? r->gathered + 3 * (size_t)array * (size_t)r->model->node_count : NULL;
    if (!r->ranks || !r->gathers)
        return;
    const drape_rows rows = rows_of(r->sim->model, *values, width);
    r->ranks->gather(r->ranks, &rows, all);
    *values = all;
}

/* Writes a frame in all formats and its energies. */
static void write_all(drape_recorder *r, double time, const double *positions, const double *velocities,
                      const drape_energy *energy)
{
    drape_frames *f = &r->frames;
    f->frame.index = r->progress.frames;
    f->frame.time = time;
    f->frame.nodes = positions;
    if (!r->ranks || r->gathers) /* else no format needs the frame of the whole model here */
        drape_frames_make(f, drape_model_whole(r->sim->model), drape_system_motion(r->sim->system),
                          velocities);
    for (size_t i = 0; i < r->output_count && !r->failure; i++) {
        const output *o = &r->outputs[i];
        if (!is_shared(r, o))
            note(r, o->ops->write(&r->def, o->state, o->ops->y_up ? &f->frame : &f->rotated));
    }
    if (!r->failure)
        note(r, drape_energy_write(&r->energies, r->progress.frames, time, drape_sim_time(r->sim), energy,
                                   r->sim));
}

static void write_frame(drape_recorder *r, double time, const double *positions, const double *velocities)
{
    const drape_energy energy = drape_sim_energy(r->sim);
    for (size_t i = 0; i < r->output_count; i++) {
        const output *o = &r->outputs[i];
        char path[DRAPE_RANKS_PATH];
        uint64_t sum = 0;
        if (!is_shared(r, o)) /* each rank writes its own nodes behind what the file of rank 0 has */
            continue;
        const drape_rows rows = rows_of(r->sim->model, positions, 3);
        drape_file *file = r->progress.writes && !r->failure ? o->ops->shared(o->state) : NULL;
        const bool reached = file && drape_file_reach(file, path, sizeof path);
        int error = r->ranks->open(r->ranks, reached ? path : NULL);
        if (!error) {
            const int writing = r->ranks->write(r->ranks, file ? (int64_t)file->kept : 0, true, &rows, &sum),
                      closing = r->ranks->close(r->ranks, r->def.durable);
            error = writing ? writing : closing;
        }
        if (file)
            note(r, o->ops->settle(o->state, error, sum));
        else if (error) /* rank 0 has the message */
            note(r, drape_fail(r->ctx, DRAPE_E_FILE, "another rank cannot write"));
    }
    gather(r, 0, 3, &positions);
    double *field = r->frames.node_density;
    if (field) {
        const double *density = field;
        gather(r, 1, 3, &velocities);
        drape_sim_energy_density(r->sim, field);
        gather(r, 2, 1, &density);
        if (r->ranks && r->progress.writes)
            memcpy(field, density, (size_t)r->model->node_count * sizeof *density);
    }
    if (r->progress.writes)
        write_all(r, time, positions, velocities, &energy);
    if (r->failure)
        return;
    r->progress.frames++;
    r->last_time = time;
    r->moved = false;
}

/* ---- Checkpoints ---- */

/* The names of the formats are in their order, which is that of the scene's list. */
static void archive_progress(drape_recorder *r, drape_archive *a)
{
    const double duration = r->sim->model->duration;
    double there = duration;
    drape_archive_mark(a, "recorder");
    drape_archive_same(a, "the number of formats", (int64_t)r->output_count);
    for (size_t i = 0; i < r->output_count && drape_archive_good(a); i++) {
        char name[32];
        snprintf(name, sizeof name, "%s", r->outputs[i].ops->entry.name);
        drape_archive_text(a, name, sizeof name);
        if (drape_archive_good(a) && strcmp(name, r->outputs[i].ops->entry.name) != 0)
            drape_archive_fail(a, DRAPE_E_ARGUMENT,
                               "the checkpoint has frames in \"%s\"; here they are in \"%s\"", name,
                               r->outputs[i].ops->entry.name);
    }
    drape_archive_double(a, &there);
    if (drape_archive_good(a) && there != duration)
        drape_archive_fail(a, DRAPE_E_ARGUMENT, "the checkpoint is of a run of %.9g s; this one has %.9g s",
                           there, duration);
    drape_archive_same(a, "whether frames have z up", r->sim->model->z_up);
    drape_archive_same(a, "the number of vertices in frames", r->model->surface.node_count);
    drape_archive_bool(a, &r->progress.finished);
    drape_archive_int64(a, &r->progress.frames);
    drape_archive_double(a, &r->last_time);
    drape_archive_bool(a, &r->moved);
    drape_archive_double(a, &r->progress.seconds);
    drape_archive_double(a, &r->progress.wall);
}

static void archive_files(drape_recorder *r, drape_archive *a)
{
    for (size_t i = 0; i < r->output_count && !a->status; i++)
        if (r->outputs[i].ops->archive)
            r->outputs[i].ops->archive(r->outputs[i].state, a);
    for (drape_file *file = r->growing; file; file = file->next)
        drape_file_archive(file, a);
}

/* All frames that a checkpoint counts must be on the disk before the checkpoint is. */
static drape_status write_checkpoint(drape_recorder *r)
{
    drape_checkpoint c;
    drape_status status = DRAPE_OK;
    for (drape_file *file = r->growing; file && !status; file = file->next)
        status = drape_file_sync(file);
    if (r->progress.writes && !status)
        status = drape_folder_sync(r->folder);
    if (drape_ranks_any(r->ranks, status != DRAPE_OK))
        return status;
    r->progress.wall = drape_clock_seconds() - r->start;
    drape_checkpoint_begin(&c, r->ctx, r->ranks, r->progress.writes ? &r->checkpoint : NULL);
    drape_sim_archive_identity(r->sim, &c.archive);
    drape_sim_archive(r->sim, &c.archive);
    archive_progress(r, &c.archive);
    if (!r->progress.finished && r->progress.writes)
        archive_files(r, &c.archive);
    return drape_checkpoint_end(&c);
}

drape_status drape_recorder_checkpoint(drape_recorder *r)
{
    if (r->failure)
        return report(r);
    if (r->progress.writes && !r->checkpoint.path)
        return drape_fail(r->ctx, DRAPE_E_ARGUMENT, "the recorder was made without checkpoints");
    locale_t old = drape_locale_enter();
    note(r, write_checkpoint(r));
    drape_locale_leave(old);
    return report(r);
}

/* ---- Events of the sim ---- */

static drape_status observe(void *user, const drape_event *event)
{
    drape_recorder *r = user;
    if (r->progress.finished)
        return DRAPE_OK;
    if (r->failure)
        return report(r);
    scope s = scope_enter(); /* the summary has the events of the kind DRAPE_EVENT_ROOT */
    if (event->kind == DRAPE_EVENT_ATTEMPT) {
        const drape_energy energy = drape_sim_energy(r->sim);
        r->moved = r->moved || event->attempt->accepted;
        if (r->progress.writes)
            note(r, drape_steps_write(&r->steps, event->attempt, &energy, &r->sim->events));
    } else if (event->kind == DRAPE_EVENT_FRAME) {
        write_frame(r, event->time, event->positions, event->velocities);
        /* a rank that could not write the frame has not counted it */
        if (r->every > 0 && !report(r) && r->progress.frames % r->every == 0)
            note(r, write_checkpoint(r));
    }
    scope_leave(r, s);
    return report(r);
}

/* ---- Formats ---- */

/* Of most_frames, one is at t = 0, one at each multiple of 1 / frame_rate, one at the end. */
static drape_export_def def_of(const drape_sim *sim)
{
    const double counted = drape_model_duration(sim->model) * sim->frame_rate;
    return (drape_export_def){.model = drape_model_whole(drape_sim_base_model(sim)),
                              .frame_rate = sim->frame_rate,
                              .most_frames = counted < MAX_FRAMES ? (int64_t)counted + 3 : MAX_FRAMES};
}

drape_status drape_recorder_check(drape_context *ctx, const drape_sim *sim, const char *pointer,
                                  const char *format)
{
    const drape_export_def def = def_of(sim);
    int i;
    drape_status status = drape_registry_choose(ctx, &drape_exporter_registry, pointer, format, &i);
    return status || !drape_exporters[i]->check ? status : drape_exporters[i]->check(ctx, pointer, &def);
}

static drape_status choose_outputs(drape_recorder *r, const drape_recorder_def *def)
{
    r->outputs = drape_arena_take(&r->arena, def->format_count, sizeof *r->outputs);
    if (!r->outputs)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < def->format_count; i++) {
        drape_status status = drape_recorder_check(r->ctx, r->sim, "", def->formats[i]);
        if (status)
            return status;
        const drape_exporter_ops *ops =
            drape_exporters[drape_registry_find(&drape_exporter_registry, NULL, def->formats[i])];
        bool chosen = false;
        for (size_t k = 0; k < r->output_count; k++)
            chosen = chosen || r->outputs[k].ops == ops;
        void *state = chosen ? NULL : drape_arena_take(&r->arena, 1, ops->state_size);
        if (!chosen && !state)
            return DRAPE_E_MEMORY;
        if (!chosen)
            r->outputs[r->output_count++] = (output){ops, state};
    }
    return DRAPE_OK;
}

static drape_status allocate_frames(drape_recorder *r)
{
    bool rotates = false, bodies = false, fields = false, gathers = false;
    for (size_t i = 0; i < r->output_count; i++) {
        const drape_exporter_ops *ops = r->outputs[i].ops;
        fields = fields || ops->wants_fields;
        bodies = bodies || ops->wants_bodies;
        rotates = rotates || (r->model->z_up && !ops->y_up);
        gathers = gathers || (r->ranks && !is_shared(r, &r->outputs[i]));
    }
    r->gathers = gathers;
    if (gathers && r->progress.writes)
        r->gathered =
            drape_arena_take(&r->arena, (size_t)r->model->node_count, (fields ? 9 : 3) * sizeof(double));
    return drape_frames_create(&r->arena, r->model, drape_system_motion(r->sim->system), fields, bodies,
                               rotates, &r->frames);
}

/* ---- Files ---- */

/* A table, the checkpoint, or a file that the caller writes. */
static bool is_own_name(const drape_recorder *r, const char *name)
{
    for (size_t i = 0; i < r->also_count; i++)
        if (drape_folder_matches(r->also[i], name, NULL))
            return true;
    return strcmp(name, DRAPE_STEPS_NAME) == 0 || strcmp(name, DRAPE_ENERGY_NAME) == 0 ||
           strcmp(name, DRAPE_CHECKPOINT_NAME) == 0;
}

/* A file of the frames that this run writes. */
static bool shows_frames(const drape_recorder *r, const char *name)
{
    for (size_t i = 0; i < r->output_count; i++)
        if (drape_export_names(r->outputs[i].ops, name))
            return true;
    return false;
}

/* What this run writes. */
static bool writes(const void *user, const char *name)
{
    return shows_frames(user, name) || is_own_name(user, name);
}

/* What an earlier run may have written, in any format: frames of two runs must not be mixed. */
static bool clears(const void *user, const char *name)
{
    for (int i = 0; drape_exporters[i]; i++)
        if (drape_export_names(drape_exporters[i], name))
            return true;
    return is_own_name(user, name);
}

/* A file of a frame that follows those of the checkpoint. */
static bool is_late(const void *user, const char *name)
{
    const drape_recorder *r = user;
    for (size_t i = 0; i < r->output_count; i++)
        if (drape_export_frame_of(r->outputs[i].ops, name) >= r->progress.frames)
            return true;
    return false;
}

/* What must be there when a run is resumed: after its end all but the summary, which is written again. */
static bool is_needed(const void *user, const char *name)
{
    const drape_recorder *r = user;
    if (r->progress.finished)
        return strcmp(name, DRAPE_SUMMARY_NAME) != 0;
    return r->progress.frames > 0 && shows_frames(r, name) && !is_late(r, name);
}

static drape_status protect(void *user, const char *path, const char *pointer)
{
    (void)pointer;
    return drape_folder_protect(user, path);
}

/* Opens the folder and protects the inputs; nothing is created but the folder. */
static drape_status open_folder(drape_recorder *r, const drape_recorder_def *def)
{
    r->also = def->also;
    r->also_count = def->also_count;
    drape_status status = drape_folder_open(r->ctx, def->folder, false, &r->folder);
    if (!status && def->scene)
        status = drape_folder_protect(r->folder, def->scene);
    if (!status)
        status = drape_scene_files(r->ctx, r->model, def->scene ? def->scene : "", protect, r->folder);
    if (!status)
        status = drape_file_create_in(r->ctx, r->folder, &r->whole);
    if (!status && def->checkpoints)
        status = drape_file_create_in(r->ctx, r->folder, &r->checkpoint);
    if (status)
        return status;
    if (def->checkpoints)
        drape_file_name(&r->checkpoint, DRAPE_CHECKPOINT_NAME);
    r->whole.durable = def->checkpoints;
    r->def = def_of(r->sim);
    r->def.ctx = r->ctx;
    if (r->counted)
        r->def.most_frames = def->frames;
    r->def.arena = &r->arena;
    r->def.folder = r->folder;
    r->def.durable = def->checkpoints;
    r->def.resumes = def->archive != NULL;
    r->def.whole = &r->whole;
    r->def.growing = &r->growing;
    r->def.bodies = r->frames.bodies;
    r->def.body_count = r->frames.body_count;
    return DRAPE_OK;
}

static drape_status open_table(drape_recorder *r, const char *name, const char *columns, drape_file *file)
{
    drape_status status = drape_export_open(&r->def, name, file);
    if (status || r->def.resumes)
        return status;
    drape_file_put_text(file, columns);
    for (int i = 0; file == &r->energies && (name = drape_sim_work(r->sim, i, NULL)); i++)
        drape_csv_put_text(file, name);
    drape_file_put_text(file, file == &r->energies ? "\n" : "");
    return drape_file_publish(file);
}

/* All files that grow. */
static drape_status open_files(drape_recorder *r)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; i < r->output_count && !status; i++)
        if (r->outputs[i].ops->open)
            status = r->outputs[i].ops->open(&r->def, r->outputs[i].state);
    if (!status)
        status = open_table(r, DRAPE_STEPS_NAME, drape_steps_columns, &r->steps);
    return status ? status : open_table(r, DRAPE_ENERGY_NAME, drape_energy_columns, &r->energies);
}

/* Nothing is changed if the run is refused. A checkpoint of an earlier run is removed first, because it
 * counts frames that are removed next. */
static drape_status begin_files(drape_recorder *r)
{
    drape_status status = drape_folder_check(r->folder, writes, clears, r);
    if (!status)
        status = drape_folder_remove(r->folder, drape_folder_is_named, DRAPE_CHECKPOINT_NAME);
    if (!status)
        status = drape_folder_begin(r->folder, clears, r);
    return status ? status : open_files(r);
}

/* A frame that the checkpoint counts must be in the manifest, which may be lost or torn itself. */
static drape_status find_frames(const drape_recorder *r)
{
    for (size_t i = 0; i < r->output_count; i++) {
        const char *pattern = r->outputs[i].ops->names[0];
        for (int64_t k = 0; strstr(pattern, DRAPE_FRAME_DIGITS) && k < r->progress.frames; k++) {
            char name[DRAPE_FRAME_NAME];
            drape_export_frame_name(pattern, k, name, sizeof name);
            if (!drape_folder_wrote(r->folder, name))
                return drape_folder_damaged(r->folder, name, "it is not in the manifest");
        }
    }
    return DRAPE_OK;
}

/* Reads from the checkpoint what the files that grow were, compares all files with what the checkpoint and
 * the manifest describe, and only then removes what follows the frames of the checkpoint. Files of formats
 * that are not written now belong to another run and stay as they are. */
static drape_status resume_files(drape_recorder *r, drape_archive *a)
{
    const bool finished = r->progress.finished;
    drape_status status = finished ? DRAPE_OK : open_files(r);
    if (!status && !finished)
        archive_files(r, a);
    if (!status)
        status = drape_archive_end(a);
    if (!status)
        status = drape_folder_verify(r->folder, is_needed, r);
    if (!status)
        status = find_frames(r);
    for (drape_file *file = r->growing; file && !status; file = file->next)
        status = file->kept > 0 ? drape_file_reopen(file) : DRAPE_OK;
    if (!status && !finished)
        status = drape_folder_check(r->folder, is_late, clears, r);
    if (!status)
        status = drape_folder_begin(r->folder, NULL, NULL);
    for (drape_file *file = r->growing; file && !status; file = file->next)
        status = file->kept > 0 ? drape_file_trim(file) : drape_file_begin(file);
    return status || finished ? status : drape_folder_remove(r->folder, is_late, r);
}

static void close_files(drape_recorder *r)
{
    if (!r->live)
        return;
    r->live = false;
    for (size_t i = 0; i < r->output_count; i++)
        if (r->outputs[i].ops->close)
            note(r, r->outputs[i].ops->close(&r->def, r->outputs[i].state));
    for (drape_file *file = r->growing; file; file = file->next)
        note(r, drape_file_close(file));
}

/* ---- Creation ---- */

drape_status drape_recorder_create(drape_context *ctx, drape_sim *sim, const drape_recorder_def *def,
                                   drape_recorder **out)
{
    if (!out)
        return DRAPE_E_ARGUMENT;
    *out = NULL;
    if (!sim || !def || !def->folder || !*def->folder)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "a recorder needs a sim and the name of a folder");
    if (def->format_count && !def->formats)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "a recorder of %zu formats needs their names",
                          def->format_count);
    drape_archive *a = def->archive;
    drape_recorder *r = drape_alloc(ctx, 1, sizeof *r);
    if (drape_ranks_agree_memory(drape_model_ranks(sim->model), ctx, r)) {
        drape_free(ctx, r);
        return DRAPE_E_MEMORY;
    }
    *r = (drape_recorder){.ctx = ctx,
                          .arena = drape_arena_of(ctx),
                          .sim = sim,
                          .model = drape_model_whole(drape_sim_base_model(sim)),
                          .ranks = drape_model_ranks(sim->model),
                          .every = def->checkpoint_every,
                          .start = def->start,
                          .counted = def->frames > 0};
    r->progress.writes = !r->ranks || r->ranks->rank == 0;
    scope s = scope_enter();
    drape_status status = choose_outputs(r, def);
    if (!status)
        status = allocate_frames(r);
    if (!status && r->progress.writes)
        status = open_folder(r, def);
    if (!status && a) {
        archive_progress(r, a);
        status = a->status;
    }
    if (!status && r->progress.writes) {
        status = a ? resume_files(r, a) : begin_files(r);
        r->live = !status && !r->progress.finished;
    }
    status = drape_ranks_agree(r->ranks, ctx, status);
    r->start -= r->progress.wall;
    /* the last stage, because an observer cannot be removed from a sim */
    note(r, status ? status : drape_sim_observe(sim, observe, r));
    scope_leave(r, s);
    status = DRAPE_OK;
    r->also_count = 0;
    if (r->failure) {
        close_files(r); /* before the message of the first failure is set */
        status = report(r);
        drape_recorder_destroy(&r);
    }
    *out = r;
    return status;
}

/* ---- The end ---- */

drape_status drape_recorder_finish(drape_recorder *r)
{
    if (r->progress.finished)
        return report(r);
    scope s = scope_enter();
    const double t = drape_sim_time(r->sim);
    const bool shown = r->progress.frames > 0 && !r->moved && fabs(t - r->last_time) <= SAME_TIME * fabs(t);
    if (!r->failure && !r->counted && !shown)
        write_frame(r, t, drape_sim_positions(r->sim), drape_sim_velocities(r->sim));
    close_files(r);
    scope_leave(r, s);
    r->progress.finished = true;
    return report(r);
}

void drape_recorder_destroy(drape_recorder **recorder)
{
    if (!recorder || !*recorder)
        return;
    drape_recorder *r = *recorder;
    close_files(r);
    for (drape_file *file = r->growing, *next; file; file = next) {
        next = file->next;
        drape_file_destroy(file);
    }
    drape_file_destroy(&r->whole);
    drape_file_destroy(&r->checkpoint);
    drape_folder_close(&r->folder);
    drape_arena_free(&r->arena);
    drape_free(r->ctx, r);
    *recorder = NULL;
}

drape_folder *drape_recorder_folder(const drape_recorder *recorder)
{
    return recorder->folder;
}

drape_recorder_progress drape_recorder_done(const drape_recorder *recorder)
{
    return recorder ? recorder->progress : (drape_recorder_progress){.frames = 0};
}
