/*
 * realtime: what a frame of 1/60 s costs on each rung, and how far its state is from the converged step. A square
 * sheet of 1 m hung by two corners, 0.2 kg/m2, E h = 1 000 N/m, D = 1e-4 N m, which falls and swings for 2 s: the
 * scene for which other simulators were measured. CPU time is of the process, of one thread; the first frame, which
 * factors afresh, is in the mean and not in the median. Errors are against backward Euler at the same step, solved to
 * 1e-6 N: positions after 0.5 s, rms and largest, and the rms strain of the edges beside that of the converged
 * sheet. Above --reference nodes there is no converged run to compare with.
 */
#include "bench.h"

#include <getopt.h>

#define FRAME      (1.0 / 60)
#define MOST       120 /* frames */
#define COMPARE_AT 30  /* frames: 0.5 s */

static const int sides[] = {5, 12, 23, 50, 100, 160, 226, 320};

typedef struct rung {
    const char *name, *integrator;
    drape_setting settings[4];
    int most_nodes;
} rung;

static const rung rungs[] = {
    {"projective 10", "projective", {{NULL, 0, NULL}}, 200000},
    {"newton_k 1", "newton_k", {{NULL, 0, NULL}}, 200000},
    {"newton_k 2", "newton_k", {{"iterations", 2, NULL}}, 200000},
    {"newton_k 3", "newton_k", {{"iterations", 3, NULL}}, 200000},
    {"be pcg", "be", {{"linear_solver", 0, "pcg"}, {"linear_tolerance", 0.01, NULL}}, 11000},
    {"be", "be", {{NULL, 0, NULL}}, 11000},
};

typedef struct request {
    int only_side, most_reference, long_frames;
    const char *only_rung, *csv;
} request;

typedef struct result {
    int frames;
    double median_ms, mean_ms, worst_ms, residual_ms, jacobian_ms, factor_ms, solve_ms;
    double iterations, linear, rejected, bytes;
    double rms_mm, largest_mm, strain, strain_reference, strain_max, residual;
} result;

static drape_model *make_model(drape_context *ctx, int side)
{
    return bench_model(
        ctx,
        "{'drape':1,'cloth':[{'mesh':{'grid':'square','columns':%d,'rows':%d,'width':1,'height':1},"
        "'material':{'young_modulus':968245.8365518542,'poisson_ratio':0.3333333333333333,"
        "'thickness':1.0327955589886444e-3,'areal_density':0.2},"
        "'terms':['stretch.edge','bend.hinge'],'pins':[{'corner':'top-left'},{'corner':'top-right'}]}],"
        "'duration':2}",
        side, side);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

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

static void compare_states(const drape_model *m, const double *x, const double *reference, result *r)
{
    double sum = 0, most = 0;
    for (size_t i = 0; i < (size_t)m->node_count; i++) {
        double square = 0;
        for (size_t k = 3 * i; k < 3 * i + 3; k++)
            square += (x[k] - reference[k]) * (x[k] - reference[k]);
        sum += square;
        most = fmax(most, square);
    }
    r->rms_mm = 1e3 * sqrt(sum / m->node_count);
    r->largest_mm = 1e3 * sqrt(most);
    r->strain_reference = strain_of(m, reference);
}

/* Positions of the converged run after 0.5 s; NULL where it would take too long. */
static double *make_reference(drape_context *ctx, const drape_model *m, const request *q)
{
    if (m->node_count > q->most_reference)
        return NULL;
    drape_sim *sim = bench_sim(ctx, m, "be", NULL, NULL, NULL);
    if (drape_sim_advance(sim, COMPARE_AT * FRAME))
        bench_fail(ctx, "the converged run");
    size_t bytes = 3 * (size_t)m->node_count * sizeof(double);
    double *x = malloc(bytes);
    memcpy(x, drape_sim_positions(sim), bytes);
    drape_sim_destroy(&sim);
    return x;
}

static drape_status keep_residual(void *user, const drape_event *event)
{
    double *residual = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted)
        *residual = fmax(*residual, event->attempt->residual);
    return DRAPE_OK;
}

static void average(const drape_sim *sim, result *r)
{
    const drape_statistics s = drape_sim_statistics(sim);
    r->iterations = (double)s.newton_iterations / r->frames;
    r->linear = (double)s.linear_iterations / r->frames;
    r->rejected = (double)s.steps_rejected;
    r->residual_ms = 1e3 * s.wall_residual / r->frames;
    r->jacobian_ms = 1e3 * s.wall_jacobian / r->frames;
    r->factor_ms = 1e3 * s.wall_factor / r->frames;
    r->solve_ms = 1e3 * s.wall_solve / r->frames;
    r->strain_max = s.strain_max;
    r->bytes = (double)sim->chosen.integrator->bytes(sim->integrator) / sim->model->node_count;
}

static result measure(drape_context *ctx, const drape_model *m, const rung *g, const double *reference,
                      const request *q)
{
    result r = {.frames = m->node_count <= q->long_frames ? MOST : COMPARE_AT,
                .rms_mm = NAN,
                .largest_mm = NAN,
                .strain_reference = NAN};
    drape_sim *sim = bench_sim(ctx, m, g->integrator, g->settings, NULL, NULL);
    double ms[MOST], start = drape_clock_cpu_seconds();
    drape_sim_observe(sim, keep_residual, &r.residual);
    for (int k = 0; k < r.frames; k++) {
        double before = drape_clock_cpu_seconds();
        if (drape_sim_advance(sim, (k + 1) * FRAME))
            bench_fail(ctx, "%s at %d nodes", g->name, (int)m->node_count);
        ms[k] = 1e3 * (drape_clock_cpu_seconds() - before);
        if (k + 1 == COMPARE_AT && reference)
            compare_states(m, drape_sim_positions(sim), reference, &r);
        if (k + 1 == COMPARE_AT)
            r.strain = strain_of(m, drape_sim_positions(sim));
    }
    r.mean_ms = 1e3 * (drape_clock_cpu_seconds() - start) / r.frames;
    average(sim, &r);
    qsort(ms, (size_t)r.frames, sizeof *ms, compare);
    r.median_ms = ms[r.frames / 2];
    r.worst_ms = ms[r.frames - 1];
    drape_sim_destroy(&sim);
    return r;
}

static void print(FILE *csv, const rung *g, int nodes, const result *r)
{
    printf("%7d %-14s %9.3f %9.3f %9.3f %7.2f %7.1f %8.2f %8.1f %8.3f %8.3f %8.3f %4.0f %7.0f\n", nodes,
           g->name, r->median_ms, r->mean_ms, r->worst_ms, r->iterations, r->linear, r->rms_mm, r->largest_mm,
           100 * r->strain, 100 * r->strain_reference, r->strain_max, r->rejected, r->bytes);
    fflush(stdout);
    if (!csv)
        return;
    bench_csv_row(csv);
    fprintf(csv,
            "%d,%s,%d,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.3f,%.2f,%.0f,%.4g,%.3f,%.2f,%.5f,%.5f,%.4f,%.0f\n",
            nodes, g->name, r->frames, r->median_ms, r->mean_ms, r->worst_ms, r->residual_ms, r->jacobian_ms,
            r->factor_ms, r->solve_ms, r->iterations, r->linear, r->rejected, r->residual, r->rms_mm,
            r->largest_mm, 100 * r->strain, 100 * r->strain_reference, r->strain_max, r->bytes);
    fflush(csv);
}

/* Slope of log cost over log nodes from 2 500 on, by least squares. */
static void print_growth(const char *name, const double *nodes, const double *ms, int count)
{
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (nodes[i] < 2500)
            continue;
        double x = log(nodes[i]), y = log(ms[i]);
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
        n++;
    }
    if (n > 1)
        printf("%s: cost grows with nodes to the power %.2f from 2 500 to %.0f nodes\n", name,
               (n * sxy - sx * sy) / (n * sxx - sx * sx), nodes[count - 1]);
}

#define RUNGS (sizeof rungs / sizeof *rungs)
#define SIDES (sizeof sides / sizeof *sides)

static void run(const request *q, FILE *csv)
{
    double nodes[RUNGS][SIDES], ms[RUNGS][SIDES];
    int counts[RUNGS] = {0};
    printf("%7s %-14s %9s %9s %9s %7s %7s %8s %8s %8s %8s %8s %4s %7s\n", "nodes", "rung", "median ms",
           "mean", "worst", "newton", "linear", "rms mm", "largest", "strain %", "conv. %", "max", "rej",
           "bytes/n");
    for (size_t i = 0; i < SIDES; i++) {
        if (q->only_side && q->only_side != sides[i])
            continue;
        drape_context *ctx = bench_context();
        drape_model *m = make_model(ctx, sides[i]);
        double *reference = make_reference(ctx, m, q);
        for (size_t k = 0; k < RUNGS; k++) {
            if ((q->only_rung && strcmp(q->only_rung, rungs[k].name) != 0) ||
                m->node_count > rungs[k].most_nodes)
                continue;
            result r = measure(ctx, m, &rungs[k], reference, q);
            print(csv, &rungs[k], m->node_count, &r);
            nodes[k][counts[k]] = m->node_count;
            ms[k][counts[k]++] = r.median_ms;
        }
        free(reference);
        drape_model_destroy(&m);
        drape_context_destroy(&ctx);
    }
    for (size_t k = 0; k < RUNGS; k++)
        print_growth(rungs[k].name, nodes[k], ms[k], counts[k]);
}

static const char help[] =
    "realtime: CPU milliseconds of a frame of 1/60 s on each rung, and its error against the converged step\n"
    "  --side N       only this size: 5 12 23 50 100 160 226 320 nodes a side\n"
    "  --rung NAME    only this rung, as \"newton_k 1\"\n"
    "  --reference N  nodes up to which the converged run is made to compare with (11000)\n"
    "  --long N       nodes up to which 2 s are run, 0.5 s above (11000)\n"
    "  --csv FILE     write the rows there; BENCH_COMMIT in the environment names the commit\n";

int main(int argc, char **argv)
{
    static const struct option options[] = {{"side", required_argument, NULL, 's'},
                                            {"rung", required_argument, NULL, 'r'},
                                            {"reference", required_argument, NULL, 'n'},
                                            {"long", required_argument, NULL, 'l'},
                                            {"csv", required_argument, NULL, 'c'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    request q = {.most_reference = 11000, .long_frames = 11000};
    for (int option; (option = getopt_long(argc, argv, "", options, NULL)) != -1;)
        switch (option) {
        case 's':
            q.only_side = atoi(optarg);
            break;
        case 'r':
            q.only_rung = optarg;
            break;
        case 'n':
            q.most_reference = atoi(optarg);
            break;
        case 'l':
            q.long_frames = atoi(optarg);
            break;
        case 'c':
            q.csv = optarg;
            break;
        default:
            fputs(help, option == 'h' ? stdout : stderr);
            return option == 'h' ? 0 : 2;
        }
    FILE *csv =
        bench_csv(q.csv, "nodes,rung,frames,median_cpu_ms,mean_cpu_ms,worst_cpu_ms,residual_ms,jacobian_ms,"
                         "factor_ms,solve_ms,newton_a_frame,linear_a_frame,rejected,residual_n,rms_mm,"
                         "largest_mm,strain_percent,converged_strain_percent,strain_max,bytes_a_node");
    run(&q, csv);
    return csv && fclose(csv) != 0;
}
