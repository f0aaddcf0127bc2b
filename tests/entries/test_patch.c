/*
 * test_patch.c: stretch.patch on any mesh: exact for uniform strains, and in equilibrium under them; no
 * in-plane modes without energy but the rigid ones; strains of the fourth order in isometric bending, where
 * those of stretch.cst are of the second; and meshes of a few triangles.
 */
#include <stdio.h>
#include <stdlib.h>

#include "assemble/check.h"
#include "models.h"
#include "sparse/project.h"
#include "support/suite.h"

static drape_model *sheet(drape_context *ctx, const char *name, enum model_mesh mesh)
{
    const drape_entry_def term = {name, NULL, 0};
    return make_model(ctx, &(model_def){.mesh = mesh, .terms = &term, .term_count = 1});
}

/* An inner node has as many edges as triangles around it. marked: 1 on the boundary. */
static void mark_boundary(const drape_model *m, int32_t *marked)
{
    memset(marked, 0, (size_t)m->node_count * sizeof *marked);
    for (int32_t e = 0; e < 2 * m->edge_count; e++)
        marked[m->edge[e]]++;
    for (int32_t t = 0; t < 3 * m->triangle_count; t++)
        marked[m->triangle[t]]--;
}

/* A uniform stretching with shear, rotated out of the plane of rest: every measure is l . e, so the energy is
 * that of stretch.cst, and so are all forces, which vanish inside. */
TEST(uniform_strain_is_exact)
{
    static const double f[6] = {1.1, 0.07, -0.04, 0.93, 0.3, -0.2}; /* of x and z */
    scoped_context *ctx = make_context();
    for (int mesh = 0; mesh < MESH_CURVED; mesh++) {
        double g[2][3 * 64] = {{0}}, energy[2] = {0}, largest = 0, inside = 0;
        int32_t boundary[64];
        for (int k = 0; k < 2; k++) {
            scoped_model *m = sheet(ctx, k ? "stretch.cst" : "stretch.patch", (enum model_mesh)mesh);
            const drape_elements *el = &m->terms[0].elements;
            double x[3 * 64];
            ck_assert_int_le(m->node_count, 64);
            mark_boundary(m, boundary);
            for (int32_t i = 0; i < m->node_count; i++)
                for (int c = 0; c < 3; c++)
                    x[3 * i + c] = f[2 * c] * m->rest[3 * i] + f[2 * c + 1] * m->rest[3 * i + 2];
            for (int32_t e = 0; e < el->count; e++) {
                double q, dq[DRAPE_MAX_ELEMENT_DOFS];
                m->terms[0].ops->measure(el, e, 1, x, NULL, &q, dq, NULL);
                const double force = el->rest[e] * (q - el->rest[el->count + e]);
                energy[k] += force * (q - el->rest[el->count + e]) / 2;
                for (int i = 0; i < 3 * el->nodes; i++)
                    g[k][3 * el->node[e * el->nodes + i / 3] + i % 3] += force * dq[i];
            }
            for (int32_t i = 0; k == 0 && i < 3 * m->node_count; i++) {
                double *max = boundary[i / 3] ? &largest : &inside;
                *max = fmax(*max, fabs(g[0][i]));
            }
        }
        /* Rounding: the coefficients of second derivatives are up to some 10. */
        ck_assert_double_eq_tol(energy[0] / energy[1], 1, 1e-12);
        ck_assert_double_le(inside, 1e-12 * largest);
        for (int i = 0; i < 3 * 64; i++)
            ck_assert_double_eq_tol(g[0][i], g[1][i], 1e-12 * largest);
    }
}

/* The in-plane part of the Hessian at rest, sum k dq dq' (n x n, n = 2 node_count). */
static void plane_hessian(const drape_model *m, double *h)
{
    const drape_elements *el = &m->terms[0].elements;
    const size_t n = 2 * (size_t)m->node_count;
    memset(h, 0, n * n * sizeof *h);
    for (int32_t e = 0; e < el->count; e++) {
        double q, dq[DRAPE_MAX_ELEMENT_DOFS];
        m->terms[0].ops->measure(el, e, 1, m->rest, NULL, &q, dq, NULL);
        for (int a = 0; a < 2 * el->nodes; a++)
            for (int b = 0; b < 2 * el->nodes; b++) {
                const size_t row = 2 * (size_t)el->node[e * el->nodes + a / 2] + (size_t)(a % 2),
                             column = 2 * (size_t)el->node[e * el->nodes + b / 2] + (size_t)(b % 2);
                h[n * row + column] +=
                    el->rest[e] * dq[3 * (a / 2) + 2 * (a % 2)] * dq[3 * (b / 2) + 2 * (b % 2)];
            }
    }
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Means of strains are softer than strains, but every mode that is not rigid keeps a good part of its
 * stiffness: from the same place in the order of eigenvalues, at least a twentieth. One that would be free of
 * energy if it were not for the boundary would keep less the larger the mesh. */
TEST(only_rigid_motions_are_free)
{
    scoped_context *ctx = make_context();
    for (int mesh = 0; mesh < MESH_CURVED; mesh++) {
        double lowest[2][128];
        int n = 0;
        for (int k = 0; k < 2; k++) {
            static double h[128 * 128], v[128 * 128];
            scoped_model *m = sheet(ctx, k ? "stretch.cst" : "stretch.patch", (enum model_mesh)mesh);
            n = 2 * m->node_count;
            plane_hessian(m, h);
            drape_diagonalise(n, h, v);
            for (int i = 0; i < n; i++)
                lowest[k][i] = h[(n + 1) * i];
            qsort(lowest[k], (size_t)n, sizeof(double), ascending);
        }
        for (int i = 0; i < n; i++) {
            if (i < 3)
                ck_assert_double_le(fabs(lowest[0][i]), 1e-12 * lowest[0][n - 1]);
            else
                ck_assert_double_ge(lowest[0][i], lowest[1][i] / 20);
        }
    }
}

/* The largest |q - q0| on a sheet that is rolled up obliquely on a cylinder. */
static double rolled_strain(const drape_model *m, double curvature)
{
    const drape_elements *el = &m->terms[0].elements;
    const double along[2] = {cos(0.7), sin(0.7)};
    double x[3 * 64], largest = 0;
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *X = m->rest + 3 * i, s = along[0] * X[0] + along[1] * X[2],
                     t = along[0] * X[2] - along[1] * X[0];
        x[3 * i] = sin(curvature * s) / curvature;
        x[3 * i + 1] = (1 - cos(curvature * s)) / curvature;
        x[3 * i + 2] = t;
    }
    for (int32_t e = 0; e < el->count; e++) {
        double q;
        m->terms[0].ops->measure(el, e, 1, x, NULL, &q, NULL, NULL);
        largest = fmax(largest, fabs(q - el->rest[el->count + e]));
    }
    return largest;
}

/* Edges of 0.1 m: 0.05 and 0.1 of the radius. */
TEST(isometric_bending_has_no_strain_of_second_order)
{
    scoped_context *ctx = make_context();
    for (int mesh = 0; mesh < MESH_CURVED; mesh++) {
        scoped_model *cst = sheet(ctx, "stretch.cst", (enum model_mesh)mesh),
                     *patch = sheet(ctx, "stretch.patch", (enum model_mesh)mesh);
        ck_assert_int_le(cst->node_count, 64);
        /* The ratio of orders two and four; the next order adds some (curvature edge)^2 of it. */
        ck_assert_double_eq_tol(rolled_strain(cst, 1) / rolled_strain(cst, 0.5), 4, 0.1);
        ck_assert_double_eq_tol(rolled_strain(patch, 1) / rolled_strain(patch, 0.5), 16, 0.8);
        ck_assert_double_le(rolled_strain(patch, 1), 0.01 * rolled_strain(cst, 1));
    }
}

/* One triangle, two, a strip of one cell, a tetrahedron, on which all neighbours have the same apex, and a
 * pyramid: at rest without force, with exact derivatives. */
TEST(small_meshes)
{
    static const double x[] = {0, 0, 0, 1, 0, 0, 0.4, 0, -0.9, 1.3, 0, -1, 0.5, 0.8, -0.3};
    static const struct {
        int nodes, triangles;
        int32_t triangle[12];
    } meshes[] = {{3, 1, {0, 1, 2}},
                  {4, 2, {0, 1, 2, 1, 3, 2}},
                  {5, 3, {0, 1, 2, 1, 3, 2, 1, 4, 3}},
                  {4, 4, {0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0}},
                  {5, 4, {0, 1, 4, 1, 3, 4, 3, 2, 4, 2, 0, 4}}};
    scoped_context *ctx = make_context();
    for (size_t k = 0; k < sizeof meshes / sizeof *meshes; k++) {
        const drape_setting material[] = {
            {"young_modulus", 1e5, NULL}, {"thickness", 1e-3, NULL}, {"areal_density", 0.2, NULL}};
        const drape_entry_def term = {"stretch.patch", NULL, 0};
        const double tetrahedron[] = {0, 0, 0, 1, 0, 0, 0.4, 0, -0.9, 0.5, 0.8, -0.3};
        drape_scene_def scene = scene_def();
        drape_cloth_def cloth = cloth_def();
        scoped_model *m = NULL;
        drape_check_result results[16];
        int32_t count = 0;
        cloth.mesh.positions = k == 3 ? tetrahedron : x;
        cloth.mesh.triangles = meshes[k].triangle;
        cloth.mesh.node_count = (size_t)meshes[k].nodes;
        cloth.mesh.triangle_count = (size_t)meshes[k].triangles;
        cloth.material = material, cloth.material_count = 3;
        cloth.terms = &term, cloth.term_count = 1;
        scene.cloths = &cloth, scene.cloth_count = 1;
        assert_ok(ctx, drape_model_create(ctx, &scene, &m));
        const drape_elements *el = &m->terms[0].elements;
        for (int32_t e = 0; e < el->count; e++) {
            double q;
            m->terms[0].ops->measure(el, e, 1, m->rest, NULL, &q, NULL, NULL);
            ck_assert_double_eq(q, el->rest[el->count + e]);
        }
        ck_assert_int_eq(drape_model_check_derivatives(m, 5, results, 16, &count), DRAPE_OK);
        ck_assert_int_gt(count, 0);
        for (int i = 0; i < count && i < 16; i++)
            ck_assert_msg(results[i].pass, "mesh %d, %s: %g", (int)k, results[i].what, results[i].error);
    }
}
