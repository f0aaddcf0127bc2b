/*
 * implicit: the part of the stability map beyond that of `explicit`. The same scenes with implicit
 * integrators, at the step lengths at which the explicit programs blow up and far beyond: springs 200 times
 * as stiff, a hundredth of the mass, both, and steps of 1/30 s. `limit` is the largest strain that a spring
 * may have; the scene of Boson has no limit.
 *
 *     implicit [--csv FILE] [--side N] [--scene NAME] [SCENES]
 *         --side    nodes along each side of pinned2 (default 20)
 *         --scene   run only this scene
 *         SCENES    the folder of cs184_pinned2.json and verlet_100.json
 */
#include "bench.h"

#include "base/vec3.h"
#include "model/scene.h"

#include <time.h>

#define MAX_SETTINGS 5
#define NONE         -1.0

typedef struct setting {
    const char *pointer, *value;
} setting;

typedef struct run {
    const char *scene, *knob, *method;
    double step;  /* [s]; 0: the default of the integrator */
    double time;  /* [s] duration */
    double limit; /* largest strain allowed; NONE: no limit */
    setting settings[MAX_SETTINGS];
} run;

#define PINNED2(method_, step_, knob_, ...)                                                                  \
    {                                                                                                        \
        .scene = "cs184_pinned2", .knob = knob_, .method = method_, .step = step_, .time = 3, .limit = 0.1,  \
        .settings = {                                                                                        \
            __VA_ARGS__                                                                                      \
        }                                                                                                    \
    }
#define BOSON(method_, step_, knob_, ...)                                                                    \
    {                                                                                                        \
        .scene = "verlet_100", .knob = knob_, .method = method_, .step = step_, .time = 3.6, .limit = NONE,  \
        .settings = {                                                                                        \
            __VA_ARGS__                                                                                      \
        }                                                                                                    \
    }
#define STOCK                                                                                                \
    {                                                                                                        \
        NULL, NULL                                                                                           \
    }
#define STIFF                                                                                                \
    {                                                                                                        \
        "/cloth/ks", "1e6"                                                                                   \
    }
#define LIGHT                                                                                                \
    {                                                                                                        \
        "/cloth/density", "1.5"                                                                              \
    }
#define FEW                                                                                                  \
    {                                                                                                        \
        "/cloth/0/material/total_mass", "5000"                                                               \
    }

static const run runs[] = {
    PINNED2("be", 1.0 / 360, "as it is", STOCK),
    PINNED2("be", 1.0 / 180, "as it is", STOCK),
    PINNED2("be", 1.0 / 30, "as it is", STOCK),
    PINNED2("be", 1.0 / 30, "ks 1e6", STIFF),
    PINNED2("be", 1.0 / 30, "mass / 100", LIGHT),
    PINNED2("be", 1.0 / 30, "ks 1e6 and mass / 100", STIFF, LIGHT),
    PINNED2("ida", 0, "as it is", STOCK),
    PINNED2("ida", 0, "ks 1e6", STIFF),
    PINNED2("ida", 0, "mass / 100", LIGHT),
    PINNED2("ida", 0, "ks 1e6 and mass / 100", STIFF, LIGHT),
    BOSON("be", 0.06, "as it is", STOCK),
    BOSON("be", 0.1, "mass / 2", FEW),
    BOSON("ida", 0, "as it is", STOCK),
    BOSON("ida", 0, "mass / 2", FEW),
};

/* Results of a run. */
typedef struct outcome {
    const drape_model *model;
    double strain; /* largest strain of all springs in all steps */
    drape_status status;
    drape_statistics done;
    double kinetic, lowest, cpu;
} outcome;

static void set(drape_context *ctx, drape_scene *scene, const char *pointer, const char *value)
{
    if (drape_scene_set(scene, pointer, value))
        bench_fail(ctx, "%s=%s", pointer, value);
}

static void set_size(drape_context *ctx, drape_scene *scene, const run *r, int side)
{
    char count[32], last[64];
    if (strcmp(r->scene, "cs184_pinned2") != 0)
        return;
    snprintf(count, sizeof count, "%d", side);
    snprintf(last, sizeof last, "[[0, 0], [%d, 0]]", side - 1);
    set(ctx, scene, "/cloth/num_width_points", count);
    set(ctx, scene, "/cloth/num_height_points", count);
    set(ctx, scene, "/cloth/pinned", last);
}

static drape_model *load(drape_context *ctx, const char *folder, const run *r, int side)
{
    char path[512], method[32], step[32];
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    snprintf(path, sizeof path, "%s/%s.json", folder, r->scene);
    snprintf(method, sizeof method, "\"%s\"", r->method);
    snprintf(step, sizeof step, "%.17g", r->step);
    if (drape_scene_load(ctx, path, &scene))
        bench_fail(ctx, "%s", path);
    set_size(ctx, scene, r, side);
    set(ctx, scene, "/integrator/method", method);
    set(ctx, scene, "/controller", "{\"type\": \"halving\"}");
    if (r->step > 0)
        set(ctx, scene, "/integrator/dt", step);
    for (int i = 0; i < MAX_SETTINGS && r->settings[i].pointer; i++)
        set(ctx, scene, r->settings[i].pointer, r->settings[i].value);
    if (drape_scene_compile(scene, &model))
        bench_fail(ctx, "%s", path);
    drape_scene_destroy(&scene);
    return model;
}

static double largest_strain(const drape_model *m, const drape_elements *el, const double *x)
{
    double largest = 0;
    for (int32_t e = 0; e < el->count; e++) {
        const int32_t *node = el->node + 2 * (size_t)e;
        double d[3], rest[3];
        vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], d);
        vec3_sub(m->rest + 3 * (size_t)node[1], m->rest + 3 * (size_t)node[0], rest);
        largest = fmax(largest, vec3_norm(d) / vec3_norm(rest) - 1);
    }
    return largest;
}

static drape_status watch(void *user, const drape_event *event)
{
    outcome *o = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT || !event->attempt->accepted)
        return DRAPE_OK;
    for (int32_t i = 0; i < o->model->term_count; i++)
        if (o->model->terms[i].ops->distance)
            o->strain = fmax(o->strain, largest_strain(o->model, &o->model->terms[i].elements,
                                                       drape_sim_positions(event->sim)));
    return DRAPE_OK;
}

static outcome go(const char *folder, const run *r, int side)
{
    drape_context *ctx = bench_context();
    drape_model *model = load(ctx, folder, r, side);
    drape_sim *sim = bench_sim(ctx, model, NULL, NULL, NULL, NULL);
    outcome o = {.model = model, .lowest = INFINITY};
    drape_sim_observe(sim, watch, &o);
    clock_t start = clock();
    o.status = drape_sim_advance(sim, r->time);
    o.cpu = (double)(clock() - start) / CLOCKS_PER_SEC;
    o.done = drape_sim_statistics(sim);
    o.kinetic = drape_sim_energy(sim).kinetic;
    for (size_t i = 0; i < (size_t)model->node_count; i++)
        o.lowest = fmin(o.lowest, drape_sim_positions(sim)[3 * i + 1]);
    if (o.status)
        printf("%s\n", drape_context_message(ctx));
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    return o;
}

static void print(const run *r, const outcome *o, int nodes)
{
    printf("%-14s %6d %-4s %7.4f  %-22s %-8s %6lld %5lld %7lld  %8.4f %9.3g %8.4f %8.1f\n", r->scene, nodes,
           r->method, r->step, r->knob, drape_status_name(o->status), (long long)o->done.steps_accepted,
           (long long)o->done.steps_rejected, (long long)o->done.newton_iterations, o->strain, o->kinetic,
           o->lowest, o->cpu);
    fflush(stdout);
}

static void write(FILE *csv, const run *r, const outcome *o, int nodes)
{
    bench_csv_row(csv);
    fprintf(csv, "%s,%d,%s,%.6g,%s,%s,%lld,%lld,%lld,%.5g,", r->scene, nodes, r->method, r->step, r->knob,
            drape_status_name(o->status), (long long)o->done.steps_accepted,
            (long long)o->done.steps_rejected, (long long)o->done.newton_iterations, o->strain);
    if (r->limit >= 0)
        fprintf(csv, "%g", r->limit);
    fprintf(csv, ",%.5g,%.5g,%.2f\n", o->kinetic, o->lowest, o->cpu);
    fflush(csv);
}

int main(int argc, char **argv)
{
    const char *name = NULL, *folder = "examples/scenes", *only = NULL;
    int side = 20, failed = 0;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--csv") == 0 && i + 1 < argc)
            name = argv[++i];
        else if (strcmp(argv[i], "--scene") == 0 && i + 1 < argc)
            only = argv[++i];
        else if (strcmp(argv[i], "--side") == 0 && i + 1 < argc && atoi(argv[i + 1]) > 1)
            side = atoi(argv[++i]);
        else if (argv[i][0] != '-')
            folder = argv[i];
        else
            return bench_usage(argv[i], "implicit [--csv FILE] [--side N] [--scene NAME] [SCENES]\n");
    }
    FILE *csv =
        bench_csv(name, "scene,nodes,method,step_s,knob,status,steps,rejected,iterations,strain,limit,"
                        "kinetic_J,lowest_m,cpu_s");
    printf("%-14s %6s %-4s %7s  %-22s %-8s %6s %5s %7s  %8s %9s %8s %8s\n", "scene", "nodes", "with",
           "step s", "knob", "status", "steps", "rej.", "iter.", "strain", "kinetic J", "lowest m", "CPU s");
    for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
        if (only && strcmp(only, runs[i].scene) != 0)
            continue;
        const outcome o = go(folder, &runs[i], side);
        const int nodes = strcmp(runs[i].scene, "verlet_100") == 0 ? 10000 : side * side;
        print(&runs[i], &o, nodes);
        failed += o.status != DRAPE_OK;
        if (csv)
            write(csv, &runs[i], &o, nodes);
    }
    if (csv)
        fclose(csv);
    return failed > 0;
}
