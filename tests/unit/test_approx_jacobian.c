/* test_approx_jacobian.c: the coarse space, conjugate gradients, and the approximate Jacobian. */
#include "entries/models.h"
#include "nonlinear/approx_jacobian.h"
#include "nonlinear/factored_jacobian.h"
#include "nonlinear/scalar_stiffness.h"
#include "solvers/pcg.h"
#include "solvers/prolong.h"
#include "support/scene.h"

/* ---- The coarse space ---- */

/* side x side nodes, each joined to its neighbours along rows and columns. */
typedef struct lattice {
    int32_t *start, *neighbor;
    drape_graph graph;
} lattice;

static lattice open_lattice(int32_t side)
{
    lattice l = {.start = calloc((size_t)(side * side) + 1, sizeof *l.start),
                 .neighbor = calloc(4 * (size_t)(side * side), sizeof *l.neighbor)};
    int32_t at = 0;
    for (int32_t i = 0; i < side * side; i++) {
        int32_t r = i / side, c = i % side;
        l.start[i] = at;
        if (r > 0)
            l.neighbor[at++] = i - side;
        if (r + 1 < side)
            l.neighbor[at++] = i + side;
        if (c > 0)
            l.neighbor[at++] = i - 1;
        if (c + 1 < side)
            l.neighbor[at++] = i + 1;
    }
    l.start[side * side] = at;
    l.graph = (drape_graph){.count = side * side, .start = l.start, .neighbor = l.neighbor};
    return l;
}

static void close_lattice(lattice *l)
{
    free(l->start);
    free(l->neighbor);
}

#define scoped_lattice SCOPED(close_lattice) lattice

/* At each node the functions are positive and add up to 1, up to a few roundings of 16 values. Seeds are at
 * least a spacing apart, so balls of a radius below half of it are disjoint: on this lattice a ball of
 * radius r has 2 r (r + 1) + 1 nodes, at the rim at least half of them. */
TEST(coarse_functions_are_a_partition_of_unity)
{
    scoped_scene s = scene_empty();
    for (int spacing = 2; spacing <= 8; spacing++) {
        scoped_lattice l = open_lattice(31);
        drape_arena memory = drape_arena_of(s.ctx);
        drape_prolong p;
        ck_assert_int_eq(drape_prolong_build(&memory, &l.graph, spacing, &p), DRAPE_OK);
        ck_assert_int_eq(p.fine, l.graph.count);
        int r = (spacing - 1) / 2;
        ck_assert_int_ge(p.coarse, 4);
        ck_assert_int_le(p.coarse, 2 * p.fine / (2 * r * (r + 1) + 1) + 1);
        for (int32_t i = 0; i < p.fine; i++) {
            double sum = 0;
            for (int32_t k = p.start[i]; k < p.start[i + 1]; k++) {
                ck_assert(p.weight[k] > 0 && p.column[k] >= 0 && p.column[k] < p.coarse);
                sum += p.weight[k];
            }
            ck_assert_double_eq_tol(sum, 1, 64 * DBL_EPSILON);
        }
        drape_arena_free(&memory);
    }
}

/* P' and P are transposes: (P' x) . y = x . (P y). */
TEST(restriction_is_the_transpose)
{
    scoped_scene s = scene_empty();
    scoped_lattice l = open_lattice(12);
    drape_arena memory = drape_arena_of(s.ctx);
    drape_prolong p;
    ck_assert_int_eq(drape_prolong_build(&memory, &l.graph, 4, &p), DRAPE_OK);
    size_t n = 3 * (size_t)p.fine, m = 3 * (size_t)p.coarse;
    double *x = calloc(n, sizeof *x), *py = calloc(n, sizeof *py), *y = calloc(m, sizeof *y),
           *px = calloc(m, sizeof *px), a = 0, b = 0;
    uint64_t seed = 5;
    for (size_t i = 0; i < n; i++)
        x[i] = random_number(&seed);
    for (size_t i = 0; i < m; i++)
        y[i] = random_number(&seed);
    drape_prolong_restrict(&p, x, px);
    drape_prolong_add(&p, y, py);
    for (size_t i = 0; i < n; i++)
        a += x[i] * py[i];
    for (size_t i = 0; i < m; i++)
        b += px[i] * y[i];
    ck_assert_double_eq_tol(a, b, 1e-12 * sqrt((double)n));
    free(x);
    free(y);
    free(px);
    free(py);
    drape_arena_free(&memory);
}

/* Without edges each node has a function of its own. */
TEST(nodes_without_neighbours_are_alone)
{
    scoped_scene s = scene_empty();
    int32_t start[4] = {0, 0, 0, 0}, none;
    const drape_graph graph = {.count = 3, .start = start, .neighbor = &none};
    drape_arena memory = drape_arena_of(s.ctx);
    drape_prolong p;
    ck_assert_int_eq(drape_prolong_build(&memory, &graph, 4, &p), DRAPE_OK);
    ck_assert_int_eq(p.coarse, 3);
    for (int i = 0; i < 3; i++)
        ck_assert(p.weight[i] == 1 && p.column[i] == i);
    drape_arena_free(&memory);
}

/* ---- Conjugate gradients ---- */

static void multiply_diagonal(const void *owner, const double *x, double *y)
{
    const double *d = owner;
    for (int i = 0; i < 6; i++)
        y[i] = d[i] * x[i];
}

static void leave(const void *owner, const double *r, double *z)
{
    (void)owner;
    memcpy(z, r, 6 * sizeof *z);
}

/* There are as many iterations as distinct eigenvalues: 3 here. */
TEST(conjugate_gradients_end_with_the_eigenvalues)
{
    const double d[6] = {1, 1, 5, 5, 9, 9}, b[6] = {1, 2, 3, 4, 5, 6};
    double r[6], z[6], p[6], q[6], x[6];
    drape_pcg s = {.n = 6,
                   .owner = d,
                   .multiply = multiply_diagonal,
                   .precondition = leave,
                   .r = r,
                   .z = z,
                   .p = p,
                   .q = q};
    drape_pcg_solve(&s, b, x, 1e-13, 20);
    ck_assert(s.definite && s.converged);
    ck_assert_int_eq(s.iterations, 3);
    for (int i = 0; i < 6; i++)
        ck_assert_double_eq_tol(x[i], b[i] / d[i], 1e-12);
}

TEST(negative_curvature_is_reported)
{
    const double d[6] = {-1, -1, -1, -1, -1, -1}, b[6] = {1, 2, 3, 4, 5, 6};
    double r[6], z[6], p[6], q[6], x[6];
    drape_pcg s = {.n = 6,
                   .owner = d,
                   .multiply = multiply_diagonal,
                   .precondition = leave,
                   .r = r,
                   .z = z,
                   .p = p,
                   .q = q};
    drape_pcg_solve(&s, b, x, 1e-13, 20);
    ck_assert(!s.definite && !s.converged);
    ck_assert_mem_eq(x, b, sizeof b); /* x still goes downhill */
}

/* ---- The matrix ---- */

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 1, 'height': "   \
    "1},"                                                                                                    \
    "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2},"                           \
    "'terms': [%s], 'pins': [{'corner': 'top-left'}]}], 'duration': 1}"

typedef struct state {
    scene s;
    drape_system *system;
    drape_approx_jacobian *jacobian;
    drape_arena *arena;
    drape_work work;
    drape_state at;
    drape_point point;
    size_t n;
    double *x, *y, *values;
} state;

static void update(const drape_matrix_ops *ops, void *matrix, const drape_point *point, drape_work *work)
{
    ck_assert_int_eq(ops->assemble(matrix, point, 3600, true, work), DRAPE_OK);
    ck_assert_int_eq(ops->factor(matrix, false, work), DRAPE_OK);
}

/* Returns the number of iterations. */
static int64_t solve(const drape_matrix_ops *ops, void *matrix, const double *b, double tolerance, double *x,
                     drape_work *work)
{
    const int64_t before = work->linear_iterations;
    bool definite;
    ck_assert_int_eq(ops->solve(matrix, b, tolerance, x, &definite, work), DRAPE_OK);
    ck_assert(definite);
    return work->linear_iterations - before;
}

static state open_state(int side, const char *terms)
{
    state q = {.s = scene_model(SHEET, side, side, terms)};
    const drape_model *m = q.s.model;
    q.n = 3 * (size_t)m->free_count;
    q.arena = drape_arena_create(q.s.ctx);
    ck_assert_int_eq(drape_system_create(q.arena, m, 1, &q.system), DRAPE_OK);
    ck_assert_int_eq(drape_state_create(q.arena, m, &q.at), DRAPE_OK);
    ck_assert_int_eq(drape_approx_jacobian_create(q.arena, q.system, &q.jacobian), DRAPE_OK);
    q.point = (drape_point){.x = q.at.x, .v = q.at.v, .internal = q.at.internal, .weight = 60};
    q.x = calloc(q.n, sizeof *q.x);
    q.y = calloc(q.n, sizeof *q.y);
    q.values = calloc((size_t)m->pattern.nonzeros, sizeof *q.values);
    return q;
}

static void close_state(state *q)
{
    drape_approx_jacobian_ops.destroy(q->jacobian);
    drape_system_destroy(&q->system);
    drape_arena_destroy(&q->arena);
    free(q->x);
    free(q->y);
    free(q->values);
    scene_close(&q->s);
}

#define scoped_state SCOPED(close_state) state

/* Largest |A x - (m_w M + J+) x| over the largest component of A x, for a random x along `direction`, or in
 * all directions. */
static double mismatch(state *q, double mass_weight, const double *direction)
{
    const drape_model *m = q->s.model;
    uint64_t seed = 11;
    double error = 0, size = 0;
    for (size_t i = 0; i < q->n; i++)
        q->x[i] = random_number(&seed) * (direction ? direction[i % 3] : 1);
    ck_assert_int_eq(drape_approx_jacobian_ops.assemble(q->jacobian, &q->point, mass_weight, true, &q->work),
                     DRAPE_OK);
    drape_approx_jacobian_multiply(q->jacobian, q->x, q->y);
    for (size_t i = 0; i < q->n; i++)
        size = fmax(size, fabs(q->y[i]));
    drape_system_jacobian(q->system, &q->point, mass_weight, 1, q->values);
    for (int64_t c = 0; c < m->pattern.n; c++)
        for (int64_t k = m->pattern.column[c]; k < m->pattern.column[c + 1]; k++)
            q->y[drape_pattern_row(&m->pattern, c, k)] -= q->values[k] * q->x[c];
    for (size_t i = 0; i < q->n; i++)
        error = fmax(error, fabs(q->y[i]));
    return error / size;
}

/* For pairs, energies and dissipation it is the positive part of the Jacobian itself, at any state. */
TEST(without_bending_it_is_the_positive_jacobian)
{
    scoped_state q =
        open_state(9, "'stretch.edge', {'type': 'damp.kelvin_voigt', 'beta': 0.01},"
                      "{'type': 'drag.viscous', 'coefficient': 0.3}, {'type': 'limit.strain', 'limit': 0.3}");
    uint64_t seed = 3;
    for (size_t i = 0; i < 3 * (size_t)q.s.model->node_count; i++)
        q.at.x[i] = 1.1 * q.at.x[i] + 0.01 * random_number(&seed);
    double *history = calloc((size_t)q.s.model->measure_count, sizeof *history);
    drape_system_measures(q.system, &q.point, history);
    for (int64_t i = 0; i < q.s.model->measure_count; i++)
        history[i] *= -q.point.weight; /* the rates are zero there */
    q.point.history = history;
    ck_assert_double_lt(mismatch(&q, 3600, NULL), 1e-12);
    free(history);
}

/* For hinges of a flat sheet all gradients lie along the normal, and in that direction it is the Jacobian. */
TEST(across_a_flat_sheet_bending_is_exact)
{
    static const double normal[3] = {0, 1, 0};
    scoped_state q = open_state(9, "'bend.hinge'");
    ck_assert_double_lt(mismatch(&q, 3600, normal), 1e-12);
}

/* Symmetric and positive: x'Ay = y'Ax, x'Ax > 0. The number of iterations does not grow with the sheet: the
 * condition number of M/h2 + K here is 8 E h h2/m = 8 x 1000/(3600 x 0.2/side^2), 1e4 at side 31, for which
 * plain conjugate gradients take hundreds. */
TEST(it_is_solved_in_few_iterations_at_any_size)
{
    for (int side = 11; side <= 31; side += 10) {
        scoped_state q = open_state(side, "'stretch.edge', 'bend.hinge'");
        double *b = calloc(q.n, sizeof *b), xax = 0, xay = 0, yax = 0, left = 0, all = 0;
        uint64_t seed = 8;
        for (size_t i = 0; i < 3 * (size_t)q.s.model->node_count; i++)
            q.at.x[i] *= 1.01;
        for (size_t i = 0; i < q.n; i++)
            b[i] = random_number(&seed);
        drape_approx_jacobian_ops.begin(q.jacobian, false, 500);
        update(&drape_approx_jacobian_ops, q.jacobian, &q.point, &q.work);
        const int iterations = (int)solve(&drape_approx_jacobian_ops, q.jacobian, b, 1e-6, q.x, &q.work);
        ck_assert_msg(iterations <= 60, "%d nodes a side: %d iterations", side, iterations);
        drape_approx_jacobian_multiply(q.jacobian, q.x, q.y);
        for (size_t i = 0; i < q.n; i++) {
            xax += q.x[i] * q.y[i];
            yax += b[i] * q.y[i];
            left += (b[i] - q.y[i]) * (b[i] - q.y[i]);
            all += b[i] * b[i];
        }
        ck_assert_double_gt(xax, 0);
        ck_assert_double_lt(left, 1e-6 * all); /* in the plain norm: the condition of P is below 1e6 */
        scoped_memory double *ab = calloc(q.n, sizeof *ab);
        drape_approx_jacobian_multiply(q.jacobian, b, ab);
        for (size_t i = 0; i < q.n; i++)
            xay += q.x[i] * ab[i];
        ck_assert_double_eq_tol(xay, yax, 1e-10 * fabs(yax) + 1e-10);
        free(b);
    }
}

/* ---- The factored matrix ---- */

/* Without bending it is m_w M + J+ itself at any state, and A (A^-1 b) = b up to the condition of a stiff
 * sheet, 1e5, times rounding. */
TEST(factored_matrix_is_the_positive_jacobian)
{
    scoped_state q = open_state(9, "'stretch.cst'");
    const drape_model *m = q.s.model;
    drape_factored_jacobian *jacobian;
    uint64_t seed = 3;
    scoped_memory double *b = calloc(q.n, sizeof *b);
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
        q.at.x[i] = 1.1 * q.at.x[i] + 0.01 * random_number(&seed);
    for (size_t i = 0; i < q.n; i++)
        b[i] = random_number(&seed);
    ck_assert_int_eq(drape_factored_jacobian_create(q.arena, q.system, 1. / 60, &jacobian), DRAPE_OK);
    update(&drape_factored_jacobian_ops, jacobian, &q.point, &q.work);
    solve(&drape_factored_jacobian_ops, jacobian, b, 0, q.x, &q.work);
    const double *a = drape_factored_jacobian_values(jacobian);
    drape_system_jacobian(q.system, &q.point, 3600, 1, q.values);
    double largest = 0;
    for (int64_t k = 0; k < m->pattern.nonzeros; k++)
        largest = fmax(largest, fabs(q.values[k]));
    for (int64_t k = 0; k < m->pattern.nonzeros; k++)
        ck_assert_double_eq_tol(a[k], q.values[k], 1e-14 * largest);
    for (int64_t c = 0; c < m->pattern.n; c++)
        for (int64_t k = m->pattern.column[c]; k < m->pattern.column[c + 1]; k++)
            b[drape_pattern_row(&m->pattern, c, k)] -= a[k] * q.x[c];
    for (size_t i = 0; i < q.n; i++)
        ck_assert_double_eq_tol(b[i], 0, 1e-9);
    ck_assert_int_eq(q.work.factorizations, 1);
    drape_factored_jacobian_ops.destroy(jacobian);
}

/* With bending lumped in the factors, conjugate gradients solve with the matrix that another system factors
 * whole: at steps of 100 s bending exceeds the inertia so far that it is not lumped. Values without it are
 * in a smaller pattern. The tolerance is in the norm of N^-1, whose condition is that of the stiff sheet,
 * 1e5. */
TEST(lumped_factors_solve_with_all_of_bending)
{
    scoped_state q = open_state(9, "'stretch.cst', 'bend.midedge'"),
                 whole = open_state(9, "'stretch.cst', 'bend.midedge'");
    const drape_pattern *p = &whole.s.model->pattern;
    drape_factored_jacobian *jacobian, *reference;
    uint64_t seed = 5;
    double *b = calloc(q.n, sizeof *b), size = 0;
    for (size_t i = 0; i < 3 * (size_t)q.s.model->node_count; i++)
        whole.at.x[i] = q.at.x[i] += 0.01 * random_number(&seed);
    for (size_t i = 0; i < q.n; i++)
        b[i] = random_number(&seed);
    ck_assert_int_eq(drape_factored_jacobian_create(q.arena, q.system, 1. / 60, &jacobian), DRAPE_OK);
    ck_assert_int_eq(drape_factored_jacobian_create(whole.arena, whole.system, 100, &reference), DRAPE_OK);
    ck_assert(drape_factored_jacobian_is_lumped(jacobian) && !drape_factored_jacobian_is_lumped(reference));
    ck_assert_int_lt(drape_system_pattern(q.system)->nonzeros, p->nonzeros);
    update(&drape_factored_jacobian_ops, jacobian, &q.point, &q.work);
    update(&drape_factored_jacobian_ops, reference, &whole.point, &whole.work);
    const int64_t iterations = solve(&drape_factored_jacobian_ops, jacobian, b, 1e-10, q.x, &q.work);
    ck_assert(iterations > 1 && iterations < 30);
    const double *a = drape_factored_jacobian_values(reference);
    for (int64_t c = 0; c < p->n; c++)
        for (int64_t k = p->column[c]; k < p->column[c + 1]; k++)
            b[drape_pattern_row(p, c, k)] -= a[k] * q.x[c];
    for (size_t i = 0; i < q.n; i++)
        size = fmax(size, fabs(b[i]));
    ck_assert_double_lt(size, 1e-6);
    drape_factored_jacobian_ops.destroy(jacobian);
    drape_factored_jacobian_ops.destroy(reference);
    free(b);
}

/* Drag of the wind is not symmetric, and neighbouring triangles cancel much of it: it has no positive parts.
 * Factored is the symmetric part of the matrix as it is, and solutions are those with all of it, up to the
 * tolerance of nonsymmetric.c, 1e-4. That of the factors alone is off by more. */
TEST(factored_matrix_is_corrected_for_drag)
{
    scoped_state q = open_state(5, "{'type': 'drag.wind', 'wind': [5, 0, 2]}");
    drape_factored_jacobian *jacobian;
    uint64_t seed = 4;
    scoped_memory double *b = calloc(q.n, sizeof *b),
                         *exact = calloc((size_t)q.s.model->pattern.nonzeros, sizeof *exact);
    const drape_pattern *p = &q.s.model->pattern;
    bool better, needed;
    for (size_t i = 0; i < 3 * (size_t)q.s.model->node_count; i++)
        q.at.x[i] += 0.02 * random_number(&seed);
    for (size_t i = 0; i < q.n; i++)
        b[i] = random_number(&seed);
    drape_system_jacobian(q.system, &q.point, 3600, 0, exact);
    ck_assert_int_eq(drape_factored_jacobian_is_better(q.system, 1. / 60, &better, &needed), DRAPE_OK);
    ck_assert(better);
    ck_assert_int_eq(drape_factored_jacobian_create(q.arena, q.system, 1. / 60, &jacobian), DRAPE_OK);
    update(&drape_factored_jacobian_ops, jacobian, &q.point, &q.work);
    const int64_t iterations = solve(&drape_factored_jacobian_ops, jacobian, b, 0, q.x, &q.work);
    double asymmetry = 0, largest = 0, left = 0, whole = 0;
    for (size_t i = 0; i < q.n; i++)
        whole += b[i] * b[i];
    ck_assert_int_gt(iterations, 1);
    for (int64_t c = 0; c < p->n; c++)
        for (int64_t k = p->column[c]; k < p->column[c + 1]; k++) {
            largest = fmax(largest, fabs(exact[k]));
            asymmetry = fmax(asymmetry, fabs(exact[k] - drape_factored_jacobian_values(jacobian)[k]));
            b[drape_pattern_row(p, c, k)] -= exact[k] * q.x[c];
        }
    drape_pattern_symmetrize(p, exact);
    ck_assert_double_gt(asymmetry, 1e-3 * largest);
    for (int64_t k = 0; k < p->nonzeros; k++)
        ck_assert_double_eq_tol(drape_factored_jacobian_values(jacobian)[k], exact[k], 1e-12 * largest);
    for (size_t i = 0; i < q.n; i++)
        left += b[i] * b[i];
    ck_assert_double_lt(left, 1e-8 * whole);
    drape_factored_jacobian_ops.destroy(jacobian);
}
