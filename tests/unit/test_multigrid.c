/* test_multigrid.c: the preconditioner of large sheets, on the matrix of a square sheet of springs with
 * bending and inertia. */
#include "support/springs.h"
#include "support/suite.h"

/* Conjugate gradients to 1e-6 for a rough right-hand side. */
static int iterations(sheet *q)
{
    scoped_memory double *b = take(q->p.n), *x = take(q->p.n);
    fill(b, q->p.n, 7);
    drape_pcg s = drape_pcg_of(q->arena, q->p.n, q, multiply, precondition);
    drape_pcg_solve(&s, b, x, 1e-6, 200);
    ck_assert(s.definite && s.converged);
    return s.iterations;
}

/* ---- Tests ---- */

/* Against the products of the whole pattern. A row has 13 blocks of 3 numbers: rounding of 1e-14 of its
 * terms, which are at most 1e5 N/m here. */
TEST(half_of_the_matrix_gives_the_product)
{
    scoped_sheet q = open_sheet(20);
    scoped_memory double *x = take(q.p.n), *y = take(q.p.n);
    factor(&q);
    fill(x, q.p.n, 3);
    drape_multigrid_multiply(q.m, x, y);
    for (int64_t c = 0; c < q.p.n; c++) {
        double sum = 0;
        for (int64_t k = q.p.column[c]; k < q.p.column[c + 1]; k++)
            sum += q.values[k] * x[drape_pattern_row(&q.p, c, k)];
        ck_assert_double_eq_tol(y[c], sum, 1e-9);
    }
}

/* 49 nodes are one level: the matrix is factored itself. The condition number is about 1e3. */
TEST(one_level_is_exact)
{
    scoped_sheet q = open_sheet(7);
    scoped_memory double *b = take(q.p.n), *x = take(q.p.n), *back = take(q.p.n);
    factor(&q);
    ck_assert_int_eq(drape_multigrid_levels(q.m), 1);
    fill(b, q.p.n, 5);
    drape_multigrid_apply(q.m, b, x);
    drape_multigrid_multiply(q.m, x, back);
    for (int64_t i = 0; i < q.p.n; i++)
        ck_assert_double_eq_tol(back[i], b[i], 1e-10);
}

/* x'By = y'Bx to the rounding of sums of n terms; x'Bx > 0, for smooth vectors, too, which only the coarse
 * levels act upon. */
TEST(the_preconditioner_is_symmetric_and_positive_definite)
{
    scoped_sheet q = open_sheet(60);
    const int64_t n = q.p.n;
    scoped_memory double *x = take(n), *y = take(n), *Bx = take(n), *By = take(n);
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
}

/* 8 and 13 iterations; inertia, which bounds the condition number, is 16 times smaller in the large sheet.
 * With a single coarse level or none the numbers are a multiple of these and grow with the nodes along a
 * side; with aggregates of all nodes that bending couples they are 9 and 18. */
TEST(a_large_stiff_sheet_takes_few_iterations)
{
    scoped_sheet small = open_sheet(30), large = open_sheet(120);
    factor(&small);
    factor(&large);
    const int few = iterations(&small), many = iterations(&large);
    ck_assert_msg(few <= 10 && many <= 16, "%d and %d iterations", few, many);
}

TEST(a_matrix_that_is_not_positive_definite_is_noticed)
{
    scoped_sheet q = open_sheet(60);
    int64_t stride;
    double *at = drape_pattern_at(&q.p, q.values, 1000, q.p.diagonal[1000], &stride);
    *at = -1;
    ck_assert_int_eq(drape_multigrid_factor(q.m, q.values, q.x), DRAPE_RETRY_LINEAR);
}

/* Pieces that are coupled to nothing else, single nodes among them, end the levels. */
TEST(separate_nodes)
{
    scoped_context *ctx = make_context();
    scoped_arena *arena = drape_arena_create(ctx);
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
}
