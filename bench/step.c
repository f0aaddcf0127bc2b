/*
 * step: milliseconds of a backward Euler step, split into its parts, for the DEP report's setting (four inner
 * pins, report stiffness, dt 0.01) over the report's own sizes, with every direct linear solver. The first
 * step, which chooses pivots, is left out; the total is the median over steps, the parts are means. CPU time
 * is of the process. Work is counted beside time, because machines are noisy and counts are not.
 */
#include "base/clock.h"
#include "drape/drape.h"
#include "solvers/linear.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

#define MAX_STEPS 200

typedef struct bench_case {
    int edges;
    const char *linear;
} bench_case;

static const int sizes[] = {4, 8, 12, 16, 22, 40, 49};

/* dense takes minutes a step beyond. */
static bool affordable(const bench_case *c)
{
    return c->edges <= 40 || strcmp(c->linear, "dense") != 0;
}

/* What was measured of one case. */
typedef struct measurement {
    int nodes, steps;
    long long unknowns, nonzeros;
    double median_ms, cpu_ms, residual_ms, jacobian_ms, factor_ms, solve_ms, newton, strain_max;
} measurement;

typedef struct settings {
    double budget; /* [s] a case */
    int steps, only_edges;
    const char *only_linear, *csv;
} settings;

static void scene_text(const bench_case *c, char *text, size_t size)
{
    int columns = c->edges + 1, low = c->edges / 3, high = 2 * c->edges / 3;
    snprintf(
        text, size,
        "{\"drape\":1,\"cloth\":[{\"mesh\":{\"grid\":\"equilateral\",\"edges\":%d,\"edge_length\":0.1},"
        "\"material\":{\"young_modulus\":1e5,\"thickness\":1e-3,\"total_mass\":0.01,\"mass\":\"uniform\"},"
        "\"terms\":[{\"type\":\"stretch.edge\",\"stiffness\":\"report\"},{\"type\":\"bend.hinge\","
        "\"stiffness\":\"report\"}],"
        "\"pins\":[{\"nodes\":[%d,%d,%d,%d]}]}],"
        "\"integrator\":{\"method\":\"be\",\"dt\":0.01,\"linear_solver\":\"%s\"},\"duration\":10}",
        c->edges, low * columns + low, low * columns + high, high * columns + low, high * columns + high,
        c->linear);
}

static drape_status make_sim(drape_context *ctx, const bench_case *c, drape_model **model, drape_sim **sim)
{
    char text[1024];
    drape_scene *scene = NULL;
    scene_text(c, text, sizeof text);
    drape_status status = drape_scene_parse(ctx, text, "bench", &scene);
    if (!status)
        status = drape_scene_compile(scene, model);
    drape_scene_destroy(&scene);
    return status ? status : drape_sim_create(ctx, *model, NULL, sim);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Steps until the number or the budget is used up. The first step, which chooses pivots, is left out,
 * unless it took the whole budget: then it is what there is. */
static drape_status run_steps(drape_sim *sim, const settings *set, measurement *m)
{
    double wall[MAX_STEPS], begin = drape_clock_seconds(), cpu = drape_clock_cpu_seconds();
    drape_status status = drape_sim_advance(sim, 0.01);
    drape_statistics before = {0}, after;
    wall[0] = 1e3 * (drape_clock_seconds() - begin);
    if (drape_clock_seconds() - begin > set->budget)
        m->steps = 1;
    else {
        before = drape_sim_statistics(sim);
        cpu = drape_clock_cpu_seconds();
    }
    while (!status && m->steps < set->steps && drape_clock_seconds() - begin < set->budget) {
        double start = drape_clock_seconds();
        status = drape_sim_advance(sim, 0.01 * (m->steps + 2));
        wall[m->steps++] = 1e3 * (drape_clock_seconds() - start);
    }
    after = drape_sim_statistics(sim);
    if (m->steps == 0)
        return status;
    qsort(wall, (size_t)m->steps, sizeof *wall, compare);
    m->median_ms = wall[m->steps / 2];
    m->cpu_ms = 1e3 * (drape_clock_cpu_seconds() - cpu) / m->steps;
    m->residual_ms = 1e3 * (after.wall_residual - before.wall_residual) / m->steps;
    m->jacobian_ms = 1e3 * (after.wall_jacobian - before.wall_jacobian) / m->steps;
    m->factor_ms = 1e3 * (after.wall_factor - before.wall_factor) / m->steps;
    m->solve_ms = 1e3 * (after.wall_solve - before.wall_solve) / m->steps;
    m->newton = (double)(after.newton_iterations - before.newton_iterations) / m->steps;
    m->strain_max = after.strain_max;
    return status;
}

static drape_status measure(const bench_case *c, const settings *set, measurement *m)
{
    drape_context *ctx = NULL;
    drape_model *model = NULL;
    drape_sim *sim = NULL;
    *m = (measurement){0};
    drape_status status = drape_context_create(NULL, &ctx);
    if (!status)
        status = make_sim(ctx, c, &model, &sim);
    if (!status) {
        m->nodes = drape_model_node_count(model);
        m->unknowns = drape_model_dof_count(model);
        m->nonzeros = drape_model_nonzero_count(model);
        status = run_steps(sim, set, m);
    }
    if (status)
        fprintf(stderr, "step: %d edges, %s: %s\n", c->edges, c->linear, drape_context_message(ctx));
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    return status;
}

static void print_row(const bench_case *c, const measurement *m)
{
    printf("%6d %-8s %8lld %9lld %6d %7.2f %10.3f %9.3f %9.3f %9.3f %9.3f %9.3f\n", m->nodes, c->linear,
           m->unknowns, m->nonzeros, m->steps, m->newton, m->median_ms, m->cpu_ms, m->residual_ms,
           m->jacobian_ms, m->factor_ms, m->solve_ms);
    fflush(stdout);
}

static void write_csv(FILE *csv, const bench_case *c, const measurement *m)
{
    struct utsname machine;
    const char *commit = getenv("BENCH_COMMIT");
    uname(&machine);
    fprintf(csv, "%s %s,%s,%s,%s,%d,%s,%lld,%lld,%d,%.3f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f\n", machine.sysname,
            machine.machine, commit ? commit : "unknown", BENCH_COMPILER, BENCH_OPTIONS, m->nodes, c->linear,
            m->unknowns, m->nonzeros, m->steps, m->newton, m->median_ms, m->cpu_ms, m->residual_ms,
            m->jacobian_ms, m->factor_ms, m->solve_ms);
}

static bool wanted(const bench_case *c, const settings *set)
{
    return affordable(c) && (set->only_edges == 0 || set->only_edges == c->edges) &&
           (!set->only_linear || strcmp(set->only_linear, c->linear) == 0);
}

static int run_case(const bench_case *c, const settings *set, FILE *csv)
{
    measurement m;
    if (measure(c, set, &m))
        return 1;
    print_row(c, &m);
    if (csv)
        write_csv(csv, c, &m);
    return 0;
}

static int run_cases(const settings *set)
{
    FILE *csv = set->csv ? fopen(set->csv, "w") : NULL;
    int failed = set->csv && !csv;
    if (failed)
        perror(set->csv);
    if (csv)
        fputs("machine,commit,compiler,build,nodes,linear,unknowns,nonzeros,steps,newton_a_step,median_ms,"
              "cpu_ms,residual_ms,"
              "jacobian_ms,factor_ms,solve_ms\n",
              csv);
    printf("%6s %-8s %8s %9s %6s %7s %10s %9s %9s %9s %9s %9s\n", "nodes", "linear", "unknowns", "nonzeros",
           "steps", "newton", "median ms", "cpu ms", "residual", "jacobian", "factor", "solve");
    for (int row = 0; drape_linears_words[row]; row++)
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
            const bench_case c = {sizes[i], drape_linears_words[row]};
            if (wanted(&c, set))
                failed |= run_case(&c, set, csv);
        }
    if (csv && fclose(csv) != 0)
        failed = 1;
    return failed;
}

static const char help[] =
    "step: milliseconds of a backward Euler step in the DEP report's setting, by size and linear solver\n"
    "  --steps N     measured steps a case, at most 200 (30)\n"
    "  --budget S    seconds a case, after which no further step begins (20)\n"
    "  --edges N     only this size: 4 8 12 16 22 40 49\n"
    "  --linear ROW  only this linear solver: a row of drape list\n"
    "  --csv FILE    write the rows there; BENCH_COMMIT in the environment names the commit\n"
    "dense at 40 edges (1 681 nodes) takes minutes a step; at least one step of every case is measured\n";

int main(int argc, char **argv)
{
    static const struct option options[] = {{"steps", required_argument, NULL, 's'},
                                            {"budget", required_argument, NULL, 'b'},
                                            {"edges", required_argument, NULL, 'e'},
                                            {"linear", required_argument, NULL, 'l'},
                                            {"csv", required_argument, NULL, 'c'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    settings set = {.budget = 20, .steps = 30};
    for (int option; (option = getopt_long(argc, argv, "", options, NULL)) != -1;)
        switch (option) {
        case 's':
            set.steps = atoi(optarg);
            break;
        case 'b':
            set.budget = atof(optarg);
            break;
        case 'e':
            set.only_edges = atoi(optarg);
            break;
        case 'l':
            set.only_linear = optarg;
            break;
        case 'c':
            set.csv = optarg;
            break;
        default:
            fputs(help, option == 'h' ? stdout : stderr);
            return option == 'h' ? 0 : 2;
        }
    if (set.steps < 1 || set.steps > MAX_STEPS || optind < argc) {
        fputs(help, stderr);
        return 2;
    }
    return run_cases(&set);
}
