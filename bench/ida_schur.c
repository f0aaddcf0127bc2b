/*
 * ida_schur: what IDA gains from eliminating the velocities. It compares the CPU time of the integrator
 * "ida", whose linear solver gets the n x n Schur complement K + c_j D + c_j^2 M, with that of the same IDA
 * on the full system of 2 n unknowns, with SUNDIALS' own sparse matrix and KLU, under the ordering that is
 * faster there. The reduced system is solved with the solver that `auto` picks and, as the full one, with
 * KLU. The scene is a square sheet hung by two corners, undamped, rtol 1e-3, max_order 2, as in `work`. Both
 * take the same steps, as the printed counts show. The goal is a factor of 3 at 2 500 nodes.
 */
#include "bench.h"
#include "support/ida_full.h"

#define RTOL     1e-3
#define DURATION 0.1 /* [s] */
#define REPEATS  3

typedef struct run {
    double seconds; /* [s] CPU, least of the repeats, with setup */
    long steps, residuals, jacobians;
    double x, y, z; /* [m] position of the last node at the end */
} run;

static drape_model *sheet(drape_context *ctx, int side)
{
    return bench_model(ctx,
                       "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, "
                       "'width': 1, 'height': 1},"
                       "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2},"
                       "'terms': ['stretch.edge', 'bend.hinge'],"
                       "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}], 'duration': 1}",
                       side, side);
}

static void place(run *r, const drape_model *model, const double *x)
{
    const double *last = x + 3 * (size_t)(model->node_count - 1);
    r->x = last[0];
    r->y = last[1];
    r->z = last[2];
}

static run run_schur(drape_context *ctx, const drape_model *model, const char *linear)
{
    const drape_setting settings[] = {
        {"rtol", RTOL, NULL}, {"max_order", 2, NULL}, {"linear_solver", 0, linear}, {0}};
    double start = drape_clock_cpu_seconds();
    drape_sim *sim = bench_sim(ctx, model, "ida", settings, NULL, NULL);
    if (drape_sim_advance(sim, DURATION))
        bench_fail(ctx, "ida");
    const drape_statistics s = drape_sim_statistics(sim);
    run r = {.seconds = drape_clock_cpu_seconds() - start,
             .steps = (long)s.steps_accepted,
             .residuals = (long)s.residuals,
             .jacobians = (long)s.jacobians};
    place(&r, model, drape_sim_positions(sim));
    drape_sim_destroy(&sim);
    return r;
}

static run run_full(drape_context *ctx, const drape_model *model, int ordering)
{
    ida_full full;
    double start = drape_clock_cpu_seconds(), speed = sqrt(9.81 * model->length);
    if (!ida_full_open(&full, ctx, model, RTOL * model->length, RTOL * speed, 2, ordering))
        bench_fail(ctx, "the full system");
    while (full.now.t < DURATION)
        if (ida_full_step(&full, DURATION) < 0)
            bench_fail(ctx, "the full system at %g s", full.now.t);
    run r = {.seconds = drape_clock_cpu_seconds() - start,
             .residuals = full.residuals,
             .jacobians = full.jacobians};
    IDAGetNumSteps(full.ida, &r.steps);
    place(&r, model, full.now.x);
    ida_full_close(&full);
    return r;
}

static void print(const char *name, int nodes, const run *r)
{
    printf("%6d %-12s %9.3f %6ld %9ld %9ld   %.12g %.12g %.12g\n", nodes, name, r->seconds, r->steps,
           r->residuals, r->jacobians, r->x, r->y, r->z);
    fflush(stdout);
}

static void keep_least(run *least, run one)
{
    if (least->seconds == 0 || one.seconds < least->seconds)
        *least = one;
}

static void compare(int side, FILE *csv)
{
    drape_context *ctx = bench_context();
    drape_model *model = sheet(ctx, side);
    run schur = {0}, klu = {0}, amd = {0}, colamd = {0};
    for (int i = 0; i < REPEATS; i++) {
        keep_least(&schur, run_schur(ctx, model, "auto"));
        keep_least(&klu, run_schur(ctx, model, "klu"));
        keep_least(&amd, run_full(ctx, model, IDA_FULL_AMD));
        keep_least(&colamd, run_full(ctx, model, IDA_FULL_COLAMD));
    }
    print("schur", side * side, &schur);
    print("schur klu", side * side, &klu);
    print("full amd", side * side, &amd);
    print("full colamd", side * side, &colamd);
    double full = fmin(amd.seconds, colamd.seconds), ratio = full / schur.seconds;
    printf("%6d nodes: full over schur %.2f, with klu %.2f, default ordering over schur %.2f%s\n",
           side * side, ratio, full / klu.seconds, colamd.seconds / schur.seconds,
           side * side < 2500 ? ""
           : ratio >= 3       ? ": goal 3 reached"
                              : ": goal 3 missed");
    if (csv) {
        bench_csv_row(csv);
        fprintf(csv, "%d,%ld,%ld,%ld,%.4f,%.4f,%.4f,%.4f\n", side * side, schur.steps, schur.residuals,
                schur.jacobians, schur.seconds, klu.seconds, amd.seconds, colamd.seconds);
    }
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
}

int main(int argc, char **argv)
{
    static const int sides[] = {12, 25, 50};
    if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
        return bench_usage(
            argv[1], "ida_schur [CSV]: CPU seconds of ida with the reduced system and with the full one\n");
    }
    FILE *csv =
        bench_csv(argc == 2 ? argv[1] : NULL,
                  "nodes,steps,residuals,jacobians,schur_auto_s,schur_klu_s,full_amd_s,full_colamd_s");
    printf("%6s %-12s %9s %6s %9s %9s   %s\n", "nodes", "system", "CPU s", "steps", "residuals", "jacobians",
           "last node [m]");
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        compare(sides[i], csv);
    return csv && fclose(csv) != 0;
}
