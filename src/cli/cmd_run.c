/* cmd_run.c: `drape run`: simulates a scene and writes frames, step log and summary into a folder. */
#include "cli/cli.h"
#include "cli/cli_ranks.h"

#include "accuracy/accuracy.h"
#include "base/clock.h"
#include "base/hash.h"
#include "io/file.h"
#include "io/record.h"
#include "io/recorder.h"
#include "io/scene_copy.h"
#include "io/summary.h"
#include "model/scene.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MAX_WARNINGS 16
#define METHOD       "newton_k"
#define TRIALS       4    /* steps, of which the first sets up and the fastest other one counts */
#define SHARE        0.5  /* of a frame that the iterations are to take: the rest is for contact to come */
#define NODES_THREAD 2500 /* for each thread: with fewer it spends its time waiting */

typedef struct realtime {
    const cli_command *command;
    drape_setting iterations; /* that were chosen */
    bool iterations_given;    /* by the scene or the command line */
    char chosen[400]; /* threads, method and iterations: what was chosen, and why, and what was given */
    double *seconds;  /* (count) wall clock of each frame, in the command's arena */
    size_t count, capacity;
    drape_summary_realtime result;
    bool estimates; /* the integrator estimates its error */
} realtime;

typedef struct run_request {
    cli_command command;
    const char *out, *summary;
    bool realtime, resume;
    int checkpoint_every; /* frames; 0: none */
} run_request;

typedef struct run {
    const run_request *request;
    cli_scene in;
    drape_recorder *recorder; /* NULL without --out */
    char *checkpoint;         /* contents of the checkpoint that the run resumes from; NULL: it starts anew */
    drape_archive archive;    /* reads the contents */
    cli_progress progress;
    realtime realtime;                /* of --realtime */
    bool accurate;                    /* the scene asks for an accuracy */
    drape_accuracy accuracy;          /* which was reached */
    double start;                     /* clock at the start minus the run time before the checkpoint [s] */
    double wall;                      /* duration of the run [s] */
    const char *warned[MAX_WARNINGS]; /* names of the warnings that are printed already */
    int warned_count;
    bool uncounted; /* the intersections at the end were not counted */
    drape_status status;
    char message[DRAPE_MESSAGE_SIZE];
} run;

/* Only the first failure is reported. */
static void note(run *r, drape_status status)
{
    if (!status || r->status)
        return;
    r->status = status;
    snprintf(r->message, sizeof r->message, "%s", drape_context_message(r->in.ctx));
}

/* ---- --realtime: frames within a budget of wall clock ---- */

static void say(realtime *r, const char *format, ...) DRAPE_PRINTF(2, 3);
static void say(realtime *r, const char *format, ...)
{
    const size_t used = strlen(r->chosen);
    va_list values;
    va_start(values, format);
    if (used > 0)
        snprintf(r->chosen + used, sizeof r->chosen - used, "; ");
    const size_t at = strlen(r->chosen);
    vsnprintf(r->chosen + at, sizeof r->chosen - at, format, values);
    va_end(values);
}

/* Seconds of the steps of a frame with one iteration each, whatever number the trial steps make; 0 if they
 * are not known, because a step failed. */
static double try_steps(const cli_scene *scene, const drape_sim_def *def)
{
    const double frame = 1 / drape_model_frame_rate(scene->model);
    drape_sim *sim = NULL;
    double best = INFINITY, dt = frame;
    drape_status status = drape_sim_create(scene->ctx, scene->model, def, &sim);
    if (!status)
        dt = drape_chosen_integrator_value(&sim->chosen, "dt", frame);
    for (int i = 0; !status && i < TRIALS && !cli_interrupted(); i++) {
        const double start = drape_clock_seconds();
        const int64_t before = drape_sim_statistics(sim).newton_iterations;
        status = drape_sim_advance(sim, drape_sim_time(sim) + dt);
        const int64_t made = drape_sim_statistics(sim).newton_iterations - before;
        best = i > 0 ? fmin(best, (drape_clock_seconds() - start) / fmax(1, (double)made)) : best;
    }
    drape_sim_destroy(&sim);
    return status || isinf(best) ? 0 : best * fmax(1, ceil(frame / dt - 1e-9));
}

/* One or two iterations are the least number: further ones follow where the estimated error asks for them and
 * there is time. */
static drape_status choose_method(realtime *r, const cli_scene *scene, drape_sim_def *def)
{
    const double budget = 1 / drape_model_frame_rate(scene->model);
    char text[16];
    def->integrator = METHOD;
    say(r, "method %s: chosen, as none is named", METHOD);
    drape_status status = drape_scene_set(scene->scene, "/integrator/method", "\"" METHOD "\"");
    if (status || r->iterations_given)
        return status;
    r->iterations = (drape_setting){.name = "iterations", .number = 1};
    def->integrator_settings = &r->iterations;
    def->integrator_setting_count = 1;
    const double seconds = try_steps(scene, def);
    const int count = seconds > 0 && 2 * seconds <= SHARE * budget ? 2 : 1;
    r->iterations.number = count;
    snprintf(text, sizeof text, "%d", count);
    if (seconds > 0)
        say(r, "iterations %d: chosen, as one takes %.3g ms of a frame of %.4g ms in trial steps%s", count,
            1e3 * seconds, 1e3 * budget, seconds > budget ? "; frames will be late" : "");
    else
        say(r, "iterations %d: chosen, as a trial step failed", count);
    return drape_scene_set(scene->scene, "/integrator/iterations", text);
}

/* A cli_choose for --realtime. Unless the scene or the command line names a method, it chooses newton_k.
 * Unless they are given, it chooses as many iterations as, by a few trial steps, fit into half of a frame,
 * and as many threads as the machine has processors and the mesh has thousands of nodes. The method is set in
 * the scene, too, so that the copy of the scene runs again alike. An option that only some methods have
 * counts as naming the method of the scene. */
static drape_status choose_realtime(void *user, const cli_scene *scene, drape_sim_def *def)
{
    realtime *r = user;
    const long there = sysconf(_SC_NPROCESSORS_ONLN), nodes = drape_model_node_count(scene->model),
               most = 1 + nodes / NODES_THREAD;
    bool named = drape_scene_gives(scene->scene, "/integrator/method");
    for (size_t i = 0; i < r->command->setting_count; i++)
        named = named || r->command->settings[i].must_act;
    r->iterations_given = drape_scene_gives(scene->scene, "/integrator/iterations");
    if (r->command->threads) {
        say(r, "threads %d: given", def->threads);
    } else {
        def->threads = (int)fmax(1, fmin(fmin((double)there, (double)most), 256));
        say(r, "threads %d: chosen, for %ld nodes and %ld processor%s", def->threads, nodes, there,
            there > 1 ? "s" : "");
    }
    if (!named)
        return choose_method(r, scene, def);
    say(r, "method %s: given by the scene or an option", scene->model->integrator.type);
    return DRAPE_OK;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* By the nearest rank; of sorted times. */
static double percentile(const realtime *r, double share)
{
    size_t rank = (size_t)ceil(share * (double)r->count);
    return r->count ? r->seconds[rank > 0 ? rank - 1 : 0] : 0;
}

/* Advances in frames of 1 / frame_rate up to the scene's duration, each with that time as its budget, without
 * sleeping. Late frames are not failures. The status is that of the advance. */
static drape_status run_realtime(realtime *r, const cli_scene *scene)
{
    double end = drape_model_duration(scene->model), frame = 1 / drape_model_frame_rate(scene->model);
    const drape_chosen *chosen = &scene->sim->chosen;
    const double number = drape_chosen_integrator_value(chosen, "iterations", NAN);
    drape_status status = DRAPE_OK;
    drape_summary_realtime *s = &r->result;
    s->budget = frame;
    if (!r->iterations.name && isnan(number)) /* not chosen */
        say(r, "iterations: not a parameter of %s", chosen->integrator->entry.name);
    else if (!r->iterations.name)
        say(r, "iterations %.0f: %s", number, r->iterations_given ? "given" : "the default of the method");
    while (!status && end - drape_sim_time(scene->sim) - s->debt > 1e-9 * frame) {
        drape_realtime report;
        double left = end - drape_sim_time(scene->sim) - s->debt;
        status = drape_sim_advance_realtime(scene->sim, fmin(frame, left), frame, &report);
        const bool full = strcmp(report.level, "full") == 0,
                   fewer = strcmp(report.level, "fewer iterations") == 0;
        s->frames++;
        s->missed += !report.kept;
        s->full += full;
        s->fewer += fewer;
        s->larger += !full && !fewer;
        s->inaccurate += report.error > report.error_bound;
        s->crossings = report.crossings > s->crossings ? report.crossings : s->crossings;
        s->still += !(report.h > 0);
        s->debt = report.debt;
        s->dropped = report.dropped_total;
        r->estimates = !isnan(report.error_bound);
        if (r->count == r->capacity) {
            const size_t capacity = r->capacity ? 2 * r->capacity : 256;
            double *more = drape_arena_resize(r->command->arena, r->seconds, capacity, sizeof *more);
            r->seconds = more ? more : r->seconds;
            r->capacity = more ? capacity : r->capacity;
        }
        if (r->count < r->capacity)
            r->seconds[r->count++] = report.seconds;
        else
            status = status ? status : DRAPE_E_MEMORY;
    }
    if (!status) /* the debt of the last frames, without a deadline */
        status = drape_sim_advance(scene->sim, end);
    if (r->count > 0)
        qsort(r->seconds, r->count, sizeof *r->seconds, compare);
    s->p50 = percentile(r, 0.5);
    s->p95 = percentile(r, 0.95);
    s->p99 = percentile(r, 0.99);
    s->worst = percentile(r, 1);
    return status;
}

static void print_realtime(const realtime *r)
{
    const drape_summary_realtime *s = &r->result;
    printf("chosen    %s\n", r->chosen);
    printf("realtime  %lld frames of %.4g ms: p50 %.4g, p95 %.4g, p99 %.4g, worst %.4g ms; %lld missed\n",
           (long long)s->frames, 1e3 * s->budget, 1e3 * s->p50, 1e3 * s->p95, 1e3 * s->p99, 1e3 * s->worst,
           (long long)s->missed);
    printf("levels    %lld frames with all iterations, %lld with fewer, %lld with longer steps; "
           "%lld frames without a new state; %.4g s of simulated time dropped; %.4g s owed at the last "
           "frame\n",
           (long long)s->full, (long long)s->fewer, (long long)s->larger, (long long)s->still, s->dropped,
           s->debt);
    if (r->estimates)
        printf("accuracy  %lld frames with a step above the bound on its estimated error\n",
               (long long)s->inaccurate);
}

/* ---- Output ---- */

static bool keeps_checkpoints(const run *r)
{
    return r->request->resume || r->request->checkpoint_every > 0;
}

/* The files that a run writes beside those of the recorder. */
static const char *const also[] = {DRAPE_SUMMARY_NAME, DRAPE_SCENE_COPY, DRAPE_SCENE_MESHES};

/* A scene that lies in the folder as scene.json stays as it is, and so do its meshes. */
static drape_recorder_def recorder_def(const run *r)
{
    const char *scene = r->request->command.operand;
    const bool copies = !drape_scene_copy_is(scene, r->request->out);
    return (drape_recorder_def){.folder = r->request->out,
                                .scene = scene,
                                .also = also,
                                .also_count = copies ? sizeof also / sizeof *also : 1,
                                .formats = (const char *const *)r->in.model->formats,
                                .format_count = r->in.model->format_count,
                                .checkpoints = keeps_checkpoints(r),
                                .checkpoint_every = r->request->checkpoint_every,
                                .start = r->start};
}

/* ---- Resuming ---- */

/* Restores the sim and the recorder from the checkpoint in the folder. Without a checkpoint the run starts
 * anew. Nothing is written if this fails. */
static int resume(run *r)
{
    const cli_command *command = &r->request->command;
    const drape_ranks *ranks = drape_model_ranks(r->in.model);
    drape_context *ctx = r->in.ctx;
    bool there;
    size_t size;
    if (!r->request->resume)
        return CLI_GO_ON;
    char *path = drape_disk_path(ctx, r->request->out, DRAPE_CHECKPOINT_NAME);
    drape_status status =
        path ? drape_file_read(ctx, path, INT64_MAX, &r->checkpoint, &size) : DRAPE_E_MEMORY;
    there = !status;
    if (status == DRAPE_E_FILE && (errno == ENOENT || errno == ENOTDIR))
        status = DRAPE_OK;
    if (!status && there)
        status = drape_archive_read_from(&r->archive, ctx, path, r->checkpoint, size);
    if (drape_ranks_any(ranks, there) && !there && !status)
        status = drape_fail(ctx, DRAPE_E_FILE, "cannot read \"%.500s\", which another rank can", path);
    status = drape_ranks_agree(ranks, ctx, status);
    if (!status && there)
        status = drape_ranks_agree(ranks, ctx, drape_sim_read(r->in.sim, &r->archive));
    drape_recorder_def def = recorder_def(r);
    def.archive = &r->archive;
    if (!status && there)
        status = drape_recorder_create(ctx, r->in.sim, &def, &r->recorder);
    r->start -= drape_recorder_done(r->recorder).wall;
    drape_free(ctx, path);
    if (status == DRAPE_E_STOPPED)
        return cli_report_interrupted(command->verb);
    return status ? cli_report(command, CLI_BAD_INPUT) : CLI_GO_ON;
}

static drape_status check_input(void *user, const char *path, const char *pointer)
{
    const run *r = user;
    (void)pointer;
    return drape_file_check_named(r->in.ctx, r->request->summary, path);
}

/* Checked again when the folder is there, if it was not before. */
static int check_summary_folder(const run_request *request)
{
    if (!request->out || !request->summary || !drape_folder_has(request->out, request->summary))
        return CLI_GO_ON;
    return cli_misuse(request->command.verb,
                      "--summary \"%.300s\" is in the folder of --out, which has its own summary.json",
                      request->summary);
}

/* The folder of a run gets a copy of the scene as it was run. If the scene itself is that file, options that
 * change the scene would overwrite the user's file. --summary must not replace the scene, a mesh, or a file
 * in the folder of the run. */
static int check_outputs(run *r)
{
    const run_request *request = r->request;
    const cli_command *command = &request->command;
    if (request->out && command->setting_count > 0 && drape_scene_copy_is(command->operand, request->out))
        return cli_misuse(command->verb,
                          "--out \"%.500s\": its " DRAPE_SCENE_COPY
                          " is the scene itself, and would be overwritten by the "
                          "changed scene; choose another folder",
                          request->out);
    if (!request->summary)
        return CLI_GO_ON;
    drape_status status = check_input(r, command->operand, "");
    if (!status)
        status =
            drape_scene_files(r->in.ctx, drape_model_whole(r->in.model), command->operand, check_input, r);
    return status ? cli_report(command, CLI_BAD_INPUT) : check_summary_folder(request);
}

static void write_summary(run *r, drape_folder *folder, const char *path)
{
    const drape_summary_def def = {.status = r->status,
                                   .message = r->message,
                                   .frames = drape_recorder_done(r->recorder).frames,
                                   .wall_total = r->wall,
                                   .wall_output = drape_recorder_done(r->recorder).seconds,
                                   .realtime = r->request->realtime ? &r->realtime.result : NULL,
                                   .accuracy = r->accurate ? &r->accuracy : NULL};
    note(r, drape_summary_write(r->in.ctx, r->in.sim, &def, folder, path));
}

/* Makes the recorder of the present sim, and the copy of the scene. */
static drape_status make_output(run *r)
{
    const char *scene = r->request->command.operand;
    const drape_recorder_def def = recorder_def(r);
    const drape_status status = drape_recorder_create(r->in.ctx, r->in.sim, &def, &r->recorder);
    if (status || !drape_recorder_done(r->recorder).writes || drape_scene_copy_is(scene, r->request->out))
        return status;
    return drape_scene_copy(r->in.ctx, r->in.scene, drape_model_whole(r->in.model), scene,
                            drape_recorder_folder(r->recorder));
}

/* Makes the output, unless the run is resumed, which has it already. The old summary is removed, since a
 * killed run must not leave it. A folder in which a file of somebody else would be replaced is refused as bad
 * input, before anything is changed; a folder that cannot be written is a failure of the run. */
static int open_output(run *r)
{
    drape_status status = DRAPE_OK;
    if (!r->request->out || drape_recorder_done(r->recorder).finished)
        return CLI_GO_ON;
    if (!r->recorder)
        status = make_output(r);
    else if (drape_recorder_done(r->recorder).writes)
        status = drape_folder_remove(drape_recorder_folder(r->recorder), drape_folder_is_named,
                                     DRAPE_SUMMARY_NAME);
    if (!status)
        return CLI_GO_ON;
    note(r, status);
    if (status != DRAPE_E_ARGUMENT && r->request->summary)
        write_summary(r, NULL, r->request->summary);
    cli_print_message(&r->request->command, r->message);
    return status == DRAPE_E_ARGUMENT ? CLI_BAD_INPUT : CLI_FAILED;
}

/* ---- Results on stdout ---- */

/* One line for each event: how often it occurred, and when. */
static void print_events(const run *r)
{
    drape_event_record event;
    for (int32_t i = 0; i < drape_sim_event(r->in.sim, -1, NULL); i++) {
        drape_sim_event(r->in.sim, i, &event);
        printf("event     %s: ", CLI_SHOWN(event.name));
        if (event.count == 0)
            puts("did not occur");
        else if (event.count == 1)
            printf("%s at %.12g s\n", event.direction > 0 ? "up" : "down", event.last);
        else
            printf("%lld times, first at %.12g s, last %s at %.12g s\n", (long long)event.count, event.first,
                   event.direction > 0 ? "up" : "down", event.last);
    }
}

/* Printed only if the scene asks for it. */
static void print_untangling(const run *r)
{
    drape_untangling u;
    if (!drape_sim_untangling(r->in.sim, &u, NULL))
        return;
    printf("untangled %s: %lld to %lld pairs of an edge and a triangle, %d to %d triangles in colliders; %d "
           "sweeps, %.3g s",
           u.clear ? "yes" : "no", (long long)u.pairs_before, (long long)u.pairs, (int)u.inside_before,
           (int)u.inside, u.sweeps, u.seconds);
    if (u.node >= 0) {
        const int32_t cloth = drape_model_cloth_of(r->in.model, u.node);
        printf("; %d cloth%s moved, by up to %.3g m (%s), strained by up to %.3g", (int)u.cloths,
               u.cloths == 1 ? "" : "s", u.displacement, CLI_SHOWN(r->in.model->cloths[cloth].name),
               u.strain);
    }
    fputc('\n', stdout);
}

/* Printed only if cloth reaches into a collider, or passes through itself, at the end. */
static void print_inside(run *r)
{
    double deepest;
    int32_t faces;
    for (int32_t c = 0; (faces = drape_sim_inside(r->in.sim, c, &deepest)) >= 0; c++)
        if (faces > 0)
            printf("inside    %d triangle%s of the cloth reach%s into %s, up to %.3g m deep\n", (int)faces,
                   faces == 1 ? "" : "s", faces == 1 ? "es" : "", CLI_SHOWN(r->in.model->colliders[c].name),
                   deepest);
    const int64_t edges = drape_sim_intersections(r->in.sim, -1);
    r->uncounted = edges < 0; /* if the count above was cancelled, this one is, too */
    if (edges > 0)
        printf("crossed   %lld edge-face intersection%s of the cloth with itself\n", (long long)edges,
               edges == 1 ? "" : "s");
}

static void print_solver(const run *r, const drape_statistics *s)
{
    const drape_left *left = &r->in.sim->left;
    const int64_t attempts = s->steps_accepted + s->steps_rejected;
    int64_t count = 0;
    const char *reason;
    printf("steps     %lld accepted, %lld rejected", (long long)s->steps_accepted,
           (long long)s->steps_rejected);
    for (int i = 0; (reason = drape_sim_reason(r->in.sim, i, &count)); i++)
        printf("%s%s %lld", i ? ", " : " (", reason, (long long)count);
    fputs(s->steps_rejected > 0 ? ")" : "", stdout);
    if (s->steps_unconverged > 0)
        printf("; %lld accepted although unconverged", (long long)s->steps_unconverged);
    if (s->steps_accepted > 0)
        printf("; %.4g to %.4g s", s->h_min, s->h_max);
    printf("\nnewton    %lld iterations, %.3g an attempt; %lld residuals, %lld Jacobians, %lld "
           "factorizations\n",
           (long long)s->newton_iterations, attempts ? (double)s->newton_iterations / (double)attempts : 0.0,
           (long long)s->residuals, (long long)s->jacobians, (long long)s->factorizations);
    if (!isnan(s->tolerance))
        printf("tolerance %.4g N on the residual of a node\n", s->tolerance);
    if (left->by_error > 0)
        printf("solved    %lld steps to their local error; last corrections of %.3g m and %.3g J at most\n",
               (long long)left->by_error, s->error_max, left->largest);
    if (s->steps_accepted > 0 && !isnan(s->error_bound))
        printf(
            "error     %.3g m at most, %.3g m in the last step, by estimate; %lld steps above the bound of "
            "%.3g m, %lld above their local error; errors of steps may add up\n",
            s->error_max, s->error_last, (long long)s->steps_above_error, s->error_bound,
            (long long)left->above_own);
}

/* What is known of the error, and until when. */
void cli_accuracy_text(const drape_model *model, const drape_accuracy *a, char *text, size_t size)
{
    snprintf(
        text, size,
        "%.3g mm, %.2g %% of the diagonal, RMS over the nodes of %s; node %d by up to %.3g mm at t=%.4g s "
        "near (%.4g, %.4g, %.4g) m",
        1e3 * a->distance, 100 * a->error, CLI_SHOWN(model->cloths[a->cloth].name), (int)a->node,
        1e3 * a->worst, a->time, a->place[0], a->place[1], a->place[2]);
}

static void print_accuracy(const run *r)
{
    const drape_accuracy *a = &r->accuracy;
    char text[512];
    cli_accuracy_text(r->in.model, a, text, sizeof text);
    printf("accuracy  %s, the last of %d runs: %s%s\n", a->method, (int)a->runs,
           isnan(a->error) ? "its error is not known" : "by estimate, off by ", isnan(a->error) ? "" : text);
    if (!a->reached && !r->status)
        printf("accuracy  not as asked: within %.2g until t=%.4g s only; after that runs by smaller steps "
               "part\n",
               a->asked, a->until);
}

static void print_results(run *r)
{
    const drape_model *model = r->in.model;
    const drape_chosen *chosen = &r->in.sim->chosen;
    const drape_statistics s = drape_sim_statistics(r->in.sim);
    const drape_energy e = drape_sim_energy(r->in.sim);
    const char *name;
    double work;
    const struct {
        const char *name;
        double value;
    } parts[] = {{"residual", s.wall_residual},
                 {"Jacobian", s.wall_jacobian},
                 {"factor", s.wall_factor},
                 {"solve", s.wall_solve},
                 {"contact", s.wall_contact}},
      energies[] = {{"kinetic", e.kinetic}, {"elastic", e.elastic},       {"gravity", e.gravity},
                    {"contact", e.contact}, {"dissipated", e.dissipated}, {"numerical", e.numerical}};
    printf("status    %s\n", drape_status_name(r->status));
    printf("method    %s", chosen->integrator->entry.name);
    if (!chosen->integrator->own_steps && !chosen->integrator->steady_state)
        printf(", dt %.3g s", drape_chosen_integrator_value(chosen, "dt", NAN));
    if (chosen->usual && !r->accurate)
        printf(": the default %s contact; --accuracy says how near it is",
               model->collider_count > 0 || model->contact.self ? "with" : "without");
    putchar('\n');
    printf("model     %d nodes, %lld degrees of freedom, %lld nonzeros\n", (int)drape_model_node_count(model),
           (long long)drape_model_dof_count(model), (long long)drape_model_nonzero_count(model));
    printf("time      %.9g of %.9g s\n", drape_sim_time(r->in.sim), drape_model_duration(model));
    print_solver(r, &s);
    printf("strain    %.5g to %.5g\n", s.strain_min, s.strain_max);
    if (s.stability_known)
        printf("equilibrium %s, %lld unstable modes\n", s.unstable_modes == 0 ? "stable" : "unstable",
               (long long)s.unstable_modes);
    fputs("energy   ", stdout);
    for (size_t i = 0; i < sizeof energies / sizeof *energies; i++)
        if (isnan(energies[i].value)) /* a start that collapses elements */
            printf("%s %s undefined", i ? "," : "", energies[i].name);
        else
            printf("%s %s %.5g J", i ? "," : "", energies[i].name, energies[i].value);
    fputc('\n', stdout);
    for (int i = 0; (name = drape_sim_work(r->in.sim, i, &work)); i++)
        if (work != 0)
            printf("work      %s %.5g J\n", CLI_SHOWN(name), work);
    print_events(r);
    print_untangling(r);
    if (!model->part)
        print_inside(r);
    printf("wall      %.4g s; %.4g ms a step", r->wall,
           s.steps_accepted ? 1e3 * s.wall_steps / (double)s.steps_accepted : 0.0);
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        if (parts[i].value > 0)
            printf("%s %s %.0f %%", i ? "," : ":", parts[i].name,
                   100 * parts[i].value / (s.wall_steps > 0 ? s.wall_steps : 1));
    fputc('\n', stdout);
    if (r->request->realtime)
        print_realtime(&r->realtime);
    if (r->accurate)
        print_accuracy(r);
    if (r->recorder)
        printf("output    %lld frames, steps.csv, energy.csv, summary.json and scene.json in %s\n",
               (long long)drape_recorder_done(r->recorder).frames, CLI_SHOWN(r->request->out));
}

/* ---- Warnings, on stderr ---- */

/* Prints those that apply by now, each once: those of the scene before the run, those of the run after it. */
static void print_warnings(run *r)
{
    drape_warning w;
    for (int i = 0; drape_sim_warning(r->in.sim, i, &w); i++) {
        bool printed = r->warned_count == MAX_WARNINGS;
        for (int k = 0; k < r->warned_count && !printed; k++)
            printed = strcmp(r->warned[k], w.name) == 0;
        if (printed)
            continue;
        r->warned[r->warned_count++] = w.name;
        fprintf(stderr, "warning: %s\n", w.text);
    }
}

/* ---- The run ---- */

/* Registered after the recorder, so that the step during which the signal came is logged. */
static drape_status watch(void *user, const drape_event *event)
{
    run *r = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT)
        return DRAPE_OK;
    cli_progress_show(&r->progress, event->sim);
    return cli_interrupted() ? DRAPE_E_STOPPED : DRAPE_OK;
}

static drape_status begin(run *r)
{
    const drape_status status = drape_sim_observe(r->in.sim, watch, r);
    cli_progress_begin(&r->progress, r->in.sim, drape_model_duration(r->in.model));
    cli_signals_cancel(r->in.sim);
    return status;
}

/* A drape_run_prepare: the files of the run before are replaced. */
static drape_status begin_again(void *user, drape_sim *sim, const drape_accuracy *before)
{
    run *r = user;
    cli_signals_cancel(NULL);
    if (cli_interrupted())
        return DRAPE_E_STOPPED;
    cli_progress_hide(&r->progress);
    if (before->runs > 1 && r->progress.on)
        fprintf(stderr, "run %d: %s\n", (int)before->runs, before->method);
    drape_recorder_destroy(&r->recorder);
    r->in.sim = sim;
    const drape_status status = r->request->out ? make_output(r) : DRAPE_OK;
    return status ? status : begin(r);
}

/* The sim of the scene, by which its settings were checked, is not run. */
static drape_status run_accurately(run *r)
{
    drape_sim_def def;
    drape_sim *last = NULL, *first = r->in.sim;
    drape_sim_def_init(&def, sizeof def);
    def.threads = r->request->command.threads ? r->request->command.threads : 1;
    const drape_status status =
        drape_run_accurately(r->in.ctx, r->in.model, &def, begin_again, r, &last, &r->accuracy);
    if (!last)
        drape_recorder_destroy(&r->recorder);
    r->in.sim = last ? last : first;
    if (last)
        drape_sim_destroy(&first);
    return status;
}

static void advance(run *r)
{
    drape_status status = r->accurate ? DRAPE_OK : begin(r);
    if (!status)
        status = r->accurate            ? run_accurately(r)
                 : r->request->realtime ? run_realtime(&r->realtime, &r->in)
                                        : drape_sim_advance(r->in.sim, drape_model_duration(r->in.model));
    cli_signals_cancel(NULL);
    if (status == DRAPE_E_STOPPED && cli_interrupted())
        drape_context_set_message(r->in.ctx, "t=%.9g: interrupted", drape_sim_time(r->in.sim));
    if (status != DRAPE_E_STOPPED || drape_sim_stopped_by(r->in.sim) < 0)
        note(r, status);
    cli_progress_clear(&r->progress);
}

/* An interrupted run writes its checkpoint before its last frame, as a resumed run will not have that frame;
 * a completed run writes it afterwards. A run that an event stopped has completed, and the summary says why.
 * A signal after the last step does not interrupt the run, unless it cut the counts short. */
static int simulate(run *r)
{
    const bool done = drape_recorder_done(r->recorder).finished;
    const bool keeps = !done && r->recorder && keeps_checkpoints(r);
    drape_event_record event;
    print_warnings(r);
    if (!done)
        advance(r);
    if (keeps && r->status == DRAPE_E_STOPPED)
        note(r, drape_recorder_checkpoint(r->recorder));
    if (!done && r->recorder)
        note(r, drape_recorder_finish(r->recorder));
    if (keeps && !r->status)
        note(r, drape_recorder_checkpoint(r->recorder));
    r->wall = done || (keeps && !r->status) ? drape_recorder_done(r->recorder).wall
                                            : drape_clock_seconds() - r->start;
    const int32_t by = drape_sim_stopped_by(r->in.sim);
    if (!r->status && by >= 0) {
        drape_sim_event(r->in.sim, by, &event);
        snprintf(r->message, sizeof r->message, "t=%.9g: stopped by event \"%.60s\"",
                 drape_sim_time(r->in.sim), event.name);
    }
    if (r->recorder)
        write_summary(r, drape_recorder_folder(r->recorder), DRAPE_SUMMARY_NAME);
    if (r->request->summary)
        write_summary(r, NULL, r->request->summary);
    print_results(r);
    fflush(stdout);
    if (!r->status) { /* a failure has its own line */
        print_warnings(r);
        return r->uncounted && cli_interrupted() ? cli_report_interrupted(r->request->command.verb)
                                                 : CLI_DONE;
    }
    cli_print_message(&r->request->command, r->message);
    return r->status == DRAPE_E_STOPPED ? CLI_INTERRUPTED : CLI_FAILED;
}

/* Refuses options that would be ignored silently. */
static int check_integrator(const run *r)
{
    const cli_command *command = &r->request->command;
    const drape_chosen *chosen = &r->in.sim->chosen;
    if (r->request->realtime && chosen->integrator->steady_state)
        return cli_misuse(command->verb, "--realtime: the integrator \"%s\" makes no steps in time",
                          chosen->integrator->entry.name);
    for (size_t i = 0; i < command->setting_count; i++) {
        const cli_setting *s = &command->settings[i];
        if (s->must_act && drape_chosen_ignores_integrator(chosen, strrchr(s->pointer, '/') + 1))
            return cli_misuse(command->verb,
                              "--%s \"%.60s\": the integrator \"%s\" does not use it; leave it out",
                              s->option, s->value, chosen->integrator->entry.name);
    }
    return CLI_GO_ON;
}

static int check_accuracy(run *r)
{
    const cli_command *command = &r->request->command;
    const char *option = r->request->realtime ? "realtime"
                         : r->request->resume ? "resume"
                                              : "checkpoint-every";
    r->accurate = r->in.model->accuracy.value > 0;
    if (!r->accurate)
        return CLI_GO_ON;
    if (r->request->realtime || keeps_checkpoints(r))
        return cli_misuse(command->verb,
                          "--%s: a scene with an accuracy is run several times, from its start", option);
    if (drape_accuracy_check(r->in.ctx, r->in.model))
        return cli_report(command, CLI_BAD_INPUT);
    for (size_t i = 0; i < command->setting_count; i++) {
        const cli_setting *s = &command->settings[i];
        if (strcmp(s->pointer, "/integrator/method") == 0 || strcmp(s->pointer, "/integrator/dt") == 0 ||
            strncmp(s->pointer, "/controller", strlen("/controller")) == 0)
            return cli_misuse(command->verb,
                              "--%s \"%.60s\": an accuracy chooses the method and its steps; leave it out",
                              s->option, s->value);
    }
    return CLI_GO_ON;
}

static int load_and_run(const run_request *request)
{
    run r = {.request = request, .start = drape_clock_seconds(), .realtime = {.command = &request->command}};
    const char *verb = request->command.verb, *option = request->resume ? "resume" : "checkpoint-every";
    const bool keeps = keeps_checkpoints(&r);
    /* The ranks compare these options here, and the scene, with those that change it, when it is read. */
    const int32_t numbers[] = {request->resume, request->realtime, request->checkpoint_every,
                               request->out != NULL, request->summary != NULL};
    const char *const texts[] = {request->out, request->summary};
    uint64_t options = drape_hash_bytes(DRAPE_HASH_START, numbers, sizeof numbers);
    for (size_t i = 0; i < 2; i++)
        options = texts[i] ? drape_hash_bytes(options, texts[i], strlen(texts[i]) + 1) : options;
    int code = cli_ranks_compare(&request->command, options);
    if (code == CLI_GO_ON && cli_ranks_count() > 1 && request->realtime)
        code = cli_misuse(verb, "--realtime: a run on several ranks has no time budget");
    if (code == CLI_GO_ON && keeps && !request->out)
        code = cli_misuse(verb, "--%s needs --out: the checkpoint is in the folder of the run", option);
    if (code == CLI_GO_ON && keeps && request->realtime)
        code = cli_misuse(verb, "--%s cannot be combined with --realtime, whose steps depend on the clock",
                          option);
    if (code != CLI_GO_ON)
        return code;
    code = cli_scene_load_with(&request->command, request->command.operand,
                               request->realtime ? choose_realtime : NULL, &r.realtime, &r.in);
    if (code == CLI_GO_ON)
        code = check_accuracy(&r);
    if (code == CLI_GO_ON)
        code = check_integrator(&r);
    if (code == CLI_GO_ON)
        code = check_outputs(&r);
    code = cli_ranks_agree(&request->command, code);
    if (code == CLI_GO_ON)
        code = cli_ranks_agree(&request->command, resume(&r));
    if (code == CLI_GO_ON)
        code = cli_ranks_agree(&request->command, open_output(&r));
    if (code == CLI_GO_ON)
        code = check_summary_folder(request);
    if (code == CLI_GO_ON)
        code = simulate(&r);
    drape_recorder_destroy(&r.recorder);
    drape_free(r.in.ctx, r.checkpoint);
    cli_scene_free(&r.in);
    return code;
}

static int run_on_ranks(const void *command)
{
    const run_request *request = command;
    const int code = cli_ranks_begin(&request->command);
    return code == CLI_GO_ON ? cli_ranks_end(load_and_run(request)) : code;
}

#define AT(member) offsetof(run_request, member)
static const cli_option options[] = {
    {"out", CLI_TEXT, "DIR",
     "folder for frames, steps.csv, energy.csv, summary.json and scene.json; created if necessary", AT(out)},
    {"summary", CLI_TEXT, "FILE", "write the summary to this file too", AT(summary)},
    {"checkpoint-every", CLI_NUMBER, "N", "save the run in DIR/checkpoint.drape with every N-th frame",
     AT(checkpoint_every), INT_MAX},
    {"resume", CLI_FLAG, NULL,
     "resume from the checkpoint in DIR, of the same scene; without one, start from the beginning",
     AT(resume)},
    {"realtime", CLI_FLAG, NULL,
     "give each frame its duration, 1/frame_rate, as time budget, by newton_k unless a method is named; "
     "report how "
     "long frames took",
     AT(realtime)},
};

const drape_verb drape_verb_run = {
    .entry = {.name = "run", .summary = "simulate a scene; write frames, step log and summary into a folder"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Simulates a scene. Without --out, it prints the results and writes no files.\nCtrl-C ends "
        "the run after the step in progress, or within it after half a second, and keeps what was "
        "written;\nbefore the first step, nothing is written. A run with --checkpoint-every that was killed "
        "resumes with --resume,\nand ends with the same results as a run that was not killed.",
    CLI_OPTIONS(options, run_request),
    .run = run_on_ranks,
};
