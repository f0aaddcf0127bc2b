/*
 * test_midedge.c: bend.midedge on any mesh: exact for every quadratic deflection; its sums over
 * hinges equal its sums over squares.
 */
#include <stdio.h>

#include "assemble/check.h"
#include "models.h"
#include "support/suite.h"
#include "terms/midedge.h"

#define SLOPE 1e-4 /* of the deflections: the angles differ from their linear parts by its square */

static drape_model *sheet(drape_context *ctx, const drape_setting *settings, size_t count,
                          enum model_mesh mesh)
{
    const drape_entry_def term = {"bend.midedge", settings, count};
    return make_model(ctx, &(model_def){.mesh = mesh, .terms = &term, .term_count = 1});
}

static void deflect(const drape_model *m, const double bend[3], double *x)
{
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *X = m->rest + 3 * (size_t)i;
        memcpy(x + 3 * (size_t)i, X, 3 * sizeof *x);
        x[3 * (size_t)i + 1] +=
            SLOPE * (bend[0] * X[0] * X[0] / 2 + bend[1] * X[2] * X[2] / 2 + bend[2] * X[0] * X[2]);
    }
}

/* A triangle without a free edge has three consecutive squares with the same first three nodes; their
 * energy is A/2 b'Cb. The warp is x, the weft -z: that changes the sign of b12, which C does not couple to
 * the others. */
static void check_energies(const drape_model *m, const double *x, const double law[4], const double bend[3])
{
    static const double flat[9 * 3000];
    const drape_elements *el = &m->terms[0].elements;
    const double density = 0.5 * SLOPE * SLOPE *
                           (law[0] * bend[0] * bend[0] + law[1] * bend[1] * bend[1] +
                            2 * law[2] * bend[0] * bend[1] + 4 * law[3] * bend[2] * bend[2]);
    int whole = 0;
    ck_assert_int_le(el->count, 3000);
    for (int32_t e = 0; e + 2 < el->count; e++) {
        const size_t n = (size_t)el->nodes;
        const int32_t *node = el->node + (size_t)e * n;
        if (memcmp(node, node + n, 3 * sizeof *node) != 0 ||
            memcmp(node, node + 2 * n, 3 * sizeof *node) != 0)
            continue;
        double energy = 0, area2, u[3], v[3], w[3];
        for (int32_t k = e; k < e + 3; k++) {
            double q;
            m->terms[0].ops->measure(el, k, 1, x, flat, &q, NULL, NULL);
            energy += 0.5 * el->rest[k] * q * q;
        }
        for (int k = 0; k < 3; k++) {
            u[k] = m->rest[3 * node[1] + k] - m->rest[3 * node[0] + k];
            v[k] = m->rest[3 * node[2] + k] - m->rest[3 * node[0] + k];
        }
        w[0] = u[1] * v[2] - u[2] * v[1], w[1] = u[2] * v[0] - u[0] * v[2], w[2] = u[0] * v[1] - u[1] * v[0];
        area2 = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        /* Slopes are below 2 SLOPE on a sheet of 0.5 m, their squares 4e-8; coefficients below 1e-9 were left
         * out. */
        ck_assert_double_eq_tol(energy / (density * area2 / 2), 1, 1e-6);
        whole++;
        e += 2;
    }
    ck_assert_int_ge(whole, 4);
}

TEST(quadratics_are_exact)
{
    static const double bends[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.613, -0.241, 0.377}};
    static const drape_setting woven[] = {
        {"warp", 3e-4, NULL}, {"weft", 1e-4, NULL}, {"twist", 0.7e-4, NULL}, {"poisson", 0.2, NULL}};
    const double c11 = 3e-4 / 0.96, c22 = 1e-4 / 0.96;
    const double law[4] = {c11, c22, 0.2 * sqrt(c11 * c22), 0.7e-4};
    scoped_context *ctx = make_context();
    double x[3 * 64];
    for (int mesh = 0; mesh < MESH_CURVED; mesh++)
        for (size_t k = 0; k < sizeof bends / sizeof *bends; k++) {
            scoped_model *m = sheet(ctx, woven, 4, (enum model_mesh)mesh);
            ck_assert_int_le(m->node_count, 64);
            deflect(m, bends[k], x);
            check_energies(m, x, law, bends[k]);
        }
}

/* Forces and matrix are summed over hinges and patches of squares. They equal the sums over squares, each by
 * itself, of f dq and of f ddq + (k + w c) dq dq'; and have the same bits for any number of threads. */
TEST(sums_over_hinges_equal_sums_over_squares)
{
    static const drape_setting damping[] = {{"beta", 0.01, NULL}};
    const drape_entry_def terms[] = {{"bend.midedge", NULL, 0}, {"damp.kelvin_voigt", damping, 1}};
    scoped_context *ctx = make_context();
    for (int mesh = 0; mesh < MESH_COUNT; mesh++) {
        scoped_model *m = make_model(
            ctx,
            &(model_def){.mesh = (enum model_mesh)mesh, .terms = terms, .term_count = 2, .pinned = true});
        const drape_elements *el = &m->terms[0].elements;
        const size_t n = 3 * (size_t)m->node_count, nonzeros = (size_t)m->pattern.nonzeros;
        drape_arena memory = drape_arena_of(ctx);
        drape_state s;
        uint64_t seed = 17;
        ck_assert_int_eq(drape_state_create(&memory, m, &s), DRAPE_OK);
        double *history = drape_arena_take(&memory, (size_t)m->measure_count, sizeof *history);
        for (size_t i = 0; i < n; i++)
            s.x[i] += 0.01 * random_number(&seed);
        for (int64_t i = 0; i < m->measure_count; i++)
            history[i] = random_number(&seed);
        const drape_point point = {
            .x = s.x, .v = s.v, .internal = s.internal, .weight = 60, .history = history};

        double *g = drape_arena_take(&memory, n, sizeof *g);
        double *h = drape_arena_take(&memory, nonzeros, sizeof *h);
        double *expected = drape_arena_take(&memory, n, sizeof *expected);
        double *matrix = drape_arena_take(&memory, nonzeros, sizeof *matrix);
        for (int32_t e = 0; e < el->count; e++) {
            const int32_t *node = el->node + (size_t)e * (size_t)el->nodes;
            const int d = 3 * el->nodes;
            const double k = el->rest[e], c = 0.01 * k;
            double q, dq[DRAPE_MAX_ELEMENT_DOFS];
            static double ddq[DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS];
            m->terms[0].ops->measure(el, e, 1, s.x, s.internal, &q, dq, ddq);
            const double force = k * (q - el->rest[el->count + e]) + c * (60 * q + history[e]);
            for (int i = 0; i < d; i++) {
                const size_t row = 3 * (size_t)node[i / 3] + (size_t)(i % 3);
                expected[row] += force * dq[i];
                for (int j = 0; j < d; j++) {
                    const int32_t from = m->free_of_node[node[i / 3]], to = m->free_of_node[node[j / 3]];
                    const double value = force * ddq[d * i + j] + (k + 60 * c) * dq[i] * dq[j];
                    if (from < 0 || to < 0 || value == 0)
                        continue;
                    ck_assert(drape_pattern_has(&m->pattern, from, to));
                    int64_t stride;
                    double *at = drape_pattern_at(&m->pattern, matrix, to,
                                                  drape_pattern_find(&m->pattern, from, to), &stride);
                    at[(j % 3) * stride + i % 3] += value;
                }
            }
        }
        for (int threads = 1; threads <= 3; threads++) {
            drape_system *system = make_system(&memory, m, threads);
            double *g_of = drape_arena_take(&memory, n, sizeof *g_of),
                   *h_of = drape_arena_take(&memory, nonzeros, sizeof *h_of);
            drape_system_force(system, &point, g_of);
            drape_system_jacobian(system, &point, 0, 0, h_of);
            if (threads == 1) {
                memcpy(g, g_of, n * sizeof *g);
                memcpy(h, h_of, nonzeros * sizeof *h);
            }
            ck_assert_mem_eq(g, g_of, n * sizeof *g);
            ck_assert_mem_eq(h, h_of, nonzeros * sizeof *h);
            drape_system_destroy(&system);
        }
        double force = 0, stiffness = 0;
        for (size_t i = 0; i < n; i++)
            force = fmax(force, fabs(expected[i]));
        for (size_t i = 0; i < nonzeros; i++)
            stiffness = fmax(stiffness, fabs(matrix[i]));
        ck_assert(force > 0 && stiffness > 0);
        /* Rounding of sums of about 100 numbers of that size. */
        for (size_t i = 0; i < n; i++)
            ck_assert_double_eq_tol(g[i], expected[i], 1e-13 * force);
        for (size_t i = 0; i < nonzeros; i++)
            ck_assert_double_eq_tol(h[i], matrix[i], 1e-13 * stiffness);
        drape_arena_free(&memory);
    }
}
