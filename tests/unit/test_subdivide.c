/* test_subdivide.c: each triangle in four: the mesh, and what a scene selects, loads and sews of it. */
#include <math.h>

#include "base/vec3.h"
#include "mesh/mesh.h"
#include "support/scene.h"
#include "support/suite.h"

/* A ring of 8 triangles around a square hole, not in one plane. */
static const double ring[] = {0, 0, 0, 3, 0, 0, 3, 0.4, 3, 0, 0, 3, 1, 0, 1, 2, 0, 1, 2, 0.1, 2, 1, 0, 2};
static const int32_t ring_triangles[] = {0, 4, 1, 1, 4, 5, 1, 5, 2, 2, 5, 6,
                                         2, 6, 3, 3, 6, 7, 3, 7, 0, 0, 7, 4};

static drape_mesh make_ring(drape_context *ctx, int32_t times)
{
    drape_mesh mesh;
    const drape_mesh_def def = {.positions = ring,
                                .node_count = 8,
                                .triangles = ring_triangles,
                                .triangle_count = 8,
                                .scale = {1, 1, 1},
                                .subdivide = times};
    ck_assert_int_eq(drape_mesh_make(ctx, "/m", &def, NULL, &mesh), DRAPE_OK);
    return mesh;
}

/* The length of the boundary, and on how many edges. */
static double boundary(const drape_mesh *mesh, int *edges)
{
    double length = 0;
    *edges = 0;
    for (int32_t e = 0; e < mesh->edge_count; e++)
        if (mesh->edge_triangle[2 * e + 1] < 0) {
            length += mesh->edge_length[e];
            ++*edges;
        }
    return length;
}

/* Nodes keep their numbers, the hole stays, pieces are alike, and what is between is in the middle. */
TEST(holes_and_folds_stay)
{
    scene s = scene_empty();
    drape_mesh coarse = make_ring(s.ctx, 0), fine = make_ring(s.ctx, 2);
    int edges[2];
    ck_assert_ptr_null(coarse.given);
    ck_assert_int_eq(fine.given->node_count, 8);
    ck_assert_int_eq(fine.triangle_count, 16 * 8);
    ck_assert_int_eq(fine.node_count - fine.edge_count + fine.triangle_count, 0); /* Euler, of a ring */
    assert_below(fabs(boundary(&coarse, &edges[0]) - boundary(&fine, &edges[1])), 32 * 16 * DBL_EPSILON);
    ck_assert_int_eq(edges[1], 4 * edges[0]);
    ck_assert(memcmp(fine.x, ring, sizeof ring) == 0);
    for (int32_t i = 8; i < fine.node_count; i++)
        for (int k = 0; k < 3; k++) {
            const int32_t *of = fine.parent + 2 * (i - 8);
            ck_assert_double_eq(fine.x[3 * i + k], (fine.x[3 * of[0] + k] + fine.x[3 * of[1] + k]) / 2);
        }
    for (int32_t t = 0; t < fine.triangle_count; t++) { /* the same normal, and a sixteenth of the area */
        double of[3], piece[3];
        vec3_triangle_area(coarse.triangle + 3 * (t / 16), coarse.x, of);
        vec3_triangle_area(fine.triangle + 3 * t, fine.x, piece);
        for (int k = 0; k < 3; k++)
            assert_below(fabs(16 * piece[k] - of[k]),
                         16 * 16 * DBL_EPSILON); /* products of coordinates up to 3 */
    }
    drape_mesh_free(&coarse);
    drape_mesh_free(&fine);
    scene_close(&s);
}

static int32_t pinned_of(const drape_model *m)
{
    int32_t count = 0;
    for (int32_t i = 0; i < m->node_count; i++)
        count += m->pinned[i];
    return count;
}

#define SHEET(name, y, times)                                                                                \
    "{'name': '" name "', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': 0.3, 'height': 0.2, " \
    "'orientation': 'vertical', 'transform': {'translate': [0, " y ", 0]}, 'subdivide': " times "},"         \
    "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 300},"

/* Held edges are held between their nodes, seams join what is between theirs, a load on an edge is the same,
 * and so are loads and masses of nodes. */
TEST(selections)
{
    for (int times = 0; times < 3; times++) {
        scene s = scene_model(
            "{'drape': 1, 'cloth': [" SHEET(
                "a", "0.2",
                "%d") "'terms': ['stretch.cst', {'type': 'load.line', 'edge': 'bottom', 'force': [0, -2, 0]},"
                      "          {'type': 'load.point', 'box_max': [1, 0.05, 1], 'force': [0, 0, 1]}],"
                      "'masses': [{'edge': 'bottom', 'add': 0.1}], 'pins': [{'edge': 'top'}, {'nodes': [4, "
                      "11]}]}," SHEET(
                          "b", "0",
                          "%d") "'terms': ['stretch.cst']}],"
                                "'seams': [{'type': 'stitch', 'a': {'cloth': 'a', 'edge': 'bottom'},"
                                "           'b': {'cloth': 'b', 'nodes': [3, 2, 1, 0], 'reverse': true}}], "
                                "'duration': 1}",
            times, times);
        const drape_model *m = s.model;
        double mass = 0;
        for (int32_t i = 0; i < m->node_count; i++)
            mass += m->mass[i];
        assert_below(fabs(mass - (2 * 0.06 * 0.3 + 4 * 0.1)), 1e3 * DBL_EPSILON); /* sum of 300 nodes */
        ck_assert_int_eq(pinned_of(m), (3 << times) + 1 + 2);
        const drape_elements *line = &m->terms[1].elements, *point = &m->terms[2].elements;
        double force = 0;
        for (int32_t i = 0; i < line->count; i++)
            force += 2 * line->rest[line->count + i];
        ck_assert_int_eq(line->count, 3 << times);
        assert_below(fabs(force + 2 * 0.3), 100 * DBL_EPSILON);
        ck_assert_int_eq(point->count, 4);
        ck_assert_int_eq(m->seams[0].pair_count, (3 << times) + 1);
        for (int32_t i = 0; i < m->seams[0].pair_count; i++) { /* pairs one below the other, in order */
            const double *p = m->rest + 3 * m->seams[0].pair[2 * i],
                         *q = m->rest + 3 * m->seams[0].pair[2 * i + 1];
            assert_below(fabs(p[0] - 0.3 * i / (3 << times)), 8 * DBL_EPSILON);
            assert_below(fabs(p[0] - q[0]), 8 * DBL_EPSILON);
        }
        scene_close(&s);
    }
}
