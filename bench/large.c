/*
 * large: large sheets by one method with each of two linear solvers, pcg and multifrontal: CPU time of a
 * step, its matrices and linear iterations, peak memory. A square sheet of 1 m of 1e4 and more nodes,
 * released horizontally, dt 1/60 s: of E 1e6 Pa, h 1 mm, 0.2 kg/m2, hung by two corners, or 1 mm above a ball
 * of 0.3 m; and of a measured denim, which is stiff in bending, with two patches of pins inside. Each case
 * runs in a process of its own, with one thread.
 */
#include "bench.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#define DIRECT_NODES 150000 /* multifrontal takes minutes for a step of more */

static const char sheet[] =
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 1, 'height': 1}, "
    "'material': {%s}, 'terms': [%s]%s}]%s, 'duration': 1}";

#define SOFT    "'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2"
#define SPRINGS "'stretch.edge', 'bend.hinge'"

typedef struct scene {
    const char *name, *material, *terms, *pins, *colliders;
} scene;

static const scene scenes[] = {
    {"hung", SOFT, SPRINGS, ", 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]", ""},
    {"ball", SOFT, SPRINGS, "",
     ", 'colliders': [{'type': 'sphere', 'center': [0.5, -0.302, -0.5], 'radius': 0.3}]"},
    {"denim", "'fabric': 'wang2011_denim', 'damping': 'none'", "'stretch.cst', 'bend.midedge'",
     ", 'pins': [{'box': [[0.29, 0, -0.71], [0.31, 0, -0.69]]}, {'box': [[0.69, 0, -0.31], [0.71, 0, "
     "-0.29]]}]",
     ""},
};

static void run(const char *method, const scene *c, int side, const char *linear, int steps, FILE *csv)
{
    struct rusage usage;
    drape_context *ctx = bench_context();
    const drape_setting settings[] = {{"dt", 1.0 / 60, NULL}, {"linear_solver", 0, linear}, {0}};
    drape_model *model = bench_model(ctx, sheet, side, side, c->material, c->terms, c->pins, c->colliders);
    drape_sim *sim = bench_sim(ctx, model, method, settings, "halving", NULL);
    const double start = drape_clock_cpu_seconds();
    if (drape_sim_advance(sim, steps / 60.0))
        bench_fail(ctx, "%s, %d nodes, %s", c->name, side * side, linear);
    const double seconds = drape_clock_cpu_seconds() - start;
    const drape_statistics w = drape_sim_statistics(sim);
    getrusage(RUSAGE_SELF, &usage);
    const double accepted = (double)w.steps_accepted, memory = 1024.0 * (double)usage.ru_maxrss;
    printf("%-5s %8d %-12s %5lld %4lld %9.3f %9.2f %9.2f %10.2f %8.0f\n", c->name, side * side, linear,
           (long long)w.steps_accepted, (long long)w.steps_rejected, seconds / accepted,
           (double)w.factorizations / accepted, (double)w.linear_iterations / accepted,
           (double)w.linear_iterations / (double)w.factorizations, 1e-6 * memory);
    fflush(stdout);
    if (csv) {
        bench_csv_row(csv);
        fprintf(csv, "%s,%s,%d,%s,%lld,%lld,%.4f,%lld,%lld,%.0f\n", method, c->name, side * side, linear,
                (long long)w.steps_accepted, (long long)w.steps_rejected, seconds,
                (long long)w.factorizations, (long long)w.linear_iterations, memory);
        fflush(csv);
    }
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
}

static void run_alone(const char *method, const scene *c, int side, const char *linear, int steps, FILE *csv)
{
    fflush(NULL); /* or the child would write what is buffered once more */
    const pid_t child = fork();
    if (child == 0) {
        run(method, c, side, linear, steps, csv);
        exit(0);
    }
    if (child > 0)
        waitpid(child, NULL, 0);
}

int main(int argc, char **argv)
{
    static const char *const linears[] = {"pcg", "multifrontal"};
    if (argc < 4 || argc > 5)
        return bench_usage(
            argc > 1 ? argv[1] : "",
            "large NODES STEPS METHOD [CSV]: STEPS/60 s of large sheets of about NODES nodes\n");
    const int side = (int)lround(sqrt(atof(argv[1]))), steps = atoi(argv[2]);
    FILE *csv = bench_csv(
        argc == 5 ? argv[4] : NULL,
        "method,scene,nodes,linear,steps,rejected,cpu_s,factorizations,linear_iterations,peak_bytes");
    printf("%-5s %8s %-12s %5s %4s %9s %9s %9s %10s %8s\n", "scene", "nodes", "linear", "steps", "rej.",
           "CPU s/step", "matrices", "lin. it.", "it./matrix", "peak MB");
    fflush(stdout);
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++)
        for (size_t k = 0; k < sizeof linears / sizeof *linears; k++)
            if (k == 0 || side * side <= DIRECT_NODES)
                run_alone(argv[3], &scenes[i], side, linears[k], steps, csv);
    return csv && fclose(csv) != 0;
}
