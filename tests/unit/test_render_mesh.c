/* test_render_mesh.c: the mesh that frames show is bound to the simulated one at rest and follows it. */
#include "model/model.h"
#include "support/failing_allocator.h"
#include "support/scene.h"

#include <stdlib.h>

#define PATCH                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'revolution', 'columns': 13, 'rows': 9, 'top_radius': 0.3,"    \
    " 'bottom_radius': 0.3, 'height': 0.5, 'angle': 200}, 'pins': [{'nodes': [0, 1, 13]}],"                  \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.cst'] %s},"  \
    " {'mesh': {'grid': 'square', 'columns': 3, 'rows': 4, 'width': 0.3, 'height': 0.4,"                     \
    " 'transform': {'translate': [2, 0, 0]}}, 'terms': ['stretch.cst'],"                                     \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}], 'duration': 1}"
#define FINE                                                                                                 \
    ", 'render_mesh': {'grid': 'revolution', 'columns': 41, 'rows': 30, 'top_radius': %g,"                   \
    " 'bottom_radius': %g, 'height': 0.52, 'angle': 205, 'transform': {'translate': [0, 0.01, 0]}}"

/* A part of a cylinder under one of another radius, which is finer and goes over its edges; then a cloth
 * without a render mesh. */
static scene cylinder(double radius)
{
    char fine[512];
    snprintf(fine, sizeof fine, FINE, radius, radius);
    return scene_model(PATCH, fine);
}

static double *shown(const drape_model *m, const double *x)
{
    scoped_memory double *normals = calloc(3 * (size_t)m->node_count, sizeof *normals);
    double *at = calloc(3 * (size_t)m->surface.node_count, sizeof *at);
    drape_model_normals(m, x, normals);
    drape_model_render_positions(m, -1, x, normals, at);
    return at;
}

/* At rest vertices are where they were given, and a rigid motion of the nodes moves them likewise, to
 * rounding: the binding stops at residuals of 16 units of the last place of 1 m. */
TEST(vertices_follow)
{
    static const double radii[] = {0.31, 0.29, 0.3, 0.27};
    for (int r = 0; r < 4; r++) {
        scoped_scene s = cylinder(radii[r]);
        const drape_model *m = s.model;
        const drape_render_mesh all = drape_model_render_mesh(m, -1), one = drape_model_render_mesh(m, 0);
        ck_assert_int_eq(one.vertex_count, 41 * 30);
        ck_assert_int_eq(all.vertex_count, 41 * 30 + 12);
        ck_assert_int_eq(all.triangle_count, one.triangle_count + 12);
        ck_assert_int_eq(all.triangles[3 * one.triangle_count],
                         drape_model_triangles(m)[3 * 2 * 12 * 8] - 13 * 9 + one.vertex_count);
        scoped_memory double *at = shown(m, m->rest), *x = calloc(3 * (size_t)m->node_count, sizeof *x);
        for (int i = 0; i < 3 * all.vertex_count; i++)
            ck_assert_double_eq_tol(at[i], all.rest[i], 1e-14);
        free(at);
        for (size_t i = 0; i < 3 * (size_t)m->node_count; i += 3) { /* a turn about z, then a shift */
            x[i] = 0.6 * m->rest[i] - 0.8 * m->rest[i + 1] + 1;
            x[i + 1] = 0.8 * m->rest[i] + 0.6 * m->rest[i + 1];
            x[i + 2] = m->rest[i + 2] - 2;
        }
        at = shown(m, x);
        for (int i = 0; i < 3 * all.vertex_count; i += 3) {
            const double *v = all.rest + i;
            const double want[3] = {0.6 * v[0] - 0.8 * v[1] + 1, 0.8 * v[0] + 0.6 * v[1], v[2] - 2};
            for (int k = 0; k < 3; k++)
                ck_assert_double_eq_tol(at[i + k], want[k], 1e-14);
        }
    }
}

/* A shell above a cylinder that is bent to another radius: from the triangles on both sides of an edge, a
 * place above it is the same, to rounding. With the normals of the triangles there would be a step of the
 * height times the angle of the hinge, 10 mm * 0.15 = 1.5 mm. */
TEST(a_shell_has_no_steps)
{
    scoped_scene s = cylinder(0.31);
    const drape_model *m = s.model;
    const drape_embedded *bound = m->cloths[0].bound;
    scoped_memory double *x = calloc(3 * (size_t)m->node_count, sizeof *x),
                         *n = calloc(3 * (size_t)m->node_count, sizeof *n);
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i += 3) {
        const double angle = atan2(m->rest[i + 2], m->rest[i]) * 0.5;
        x[i] = 0.6 * cos(angle);
        x[i + 1] = m->rest[i + 1];
        x[i + 2] = 0.6 * sin(angle);
    }
    drape_model_normals(m, x, n);
    int edges = 0;
    for (int i = 0; i < m->cloths[0].render_mesh.node_count;
         i++) /* onto the first edge, from both sides of it */
        for (int j = 0; j < i; j++) {
            drape_embedded a = bound[i], b = bound[j];
            if (a.flat || b.flat || a.triangle == b.triangle)
                continue;
            for (int k = 0; k < 3; k++)
                for (int l = 0; l < 3; l++)
                    if (a.node[k] == b.node[(l + 1) % 3] && a.node[(k + 1) % 3] == b.node[l]) {
                        double p[3], q[3];
                        a.height = b.height = 0.01;
                        a.weights[k] = b.weights[(l + 1) % 3] = 0.3;
                        a.weights[(k + 1) % 3] = b.weights[l] = 0.7;
                        a.weights[(k + 2) % 3] = b.weights[(l + 2) % 3] = 0;
                        drape_embedded_point(&a, x, n, p);
                        drape_embedded_point(&b, x, n, q);
                        for (int c = 0; c < 3; c++)
                            ck_assert_double_eq_tol(p[c], q[c], 1e-15);
                        edges++;
                    }
        }
    ck_assert_int_gt(edges, 1000);
}

/* Values stay within those of the nodes, and are linear in the positions of a flat cloth inside of it. */
TEST(values_are_interpolated)
{
    scoped_scene s = scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.3,"
        " 'height': 0.3}, 'pins': [{'edge': 'top'}], 'terms': ['stretch.cst'], 'material':"
        " {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'render_mesh': {'grid': 'square',"
        " 'columns': 9, 'rows': 9, 'width': 0.34, 'height': 0.3, 'transform': {'translate': [-0.02, 0.01, "
        "0]}}}],"
        " 'duration': 1}");
    const drape_model *m = s.model;
    double values[16], found[81];
    uint8_t pinned[81];
    int32_t triangle[128];
    for (int i = 0; i < 16; i++)
        values[i] = 3 * m->rest[3 * i] - m->rest[3 * i + 2];
    drape_render_values(m, values, 1, found);
    drape_render_pinned(m, pinned);
    drape_render_triangles(m, triangle);
    for (int i = 0; i < 81; i++) {
        const double *v = m->surface.rest + 3 * (size_t)i;
        if (v[0] >= 0 && v[0] <= 0.3)
            ck_assert_double_eq_tol(found[i], 3 * v[0] - v[2], 1e-14);
        ck_assert(found[i] >= 0 && found[i] <= 1.2);
        ck_assert_int_eq(pinned[i], i < 9);
    }
    for (int t = 0; t < 128; t++)
        ck_assert(triangle[t] >= 0 && triangle[t] < m->triangle_count);
}

/* A host gives arrays; wrong ones are refused with a place, NULL changes nothing, and any failure of memory
 * leaves nothing behind. */
TEST(of_a_host)
{
    failing_allocator memory = {0};
    drape_context *ctx = failing_context(&memory);
    drape_model *model = NULL;
    static double fine[] = {0.1, 0, -0.1, 0.2, 0, -0.1, 0.2, 0.005, -0.2, 5, 5, 5};
    static int32_t corners[] = {0, 1, 2};
    const drape_setting grid[] = {{.name = "columns", .number = 3},
                                  {.name = "rows", .number = 3},
                                  {.name = "width", .number = 0.3},
                                  {.name = "height", .number = 0.3}},
                        material[] = {{.name = "young_modulus", .number = 1e5},
                                      {.name = "thickness", .number = 1e-3},
                                      {.name = "density", .number = 200}};
    const drape_entry_def term = {.type = "stretch.cst"};
    drape_cloth_def cloth = cloth_def();
    drape_scene_def def = scene_def();
    ck_assert(isnan(cloth.render_mesh.max_distance) && cloth.render_mesh.mesh.scale[0] == 1);
    def.cloths = &cloth;
    def.cloth_count = 1;
    cloth.mesh.grid = (drape_entry_def){"square", grid, 4};
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = &term;
    cloth.term_count = 1;
    cloth.render_mesh.mesh.positions = fine;
    cloth.render_mesh.mesh.triangles = corners;
    cloth.render_mesh.mesh.node_count = 3;
    cloth.render_mesh.mesh.triangle_count = 1;
    for (long fail = 0;; fail++) {
        memory.fail_at = memory.calls + fail + 1;
        const drape_status status = drape_model_create(ctx, &def, &model);
        memory.fail_at = 0;
        if (status == DRAPE_OK)
            break;
        ck_assert_int_eq(status, DRAPE_E_MEMORY);
        ck_assert_ptr_null(model);
    }
    const drape_render_mesh mesh = drape_model_render_mesh(model, 0);
    ck_assert_int_eq(mesh.vertex_count, 3);
    ck_assert_mem_eq(mesh.rest, fine, 9 * sizeof *fine);
    ck_assert_int_eq(drape_model_render_mesh(model, 1).vertex_count, 0);
    ck_assert_int_eq(drape_model_render_mesh(model, -2).vertex_count, 0);
    ck_assert_int_eq(drape_model_render_mesh(NULL, 0).vertex_count, 0);
    drape_model_render_positions(NULL, 0, fine, fine, fine);
    drape_model_render_positions(model, 1, fine, fine, fine);
    drape_model_render_positions(model, 0, NULL, fine, fine);
    drape_model_render_positions(model, 0, fine, NULL, fine);
    drape_model_render_positions(model, 0, fine, fine, NULL);
    ck_assert_double_eq(fine[0], 0.1);
    drape_model_destroy(&model);

    const struct {
        double *at, value;
        int32_t *index;
        int32_t number;
        const char *says;
    } faults[] = {
        {&fine[3], NAN, NULL, 0, "/cloth/0/render_mesh: node 1 is at (nan"},
        {&fine[7], -INFINITY, NULL, 0, "/cloth/0/render_mesh: node 2 is at (0.2, -inf"},
        {&fine[4], 1, NULL, 0, "/cloth/0/render_mesh: vertex 1, at (0.2, 1, -0.1) m, is 1 m from"},
        {NULL, 0, &corners[2], 3, "/cloth/0/render_mesh: triangle 0 (nodes 0 1 3): there is no node 3"},
        {&cloth.render_mesh.max_distance, -1, NULL, 0, "/cloth/0/render_mesh/max_distance: -1"},
        {&cloth.render_mesh.mesh.scale[1], 0, NULL, 0, "/cloth/0/render_mesh/transform/scale: "},
    };
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        const double before = faults[i].at ? *faults[i].at : 0;
        const int32_t index = faults[i].index ? *faults[i].index : 0;
        if (faults[i].at)
            *faults[i].at = faults[i].value;
        if (faults[i].index)
            *faults[i].index = faults[i].number;
        ck_assert_int_eq(drape_model_create(ctx, &def, &model), DRAPE_E_ARGUMENT);
        ck_assert_msg(strstr(drape_context_message(ctx), faults[i].says) != NULL, "%s",
                      drape_context_message(ctx));
        if (faults[i].at)
            *faults[i].at = before;
        if (faults[i].index)
            *faults[i].index = index;
    }
    cloth.struct_size = offsetof(drape_cloth_def, render_mesh); /* a host of an earlier version */
    ck_assert_int_eq(drape_model_create(ctx, &def, &model), DRAPE_OK);
    ck_assert_int_eq(drape_model_render_mesh(model, 0).vertex_count, 9);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    ck_assert_int_eq(memory.live, 0);
}
