/* test_linears.c: all linear solvers on the pattern of a cloth, against Gaussian elimination in long
 * double. */
#include "solvers/elimination.h"
#include "solvers/inertia.h"
#include "solvers/linear.h"
#include "solvers/refine.h"

#include <float.h>

#include "model/model.h"
#include "models.h"
#include "support/failing_allocator.h"
#include "support/suite.h"

/* ---- Matrices on the pattern of a cloth ---- */

typedef struct problem {
    drape_context *ctx;
    drape_arena *arena; /* of solvers */
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
    const drape_entry_def terms[] = {{.type = "stretch.edge"}, {.type = "bend.hinge"}};
    problem q = {.ctx = make_context()};
    q.arena = drape_arena_create(q.ctx);
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
    drape_arena_destroy(&q->arena);
    drape_model_destroy(&q->model);
    drape_context_destroy(&q->ctx);
}

#define scoped_problem SCOPED(close_problem) problem

typedef enum matrix_kind { SPD, INDEFINITE, UNSYMMETRIC, TINY, HUGE_ENTRIES, KIND_COUNT } matrix_kind;

/* Random entries; the diagonal dominates if the matrix is to be positive definite. */
static void fill(problem *q, matrix_kind kind, uint64_t seed)
{
    const drape_pattern *p = q->p;
    double scale = kind == TINY ? 1e-9 : kind == HUGE_ENTRIES ? 1e12 : 1;
    for (int64_t c = 0; c < p->n; c++) {
        double *diagonal = NULL, sum = 0;
        for (int64_t k = p->column[c]; k < p->column[c + 1]; k++) {
            int64_t r = drape_pattern_row(p, c, k), low = r < c ? r : c, high = r < c ? c : r;
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

/* Gaussian elimination with partial pivoting. */
static void solve_dense(problem *q)
{
    size_t n = q->n, w = n + 1;
    long double *a = q->dense;
    memset(a, 0, n * w * sizeof *a);
    for (size_t c = 0; c < n; c++)
        for (int64_t k = q->p->column[c]; k < q->p->column[c + 1]; k++)
            a[w * (size_t)drape_pattern_row(q->p, (int64_t)c, k) + c] = q->values[k];
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

/* Factors the values, solves, and compares: the limit is 1e-10 of the largest component. The condition
 * numbers of these matrices are about 1e3, so the expected loss is 1e-13. */
static void check_solution(problem *q, const drape_linear_ops *ops, void *solver, const char *what)
{
    double size = 0, error = 0;
    ck_assert_msg(ops->factor(solver, q->values) == DRAPE_OK, "%s: %s", ops->entry.name, what);
    memcpy(q->kept, q->b, q->n * sizeof *q->b);
    ck_assert_msg(ops->solve(solver, q->b, q->x) == DRAPE_OK, "%s: %s", ops->entry.name, what);
    ck_assert_mem_eq(q->kept, q->b, q->n * sizeof *q->b);
    solve_dense(q);
    for (size_t i = 0; i < q->n; i++) {
        size = fmax(size, fabs(q->expected[i]));
        error = fmax(error, fabs(q->x[i] - q->expected[i]));
    }
    ck_assert_msg(error <= 1e-10 * size, "%s: %s is off by %g of %g", ops->entry.name, what, error, size);
}

static void *open_solver(problem *q, const drape_linear_ops *ops)
{
    void *solver = NULL;
    assert_ok(q->ctx, ops->create(q->arena, q->p, &solver));
    ck_assert_ptr_nonnull(solver);
    return solver;
}

enum { FIRST = 1 }; /* in the table: after `auto`, which stands for the others */

/* The report of a solver; empty if it makes none. */
static drape_linear_report report_of(const drape_linear_ops *ops, const void *solver)
{
    drape_linear_report report = {0};
    if (ops->report)
        ops->report(solver, &report);
    return report;
}

static const drape_linear_ops *multifrontal(void)
{
    const drape_linear_ops *found = NULL;
    for (int i = FIRST; drape_linears[i]; i++)
        if (strcmp(drape_linears[i]->entry.name, "multifrontal") == 0)
            found = drape_linears[i];
    ck_assert_ptr_nonnull(found);
    return found;
}

/* ---- Tests ---- */

TEST(entries_are_well_formed)
{
    int count = 0;
    for (; drape_linears[count]; count++) {
        const drape_linear_ops *ops = drape_linears[count];
        ck_assert_ptr_eq(drape_linear_registry.entries[count], &ops->entry);
        ck_assert_str_eq(ops->entry.name, drape_linears_names[count]);
        ck_assert(ops->pick || (ops->create && ops->factor && ops->solve));
    }
    ck_assert_ptr_null(drape_linears_names[count]);
    ck_assert_int_eq(drape_registry_count(&drape_linear_registry), count);
}

TEST(random_systems_are_solved)
{
    static const char *const names[] = {"positive definite", "indefinite", "unsymmetric", "tiny", "huge"};
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        for (uint64_t seed = 1; seed <= 20;
             seed++) { /* kinds alternate, so that kept pivots meet other matrices */
            fill(&q, (matrix_kind)(seed * 3 % KIND_COUNT), seed);
            check_solution(&q, drape_linears[i], solver, names[seed * 3 % KIND_COUNT]);
        }
        ck_assert_uint_gt(q.arena->bytes + drape_linear_bytes(drape_linears[i], solver),
                          q.n * sizeof(double));
        drape_linear_destroy(drape_linears[i], &solver);
        ck_assert_ptr_null(solver);
        drape_linear_destroy(drape_linears[i], &solver);
    }
}

static void clear_column(problem *q, int64_t c)
{
    for (int64_t k = q->p->column[c]; k < q->p->column[c + 1]; k++)
        q->values[k] = 0;
}

static void clear_row(problem *q, int64_t r)
{
    for (int64_t c = 0; c < q->p->n; c++)
        for (int64_t k = q->p->column[c]; k < q->p->column[c + 1]; k++)
            if (drape_pattern_row(q->p, c, k) == r)
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
enum { BREAKS = 8 };

/* Once as the first matrix, for which pivots are chosen, and once as a later one, for which they are kept. */
TEST(broken_matrices_are_reported_and_good_ones_work_again)
{
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++)
        for (int how = 0; how < BREAKS; how++)
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
                              "%s accepts the broken matrix %d, %s", ops->entry.name, how,
                              later ? "later" : "first");
                ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
                for (uint64_t seed = 1; seed <= 3; seed++) {
                    fill(&q, (matrix_kind)(seed % 2), seed);
                    check_solution(&q, ops, solver, "after a broken one");
                }
                drape_linear_destroy(ops, &solver);
            }
}

TEST(a_right_hand_side_that_is_not_finite_is_reported)
{
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        fill(&q, SPD, 2);
        check_solution(&q, drape_linears[i], solver, "before");
        q.b[q.n / 2] = NAN;
        ck_assert_int_eq(drape_linears[i]->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
        fill(&q, SPD, 2);
        check_solution(&q, drape_linears[i], solver, "after");
        drape_linear_destroy(drape_linears[i], &solver);
    }
}

/* The pivots that were chosen for the first matrix are zero in the second, which is regular: its pivots are
 * off the diagonal of each node's block. */
TEST(kept_pivots_that_become_zero_are_chosen_again)
{
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        fill(&q, SPD, 4);
        check_solution(&q, drape_linears[i], solver, "diagonal pivots");
        for (int64_t c = 0; c < q.p->n; c++)
            for (int64_t k = q.p->column[c]; k < q.p->column[c + 1]; k++) {
                bool own = drape_pattern_row(q.p, c, k) / 3 == c / 3;
                q.values[k] =
                    own ? (drape_pattern_row(q.p, c, k) % 3 == (c + 1) % 3 ? 2.385 : 0) : 1e-3 * q.values[k];
            }
        check_solution(&q, drape_linears[i], solver, "other pivots");
        drape_linear_destroy(drape_linears[i], &solver);
    }
}

/* The 3 x 3 block of a node is symmetric in the pattern of every mesh, so a difference there is the
 * smallest that a solver can overlook. Taking one triangle for both gives an error of about the
 * difference. */
TEST(a_small_part_that_is_not_symmetric_is_not_lost)
{
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++) {
        void *solver = open_solver(&q, drape_linears[i]);
        for (int upper = 0; upper < 2; upper++)
            for (double size = 1; size > 1e-8; size /= 10) {
                fill(&q, SPD, 5);
                int64_t c = 3 * (q.p->n / 6) + upper; /* entry (1 - upper, upper) of that block */
                for (int64_t k = q.p->column[c]; k < q.p->column[c + 1]; k++)
                    if (drape_pattern_row(q.p, c, k) == c + 1 - 2 * upper)
                        q.values[k] *= 1 + size;
                check_solution(&q, drape_linears[i], solver, "a little unsymmetric");
            }
        drape_linear_destroy(drape_linears[i], &solver);
    }
}

/* Whether the solver passes matrices that are not positive definite to another solver. */
static bool falls_back(const drape_linear_ops *ops)
{
    return strcmp(ops->entry.name, "pcg") == 0;
}

/* Whether it takes more memory for the first such matrix. */
static bool takes_more(const drape_linear_ops *ops)
{
    return falls_back(ops) || strcmp(ops->entry.name, "multifrontal") == 0;
}

/* Such solvers pass on all matrices that are not positive definite, and only these. */
TEST(fallbacks_are_counted)
{
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++) {
        const drape_linear_ops *ops = drape_linears[i];
        void *solver = open_solver(&q, ops);
        int64_t before = report_of(ops, solver).fallbacks, counts[KIND_COUNT];
        ck_assert_int_eq(before, 0);
        for (int kind = 0; kind < KIND_COUNT; kind++) {
            fill(&q, (matrix_kind)kind, 6);
            check_solution(&q, ops, solver, "counted");
            counts[kind] = report_of(ops, solver).fallbacks - before;
            before += counts[kind];
        }
        bool falls = falls_back(ops);
        ck_assert_int_eq(counts[SPD] + counts[TINY] + counts[HUGE_ENTRIES], 0);
        ck_assert_int_eq(counts[INDEFINITE], falls);
        ck_assert_int_eq(counts[UNSYMMETRIC], falls);
        drape_linear_destroy(ops, &solver);
    }
}

/* An indefinite matrix is refused if a definite one is asked for, at the latest when it is solved with; no
 * other solver is needed then. */
TEST(iterative_solvers_refuse_indefinite_matrices_if_asked)
{
    scoped_problem q = open_problem();
    for (int i = FIRST; drape_linears[i]; i++) {
        const drape_linear_ops *ops = drape_linears[i];
        if (!falls_back(ops))
            continue;
        void *solver = open_solver(&q, ops);
        for (uint64_t seed = 1; seed <= 5; seed++) {
            fill(&q, INDEFINITE, seed);
            drape_status status = ops->factor_definite(solver, q.values);
            ck_assert_int_eq(status ? status : ops->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
            fill(&q, SPD, seed);
            ck_assert_int_eq(ops->factor_definite(solver, q.values), DRAPE_OK);
            ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_OK);
        }
        ck_assert_int_eq(report_of(ops, solver).fallbacks, 0);
        drape_linear_destroy(ops, &solver);
    }
}

/* ---- A sheet of many supernodes ---- */

typedef struct sheet {
    drape_context *ctx;
    drape_arena *arena; /* of the pattern and solvers */
    drape_pattern p;
    double *values, *b, *x, *again;
} sheet;

/* side x side nodes, each coupled to those at most two rows and columns away: the pattern of a cloth with
 * hinges. */
static sheet open_sheet(int32_t side)
{
    sheet q = {.ctx = make_context()};
    q.arena = drape_arena_create(q.ctx);
    int32_t count = side * side, patches = (side - 2) * (side - 2),
            *block = take((size_t)count, sizeof *block), *node = take(9 * (size_t)patches, sizeof *node),
            *next = node;
    for (int32_t i = 0; i < count; i++)
        block[i] = i;
    for (int32_t r = 0; r + 2 < side; r++)
        for (int32_t c = 0; c + 2 < side; c++)
            for (int32_t k = 0; k < 9; k++)
                *next++ = (r + k / 3) * side + c + k % 3;
    const drape_coupling coupling = {.count = patches, .nodes = 9, .node = node};
    ck_assert_int_eq(drape_pattern_build(q.arena, count, block, &coupling, 1, &q.p), DRAPE_OK);
    free(block);
    free(node);
    q.values = take((size_t)q.p.nonzeros, sizeof *q.values);
    q.b = take((size_t)q.p.n, sizeof *q.b);
    q.x = take((size_t)q.p.n, sizeof *q.x);
    q.again = take((size_t)q.p.n, sizeof *q.again);
    return q;
}

static void close_sheet(sheet *q)
{
    free(q->values);
    free(q->b);
    free(q->x);
    free(q->again);
    drape_arena_destroy(&q->arena);
    drape_context_destroy(&q->ctx);
}

#define scoped_sheet SCOPED(close_sheet) sheet

/* Symmetric and random. With shift 1 the diagonal dominates weakly; the smaller shift, the more
 * indefinite. */
static void fill_sheet(sheet *q, double shift, uint64_t seed)
{
    uint64_t side = seed;
    for (int64_t c = 0; c < q->p.n; c++) {
        double *diagonal = NULL, sum = 0;
        for (int64_t k = q->p.column[c]; k < q->p.column[c + 1]; k++) {
            int64_t r = drape_pattern_row(&q->p, c, k), low = r < c ? r : c, high = r < c ? c : r;
            uint64_t own = seed * 1000003 + (uint64_t)(low * q->p.n + high);
            random_number(&own);
            q->values[k] = random_number(&own);
            sum += fabs(q->values[k]);
            diagonal = r == c ? &q->values[k] : diagonal;
        }
        *diagonal = shift * sum;
        q->b[c] = random_number(&side);
    }
}

/* Largest |A x - b| in a row, as a part of its terms |A| |x| + |b|. */
static double backward_error(const sheet *q)
{
    double *r = take((size_t)q->p.n, sizeof *r), *size = take((size_t)q->p.n, sizeof *size), max = 0;
    for (int64_t i = 0; i < q->p.n; i++) {
        r[i] = -q->b[i];
        size[i] = fabs(q->b[i]);
    }
    for (int64_t c = 0; c < q->p.n; c++)
        for (int64_t k = q->p.column[c]; k < q->p.column[c + 1]; k++) {
            r[drape_pattern_row(&q->p, c, k)] += q->values[k] * q->x[c];
            size[drape_pattern_row(&q->p, c, k)] += fabs(q->values[k] * q->x[c]);
        }
    for (int64_t i = 0; i < q->p.n; i++)
        max = fmax(max, fabs(r[i]) / size[i]);
    free(r);
    free(size);
    return max;
}

/* Backward stability: |A x - b| <= c eps (|A| |x| + |b|) row by row, c = 1e4 for Cholesky factors of about
 * 1e3 unknowns. KLU accepts a diagonal pivot that is a thousandth of the largest: a thousand times that if
 * the matrix is indefinite. */
static void check_residual(const sheet *q, bool definite, const char *name)
{
    const double error = backward_error(q);
    ck_assert_msg(error <= (definite ? 1e4 : 1e7) * DBL_EPSILON, "%s: a row of A x - b is %g of its terms",
                  name, error);
}

/* The fallback of pcg is multifrontal, which itself may need klu for some of the indefinite matrices. */
static void check_fallback(const drape_linear_ops *ops, const drape_linear_report *report, int64_t count)
{
    const bool falls = falls_back(ops);
    ck_assert_int_ge(report->fallbacks, falls ? count : 0);
    ck_assert_int_le(report->fallbacks, count);
    ck_assert_int_eq(report->fallback != NULL, report->fallbacks > 0);
    if (report->fallback)
        ck_assert_str_eq(report->fallback->entry.name, falls ? "multifrontal" : "klu");
}

/* Definite and indefinite matrices in turn; a second solver with the same input gives the same bits. A dense
 * matrix has no supernodes, and takes n^3: a small sheet does for it. */
TEST(a_sheet_of_many_supernodes)
{
    static const double shifts[] = {1.01, 0.15, 1.5, 0.2, 1.01};
    for (int i = FIRST; drape_linears[i]; i++) {
        const drape_linear_ops *ops = drape_linears[i];
        scoped_sheet q = open_sheet(strcmp(ops->entry.name, "dense") == 0 ? 8 : 24);
        void *solver = NULL, *other = NULL;
        ck_assert_int_eq(ops->create(q.arena, &q.p, &solver), DRAPE_OK);
        ck_assert_int_eq(ops->create(q.arena, &q.p, &other), DRAPE_OK);
        for (size_t k = 0; k < sizeof shifts / sizeof *shifts; k++) {
            fill_sheet(&q, shifts[k], 7);
            ck_assert_int_eq(ops->factor(solver, q.values), DRAPE_OK);
            ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_OK);
            check_residual(&q, shifts[k] > 1, ops->entry.name);
            ck_assert_int_eq(ops->factor(other, q.values), DRAPE_OK);
            ck_assert_int_eq(ops->solve(other, q.b, q.again), DRAPE_OK);
            ck_assert_mem_eq(q.again, q.x, (size_t)q.p.n * sizeof *q.x);
        }
        drape_linear_report report = report_of(ops, solver);
        check_fallback(ops, &report, 2);
        drape_linear_destroy(ops, &solver);
        drape_linear_destroy(ops, &other);
    }
}

/* Ordered by minimum degree and, if METIS is built in, by nested dissection; with several branches for the
 * threads and fronts that they share. */
TEST(threads_give_the_same_bits)
{
    static const int32_t sides[] = {24, 40};
    for (int i = FIRST; drape_linears[i]; i++)
        for (size_t k = 0; drape_linears[i]->use_threads && k < sizeof sides / sizeof *sides; k++) {
            const drape_linear_ops *ops = drape_linears[i];
            scoped_sheet q = open_sheet(sides[k]);
            void *solver = NULL;
            ck_assert_int_eq(ops->create(q.arena, &q.p, &solver), DRAPE_OK);
            fill_sheet(&q, 1.01, 7);
            for (int threads = 1; threads <= 3; threads += 2) {
                double *x = threads == 1 ? q.x : q.again;
                drape_pool *pool = NULL;
                ck_assert_int_eq(drape_pool_create(q.arena, threads, &pool), DRAPE_OK);
                ops->use_threads(solver, pool);
                ck_assert_int_eq(ops->factor(solver, q.values), DRAPE_OK);
                ck_assert_int_eq(ops->solve(solver, q.b, x), DRAPE_OK);
                ck_assert_mem_eq(x, q.x, (size_t)q.p.n * sizeof *x);
                ops->use_threads(solver, NULL);
                drape_pool_destroy(&pool);
            }
            check_residual(&q, true, ops->entry.name);
            drape_linear_destroy(ops, &solver);
        }
}

/* What only other matrices need is taken when it is needed: definite matrices do not pay for it. If there is
 * no memory for it then, the solver reports that, has no factors, and succeeds when it is called again. */
TEST(no_memory_for_other_matrices)
{
    static const int32_t sides[] = {8, 24};
    for (int i = FIRST; drape_linears[i]; i++)
        for (size_t k = 0; k < sizeof sides / sizeof *sides; k++) {
            const drape_linear_ops *ops = drape_linears[i];
            failing_allocator memory = {0};
            drape_context *ctx = failing_context(&memory);
            drape_arena arena = drape_arena_of(ctx);
            sheet q = open_sheet(sides[k]);
            void *solver = NULL;
            ck_assert_int_eq(ops->create(&arena, &q.p, &solver), DRAPE_OK);
            fill_sheet(&q, 1.5, 7);
            ck_assert_int_eq(ops->factor(solver, q.values), DRAPE_OK);
            ck_assert_ptr_null(report_of(ops, solver).fallback);
            size_t definite = arena.bytes + drape_linear_bytes(ops, solver);
            long before = memory.calls, failed = 0;
            fill_sheet(&q, 0.2, 7);
            drape_status status = DRAPE_E_MEMORY;
            for (memory.fail_at = before + 1; status == DRAPE_E_MEMORY;
                 memory.fail_at = memory.calls + 1 + failed) {
                status = ops->factor(solver, q.values);
                if (status)
                    ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
                else /* pcg needs the fallback only when it solves */
                    status = ops->solve(solver, q.b, q.x);
                failed += status == DRAPE_E_MEMORY;
            }
            ck_assert_int_eq(status, DRAPE_OK);
            ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_OK);
            check_residual(&q, false, ops->entry.name);
            ck_assert_int_eq(report_of(ops, solver).fallback != NULL, falls_back(ops));
            ck_assert_int_eq(failed > 0, takes_more(ops));
            if (failed > 0)
                ck_assert_uint_gt(arena.bytes + drape_linear_bytes(ops, solver), definite);
            drape_linear_destroy(ops, &solver);
            drape_arena_free(&arena);
            close_sheet(&q);
            drape_context_destroy(&ctx);
            ck_assert_int_eq(memory.live, 0);
        }
}

/* The solver with the largest best_from that is not above the size; klu below all others. */
TEST(auto_chooses_by_size_and_reports_it)
{
    static const int32_t sides[] = {3, 30};
    const drape_linear_ops *chooser = drape_linears[0];
    ck_assert_str_eq(chooser->entry.name, "auto");
    ck_assert_int_eq(chooser->best_from, 0);
    for (size_t k = 0; k < sizeof sides / sizeof *sides; k++) {
        scoped_sheet q = open_sheet(sides[k]);
        char why[DRAPE_LINEAR_WHY] = "";
        const drape_linear_ops *expected = NULL, *found = drape_linear_of(NULL, 0, q.p.n);
        for (int i = FIRST; drape_linears[i]; i++)
            if (drape_linears[i]->best_from > 0 && drape_linears[i]->best_from <= q.p.n &&
                (!expected || drape_linears[i]->best_from > expected->best_from))
                expected = drape_linears[i];
        ck_assert_ptr_eq(found, expected);
        ck_assert_ptr_nonnull(found);
        drape_linear_explain(q.p.n, why);
        ck_assert_str_ne(why, "");
        if (k == 0)
            ck_assert_str_eq(found->entry.name, "klu");
    }
}

/* ---- Matrices that are not positive definite ---- */

typedef enum hard_kind {
    SADDLE,          /* some nodes have no diagonal block, as Lagrange multipliers do */
    NEGATIVE,        /* the diagonal dominates and has both signs */
    ROTATED,         /* not symmetric, the diagonal is smaller than most entries */
    CONVECTED,       /* half of it symmetric, half of it antisymmetric */
    BADLY_SCALED,    /* rows and columns by 1e-12 to 1e12 */
    NEARLY_SINGULAR, /* condition number 1e12 */
    HARD_COUNT
} hard_kind;
static void fill_hard(sheet *q, hard_kind kind)
{
    fill_sheet(q, kind == NEARLY_SINGULAR ? 1.0 : 1.01, 11);
    const drape_pattern *p = &q->p;
    for (int64_t c = 0; c < p->n; c++)
        for (int64_t k = p->column[c]; k < p->column[c + 1]; k++) {
            const int64_t r = drape_pattern_row(p, c, k);
            double *v = &q->values[k];
            if (kind == SADDLE && r / 3 == c / 3 && c / 3 % 3 == 1)
                *v = 0;
            else if (kind == NEGATIVE && r == c && c % 5 < 2)
                *v = -*v;
            else if (kind == ROTATED && r == c)
                *v *= 0.01;
            else if (kind == CONVECTED && r != c)
                *v *= r < c ? 1.9 : 0.1;
            else if (kind == BADLY_SCALED)
                *v *= pow(10, 12 * sin((double)r)) * pow(10, 12 * sin((double)(7 * c)));
        }
}

/* The graph Laplacian has the three translations as its null space; the diagonal is raised by `shift` in
 * part. */
static void fill_laplacian(sheet *q, double shift)
{
    const drape_pattern *p = &q->p;
    for (int64_t c = 0; c < p->n; c++) {
        const double neighbours = (double)(p->column[c + 1] - p->column[c]) / 3 - 1;
        for (int64_t k = p->column[c]; k < p->column[c + 1]; k++)
            q->values[k] = drape_pattern_row(p, c, k) == c           ? neighbours * (1 + shift)
                           : drape_pattern_row(p, c, k) % 3 == c % 3 ? -1
                                                                     : 0;
    }
}

/* The Laplacian itself is singular: it is refused, or, if rounding errors hide that, gets a solution within
 * the bound. A shift of -1e-11 moves its three eigenvalues 0 to about -1e-11 of the largest; a larger one
 * makes more of them negative. */
TEST(a_singular_matrix_is_refused_and_a_nearly_singular_one_solved)
{
    const drape_linear_ops *ops = multifrontal();
    scoped_sheet q = open_sheet(16);
    void *solver = NULL;
    ck_assert_int_eq(ops->create(q.arena, &q.p, &solver), DRAPE_OK);
    for (int64_t i = 0; i < q.p.n; i++)
        q.b[i] = 1 + sin((double)i);
    fill_laplacian(&q, 0);
    drape_status status = ops->factor(solver, q.values);
    ck_assert(status == DRAPE_RETRY_LINEAR || ops->solve(solver, q.b, q.x) == DRAPE_RETRY_LINEAR ||
              backward_error(&q) < 1e-10);
    static const double shifts[] = {-1e-11, -1e-6, -0.3};
    for (int k = 0; k < 3; k++) {
        fill_laplacian(&q, shifts[k]);
        ck_assert_int_eq(ops->factor(solver, q.values), DRAPE_OK);
        ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_OK);
        ck_assert_double_lt(backward_error(&q), 1e-10);
    }
    drape_linear_destroy(ops, &solver);
}

/* Gershgorin's circles of a matrix whose diagonal dominates do not contain 0, so there is a negative
 * eigenvalue for each negative number on the diagonal. Of the Laplacian, lowered by less than its second
 * eigenvalue, three are. */
TEST(negative_eigenvalues_are_counted)
{
    scoped_sheet q = open_sheet(20);
    int64_t negative = -1, expected = 0;
    bool known = false;
    for (int64_t c = 0; c < q.p.n; c++)
        expected += c % 5 < 2;
    fill_hard(&q, NEGATIVE);
    ck_assert_int_eq(drape_inertia(q.ctx, &q.p, q.values, NULL, &negative, &known), DRAPE_OK);
    ck_assert(known);
    ck_assert_int_eq(negative, expected);
    fill_laplacian(&q, -1e-9);
    ck_assert_int_eq(drape_inertia(q.ctx, &q.p, q.values, NULL, &negative, &known), DRAPE_OK);
    ck_assert(known);
    ck_assert_int_eq(negative, 3);
    fill_sheet(&q, 1.01, 3);
    ck_assert_int_eq(drape_inertia(q.ctx, &q.p, q.values, NULL, &negative, &known), DRAPE_OK);
    ck_assert(known);
    ck_assert_int_eq(negative, 0);
    memset(q.values, 0, (size_t)q.p.nonzeros * sizeof *q.values);
    ck_assert_int_eq(drape_inertia(q.ctx, &q.p, q.values, NULL, &negative, &known), DRAPE_OK);
    ck_assert(!known);
    q.values[0] = NAN;
    ck_assert_int_eq(drape_inertia(q.ctx, &q.p, q.values, NULL, &negative, &known), DRAPE_OK);
    ck_assert(!known);
}

/* A raised flag ends a factorisation of each class; lowered, the next one succeeds. */
TEST(a_factorisation_can_be_cancelled)
{
    static const hard_kind kinds[] = {NEGATIVE, CONVECTED};
    const drape_linear_ops *ops = multifrontal();
    scoped_sheet q = open_sheet(20);
    atomic_bool flag = true;
    const atomic_bool *place = NULL;
    void *solver = NULL;
    ck_assert_int_eq(ops->create(q.arena, &q.p, &solver), DRAPE_OK);
    ops->watch(solver, &place);
    for (int k = 0; k < 3; k++) {
        if (k < 2)
            fill_hard(&q, kinds[k]);
        else
            fill_sheet(&q, 1.01, 3);
        place = &flag;
        ck_assert_int_eq(ops->factor(solver, q.values), DRAPE_E_STOPPED);
        ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_RETRY_LINEAR);
        place = NULL;
        ck_assert_int_eq(ops->factor(solver, q.values), DRAPE_OK);
        ck_assert_int_eq(ops->solve(solver, q.b, q.x), DRAPE_OK);
    }
    drape_linear_destroy(ops, &solver);
}

/* For fewer unknowns than any solver is the fastest for, the one for the smallest size. */
TEST(the_best_solver_of_no_unknowns)
{
    ck_assert_str_eq(drape_linear_best(0)->entry.name, "klu");
    ck_assert_str_eq(drape_linear_best(1)->entry.name, "klu");
    ck_assert_str_eq(drape_linear_best(1000)->entry.name, "multifrontal");
}

/* A + B with B' = -B has A as its symmetric part and B as its antisymmetric one, up to the rounding of the
 * sum; A itself keeps its bits. */
TEST(the_symmetric_part_is_exact)
{
    scoped_sheet q = open_sheet(8);
    fill_sheet(&q, 1, 7);
    scoped_memory double *symmetric = take((size_t)q.p.nonzeros, sizeof *symmetric),
                         *rest = take((size_t)q.p.nonzeros, sizeof *rest);
    memcpy(symmetric, q.values, (size_t)q.p.nonzeros * sizeof *symmetric);
    drape_pattern_symmetrize(&q.p, q.values);
    ck_assert(memcmp(symmetric, q.values, (size_t)q.p.nonzeros * sizeof *symmetric) == 0);
    for (int64_t c = 0; c < q.p.n; c++)
        for (int64_t k = q.p.column[c]; k < q.p.column[c + 1]; k++) {
            const int64_t r = drape_pattern_row(&q.p, c, k);
            q.values[k] += sin((double)(r * r - c * c)); /* odd in (r, c) */
        }
    drape_pattern_add_antisymmetric(&q.p, q.values, rest);
    for (int64_t c = 0; c < q.p.n; c++)
        for (int64_t k = q.p.column[c]; k < q.p.column[c + 1]; k++) {
            const int64_t r = drape_pattern_row(&q.p, c, k);
            ck_assert_double_eq_tol(rest[k], sin((double)(r * r - c * c)),
                                    2 * DBL_EPSILON * (fabs(symmetric[k]) + 1));
        }
    drape_pattern_symmetrize(&q.p, q.values);
    for (int64_t k = 0; k < q.p.nonzeros; k++)
        ck_assert_double_eq_tol(q.values[k], symmetric[k], 2 * DBL_EPSILON * (fabs(symmetric[k]) + 1));
}

/* The factors of a solver as a preconditioner. */
typedef struct factored {
    const drape_linear_ops *ops;
    void *solver;
} factored;

static void apply(void *user, const double *b, double *x)
{
    const factored *f = user;
    ck_assert(f->ops->solve(f->solver, b, x) == DRAPE_OK);
}

static double euclidean(size_t n, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum);
}

/* |b - A x| */
static double residual_of(problem *q)
{
    memcpy(q->kept, q->b, q->n * sizeof *q->b);
    for (size_t c = 0; c < q->n; c++)
        for (int64_t k = q->p->column[c]; k < q->p->column[c + 1]; k++)
            q->kept[drape_pattern_row(q->p, (int64_t)c, k)] -= q->values[k] * q->x[c];
    return euclidean(q->n, q->kept, q->expected);
}

/* With the factors of its symmetric part S, an unsymmetric system A x = b is solved to a tolerance. Rows of
 * the random symmetric part are dominated by the diagonal, so S is positive definite with condition numbers
 * of about 1e3; one entry in each of three columns is changed, a change of rank 3, so four
 * iterations end at rounding errors: 1e-10 is far above them. At 1e-2 the solution of S alone misses. */
TEST(a_nearby_matrix_is_corrected)
{
    scoped_problem q = open_problem();
    scoped_memory double *symmetric = take((size_t)q.p->nonzeros, sizeof *symmetric),
                         *zero = take(q.n, sizeof *zero);
    drape_refine work;
    ck_assert(drape_refine_create(q.arena, q.p, &work) == DRAPE_OK);
    for (int i = FIRST; drape_linears[i]; i++) {
        factored f = {drape_linears[i], open_solver(&q, drape_linears[i])};
        fill(&q, SPD, 11);
        memcpy(symmetric, q.values, (size_t)q.p->nonzeros * sizeof *symmetric);
        ck_assert(f.ops->factor(f.solver, symmetric) == DRAPE_OK);
        for (int64_t c = 1; c < q.p->n; c += q.p->n / 3)
            q.values[q.p->column[c]] += 2 * fabs(symmetric[q.p->column[c]]) + 1;
        memset(q.expected, 0, q.n * sizeof *q.expected);
        const double size = euclidean(q.n, q.b, zero);
        apply(&f, q.b, q.x);
        ck_assert_double_gt(residual_of(&q), 1e-2 * size);
        const double tolerances[] = {1e-2, 1e-10};
        for (int k = 0; k < 2; k++) {
            drape_refine_reduce(&work, apply, &f, q.values, q.b, tolerances[k], q.x);
            ck_assert_double_le(residual_of(&q), 1.001 * tolerances[k] * size);
        }
        solve_dense(&q);
        ck_assert_double_le(euclidean(q.n, q.x, q.expected), 1e-6 * euclidean(q.n, q.expected, zero));
        drape_linear_destroy(f.ops, &f.solver);
    }
}

/* ---- Orders ---- */

static drape_model *small_model(drape_context *ctx, bool pinned)
{
    const drape_entry_def terms[] = {{.type = "stretch.edge"}};
    return make_model(
        ctx, &(model_def){.mesh = MESH_IRREGULAR, .terms = terms, .term_count = 1, .pinned = pinned});
}

/* Solvers with equal patterns share one order, also after the pattern that it was found for is gone; it goes
 * with the last of them. Failed allocations leave nothing. */
TEST(equal_patterns_share_an_order)
{
    failing_allocator memory = {0};
    drape_context *ctx = failing_context(&memory);
    drape_model *a = small_model(ctx, true), *b = small_model(ctx, true), *c = small_model(ctx, false);
    drape_shared_elimination *of[4] = {NULL};
    const long live = memory.live;
    ck_assert_int_eq(drape_elimination_share(ctx, &a->pattern, &of[0]), DRAPE_OK);
    drape_model_destroy(&a);
    const long shared = memory.live, calls = memory.calls;
    ck_assert_int_eq(drape_elimination_share(ctx, &b->pattern, &of[1]), DRAPE_OK);
    ck_assert_int_eq(memory.calls, calls);
    ck_assert_ptr_eq(of[0], of[1]);
    ck_assert_int_eq(drape_elimination_share(ctx, &c->pattern, &of[2]), DRAPE_OK);
    ck_assert_ptr_ne(of[2], of[0]);
    ck_assert_int_ne(drape_elimination_of(of[2])->n, drape_elimination_of(of[0])->n);
    ck_assert_uint_gt(drape_elimination_bytes(of[0]), 0);
    drape_elimination_release(&of[2]);
    drape_elimination_release(&of[0]);
    ck_assert_ptr_null(of[0]);
    ck_assert_int_eq(memory.live, shared);
    ck_assert_int_eq(drape_elimination_share(ctx, &b->pattern, &of[3]), DRAPE_OK);
    ck_assert_ptr_eq(of[3], of[1]);
    drape_elimination_release(&of[1]);
    drape_elimination_release(&of[3]);
    drape_elimination_release(&of[3]);
    ck_assert_int_lt(memory.live, live); /* without the model a */
    drape_status status = DRAPE_E_MEMORY;
    const long before = memory.live;
    for (long n = 1; status; n++) {
        memory.fail_at = memory.calls + n;
        status = drape_elimination_share(ctx, &b->pattern, &of[0]);
        memory.fail_at = 0;
        ck_assert(!status || (status == DRAPE_E_MEMORY && memory.live == before && !of[0]));
    }
    drape_elimination_release(&of[0]);
    ck_assert_int_eq(memory.live, before);
    drape_model_destroy(&b), drape_model_destroy(&c);
    drape_context_destroy(&ctx);
    ck_assert_int_eq(memory.live, 0);
}
