/* realtime.c: see realtime.h. */
#include "cli/realtime.h"

#include "base/clock.h"
#include "model/scene.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define METHOD       "newton_k"
#define TRIALS       4    /* steps, of which the first sets up and the fastest other one counts */
#define SHARE        0.5  /* of a frame that the iterations are to take: the rest is for contact to come */
#define NODES_THREAD 2500 /* for each thread: with fewer it spends its time waiting */

/* ---- What is chosen ---- */

static void say(cli_realtime *r, const char *format, ...) DRAPE_PRINTF(2, 3);
static void say(cli_realtime *r, const char *format, ...)
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
static drape_status choose_method(cli_realtime *r, const cli_scene *scene, drape_sim_def *def)
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

/* An option that only some methods have stands for the scene's own, as one that is named does. */
drape_status cli_realtime_choose(void *user, const cli_scene *scene, drape_sim_def *def)
{
    cli_realtime *r = user;
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

/* ---- Frames ---- */

static drape_status add_time(cli_realtime *r, drape_arena *arena, double seconds)
{
    if (r->count == r->capacity) {
        size_t capacity = r->capacity ? 2 * r->capacity : 256;
        double *more = drape_arena_resize(arena, r->seconds, capacity, sizeof *more);
        if (!more)
            return DRAPE_E_MEMORY;
        r->seconds = more;
        r->capacity = capacity;
    }
    r->seconds[r->count++] = seconds;
    return DRAPE_OK;
}

static void count(drape_summary_realtime *s, const drape_realtime *frame)
{
    bool full = strcmp(frame->level, "full") == 0, fewer = strcmp(frame->level, "fewer iterations") == 0;
    s->frames++;
    s->missed += !frame->kept;
    s->full += full;
    s->fewer += fewer;
    s->larger += !full && !fewer;
    s->inaccurate += frame->error > frame->error_bound;
    s->crossings = frame->crossings > s->crossings ? frame->crossings : s->crossings;
    s->still += !(frame->h > 0);
    s->debt = frame->debt;
    s->dropped = frame->dropped_total;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* By the nearest rank; of sorted times. */
static double percentile(const cli_realtime *r, double share)
{
    size_t rank = (size_t)ceil(share * (double)r->count);
    return r->count ? r->seconds[rank > 0 ? rank - 1 : 0] : 0;
}

drape_status cli_realtime_run(cli_realtime *r, const cli_scene *scene)
{
    double end = drape_model_duration(scene->model), frame = 1 / drape_model_frame_rate(scene->model);
    const drape_chosen *chosen = &scene->sim->chosen;
    const double number = drape_chosen_integrator_value(chosen, "iterations", NAN);
    drape_status status = DRAPE_OK;
    r->result.budget = frame;
    if (!r->iterations.name && isnan(number)) /* not chosen */
        say(r, "iterations: not a parameter of %s", chosen->integrator->entry.name);
    else if (!r->iterations.name)
        say(r, "iterations %.0f: %s", number, r->iterations_given ? "given" : "the default of the method");
    while (!status && end - drape_sim_time(scene->sim) - r->result.debt > 1e-9 * frame) {
        drape_realtime report;
        double left = end - drape_sim_time(scene->sim) - r->result.debt;
        status = drape_sim_advance_realtime(scene->sim, fmin(frame, left), frame, &report);
        count(&r->result, &report);
        r->estimates = !isnan(report.error_bound);
        drape_status kept = add_time(r, r->command->arena, report.seconds);
        status = status ? status : kept;
    }
    if (!status) /* the debt of the last frames, without a deadline */
        status = drape_sim_advance(scene->sim, end);
    if (r->count > 0)
        qsort(r->seconds, r->count, sizeof *r->seconds, compare);
    r->result.p50 = percentile(r, 0.5);
    r->result.p95 = percentile(r, 0.95);
    r->result.p99 = percentile(r, 0.99);
    r->result.worst = percentile(r, 1);
    return status;
}

void cli_realtime_print(const cli_realtime *r)
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
