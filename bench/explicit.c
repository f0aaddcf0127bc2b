/*
 * explicit: the part of the stability map that explicit steps reach. The scenes of the programs CS184 and
 * Boson are stepped as those programs do it, over substeps, dt, stiffness and mass, and compared with what a
 * build of each program did (docs/springs.md). A run has blown up in the first frame in which a node is
 * faster than 1e4 lengths of the scene per second.
 *
 *     explicit [--csv FILE] [SCENES]      SCENES: the folder of cs184_pinned2.json and verlet_100.json
 */
#include "bench.h"

#include "base/vec3.h"
#include "model/scene.h"

#include <time.h>

#define FAST 1e4 /* lengths of the scene per second */

typedef struct setting {
    const char *pointer, *value;
} setting;

/* One run, and the result of the program that the scene comes from: NaN if it is not known. */
typedef struct run {
    const char *scene, *knob, *value;
    setting settings[2];
    int frames;
    double strain, kinetic, lowest, speed;
    int blow_up; /* frame in which it blew up; 0: it did not */
} run;

#define PINNED2(substeps, strain_, kinetic_, lowest_, blow_up_)                                              \
    {                                                                                                        \
        .scene = "cs184_pinned2", .knob = "substeps", .value = #substeps,                                    \
        .settings = {{"/integrator/substeps", #substeps}}, .frames = 270, .strain = strain_,                 \
        .kinetic = kinetic_, .lowest = lowest_, .speed = NAN, .blow_up = blow_up_                            \
    }
#define KS(ks, strain_, lowest_)                                                                             \
    {                                                                                                        \
        .scene = "cs184_pinned2", .knob = "ks", .value = #ks, .settings = {{"/cloth/ks", #ks}},              \
        .frames = 270, .strain = strain_, .kinetic = NAN, .lowest = lowest_, .speed = NAN                    \
    }
#define BOSON(dt, frames_, speed_, blow_up_)                                                                 \
    {                                                                                                        \
        .scene = "verlet_100", .knob = "dt", .value = #dt, .settings = {{"/integrator/dt", #dt}},            \
        .frames = frames_, .strain = NAN, .kinetic = NAN, .lowest = NAN, .speed = speed_,                    \
        .blow_up = blow_up_                                                                                  \
    }
#define HEAVY(mass, kg, frames_, speed_, blow_up_)                                                           \
    {                                                                                                        \
        .scene = "verlet_100", .knob = "mass", .value = #mass,                                               \
        .settings = {{"/cloth/0/material/total_mass", #kg}}, .frames = frames_, .strain = NAN,               \
        .kinetic = NAN, .lowest = NAN, .speed = speed_, .blow_up = blow_up_                                  \
    }

static const run runs[] = {
    PINNED2(30, 0.125, 3.5e-4, -0.083, 0),
    PINNED2(15, 0.20, 3.2e-2, -0.0865, 0),
    PINNED2(10, 0.31, 0.51, -0.089, 0),
    PINNED2(8, 0.39, 2.0, NAN, 0),
    PINNED2(6, 0.57, 4.5, NAN, 0),
    PINNED2(5, 0.64, 6.9, NAN, 0),
    PINNED2(4, 0.75, 72, NAN, 0),
    PINNED2(3, 1.79, 575, NAN, 0),
    PINNED2(2, NAN, NAN, NAN, 14),
    KS(1, 0.140, -0.1495),
    KS(50, 0.137, -0.1500),
    KS(500, 0.131, -0.143),
    KS(50000, 0.106, -0.022),
    KS(100000, 0.100, -0.013),
    KS(200000, 0.082, -0.007),
    {.scene = "cs184_pinned2",
     .knob = "ks",
     .value = "500000",
     .settings = {{"/cloth/ks", "500000"}},
     .frames = 270,
     .strain = NAN,
     .kinetic = 4.5e4,
     .lowest = NAN,
     .speed = NAN},
    {.scene = "cs184_pinned2",
     .knob = "density, ks",
     .value = "10, 1e5",
     .settings = {{"/cloth/density", "10"}, {"/cloth/ks", "1e5"}},
     .frames = 270,
     .strain = NAN,
     .kinetic = NAN,
     .lowest = NAN,
     .speed = NAN,
     .blow_up = 2},
    {.scene = "cs184_pinned2",
     .knob = "density, ks",
     .value = "1, 5e4",
     .settings = {{"/cloth/density", "1"}, {"/cloth/ks", "5e4"}},
     .frames = 270,
     .strain = NAN,
     .kinetic = NAN,
     .lowest = NAN,
     .speed = NAN,
     .blow_up = 1},
    BOSON(0.02, 1500, 0.2, 0),
    BOSON(0.04, 1500, 0.35, 0),
    {.scene = "verlet_100",
     .knob = "dt",
     .value = "0.05",
     .settings = {{"/integrator/dt", "0.05"}},
     .frames = 1500,
     .strain = 4.5,
     .kinetic = NAN,
     .lowest = 39,
     .speed = 22.5},
    BOSON(0.055, 1500, 63, 0),
    BOSON(0.06, 1500, NAN, 160),
    BOSON(0.0625, 1500, NAN, 54),
    BOSON(0.065, 1500, NAN, 38),
    BOSON(0.07, 1500, NAN, 25),
    BOSON(0.08, 1500, NAN, 17),
    BOSON(0.1, 1500, NAN, 13),
    HEAVY(0.9, 9000, 1500, 49, 0),
    HEAVY(0.8, 8000, 1500, 81, 0),
    HEAVY(0.7, 7000, 1500, NAN, 60),
    HEAVY(0.5, 5000, 1500, NAN, 21),
};

static drape_model *load(drape_context *ctx, const char *folder, const run *r)
{
    char path[512];
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    snprintf(path, sizeof path, "%s/%s.json", folder, r->scene);
    drape_status status = drape_scene_load(ctx, path, &scene);
    for (int i = 0; !status && i < 2 && r->settings[i].pointer; i++)
        status = drape_scene_set(scene, r->settings[i].pointer, r->settings[i].value);
    if (!status)
        status = drape_scene_compile(scene, &model);
    drape_scene_destroy(&scene);
    if (status)
        bench_fail(ctx, "%s", path);
    return model;
}

static double spring_strain(const drape_model *m, const int32_t *node, const double *x)
{
    double d[3], rest[3];
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], d);
    vec3_sub(m->rest + 3 * (size_t)node[1], m->rest + 3 * (size_t)node[0], rest);
    return vec3_norm(d) / vec3_norm(rest) - 1;
}

static void measure(drape_sim *sim, run *got)
{
    const drape_model *m = drape_sim_model(sim);
    const double *x = drape_sim_positions(sim), *v = drape_sim_velocities(sim);
    got->strain = got->speed = 0;
    got->lowest = INFINITY;
    for (int32_t i = 0; i < m->term_count; i++)
        for (int32_t e = 0; m->terms[i].ops->measure && e < m->terms[i].elements.count; e++)
            got->strain = fmax(got->strain, spring_strain(m, m->terms[i].elements.node + 2 * (size_t)e, x));
    for (size_t i = 0; i < (size_t)m->node_count; i++) {
        got->speed = fmax(got->speed, vec3_norm(v + 3 * i));
        got->lowest = fmin(got->lowest, x[3 * i + 1]);
    }
    got->kinetic = drape_sim_energy(sim).kinetic;
}

/* Runs the scene with Drape. A frame is one step of length dt here. */
static run go(drape_context *ctx, const char *folder, const run *r, drape_stability *stability,
              double *seconds)
{
    run got = *r;
    drape_model *model = load(ctx, folder, r);
    drape_sim *sim = bench_sim(ctx, model, NULL, NULL, NULL, NULL);
    double dt = sim->schedule.dt, max_speed = FAST * model->length;
    sim->chosen.integrator->stability(sim->integrator, drape_sim_state(sim), dt, stability);
    got.blow_up = 0;
    clock_t start = clock();
    for (int k = 1; k <= r->frames && !got.blow_up; k++) {
        drape_status status = drape_sim_advance(sim, k * dt);
        measure(sim, &got);
        if (status || !(got.speed <= max_speed))
            got.blow_up = k;
    }
    *seconds = (double)(clock() - start) / CLOCKS_PER_SEC / r->frames;
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    return got;
}

static void print_pair(double here, double there)
{
    printf(" %10.3g", here);
    if (isnan(there))
        printf(" (%8s)", "-");
    else
        printf(" (%8.3g)", there);
}

static void print_run(const run *r, const run *got, const drape_stability *s)
{
    printf("%-14s %-11s %-8s %8.3g", r->scene, r->knob, r->value, s->substep / s->limit);
    if (got->blow_up) {
        printf("  blows up in frame %d", got->blow_up);
    } else {
        print_pair(got->strain, r->strain);
        print_pair(got->kinetic, r->kinetic);
        print_pair(got->lowest, r->lowest);
        print_pair(got->speed, r->speed);
    }
    if (got->blow_up || r->blow_up)
        printf(r->blow_up ? "  (theirs in frame %d)" : "  (theirs does not)", r->blow_up);
    puts("");
    fflush(stdout);
}

static void write_run(FILE *csv, const run *r, const run *got, const drape_stability *s, double seconds)
{
    bench_csv_row(csv);
    fprintf(csv, "%s,\"%s\",\"%s\",%.4g,%d,%.5g,%.5g,%.5g,%.5g,%d,%.5g,%.5g,%.5g,%.5g,%.3g\n", r->scene,
            r->knob, r->value, s->substep / s->limit, got->blow_up, got->strain, got->kinetic, got->lowest,
            got->speed, r->blow_up, r->strain, r->kinetic, r->lowest, r->speed, 1e3 * seconds);
    fflush(csv);
}

int main(int argc, char **argv)
{
    const char *name = NULL, *folder = "examples/scenes";
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--csv") == 0 && i + 1 < argc)
            name = argv[++i];
        else if (argv[i][0] != '-')
            folder = argv[i];
        else
            return bench_usage(argv[i], "explicit [--csv FILE] [SCENES]\n");
    }
    drape_context *ctx = bench_context();
    FILE *csv =
        bench_csv(name, "scene,knob,value,share_of_limit,blow_up_frame,strain,kinetic_J,lowest_m,speed_m_s,"
                        "their_blow_up_frame,their_strain,their_kinetic_J,their_lowest_m,"
                        "their_speed_m_s,cpu_ms_a_frame");
    printf("%-14s %-11s %-8s %8s %21s %21s %21s %21s\n", "scene", "knob", "value", "of limit", "strain",
           "kinetic J", "lowest m", "speed m/s");
    for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
        drape_stability stability;
        double seconds;
        run got = go(ctx, folder, &runs[i], &stability, &seconds);
        print_run(&runs[i], &got, &stability);
        if (csv)
            write_run(csv, &runs[i], &got, &stability, seconds);
    }
    if (csv)
        fclose(csv);
    drape_context_destroy(&ctx);
    return 0;
}
