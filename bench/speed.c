/*
 * speed: the cost of a step with each method and its error, as one table of cases. A group is a scene with
 * several sizes and methods; a method is an integrator with its settings. Two scenes:
 *     dep     the setting of the DEP report: equilateral lattice, four inner pins, its stiffness, dt 0.01 s
 *     sheet   a square sheet of 1 m, released horizontally, hanging by two corners; E h = 1 000 N/m,
 *             D = 1e-4 N m, 0.2 kg/m2, dt 1/60 s: the workload that other programs were measured with
 * The first step, with its one-time work, is left out. Times are milliseconds per step: CPU time of the
 * process (mean, median and maximum), wall time and its parts; the rest is overhead of the framework.
 * Small cases are repeated. Every repeat computes the same, so the CPU time of a step is the least over the
 * repeats, and the wall times are those of the fastest repeat. Work is counted too, because times on a busy
 * machine vary and counts do not. Equal hashes mean equal bits, as with one thread and with several. Errors
 * are relative to backward Euler at the same step, solved to 1e-6 N: rms and largest distance of the nodes
 * after 0.5 s, and the rms strain of the edges beside that of the converged sheet; nan if there is nothing
 * to compare with.
 */
#include "bench.h"
#include "sim/profile.h"
#include "solvers/linear.h"

#include <errno.h>
#include <inttypes.h>

#define MAX_STEPS    256
#define MAX_SIDES    8
#define MAX_METHODS  7
#define COMPARE_AT   30    /* steps of 1/60 s */
#define MAX_COMPARED 11000 /* nodes: for larger sheets the converged run takes too long */
#define GROWTH_FROM  2500  /* nodes */
#define NAN_RESULT                                                                                           \
    {                                                                                                        \
        .rms_mm = NAN, .largest_mm = NAN, .strain_rms = NAN, .strain_converged = NAN                         \
    }

/* ---- The table ---- */

typedef enum scene_kind { DEP, SHEET } scene_kind;

typedef struct method {
    const char *name, *integrator;
    drape_setting settings[3];
    int threads;
    int max_nodes; /* 0: unlimited. Larger cases take minutes and show nothing new */
} method;

static const method be = {"be", "be", {{NULL, 0, NULL}}, 1}, be_two = {"be", "be", {{NULL, 0, NULL}}, 2},
                    be_klu = {"be klu", "be", {{"linear_solver", 0, "klu"}}, 1},
                    be_dense = {"be dense", "be", {{"linear_solver", 0, "dense"}}, 1},
                    be_pcg = {"be pcg",
                              "be",
                              {{"linear_solver", 0, "pcg"}, {"linear_tolerance", 0.01, NULL}},
                              1,
                              2500},
                    newton_1 = {"newton_k 1", "newton_k", {{NULL, 0, NULL}}, 1},
                    newton_2 = {"newton_k 2", "newton_k", {{"iterations", 2, NULL}}, 1},
                    newton_3 = {"newton_k 3", "newton_k", {{"iterations", 3, NULL}}, 1};

typedef struct bench_group {
    const char *name;
    scene_kind scene;
    double seconds; /* simulated time */
    int sides[MAX_SIDES];
    const method *methods[MAX_METHODS];
    bool compared;
} bench_group;

static const bench_group groups[] = {
    {"dep", DEP, 0.6, {5, 9, 13, 17, 23, 41, 50}, {&be}, false},
    {"dep_linear", DEP, 0.6, {23}, {&be, &be_klu}, false},
    {"dep_dense", DEP, 0.03, {23}, {&be, &be_dense}, false},
    {"fall", SHEET, 2, {23, 50, 100}, {&be}, false},
    {"linear", SHEET, 0.1, {50}, {&be, &be_klu}, false},
    {"growth", SHEET, 0.1, {5, 10, 25, 50, 100, 160, 226, 320}, {&be}, false},
    {"threads", SHEET, 0.25, {100}, {&be, &be_two}, false},
    {"levels", SHEET, 2, {5, 12, 23, 50, 100}, {&newton_1, &newton_2, &newton_3, &be_pcg, &be}, true},
    {"levels_growth", SHEET, 0.5, {50, 100, 160, 226, 320}, {&newton_1, &newton_2, &newton_3}, false},
};

/* The results of a method at one size, per step; times in ms. */
typedef struct result {
    int nodes, steps;
    long long unknowns, nonzeros, rejected;
    double cpu, median, worst, wall, residual, jacobian, factor, solve, contact;
    double newton, residuals, jacobians, factorizations, iterations;
    double residual_left; /* [N] largest residual of an accepted step */
    double rms_mm, largest_mm, strain_rms, strain_converged, strain_max;
    size_t bytes;
    uint64_t hash;
} result;

/* ---- The scenes ---- */

static double step_of(scene_kind scene)
{
    return scene == DEP ? 0.01 : 1.0 / 60;
}

static drape_model *dep_scene(drape_context *ctx, int side)
{
    const int edges = side - 1, low = edges / 3, high = 2 * edges / 3;
    return bench_model(
        ctx,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'total_mass': 0.01, "
        "'mass': 'uniform'},"
        "'terms': [{'type': 'stretch.edge', 'stiffness': 'report'},"
        "{'type': 'bend.hinge', 'stiffness': 'report'}], 'pins': [{'nodes': [%d, %d, %d, %d]}]}],"
        "'integrator': {'method': 'be', 'dt': 0.01}, 'duration': 10}",
        edges, low * side + low, low * side + high, high * side + low, high * side + high);
}

static drape_model *sheet_scene(drape_context *ctx, int side)
{
    return bench_model(
        ctx,
        "{'drape':1,'cloth':[{'mesh':{'grid':'square','columns':%d,'rows':%d,'width':1,'height':1},"
        "'material':{'young_modulus':968245.8365518542,'poisson_ratio':0.3333333333333333,"
        "'thickness':1.0327955589886444e-3,'areal_density':0.2},"
        "'terms':['stretch.edge','bend.hinge'],'pins':[{'corner':'top-left'},{'corner':'top-right'}]}],"
        "'duration':10}",
        side, side);
}

/* ---- Errors ---- */

/* Root mean square of |e|/L - 1. */
static double strain_of(const drape_model *m, const double *x)
{
    double sum = 0;
    for (int32_t e = 0; e < m->edge_count; e++) {
        const double *a = x + 3 * (size_t)m->edge[2 * (size_t)e],
                     *b = x + 3 * (size_t)m->edge[2 * (size_t)e + 1];
        double length = sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]) +
                             (b[2] - a[2]) * (b[2] - a[2]));
        sum += (length / m->edge_length[e] - 1) * (length / m->edge_length[e] - 1);
    }
    return sqrt(sum / m->edge_count);
}

static void compare_states(const drape_model *m, const double *x, const double *converged, result *r)
{
    double sum = 0, largest = 0;
    for (size_t i = 0; i < (size_t)m->node_count; i++) {
        double square = 0;
        for (size_t k = 3 * i; k < 3 * i + 3; k++)
            square += (x[k] - converged[k]) * (x[k] - converged[k]);
        sum += square;
        largest = fmax(largest, square);
    }
    r->rms_mm = 1e3 * sqrt(sum / m->node_count);
    r->largest_mm = 1e3 * sqrt(largest);
    r->strain_rms = strain_of(m, x);
    r->strain_converged = strain_of(m, converged);
}

/* Positions of the converged run at COMPARE_AT; NULL if nothing is compared. */
static double *make_converged(const bench_group *g, int side)
{
    if (!g->compared || side * side > MAX_COMPARED)
        return NULL;
    drape_context *ctx = bench_context();
    drape_model *m = sheet_scene(ctx, side);
    drape_sim *sim = bench_sim(ctx, m, "be", NULL, NULL, NULL);
    if (drape_sim_advance(sim, COMPARE_AT * step_of(SHEET)))
        bench_fail(ctx, "the converged run");
    const size_t bytes = 3 * (size_t)m->node_count * sizeof(double);
    double *x = malloc(bytes);
    if (!x)
        exit(1);
    memcpy(x, drape_sim_positions(sim), bytes);
    drape_sim_destroy(&sim);
    drape_model_destroy(&m);
    drape_context_destroy(&ctx);
    return x;
}

static drape_status keep_residual(void *user, const drape_event *event)
{
    double *left = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted)
        *left = fmax(*left, event->attempt->residual);
    return DRAPE_OK;
}

/* ---- One run ---- */

static drape_sim *open_sim(drape_context *ctx, const drape_model *m, const method *g)
{
    drape_sim *sim = NULL;
    drape_sim_def def;
    drape_sim_def_init(&def, sizeof def);
    def.integrator = g->integrator;
    def.integrator_settings = g->settings;
    def.integrator_setting_count = bench_count(g->settings);
    def.threads = g->threads;
    if (drape_sim_create(ctx, m, &def, &sim))
        bench_fail(ctx, "%s", g->name);
    return sim;
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

/* Sets counts and parts per step, from the statistics before and after. */
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
    r->iterations = (double)(b->linear_iterations - a->linear_iterations) / steps;
    r->strain_max = b->strain_max;
}

/* least: (MAX_STEPS) [s] least CPU time of each step over the repeats so far. */
static void run_once(const bench_group *group, int side, const method *g, const double *converged,
                     double *least, result *r)
{
    const double dt = step_of(group->scene);
    drape_context *ctx = bench_context();
    drape_model *model = (group->scene == DEP ? dep_scene : sheet_scene)(ctx, side);
    drape_sim *sim = open_sim(ctx, model, g);
    result now = NAN_RESULT;
    drape_sim_observe(sim, keep_residual, &now.residual_left);
    if (drape_sim_advance(sim, dt))
        bench_fail(ctx, "%s, %s", group->name, g->name);
    const drape_statistics before = drape_sim_statistics(sim);
    for (int k = 0; k < MAX_STEPS && (k + 1.5) * dt < group->seconds; k++) {
        const double cpu = drape_clock_cpu_seconds();
        if (drape_sim_advance(sim, (k + 2) * dt))
            bench_fail(ctx, "%s, %s", group->name, g->name);
        least[k] = fmin(least[k], drape_clock_cpu_seconds() - cpu);
        if (k + 2 == COMPARE_AT && converged)
            compare_states(model, drape_sim_positions(sim), converged, &now);
    }
    const drape_statistics after = drape_sim_statistics(sim);
    divide(&now, &before, &after);
    now.nodes = (int)drape_model_node_count(model);
    now.unknowns = drape_model_dof_count(model);
    now.nonzeros = drape_model_nonzero_count(model);
    now.hash = drape_sim_hash(sim);
    now.bytes = r->bytes ? r->bytes : bytes_of(ctx, sim);
    if (r->steps == 0 || now.wall < r->wall)
        *r = now;
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
}

static int repeats_of(int side, const method *g)
{
    return g == &be_dense || side > 50 ? 1 : side > 25 ? 3 : 7;
}

static result measure(const bench_group *group, int side, const method *g, const double *converged)
{
    result r = NAN_RESULT;
    double least[MAX_STEPS];
    int count = 0;
    for (int k = 0; k < MAX_STEPS; k++)
        least[k] = INFINITY;
    for (int i = 0; i < repeats_of(side, g); i++)
        run_once(group, side, g, converged, least, &r);
    for (; count < MAX_STEPS && isfinite(least[count]); count++)
        r.cpu += 1e3 * least[count] / r.steps;
    qsort(least, (size_t)count, sizeof *least, bench_compare);
    r.median = 1e3 * least[count / 2];
    r.worst = 1e3 * least[count - 1];
    return r;
}

/* ---- Output ---- */

static double rest_of(const result *r)
{
    return r->wall - r->residual - r->jacobian - r->factor - r->solve - r->contact;
}

static const char csv_columns[] =
    "group,nodes,method,threads,unknowns,nonzeros,steps,rejected,cpu_ms,median_cpu_ms,worst_cpu_ms,wall_ms,"
    "residual_ms,"
    "jacobian_ms,factor_ms,solve_ms,contact_ms,rest_ms,newton,residuals,jacobians,factorizations,linear_"
    "iterations,"
    "residual_n,rms_mm,largest_mm,strain_percent,converged_strain_percent,strain_max,bytes,hash";

static void print_head(void)
{
    printf("%-12s %6s %-13s %2s %5s %4s %9s %9s %9s %9s %9s %9s %9s %5s %6s %6s %6s %6s %7s %6s %7s %s\n",
           "group", "nodes", "method", "th", "steps", "rej", "cpu ms", "median", "wall ms", "residual",
           "jacobian", "factor", "solve", "rest%", "newton", "resid.", "factor", "linear", "rms mm", "strain",
           "B/node", "hash");
}

static void print(const char *group, const method *g, const result *r)
{
    printf("%-12s %6d %-13s %2d %5d %4lld %9.3f %9.3f %9.3f %9.3f %9.3f %9.3f %9.3f %5.1f %6.2f %6.2f %6.2f "
           "%6.1f "
           "%7.3f %6.4f %7zu %016" PRIx64 "\n",
           group, r->nodes, g->name, g->threads, r->steps, r->rejected, r->cpu, r->median, r->wall,
           r->residual, r->jacobian, r->factor, r->solve, 100 * rest_of(r) / r->wall, r->newton, r->residuals,
           r->factorizations, r->iterations, r->rms_mm, 100 * r->strain_rms, r->bytes / (size_t)r->nodes,
           r->hash);
    fflush(stdout);
}

static void write_row(FILE *csv, const char *group, const method *g, const result *r)
{
    bench_csv_row(csv);
    fprintf(csv, "%s,%d,%s,%d,%lld,%lld,%d,%lld,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,", group,
            r->nodes, g->name, g->threads, r->unknowns, r->nonzeros, r->steps, r->rejected, r->cpu, r->median,
            r->worst, r->wall, r->residual, r->jacobian, r->factor, r->solve, r->contact, rest_of(r));
    fprintf(csv, "%.3f,%.3f,%.3f,%.3f,%.2f,%.4g,%.4f,%.3f,%.5f,%.5f,%.5f,%zu,%016" PRIx64 "\n", r->newton,
            r->residuals, r->jacobians, r->factorizations, r->iterations, r->residual_left, r->rms_mm,
            r->largest_mm, 100 * r->strain_rms, 100 * r->strain_converged, r->strain_max, r->bytes, r->hash);
    fflush(csv);
}

/* A fit of step time over node count, for one method over the sizes of a group. */
typedef struct growth {
    int first, last, count; /* nodes, from GROWTH_FROM on */
    double x, y, xx, xy;    /* sums of logarithms */
} growth;

static void add_to_growth(growth *a, const result *r)
{
    if (r->nodes < GROWTH_FROM)
        return;
    const double x = log(r->nodes), y = log(r->median);
    if (a->count++ == 0)
        a->first = r->nodes;
    a->last = r->nodes;
    a->x += x;
    a->y += y;
    a->xx += x * x;
    a->xy += x * y;
}

/* Prints the slope, by least squares in logarithms. */
static void print_growth(const method *g, const growth *a)
{
    if (a->count > 1)
        printf("%s: from %d to %d nodes the median time of a step grows as the number of nodes to the power "
               "%.2f\n",
               g->name, a->first, a->last,
               (a->count * a->xy - a->x * a->y) / (a->count * a->xx - a->x * a->x));
}

/* Compares two methods that differ only in their number of threads. */
static void print_threads(const method *const *g, const result *r)
{
    if (g[1] && g[1]->threads != g[0]->threads)
        printf("%d threads: %.2f times faster, %s bits\n", g[1]->threads, r[0].wall / r[1].wall,
               r[0].hash == r[1].hash ? "the same" : "DIFFERENT");
}

/* ---- The groups ---- */

static bool is_for(const method *g, int side)
{
    if (g->max_nodes > 0 && side * side > g->max_nodes)
        return false;
    const drape_setting *linear = &g->settings[0];
    return !linear->name || strcmp(linear->name, "linear_solver") != 0 ||
           drape_registry_find(&drape_linear_registry, NULL, linear->text) >= 0;
}

static void run_side(const bench_group *group, int side, FILE *csv, growth *grown)
{
    double *converged = make_converged(group, side);
    result r[MAX_METHODS];
    for (int k = 0; k < MAX_METHODS && group->methods[k]; k++) {
        const method *g = group->methods[k];
        if (!is_for(g, side))
            continue;
        r[k] = measure(group, side, g, converged);
        print(group->name, g, &r[k]);
        add_to_growth(&grown[k], &r[k]);
        if (csv)
            write_row(csv, group->name, g, &r[k]);
    }
    print_threads(group->methods, r);
    free(converged);
}

static void run_group(const bench_group *group, int max_nodes, FILE *csv)
{
    growth grown[MAX_METHODS] = {{0}};
    for (int i = 0; i < MAX_SIDES && group->sides[i]; i++)
        if (group->sides[i] * group->sides[i] <= max_nodes)
            run_side(group, group->sides[i], csv, grown);
    for (int k = 0; k < MAX_METHODS && group->methods[k]; k++)
        print_growth(group->methods[k], &grown[k]);
}

static int usage(const char *argument)
{
    char text[600];
    int length = snprintf(
        text, sizeof text,
        "speed [GROUP [CSV [NODES]]]: milliseconds per step with each method, its parts and its error\n"
        "  GROUP  all");
    for (size_t i = 0; i < sizeof groups / sizeof *groups; i++)
        length += snprintf(text + length, sizeof text - (size_t)length, ", %s", groups[i].name);
    snprintf(text + length, sizeof text - (size_t)length,
             "\n  NODES  the largest size; BENCH_COMMIT in the environment names the commit\n");
    return bench_usage(argument, text);
}

/* 0: not a valid number of nodes. */
static int read_nodes(const char *text)
{
    char *end;
    errno = 0;
    const long nodes = strtol(text, &end, 10);
    return end == text || *end || errno || nodes < 1 || nodes > INT32_MAX ? 0 : (int)nodes;
}

int main(int argc, char **argv)
{
    const char *only = argc >= 2 ? argv[1] : "all";
    bool known = strcmp(only, "all") == 0;
    for (size_t i = 0; i < sizeof groups / sizeof *groups; i++)
        known |= strcmp(only, groups[i].name) == 0;
    if (argc > 4 || !known)
        return usage(only);
    const int max_nodes = argc == 4 ? read_nodes(argv[3]) : INT32_MAX;
    if (max_nodes == 0) {
        fprintf(stderr, "speed: NODES \"%s\": it is an integer, 1 to %d\n", argv[3], INT32_MAX);
        return 2;
    }
    FILE *csv = bench_csv(argc >= 3 && *argv[2] ? argv[2] : NULL, csv_columns);
    print_head();
    for (size_t i = 0; i < sizeof groups / sizeof *groups; i++)
        if (strcmp(only, "all") == 0 || strcmp(only, groups[i].name) == 0)
            run_group(&groups[i], max_nodes, csv);
    return csv && fclose(csv) != 0;
}
