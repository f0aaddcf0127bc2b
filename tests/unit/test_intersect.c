/* test_intersect.c: edges that pass through triangles are counted exactly, wherever they are and however near
 * to a side; signs of volumes are exact. */
#include "geometry/intersect.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

/* Two squares of 5 x 5 nodes, the second one rotated upright through the middle of the first and slightly
 * shifted so that no edge touches a node. */
static drape_model *crossed_squares(drape_context *ctx, double shift)
{
    static const drape_setting grid[] = {
        {"columns", 5, NULL}, {"rows", 5, NULL}, {"width", 1, NULL}, {"height", 1, NULL}};
    static const drape_setting material[] = {
        {"young_modulus", 1e5, NULL}, {"thickness", 1e-3, NULL}, {"density", 200, NULL}};
    drape_cloth_def cloths[2];
    drape_scene_def scene = scene_def();
    drape_model *model = NULL;
    for (int c = 0; c < 2; c++) {
        drape_cloth_def_init(&cloths[c], sizeof cloths[c]);
        cloths[c].mesh.grid = (drape_entry_def){"square", grid, 4};
        cloths[c].material = material;
        cloths[c].material_count = 3;
    }
    const double upright[4] = {1, 0, 0, 90};
    memcpy(cloths[1].mesh.rotate, upright, sizeof upright);
    cloths[1].mesh.translate[0] = 0.013;
    cloths[1].mesh.translate[1] = shift;
    cloths[1].mesh.translate[2] = -0.387;
    scene.cloths = cloths;
    scene.cloth_count = 2;
    ck_assert_int_eq(drape_model_create(ctx, &scene, &model), DRAPE_OK);
    return model;
}

/* Every edge against every triangle, by solving for their common point. */
static int64_t count_all_pairs(const drape_model *m, const double *x)
{
    int64_t count = 0;
    for (int32_t e = 0; e < m->edge_count; e++)
        for (int32_t t = 0; t < m->triangle_count; t++) {
            const int32_t *edge = m->edge + 2 * (size_t)e, *tri = m->triangle + 3 * (size_t)t;
            const double *p = x + 3 * (size_t)edge[0], *q = x + 3 * (size_t)edge[1],
                         *a = x + 3 * (size_t)tri[0];
            double d[3], u[3], v[3], w[3];
            bool shared = false;
            for (int k = 0; k < 3; k++) {
                d[k] = q[k] - p[k];
                u[k] = x[3 * (size_t)tri[1] + (size_t)k] - a[k];
                v[k] = x[3 * (size_t)tri[2] + (size_t)k] - a[k];
                w[k] = p[k] - a[k];
                shared = shared || tri[k] == edge[0] || tri[k] == edge[1];
            }
            /* Cramer's rule for s u + r v - l d = w */
            double det = -(u[0] * (v[1] * d[2] - v[2] * d[1]) - u[1] * (v[0] * d[2] - v[2] * d[0]) +
                           u[2] * (v[0] * d[1] - v[1] * d[0]));
            double s = -(w[0] * (v[1] * d[2] - v[2] * d[1]) - w[1] * (v[0] * d[2] - v[2] * d[0]) +
                         w[2] * (v[0] * d[1] - v[1] * d[0])) /
                       det;
            double r = -(u[0] * (w[1] * d[2] - w[2] * d[1]) - u[1] * (w[0] * d[2] - w[2] * d[0]) +
                         u[2] * (w[0] * d[1] - w[1] * d[0])) /
                       det;
            double l = (u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) +
                        u[2] * (v[0] * w[1] - v[1] * w[0])) /
                       det;
            count += !shared && det != 0 && s > 0 && r > 0 && s + r < 1 && l > 0 && l < 1;
        }
    return count;
}

TEST(crossing_sheets_are_counted_as_by_all_pairs)
{
    scoped_context *ctx = NULL;
    drape_intersections found;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    scoped_model *model = crossed_squares(ctx, -0.4629);
    double *x = model->rest;
    int64_t expected = count_all_pairs(model, x);
    ck_assert_int_gt(expected, 5); /* 4 cells wide: at least one edge a cell */
    ck_assert_int_eq(drape_find_intersections(ctx, model, x, &found), DRAPE_OK);
    ck_assert_int_eq(found.count, expected);
    ck_assert_int_ge(found.edge[0], 0);
    uint64_t random = 1; /* crumpled states: many pairs in many cells */
    for (int round = 0; round < 20; round++) {
        for (int32_t i = 0; i < 3 * model->node_count; i++) {
            random = random * UINT64_C(6364136223846793005) + 1;
            x[i] += 0.2 * ((double)(random >> 11) / 9007199254740992.0 - 0.5);
        }
        ck_assert_int_eq(drape_find_intersections(ctx, model, x, &found), DRAPE_OK);
        ck_assert_int_eq(found.count, count_all_pairs(model, x));
    }
}

/* In a flat sheet nothing crosses, whatever its rotation: its volumes are rounding errors. */
TEST(a_flat_sheet_has_none)
{
    static const drape_setting grid[] = {
        {"columns", 17, NULL}, {"rows", 13, NULL}, {"width", 1.3, NULL}, {"height", 0.7, NULL}};
    static const drape_setting material[] = {
        {"young_modulus", 1e5, NULL}, {"thickness", 1e-3, NULL}, {"density", 200, NULL}};
    for (int k = 0; k < 36; k++) {
        scoped_context *ctx = NULL;
        scoped_model *model = NULL;
        drape_cloth_def cloth = cloth_def();
        drape_scene_def scene = scene_def();
        drape_intersections found;
        ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
        cloth.mesh.grid = (drape_entry_def){"square", grid, 4};
        cloth.material = material;
        cloth.material_count = 3;
        const double turn[4] = {k % 2, k % 3, 1, 10.0 * k - 175};
        memcpy(cloth.mesh.rotate, turn, sizeof turn);
        cloth.mesh.translate[0] = k;
        scene.cloths = &cloth;
        scene.cloth_count = 1;
        ck_assert_int_eq(drape_model_create(ctx, &scene, &model), DRAPE_OK);
        ck_assert_int_eq(drape_find_intersections(ctx, model, model->rest, &found), DRAPE_OK);
        ck_assert_int_eq(found.count, 0);
    }
}

/* Points of a grid of steps of 2^-12 around (1, 1, 1) 2^20, far beyond what doubles resolve in a volume: d
 * = a + i (b - a) + j (c - a) lies in the plane exactly, and one step along z beside it on the side of the
 * normal's z. All sums are integers below 2^52 steps, so the points are exact. */
TEST(signs_are_exact)
{
    const double step = 1.0 / 4096, origin = 1048576;
    uint64_t random = 7;
    int sides[3] = {0};
    for (int n = 0; n < 20000; n++) {
        double p[3][3], d[3], u[3], v[3];
        for (int k = 0; k < 9; k++) {
            random = random * UINT64_C(6364136223846793005) + 1;
            p[k / 3][k % 3] = origin + step * (double)((random >> 33) % 1000);
        }
        const double i = (double)(n % 17 - 8), j = (double)(n % 13 - 6);
        const int beside = n % 3 - 1;
        for (int k = 0; k < 3; k++) {
            u[k] = p[1][k] - p[0][k];
            v[k] = p[2][k] - p[0][k];
            d[k] = p[0][k] + i * u[k] + j * v[k] + (k == 2 ? beside * step : 0);
        }
        const double up = u[0] * v[1] - u[1] * v[0];
        const int expected = beside * ((up > 0) - (up < 0));
        ck_assert_int_eq(drape_orient(p[0], p[1], p[2], d), expected);
        ck_assert_int_eq(drape_orient(p[1], p[0], p[2], d), -expected);
        ck_assert_int_eq(drape_orient(d, p[1], p[2], p[0]), -expected);
        sides[expected + 1]++;
    }
    for (int k = 0; k < 3; k++)
        ck_assert_int_gt(sides[k], 5000);
}

static void count_visits(void *user, int32_t edge, int32_t triangle)
{
    (void)edge;
    (void)triangle;
    ++*(int64_t *)user;
}

/* An edge through the common side of two triangles passes through both, from either side; one that ends on
 * the plane passes through none. */
TEST(sides_belong_to_triangles)
{
    const double x[] = {0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1, 0.5, -1, 0.5, 0.5, 1, 0.5, 0.5, 0, 0.5};
    const int32_t triangle[] = {0, 1, 2, 0, 2, 3}, edges[][2] = {{4, 5}, {5, 4}, {4, 6}, {6, 5}};
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    for (int i = 0; i < 4; i++) {
        int64_t count = 0;
        const drape_surface surface = {
            .x = x, .edge = edges[i], .triangle = triangle, .edge_count = 1, .triangle_count = 2};
        ck_assert_int_eq(drape_intersect(ctx, &surface, &surface, count_visits, &count), DRAPE_OK);
        ck_assert_int_eq(count, i < 2 ? 2 : 0);
    }
}
