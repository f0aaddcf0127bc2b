/* test_linears.c: every row of the linear solvers on the pattern of a cloth, against Gaussian elimination in
 * long double. */
#include "solvers/linear.h"

#include "model/model.h"
#include "models.h"
#include "support/suite.h"

/* ---- Matrices on the pattern of a cloth ---- */

typedef struct problem {
    drape_context *ctx;
    drape_model *model;
    const drape_pattern *p;
    size_t n;
    double *values, *b, *kept, *x, *expected;
    long double *dense;
} problem;

static void *take(size_t count, size_t size)
{
    void *memory = calloc(count, size);
    ck_assert_ptr_nonnull(memory);
    return memory;
}

static problem open_problem(void)
{
    const drape_row_def terms[] = {{.type = "stretch.edge"}, {.type = "bend.hinge"}};
    problem q = {.ctx = make_context()};
    q.model = make_model(
        q.ctx, &(model_def){.mesh = MESH_IRREGULAR, .terms = terms, .term_count = 2, .pinned = true});
    q.p = &q.model->pattern;
    q.n = (size_t)q.p->n;
    ck_assert_uint_eq(q.n, 3 * (IRREGULAR_NODES - 2));
    ck_assert_int_lt(q.p->nonzeros, (int64_t)(q.n * q.n));
    q.values = take((size_t)q.p->nonzeros, sizeof *q.values);
    q.b = take(q.n, sizeof *q.b);
    q.kept = take(q.n, sizeof *q.kept);
    q.x = take(q.n, sizeof *q.x);
    q.expected = take(q.n, sizeof *q.expected);
    q.dense = take(q.n * (q.n + 1), sizeof *q.dense);
    return q;
}

static void close_problem(problem *q)
{
    free(q->values);
    free(q->b);
    free(q->kept);
    free(q->x);
    free(q->expected);
    free(q->dense);
    drape_model_destroy(&q->model);
    drape_context_destroy(&q->ctx);
}

typedef enum matrix_kind { SPD, INDEFINITE, UNSYMMETRIC, TINY, HUGE_ENTRIES, KIND_COUNT } matrix_kind;

/* Random entries; a diagonal that dominates where the matrix is to be positive definite. */
static void fill(problem *q, matrix_kind kind, uint64_t seed)
{
    const drape_pattern *p = q->p;
    double scale = kind == TINY ? 1e-9 : kind == HUGE_ENTRIES ? 1e12 : 1;
    for (int64_t c = 0; c < p->n; c++) {
        double *diagonal = NULL, sum = 0;
        for (int64_t k = p->column[c]; k < p->column[c + 1]; k++) {
            int64_t r = p->row[k], low = r < c ? r : c, high = r < c ? c : r;
            uint64_t own = seed * 1000003 + (uint64_t)(low * p->n + high) +
                           (kind == UNSYMMETRIC && r < c ? 77777777 : 0);
            random_number(&own);
            q->values[k] = scale * random_number(&own);
            sum += fabs(q->values[k]);
            diagonal = r == c ? &q->values[k] : diagonal;
        }
        if (kind == SPD || kind == TINY || kind == HUGE_ENTRIES)
            *diagonal = sum;
    }
    for (size_t i = 0; i < q->n; i++)
        q->b[i] = random_number(&seed);
}

/* Partial pivoting. */
static void solve_dense(problem *q)
{
    size_t n = q->n, w = n + 1;
    long double *a = q->dense;
    memset(a, 0, n * w * sizeof *a);
    for (size_t c = 0; c < n; c++)
        for (int64_t k = q->p->column[c]; k < q->p->column[c + 1]; k++)
            a[w * (size_t)q->p->row[k] + c] = q->values[k];
    for (size_t i = 0; i < n; i++)
        a[w * i + n] = q->b[i];
    for (size_t k = 0; k < n; k++) {
        size_t pivot = k;
        for (size_t i = k + 1; i < n; i++)
            pivot = fabsl(a[w * i + k]) > fabsl(a[w * pivot + k]) ? i : pivot;
        for (size_t j = 0; j < w; j++) {
            long double kept = a[w * k + j];
            a[w * k + j] = a[w * pivot + j];
            a[w * pivot + j] = kept;
        }
        for (size_t i = k + 1; i < n; i++) {
            long double factor = a[w * i + k] / a[w * k + k];
            for (size_t j = k; j < w; j++)
                a[w * i + j] -= factor * a[w * k + j];
        }
    }
    for (size_t i = n; i-- > 0;) {
        long double sum = a[w * i + n];
        for (size_t j = i + 1; j < n; j++)
            sum -= a[w * i + j] * a[w * j + n];
        a[w * i + n] = sum / a[w * i + i];
        q->expected[i] = (double)a[w * i + n];
    }
}

/* Factors the values, solves, and compares: 1e-10 of the largest component. The conditions of these matrices
 * are some 1e3, so 1e-13 is left to be lost. */
static void check_solution(problem *q, const drape_linear_ops *ops, void *solver, const char *what)
{
    double size = 0, error = 0;
    ck_assert_msg(ops->factor(solver, q->values) == DRAPE_OK, "%s: %s", ops->name, what);
    memcpy(q->kept, q->b, q->n * sizeof *q->b);
    ck_assert_msg(ops->solve(solver, q->b, q->x) == DRAPE_OK, "%s: %s", ops->name, what);
    ck_assert_mem_eq(q->kept, q->b, q->n * sizeof *q->b);
    solve_dense(q);
    for (size_t i = 0; i < q->n; i++) {
        size = fmax(size, fabs(q->expected[i]));
        error = fmax(error, fabs(q->x[i] - q->expected[i]));
    }
    ck_assert_msg(error <= 1e-10 * size, "%s: %s is off by %g of %g", ops->name, what, error, size);
}

static void *open_solver(problem *q, const drape_linear_ops *ops)
{
    void *solver = NULL;
    ck_assert_msg(ops->create(q->ctx, q->p, &solver) == DRAPE_OK, "%s", drape_context_message(q->ctx));
    ck_assert_ptr_nonnull(solver);
    return solver;
}

/* ---- Tests ---- */

START_TEST(rows_are_well_formed)
{
    int count = 0;
    for (; drape_linears[count]; count++) {
        const drape_linear_ops *ops = drape_linears[count];
        check_row(ops->name, ops->summary, ops->reference, false);
        ck_assert_str_eq(ops->name, drape_linears_words[count]);
        ck_assert(ops->create && ops->factor && ops->solve && ops->destroy && ops->bytes);
        for (int i = 0; i < count; i++)
            ck_assert_str_ne(ops->name, drape_linears[i]->name);
    }
    ck_assert_ptr_null(drape_linears_words[count]);
    ck_assert_int_ge(count, 2);
}
END_TEST

START_TEST(random_systems_are_solved)
{
    static const char *const names[] = {"positive definite", "indefinite", "unsymmetric", "tiny", "huge"};
    problem q = open_problem();
    for (int i = 0; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        for (uint64_t seed = 1; seed <= 20; seed++) { /* kinds mixed: kept pivots meet other matrices */
            fill(&q, (matrix_kind)(seed * 3 % KIND_COUNT), seed);
            check_solution(&q, drape_linears[i], solver, names[seed * 3 % KIND_COUNT]);
        }
        ck_assert_uint_gt(drape_linears[i]->bytes(solver), q.n * sizeof(double));
        drape_linears[i]->destroy(&solver);
        ck_assert_ptr_null(solver);
        drape_linears[i]->destroy(&solver);
    }
    close_problem(&q);
}
END_TEST

START_TEST(several_right_hand_sides_of_one_factorisation)
{
    problem q = open_problem();
    for (int i = 0; drape_linears[i]; i++) {
        const drape_linear_ops *ops = drape_linears[i];
        void *solver = open_solver(&q, ops);
        fill(&q, INDEFINITE, 3);
        check_solution(&q, ops, solver, "first");
        double first = q.x[0];
        for (size_t k = 0; k < q.n; k++)
            q.b[k] *= -2;
        ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_OK);
        ck_assert_double_eq(q.x[0], -2 * first);
        ops->destroy(&solver);
    }
    close_problem(&q);
}
END_TEST

static void clear_column(problem *q, int64_t c)
{
    for (int64_t k = q->p->column[c]; k < q->p->column[c + 1]; k++)
        q->values[k] = 0;
}

static void clear_row(problem *q, int64_t r)
{
    for (int64_t k = 0; k < q->p->nonzeros; k++)
        if (q->p->row[k] == r)
            q->values[k] = 0;
}

static void break_matrix(problem *q, int how)
{
    int64_t middle = q->p->n / 2;
    fill(q, how == 5 ? INDEFINITE : SPD, 8);
    switch (how) {
    case 0:
        clear_column(q, middle);
        break;
    case 1:
        clear_row(q, q->p->n - 1);
        break;
    case 2:
        memset(q->values, 0, (size_t)q->p->nonzeros * sizeof *q->values);
        break;
    case 3:
        for (int64_t k = 0; k < 3; k++)
            clear_row(q, middle + k), clear_column(q, middle + k);
        break;
    case 4:
        q->values[q->p->nonzeros - 1] = NAN;
        break;
    case 5:
        q->values[q->p->column[middle] + 2] = NAN;
        break;
    case 6:
        q->values[0] = INFINITY;
        break;
    default:
        for (int64_t k = 0; k < q->p->nonzeros; k++)
            q->values[k] = -INFINITY;
    }
}
enum { WAYS = 8 };

/* As the first matrix, which pivots are chosen for, and as a later one, for which they are kept. */
START_TEST(broken_matrices_are_told_and_good_ones_work_again)
{
    problem q = open_problem();
    for (int i = 0; drape_linears[i]; i++)
        for (int how = 0; how < WAYS; how++)
            for (int later = 0; later < 2; later++) {
                const drape_linear_ops *ops = drape_linears[i];
                void *solver = open_solver(&q, ops);
                fill(&q, SPD, 1);
                if (later)
                    check_solution(&q, ops, solver, "before");
                else
                    ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
                break_matrix(&q, how);
                ck_assert_msg(ops->factor(solver, q.values) == DRAPE_RETRY_LINEAR,
                              "%s takes the broken matrix %d, %s", ops->name, how, later ? "later" : "first");
                ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
                for (uint64_t seed = 1; seed <= 3; seed++) {
                    fill(&q, (matrix_kind)(seed % 2), seed);
                    check_solution(&q, ops, solver, "after a broken one");
                }
                ops->destroy(&solver);
            }
    close_problem(&q);
}
END_TEST

START_TEST(a_right_hand_side_that_is_not_finite_is_told)
{
    problem q = open_problem();
    for (int i = 0; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        fill(&q, SPD, 2);
        check_solution(&q, drape_linears[i], solver, "before");
        q.b[q.n / 2] = NAN;
        ck_assert_int_eq(drape_linears[i]->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
        fill(&q, SPD, 2);
        check_solution(&q, drape_linears[i], solver, "after");
        drape_linears[i]->destroy(&solver);
    }
    close_problem(&q);
}
END_TEST

/* The pivots that the first matrix chose are zero in the second, which is a good matrix: off-diagonal ones in
 * each block of a node. */
START_TEST(kept_pivots_that_become_zero_are_chosen_again)
{
    problem q = open_problem();
    for (int i = 0; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        fill(&q, SPD, 4);
        check_solution(&q, drape_linears[i], solver, "diagonal pivots");
        for (int64_t c = 0; c < q.p->n; c++)
            for (int64_t k = q.p->column[c]; k < q.p->column[c + 1]; k++) {
                bool own = q.p->row[k] / 3 == c / 3;
                q.values[k] = own ? (q.p->row[k] % 3 == (c + 1) % 3 ? 2.385 : 0) : 1e-3 * q.values[k];
            }
        check_solution(&q, drape_linears[i], solver, "other pivots");
        drape_linears[i]->destroy(&solver);
    }
    close_problem(&q);
}
END_TEST

SUITE("linears", rows_are_well_formed, random_systems_are_solved,
      several_right_hand_sides_of_one_factorisation, broken_matrices_are_told_and_good_ones_work_again,
      a_right_hand_side_that_is_not_finite_is_told, kept_pivots_that_become_zero_are_chosen_again)
