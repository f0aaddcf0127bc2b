/*
 * speed: what a converged backward Euler step costs, as one table of cases. Two scenes:
 *     dep     the DEP report's setting: equilateral lattice, four inner pins, its stiffness, dt 0.01 s
 *     sheet   a square sheet of 1 m let go level from two corners, E h 1 000 N/m, D 1e-4 N m, 0.2 kg/m2, dt 1/60 s:
 *             the workload that other programs were measured on
 * The first step is left out. Milliseconds are a step's: CPU time of the process, wall time, and of that the parts; the
 * rest is what the framework takes. Work is counted beside time, because machines are noisy and counts are not. Equal
 * hashes are equal bits: of one thread and several.
 */
#include "bench.h"
#include "sim/profile.h"
#include "solvers/linear.h"

#include <inttypes.h>

typedef struct bench_case {
    const char *group;
    bool dep;
    int side; /* nodes */
    const char *linear;
    int threads;
    double seconds; /* that are simulated */
} bench_case;

static const bench_case cases[] = {
    {"dep", true, 5, "auto", 1, 0.6},           {"dep", true, 9, "auto", 1, 0.6},
    {"dep", true, 13, "auto", 1, 0.6},          {"dep", true, 17, "auto", 1, 0.6},
    {"dep", true, 23, "auto", 1, 0.6},          {"dep", true, 23, "klu", 1, 0.6},
    {"dep", true, 23, "cholmod", 1, 0.6},       {"dep", true, 23, "dense", 1, 0.03},
    {"dep", true, 41, "auto", 1, 0.6},          {"dep", true, 50, "auto", 1, 0.6},
    {"fall", false, 23, "auto", 1, 2},          {"fall", false, 50, "auto", 1, 2},
    {"fall", false, 100, "auto", 1, 2},         {"linear", false, 50, "auto", 1, 0.1},
    {"linear", false, 50, "cholmod", 1, 0.1},   {"linear", false, 50, "klu", 1, 0.1},
    {"growth", false, 5, "auto", 1, 0.1},       {"growth", false, 10, "auto", 1, 0.1},
    {"growth", false, 25, "auto", 1, 0.1},      {"growth", false, 50, "auto", 1, 0.1},
    {"growth", false, 100, "auto", 1, 0.1},     {"growth", false, 200, "auto", 1, 0.1},
    {"growth", false, 320, "auto", 1, 0.1},     {"cholmod", false, 50, "cholmod", 1, 0.1},
    {"cholmod", false, 100, "cholmod", 1, 0.1}, {"cholmod", false, 320, "cholmod", 1, 0.1},
    {"threads", false, 100, "auto", 1, 0.25},   {"threads", false, 100, "auto", 2, 0.25},
};

/* Of one case, a step; times in ms. */
typedef struct result {
    int nodes, steps;
    long long unknowns, nonzeros, rejected;
    double cpu, wall, residual, jacobian, factor, solve, contact;
    double newton, residuals, jacobians, factorizations, strain;
    size_t bytes;
    uint64_t hash;
} result;

static drape_model *dep_scene(drape_context *ctx, const bench_case *c)
{
    const int edges = c->side - 1, low = edges / 3, high = 2 * edges / 3;
    return bench_model(
        ctx,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'total_mass': 0.01, "
        "'mass': 'uniform'},"
        "'terms': [{'type': 'stretch.edge', 'stiffness': 'report'},"
        "{'type': 'bend.hinge', 'stiffness': 'report'}], 'pins': [{'nodes': [%d, %d, %d, %d]}]}],"
        "'integrator': {'method': 'be', 'dt': 0.01, 'linear_solver': '%s'}, 'duration': 10}",
        edges, low * c->side + low, low * c->side + high, high * c->side + low, high * c->side + high,
        c->linear);
}

static drape_model *sheet_scene(drape_context *ctx, const bench_case *c)
{
    return bench_model(
        ctx,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 1, "
        "'height': 1},"
        "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2},"
        "'terms': ['stretch.edge', 'bend.hinge'],"
        "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}],"
        "'integrator': {'method': 'be', 'linear_solver': '%s'}, 'duration': 10}",
        c->side, c->side, c->linear);
}

static size_t bytes_of(drape_context *ctx, drape_sim *sim)
{
    drape_profile profile;
    drape_profile_term *terms = calloc((size_t)sim->model->term_count, sizeof *terms);
    if (!terms || drape_profile_measure(ctx, sim, terms, &profile))
        bench_fail(ctx, "the profile");
    const size_t bytes = drape_profile_bytes(&profile);
    free(terms);
    return bytes;
}

/* The parts, from what was counted before and after. */
static void divide(result *r, const drape_statistics *a, const drape_statistics *b)
{
    const double steps = (double)(b->steps_accepted - a->steps_accepted), ms = 1e3 / steps;
    r->steps = (int)steps;
    r->rejected = (long long)(b->steps_rejected - a->steps_rejected);
    r->wall = ms * (b->wall_steps - a->wall_steps);
    r->residual = ms * (b->wall_residual - a->wall_residual);
    r->jacobian = ms * (b->wall_jacobian - a->wall_jacobian);
    r->factor = ms * (b->wall_factor - a->wall_factor);
    r->solve = ms * (b->wall_solve - a->wall_solve);
    r->contact = ms * (b->wall_contact - a->wall_contact);
    r->newton = (double)(b->newton_iterations - a->newton_iterations) / steps;
    r->residuals = (double)(b->residuals - a->residuals) / steps;
    r->jacobians = (double)(b->jacobians - a->jacobians) / steps;
    r->factorizations = (double)(b->factorizations - a->factorizations) / steps;
    r->strain = b->strain_max;
}

static result measure(const bench_case *c)
{
    result r = {0};
    drape_context *ctx = bench_context();
    drape_model *model = c->dep ? dep_scene(ctx, c) : sheet_scene(ctx, c);
    drape_sim *sim = NULL;
    drape_sim_def def;
    drape_sim_def_init(&def, sizeof def);
    def.threads = c->threads;
    if (drape_sim_create(ctx, model, &def, &sim) || drape_sim_advance(sim, c->dep ? 0.01 : 1.0 / 60))
        bench_fail(ctx, "%s", c->group);
    const drape_statistics before = drape_sim_statistics(sim);
    const double cpu = drape_clock_cpu_seconds();
    if (drape_sim_advance(sim, c->seconds))
        bench_fail(ctx, "%s", c->group);
    r.cpu = 1e3 * (drape_clock_cpu_seconds() - cpu);
    const drape_statistics after = drape_sim_statistics(sim);
    divide(&r, &before, &after);
    r.cpu /= r.steps;
    r.nodes = (int)drape_model_node_count(model);
    r.unknowns = drape_model_dof_count(model);
    r.nonzeros = drape_model_nonzero_count(model);
    r.hash = drape_sim_hash(sim);
    r.bytes = bytes_of(ctx, sim);
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    return r;
}

static double rest_of(const result *r)
{
    return r->wall - r->residual - r->jacobian - r->factor - r->solve - r->contact;
}

static void print(const bench_case *c, const result *r)
{
    printf("%-8s %6d %-8s %2d %5d %4lld %9.2f %9.2f %9.3f %9.3f %9.3f %9.3f %5.1f %6.2f %6.2f %6.2f %7zu "
           "%016" PRIx64 "\n",
           c->group, r->nodes, c->linear, c->threads, r->steps, r->rejected, r->cpu, r->wall, r->residual,
           r->jacobian, r->factor, r->solve, 100 * rest_of(r) / r->wall, r->newton, r->residuals,
           r->factorizations, r->bytes / (size_t)r->nodes, r->hash);
    fflush(stdout);
}

static void write_row(FILE *csv, const bench_case *c, const result *r)
{
    bench_csv_row(csv);
    fprintf(csv,
            "%s,%d,%s,%d,%lld,%lld,%d,%lld,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.3f,%.3f,%.3f,%.3f,%zu,%.5f,%"
            "016" PRIx64 "\n",
            c->group, r->nodes, c->linear, c->threads, r->unknowns, r->nonzeros, r->steps, r->rejected,
            r->cpu, r->wall, r->residual, r->jacobian, r->factor, r->solve, rest_of(r), r->newton,
            r->residuals, r->jacobians, r->factorizations, r->bytes, r->strain, r->hash);
    fflush(csv);
}

/* What the goals are about: growth, threads, overhead. */
static void conclude(const char *group, const result *first, const result *last, int count)
{
    if (count < 2)
        return;
    if (strcmp(group, "threads") == 0)
        printf("threads: %.2f times faster, %s bits\n", first->wall / last->wall,
               first->hash == last->hash ? "the same" : "OTHER");
    if (strcmp(group, "growth") == 0 || strcmp(group, "cholmod") == 0)
        printf("%s: from %d to %d nodes a Newton iteration grows with the exponent %.2f, a step with %.2f\n",
               group, first->nodes, last->nodes,
               log(last->cpu / last->newton * first->newton / first->cpu) /
                   log((double)last->nodes / first->nodes),
               log(last->cpu / first->cpu) / log((double)last->nodes / first->nodes));
}

static bool is_row(const char *name)
{
    for (int i = 0; drape_linears_words[i]; i++)
        if (strcmp(drape_linears_words[i], name) == 0)
            return true;
    return false;
}

static void run_group(const char *group, int most, FILE *csv)
{
    result first = {0}, last = {0};
    int count = 0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const bench_case *c = &cases[i];
        if (strcmp(c->group, group) != 0 || c->side * c->side > most || !is_row(c->linear))
            continue;
        last = measure(c);
        if (count == 0 || first.nodes < 2500) /* growth counts from there on */
            first = last;
        count++;
        print(c, &last);
        if (csv)
            write_row(csv, c, &last);
    }
    conclude(group, &first, &last, count);
}

static const char help[] = "speed [GROUP [CSV [NODES]]]: milliseconds of a converged backward Euler step, by "
                           "size, linear solver and threads\n"
                           "  GROUP  all, dep, fall, linear, growth, cholmod or threads; NODES: none larger; "
                           "BENCH_COMMIT names the commit\n";

int main(int argc, char **argv)
{
    const char *only = argc >= 2 ? argv[1] : "all", *done = "";
    if (argc > 4 || only[0] == '-')
        return bench_usage(only, help);
    const int most = argc == 4 ? atoi(argv[3]) : INT32_MAX;
    FILE *csv =
        bench_csv(argc >= 3 && *argv[2] ? argv[2] : NULL,
                  "group,nodes,linear,threads,unknowns,nonzeros,steps,rejected,cpu_ms,wall_ms,residual_ms,"
                  "jacobian_ms,factor_ms,solve_ms,rest_ms,newton,residuals,jacobians,factorizations,bytes,"
                  "strain_max,hash");
    printf("%-8s %6s %-8s %2s %5s %4s %9s %9s %9s %9s %9s %9s %5s %6s %6s %6s %7s %s\n", "group", "nodes",
           "linear", "th", "steps", "rej", "cpu ms", "wall ms", "residual", "jacobian", "factor", "solve",
           "rest%", "newton", "resid.", "factor", "B/node", "hash");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *group = cases[i].group;
        if (strcmp(group, done) != 0 && (strcmp(only, "all") == 0 || strcmp(only, group) == 0))
            run_group(group, most, csv);
        done = group;
    }
    return csv && fclose(csv) != 0;
}
