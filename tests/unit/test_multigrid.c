/* test_multigrid.c: the preconditioner of large sheets, on the matrix of a square sheet of springs with
 * bending and inertia. */
#include "entries/models.h"
#include "solvers/multigrid.h"
#include "solvers/pcg.h"
#include "support/suite.h"

typedef struct sheet {
    drape_context *ctx;
    drape_arena *arena;
    drape_pattern p;
    double *values, *x;
    drape_multigrid *m;
} sheet;

static double *take(int64_t count)
{
    double *memory = calloc((size_t)count, sizeof *memory);
    ck_assert_ptr_nonnull(memory);
    return memory;
}

static void add_block(sheet *q, int32_t i, int32_t j, double k, const double n[3])
{
    int64_t stride;
    double *at = drape_pattern_at(&q->p, q->values, j, drape_pattern_find(&q->p, i, j), &stride);
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            at[c * stride + r] += k * n[c] * n[r];
}

/* k times the square of n . (sum of weight x). */
static void add_energy(sheet *q, const int32_t *node, const double *weight, int count, double k,
                       const double n[3])
{
    for (int a = 0; a < count; a++)
        for (int b = 0; b < count; b++)
            add_block(q, node[a], node[b], k * weight[a] * weight[b], n);
}

/* The sheet of side x side nodes, 1 m, in the plane y = 0: springs of 1e3 N/m along the edges and diagonals,
 * second differences of deflection by a bending stiffness of 1e-4 N m, and the inertia 0.2 kg/m2 /
 * (1/60 s)^2. */
static sheet open_sheet(int32_t side)
{
    static const int32_t step[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    sheet q = {.ctx = make_context()};
    q.arena = drape_arena_create(q.ctx);
    const int32_t count = side * side;
    const double edge = 1.0 / (side - 1), up[3] = {0, 1, 0};
    int32_t *own = calloc((size_t)count, sizeof *own), *triples = calloc(6 * (size_t)count, sizeof *triples),
            used = 0;
    ck_assert(own && triples);
    for (int32_t i = 0; i < count; i++) {
        own[i] = i;
        for (int d = 0; d < 2; d++)
            if ((d ? i / side : i % side) + 2 < side)
                for (int32_t k = 0; k < 3; k++)
                    triples[used++] = i + k * (d ? side : 1);
    }
    int32_t *pairs = calloc(8 * (size_t)count, sizeof *pairs), ends = 0;
    for (int32_t i = 0; i < count; i++)
        for (int d = 0; d < 4; d++) {
            const int32_t c = i % side + step[d][0], r = i / side + step[d][1];
            if (c < 0 || c >= side || r < 0 || r >= side)
                continue;
            pairs[ends++] = i;
            pairs[ends++] = r * side + c;
        }
    const drape_coupling couplings[] = {{.count = used / 3, .nodes = 3, .node = triples},
                                        {.count = ends / 2, .nodes = 2, .node = pairs}};
    ck_assert_int_eq(drape_pattern_build(q.arena, count, own, couplings, 2, &q.p), DRAPE_OK);
    q.values = take(q.p.nonzeros);
    q.x = take(q.p.n);
    for (int32_t i = 0; i < count; i++) {
        q.x[3 * i] = edge * (i % side);
        q.x[3 * i + 2] = edge * (i / side);
        for (int c = 0; c < 3; c++)
            add_block(&q, i, i, 0.2 * edge * edge * 3600, (double[3]){c == 0, c == 1, c == 2});
    }
    for (int32_t k = 0; k < ends; k += 2) {
        double n[3] = {0}, length = 0;
        for (int c = 0; c < 3; c++)
            n[c] = q.x[3 * pairs[k + 1] + c] - q.x[3 * pairs[k] + c];
        length = sqrt(n[0] * n[0] + n[2] * n[2]);
        for (int c = 0; c < 3; c++)
            n[c] /= length;
        add_energy(&q, pairs + k, (double[2]){1, -1}, 2, 1e3, n);
    }
    for (int32_t k = 0; k < used; k += 3)
        add_energy(&q, triples + k, (double[3]){1, -2, 1}, 3, 1e-4 / (edge * edge), up);
    free(own);
    free(triples);
    free(pairs);
    ck_assert_int_eq(drape_multigrid_create(q.arena, &q.p, &q.m), DRAPE_OK);
    return q;
}

static void close_sheet(sheet *q)
{
    free(q->values);
    free(q->x);
    drape_arena_destroy(&q->arena);
    drape_context_destroy(&q->ctx);
}

static void factor(sheet *q)
{
    ck_assert_int_eq(drape_multigrid_factor(q->m, q->values, q->x), DRAPE_OK);
}

static void fill(double *x, int64_t n, uint64_t seed)
{
    for (int64_t i = 0; i < n; i++)
        x[i] = random_number(&seed);
}

static double dot(const double *a, const double *b, int64_t n)
{
    double sum = 0;
    for (int64_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static void multiply(const void *owner, const double *x, double *y)
{
    drape_multigrid_multiply(((const sheet *)owner)->m, x, y);
}

static void precondition(const void *owner, const double *r, double *z)
{
    drape_multigrid_apply(((const sheet *)owner)->m, r, z);
}

/* Conjugate gradients to 1e-6 for a rough right-hand side. */
static int iterations(sheet *q)
{
    double *b = take(q->p.n), *x = take(q->p.n);
    fill(b, q->p.n, 7);
    drape_pcg s = drape_pcg_of(q->arena, q->p.n, q, multiply, precondition);
    drape_pcg_solve(&s, b, x, 1e-6, 200);
    ck_assert(s.definite && s.converged);
    free(b);
    free(x);
    return s.iterations;
}

/* ---- Tests ---- */

/* Against the products of the whole pattern. A row has 13 blocks of 3 numbers: rounding of 1e-14 of its
 * terms, which are at most 1e5 N/m here. */
START_TEST(half_of_the_matrix_gives_the_product)
{
    sheet q = open_sheet(20);
    double *x = take(q.p.n), *y = take(q.p.n);
    factor(&q);
    fill(x, q.p.n, 3);
    drape_multigrid_multiply(q.m, x, y);
    for (int64_t c = 0; c < q.p.n; c++) {
        double sum = 0;
        for (int64_t k = q.p.column[c]; k < q.p.column[c + 1]; k++)
            sum += q.values[k] * x[drape_pattern_row(&q.p, c, k)];
        ck_assert_double_eq_tol(y[c], sum, 1e-9);
    }
    free(x);
    free(y);
    close_sheet(&q);
}
END_TEST

/* 49 nodes are one level: the matrix is factored itself. The condition number is about 1e3. */
START_TEST(one_level_is_exact)
{
    sheet q = open_sheet(7);
    double *b = take(q.p.n), *x = take(q.p.n), *back = take(q.p.n);
    factor(&q);
    ck_assert_int_eq(drape_multigrid_levels(q.m), 1);
    fill(b, q.p.n, 5);
    drape_multigrid_apply(q.m, b, x);
    drape_multigrid_multiply(q.m, x, back);
    for (int64_t i = 0; i < q.p.n; i++)
        ck_assert_double_eq_tol(back[i], b[i], 1e-10);
    free(b);
    free(x);
    free(back);
    close_sheet(&q);
}
END_TEST

/* x'By = y'Bx to the rounding of sums of n terms; x'Bx > 0, for smooth vectors, too, which only the coarse
 * levels act upon. */
START_TEST(the_preconditioner_is_symmetric_and_positive_definite)
{
    sheet q = open_sheet(60);
    const int64_t n = q.p.n;
    double *x = take(n), *y = take(n), *Bx = take(n), *By = take(n);
    factor(&q);
    ck_assert_int_ge(drape_multigrid_levels(q.m), 3);
    for (uint64_t seed = 1; seed <= 6; seed++) {
        fill(x, n, seed);
        fill(y, n, 100 + seed);
        for (int64_t i = 0; seed % 2 && i < n; i++)
            x[i] = i % 3 == (int64_t)seed / 2 ? 1 + 0.1 * q.x[i] : 0;
        drape_multigrid_apply(q.m, x, Bx);
        drape_multigrid_apply(q.m, y, By);
        ck_assert_double_gt(dot(x, Bx, n), 0);
        const double size = sqrt(dot(x, Bx, n) * dot(y, By, n));
        ck_assert_double_le(fabs(dot(x, By, n) - dot(y, Bx, n)), 1e-10 * size);
    }
    free(x);
    free(y);
    free(Bx);
    free(By);
    close_sheet(&q);
}
END_TEST

/* 8 and 13 iterations; inertia, which bounds the condition number, is 16 times smaller in the large sheet.
 * With a single coarse level or none the numbers are a multiple of these and grow with the nodes along a
 * side; with aggregates of all nodes that bending couples they are 9 and 18. */
START_TEST(a_large_stiff_sheet_takes_few_iterations)
{
    sheet small = open_sheet(30), large = open_sheet(120);
    factor(&small);
    factor(&large);
    const int few = iterations(&small), many = iterations(&large);
    ck_assert_msg(few <= 10 && many <= 16, "%d and %d iterations", few, many);
    close_sheet(&small);
    close_sheet(&large);
}
END_TEST

/* The motions of the aggregates turn with the sheet: of a sheet in any plane they are the same. Without
 * positions there are translations only, which is a worse preconditioner and no failure. */
START_TEST(positions_may_be_missing)
{
    sheet q = open_sheet(60);
    factor(&q);
    const int with = iterations(&q);
    memset(q.x, 0, (size_t)q.p.n * sizeof *q.x);
    factor(&q);
    ck_assert_int_ge(iterations(&q), with);
    close_sheet(&q);
}
END_TEST

START_TEST(a_matrix_that_is_not_positive_definite_is_noticed)
{
    sheet q = open_sheet(60);
    int64_t stride;
    double *at = drape_pattern_at(&q.p, q.values, 1000, q.p.diagonal[1000], &stride);
    *at = -1;
    ck_assert_int_eq(drape_multigrid_factor(q.m, q.values, q.x), DRAPE_RETRY_LINEAR);
    close_sheet(&q);
}
END_TEST

/* Pieces that are coupled to nothing else, single nodes among them, end the levels. */
START_TEST(separate_nodes)
{
    drape_context *ctx = make_context();
    drape_arena *arena = drape_arena_create(ctx);
    drape_pattern p;
    drape_multigrid *m;
    int32_t own[200];
    double x[600], b[600], values[1800];
    for (int32_t i = 0; i < 200; i++)
        own[i] = i;
    ck_assert_int_eq(drape_pattern_build(arena, 200, own, NULL, 0, &p), DRAPE_OK);
    ck_assert_int_eq(drape_multigrid_create(arena, &p, &m), DRAPE_OK);
    for (int i = 0; i < 1800; i++)
        values[i] = i % 9 % 4 == 0 ? 2 : 0;
    fill(b, 600, 9);
    ck_assert_int_eq(drape_multigrid_factor(m, values, b), DRAPE_OK);
    drape_multigrid_apply(m, b, x);
    for (int i = 0; i < 600; i++)
        ck_assert_double_eq(x[i], b[i] / 2);
    drape_arena_destroy(&arena);
    drape_context_destroy(&ctx);
}
END_TEST

SUITE("multigrid", half_of_the_matrix_gives_the_product, one_level_is_exact,
      the_preconditioner_is_symmetric_and_positive_definite, a_large_stiff_sheet_takes_few_iterations,
      positions_may_be_missing, a_matrix_that_is_not_positive_definite_is_noticed, separate_nodes)
