/*
 * linears: the time of each linear solver for the matrix of a backward Euler step, by size: create (ordering
 * and analysis, once per sparsity pattern), the first factorization, a later one, a solve. Square sheets of 1
 * m hung by two corners, dt 1/60 s, with three matrices each: a slightly deformed sheet, positive definite;
 * the same with friction on a plane under each node, not symmetric; a compressed sheet, indefinite. Times are
 * the least of the repeats. The size thresholds of the solver `auto` come from the first matrix.
 */
#include "bench.h"
#include "solvers/linear.h"

#define DT          (1.0 / 60)
#define DEFORMATION 1e-3 /* share of the length of an edge */
#define PRESSED     0.7  /* share of the length that the compressed, indefinite sheet has left */
#define FRICTION    0.5  /* mu */
#define BUDGET      1.0  /* [s] time for the repeats of one measurement */

typedef enum matrix_kind { DEFINITE, FRICTIONAL, INDEFINITE, KIND_COUNT } matrix_kind;
static const char *const kind_names[KIND_COUNT] = {"definite", "friction", "indefinite"};

typedef struct problem {
    drape_context *ctx;
    drape_model *model;
    double *values, *b, *x;
} problem;

typedef struct times {
    double create, first, factor, solve; /* [s] CPU */
    size_t bytes;
} times;

static double *take(size_t count)
{
    double *memory = calloc(count, sizeof *memory);
    if (!memory)
        exit(1);
    return memory;
}

/* Implicit friction: if a node slides along x under the normal force k z, its block of the Jacobian has k at
 * (z, z) and mu k at (x, z). Here k is the stiffness that the node has without contact. */
static void add_friction(const drape_pattern *p, double *values)
{
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        double *at = drape_pattern_at(p, values, j, p->diagonal[j], &stride), k = at[2 * stride + 2];
        at[2 * stride + 2] += k;
        at[2 * stride] += FRICTION * k;
    }
}

static void fill(problem *q, matrix_kind kind)
{
    const drape_model *m = q->model;
    drape_system *system = NULL;
    drape_arena arena = drape_arena_of(q->ctx);
    drape_state state = {0};
    if (drape_system_create(&arena, m, 1, &system) || drape_state_create(&arena, m, &state))
        bench_fail(q->ctx, "the state");
    const double edge = m->edge_length[0];
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
        state.x[i] = (kind == INDEFINITE ? PRESSED : 1) * state.x[i] +
                     (m->pinned[i / 3] ? 0 : DEFORMATION * edge * sin(12.9898 * (double)(i + 1)));
    drape_system_jacobian(
        system, &(drape_point){.x = state.x, .v = state.v, .internal = state.internal, .weight = 1 / DT},
        1 / (DT * DT), kind == INDEFINITE ? 0 : 1, q->values);
    if (kind == FRICTIONAL)
        add_friction(&m->pattern, q->values);
    for (int64_t i = 0; i < m->pattern.n; i++)
        q->b[i] = cos((double)i);
    drape_system_destroy(&system);
    drape_arena_free(&arena);
}

static problem open_problem(int side, matrix_kind kind)
{
    problem q = {.ctx = bench_context()};
    q.model = bench_model(q.ctx,
                          "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, "
                          "'width': 1, 'height': 1},"
                          "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2},"
                          "'terms': ['stretch.edge', 'bend.hinge'],"
                          "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}], 'duration': 1}",
                          side, side);
    const drape_pattern *p = &q.model->pattern;
    q.values = take((size_t)p->nonzeros);
    q.b = take((size_t)p->n);
    q.x = take((size_t)p->n);
    fill(&q, kind);
    return q;
}

static void close_problem(problem *q)
{
    free(q->values);
    free(q->b);
    free(q->x);
    drape_model_destroy(&q->model);
    drape_context_destroy(&q->ctx);
}

static void keep_least(double *least, double start)
{
    double seconds = drape_clock_cpu_seconds() - start;
    *least = seconds < *least ? seconds : *least;
}

static times measure(problem *q, const drape_linear_ops *ops)
{
    times t = {INFINITY, INFINITY, INFINITY, INFINITY, 0};
    void *solver = NULL;
    drape_arena arena = drape_arena_of(q->ctx);
    double begin = drape_clock_cpu_seconds();
    do {
        drape_linear_destroy(ops, &solver);
        drape_arena_free(&arena);
        double start = drape_clock_cpu_seconds();
        if (ops->create(&arena, &q->model->pattern, &solver))
            bench_fail(q->ctx, "%s", ops->entry.name);
        keep_least(&t.create, start);
        start = drape_clock_cpu_seconds();
        if (ops->factor(solver, q->values))
            bench_fail(q->ctx, "%s cannot factor", ops->entry.name);
        keep_least(&t.first, start);
    } while (drape_clock_cpu_seconds() - begin < BUDGET);
    begin = drape_clock_cpu_seconds();
    do {
        double start = drape_clock_cpu_seconds();
        if (ops->factor(solver, q->values))
            bench_fail(q->ctx, "%s cannot factor", ops->entry.name);
        keep_least(&t.factor, start);
        start = drape_clock_cpu_seconds();
        if (ops->solve(solver, q->b, q->x))
            bench_fail(q->ctx, "%s cannot solve", ops->entry.name);
        keep_least(&t.solve, start);
    } while (drape_clock_cpu_seconds() - begin < BUDGET);
    t.bytes = arena.bytes + drape_linear_bytes(ops, solver);
    drape_linear_destroy(ops, &solver);
    drape_arena_free(&arena);
    return t;
}

static void report(FILE *csv, int nodes, const problem *q, matrix_kind kind, const char *name, const times *t)
{
    const drape_pattern *p = &q->model->pattern;
    printf("%6d %-10s %-8s %8lld %9lld %10.3f %10.3f %10.3f %9.3f %9.2f\n", nodes, kind_names[kind], name,
           (long long)p->n, (long long)p->nonzeros, 1e3 * t->create, 1e3 * t->first, 1e3 * t->factor,
           1e3 * t->solve, 1e-6 * (double)t->bytes);
    fflush(stdout);
    if (!csv)
        return;
    bench_csv_row(csv);
    fprintf(csv, "%d,%s,%s,%lld,%lld,%.4f,%.4f,%.4f,%.4f,%zu\n", nodes, kind_names[kind], name,
            (long long)p->n, (long long)p->nonzeros, 1e3 * t->create, 1e3 * t->first, 1e3 * t->factor,
            1e3 * t->solve, t->bytes);
}

/* The dense solver takes time n^3: minutes for larger sheets. */
static bool affordable(const drape_linear_ops *ops, int side)
{
    return side <= 16 || strcmp(ops->entry.name, "dense") != 0;
}

static void measure_all(FILE *csv, int side, matrix_kind kind)
{
    problem q = open_problem(side, kind);
    for (int k = 0; drape_linears[k]; k++)
        if (affordable(drape_linears[k], side)) {
            times t = measure(&q, drape_linear_of(NULL, k, q.model->pattern.n));
            report(csv, side * side, &q, kind, drape_linears[k]->entry.name, &t);
        }
    close_problem(&q);
}

int main(int argc, char **argv)
{
    static const int sides[] = {4, 6, 8, 10, 12, 16, 23, 32, 50, 71, 100};
    if (argc > 3 || (argc >= 2 && argv[1][0] == '-')) {
        return bench_usage(
            argv[1],
            "linears [CSV [NODES]]: milliseconds of each linear solver by size, up to NODES (10000)\n");
    }
    int most = argc == 3 ? atoi(argv[2]) : 10000;
    FILE *csv =
        bench_csv(argc >= 2 ? argv[1] : NULL,
                  "nodes,matrix,linear,unknowns,nonzeros,create_ms,first_factor_ms,factor_ms,solve_ms,bytes");
    printf("%6s %-10s %-8s %8s %9s %10s %10s %10s %9s %9s\n", "nodes", "matrix", "linear", "unknowns",
           "nonzeros", "create ms", "first ms", "factor ms", "solve ms", "MB");
    for (size_t i = 0; i < sizeof sides / sizeof *sides && sides[i] * sides[i] <= most; i++)
        for (matrix_kind kind = DEFINITE; kind < KIND_COUNT; kind++)
            measure_all(csv, sides[i], kind);
    return csv && fclose(csv) != 0;
}
