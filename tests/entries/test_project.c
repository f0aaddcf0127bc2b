/* test_project.c: the nearest positive semidefinite matrix, checked by the properties that define it. */
#include "sparse/project.h"

#include "models.h"
#include "support/suite.h"

enum { N = DRAPE_MAX_ELEMENT_DOFS, TRIALS = 20 };

static void random_symmetric(int n, uint64_t *seed, double *a)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++)
            a[n * i + j] = a[n * j + i] = random_number(seed);
}

static double norm(int n, const double *a)
{
    double sum = 0;
    for (int i = 0; i < n * n; i++)
        sum += a[i] * a[i];
    return sqrt(sum);
}

/* Whether sign a + shift I has a Cholesky factor: all eigenvalues of sign a lie above -shift. */
static bool is_above(int n, const double *a, double sign, double shift)
{
    double l[N * N];
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = sign * a[n * i + j] + (i == j ? shift : 0);
            for (int k = 0; k < j; k++)
                sum -= l[n * i + k] * l[n * j + k];
            if (i == j && !(sum > 0))
                return false;
            l[n * i + j] = i == j ? sqrt(sum) : sum / l[n * j + j];
        }
    return true;
}

/* P is the projection of A onto the cone of positive semidefinite matrices exactly if P is in the cone, P -
 * A is in it too (the cone is its own dual), and the two are orthogonal (Moreau). */
static void check_projected(int n, const double *a, const double *p)
{
    double scale = norm(n, a), inner = 0, rest[N * N];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            ck_assert_double_le(fabs(p[n * i + j] - p[n * j + i]), 1e-14 * scale);
            rest[n * i + j] = p[n * i + j] - a[n * i + j];
            inner += p[n * i + j] * rest[n * i + j];
        }
    ck_assert(is_above(n, p, 1, 1e-13 * scale));
    ck_assert(is_above(n, rest, 1, 1e-13 * scale));
    ck_assert_double_le(fabs(inner), 1e-13 * scale * scale);
}

TEST(it_is_the_nearest)
{
    uint64_t seed = 4711;
    for (int n = 1; n <= N; n++)
        for (int trial = 0; trial < TRIALS; trial++) {
            double a[N * N], p[N * N], again[N * N];
            random_symmetric(n, &seed, a);
            memcpy(p, a, sizeof a);
            drape_project(n, p);
            check_projected(n, a, p);
            memcpy(again, p, sizeof p);
            drape_project(n, again);
            for (int i = 0; i < n * n; i++)
                ck_assert_double_le(fabs(again[i] - p[i]), 1e-14 * norm(n, a));
        }
}

TEST(a_positive_matrix_keeps_its_bits)
{
    uint64_t seed = 5;
    for (int n = 1; n <= N; n++) {
        double b[N * N], a[N * N], p[N * N];
        random_symmetric(n, &seed, b);
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) {
                a[n * i + j] = i == j ? 0.1 : 0;
                for (int k = 0; k < n; k++)
                    a[n * i + j] += b[n * i + k] * b[n * j + k];
            }
        memcpy(p, a, sizeof a);
        drape_project(n, p);
        ck_assert_mem_eq(p, a, (size_t)(n * n) * sizeof *a);
    }
}

/* A NaN must stay a NaN, and must not make the rotations endless. */
TEST(nan_stays)
{
    uint64_t seed = 9;
    double a[N * N];
    random_symmetric(N, &seed, a);
    a[N + 2] = a[2 * N + 1] = NAN;
    drape_project(N, a);
    bool finite = true;
    for (int i = 0; i < N * N; i++)
        finite = finite && isfinite(a[i]);
    ck_assert(!finite);
}

/* ---- The membrane ---- */

static drape_model *membrane(drape_context *ctx)
{
    const drape_entry_def term = {"stretch.cst", NULL, 0};
    return make_model(ctx, &(model_def){.mesh = MESH_IRREGULAR, .terms = &term, .term_count = 1});
}

/* The Jacobian of a sheet that is stretched by these factors along x and z, exact and projected. Returns the
 * largest entry of their difference over the largest of the exact one. */
static double projected_away(drape_context *ctx, const drape_model *m, double along, double across)
{
    const size_t values = (size_t)m->pattern.nonzeros;
    double *x = drape_alloc(ctx, 3 * (size_t)m->node_count, sizeof *x),
           *v = drape_alloc(ctx, 3 * (size_t)m->node_count, sizeof *v),
           *exact = drape_alloc(ctx, values, sizeof *exact), *projected = drape_alloc(ctx, values, sizeof *x);
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = NULL;
    double max = 0, away = 0;
    ck_assert(x && v && exact && projected);
    ck_assert_int_eq(drape_system_create(&memory, m, 1, &system), DRAPE_OK);
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *rest = m->rest + 3 * (size_t)i;
        x[3 * i] = along * rest[0], x[3 * i + 1] = rest[1], x[3 * i + 2] = across * rest[2];
    }
    const drape_point point = {.x = x, .v = v};
    drape_system_jacobian(system, &point, 0, 0, exact);
    drape_system_jacobian(system, &point, 0, 1, projected);
    for (size_t i = 0; i < values; i++) {
        max = fmax(max, fabs(exact[i]));
        away = fmax(away, fabs(projected[i] - exact[i]));
    }
    drape_system_destroy(&system);
    drape_arena_free(&memory);
    drape_free(ctx, x), drape_free(ctx, v), drape_free(ctx, exact), drape_free(ctx, projected);
    return away / max;
}

/* Equal tension in both directions: f1 L1 = (S, nu S), f2 L2 = (0, (1 - nu) S), f3 = 0: all of it is
 * tension, and nothing is lost. If compressed as much, all of the stress is lost: S/E = .02 (1 + .01)/(1 -
 * nu) of a stiffness of about 1. */
TEST(the_membrane_keeps_its_tension)
{
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    scoped_model *m = membrane(ctx);
    ck_assert_double_le(projected_away(ctx, m, 1.02, 1.02), 1e-13);
    ck_assert_double_ge(projected_away(ctx, m, 0.98, 0.98), 1e-3);
}
