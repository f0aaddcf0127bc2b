/* test_mesh.c: grids, arrays, transforms, topology, validation, measures at rest. Import has its own test. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "base/vec3.h"
#include "mesh/mesh.h"
#include "support/failing_allocator.h"
#include "support/message.h"
#include "support/suite.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))
/* For coordinates and lengths of order 1: a few roundings of 2^-53. */
#define ROUNDING 1e-15

static drape_mesh_def empty_def(void)
{
    return (drape_mesh_def){.scale = {1, 1, 1}};
}

static drape_mesh_def equilateral(drape_setting settings[2], int edges, double edge_length)
{
    drape_mesh_def def = empty_def();
    settings[0] = (drape_setting){"edges", edges, NULL};
    settings[1] = (drape_setting){"edge_length", edge_length, NULL};
    def.grid = (drape_entry_def){"equilateral", settings, 2};
    return def;
}

static drape_mesh_def square(drape_setting settings[6], int columns, int rows, const char *diagonals,
                             const char *orientation)
{
    drape_mesh_def def = empty_def();
    settings[0] = (drape_setting){"columns", columns, NULL};
    settings[1] = (drape_setting){"rows", rows, NULL};
    settings[2] = (drape_setting){"width", 1.5, NULL};
    settings[3] = (drape_setting){"height", 0.75, NULL};
    settings[4] = (drape_setting){"diagonals", 0, diagonals};
    settings[5] = (drape_setting){"orientation", 0, orientation};
    def.grid = (drape_entry_def){"square", settings, 6};
    return def;
}

static drape_mesh make(drape_context *ctx, const drape_mesh_def *def)
{
    drape_mesh mesh;
    assert_ok(ctx, drape_mesh_make(ctx, "/m", def, NULL, &mesh));
    return mesh;
}

static void assert_empty(const drape_mesh *mesh)
{
    ck_assert(!mesh->x && !mesh->triangle && !mesh->edge && !mesh->edge_triangle && !mesh->hinge &&
              !mesh->hinge_edge && !mesh->triangle_area && !mesh->edge_length && !mesh->node_area);
    ck_assert_int_eq(mesh->node_count, 0);
    ck_assert_int_eq(mesh->triangle_count, 0);
}

/* The def is refused with this message, and the mesh is left empty. */
static void assert_refused(const drape_mesh_def *def, const char *message)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    ck_assert_int_eq(drape_mesh_make(ctx, "/m", def, NULL, &mesh), DRAPE_E_ARGUMENT);
    check_matches(drape_context_message(ctx), message);
    assert_empty(&mesh);
}

static bool has_node(const int32_t *triangle, int32_t node)
{
    return triangle[0] == node || triangle[1] == node || triangle[2] == node;
}

static double area_sum(const double *area, int32_t count)
{
    double sum = 0;
    for (int32_t i = 0; i < count; i++)
        sum += area[i];
    return sum;
}

static void assert_edges(const drape_mesh *mesh)
{
    for (int32_t e = 0; e < mesh->edge_count; e++) {
        const int32_t *n = mesh->edge + 2 * e, *t = mesh->edge_triangle + 2 * e;
        ck_assert_int_lt(n[0], n[1]);
        if (e > 0)
            ck_assert(n[-2] < n[0] || (n[-2] == n[0] && n[-1] < n[1]));
        for (int k = 0; k < 2; k++)
            if (t[k] >= 0)
                ck_assert(has_node(mesh->triangle + 3 * t[k], n[0]) &&
                          has_node(mesh->triangle + 3 * t[k], n[1]));
        ck_assert(t[0] >= 0 && (t[1] == -1 || t[0] < t[1]));
    }
}

/* In a flat mesh, the apices lie on opposite sides of the edge: (e x a) . (e x b) < 0. */
static void assert_hinges(const drape_mesh *mesh, bool flat)
{
    for (int32_t h = 0; h < mesh->hinge_count; h++) {
        const int32_t *n = mesh->hinge + 4 * h, e = mesh->hinge_edge[h];
        ck_assert(h == 0 || e > mesh->hinge_edge[h - 1]);
        ck_assert_int_eq(n[0], mesh->edge[2 * e]);
        ck_assert_int_eq(n[1], mesh->edge[2 * e + 1]);
        for (int k = 0; k < 2; k++) {
            const int32_t t = mesh->edge_triangle[2 * e + k];
            ck_assert_int_ge(t, 0);
            ck_assert(has_node(mesh->triangle + 3 * t, n[2 + k]) && n[2 + k] != n[0] && n[2 + k] != n[1]);
        }
        double along[3], a[3], b[3], first[3], second[3];
        vec3_sub(mesh->x + 3 * n[1], mesh->x + 3 * n[0], along);
        vec3_sub(mesh->x + 3 * n[2], mesh->x + 3 * n[0], a);
        vec3_sub(mesh->x + 3 * n[3], mesh->x + 3 * n[0], b);
        vec3_cross(along, a, first);
        vec3_cross(along, b, second);
        ck_assert(!flat || vec3_dot(first, second) < 0);
    }
}

/* True of every mesh: hinges are the inner edges, 3 T = E + H, and lumping preserves the area. */
static void assert_consistent(const drape_mesh *mesh, bool flat)
{
    assert_edges(mesh);
    assert_hinges(mesh, flat);
    ck_assert_int_eq(3 * mesh->triangle_count, mesh->edge_count + mesh->hinge_count);
    const double area = area_sum(mesh->triangle_area, mesh->triangle_count);
    ck_assert_double_eq_tol(area_sum(mesh->node_area, mesh->node_count), area,
                            area * mesh->node_count * ROUNDING);
}

static int euler_characteristic(const drape_mesh *mesh)
{
    return mesh->node_count - mesh->edge_count + mesh->triangle_count;
}

static void assert_normals(const drape_mesh *mesh, int axis)
{
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
        const int32_t *n = mesh->triangle + 3 * t;
        double u[3], v[3], normal[3];
        vec3_sub(mesh->x + 3 * n[1], mesh->x + 3 * n[0], u);
        vec3_sub(mesh->x + 3 * n[2], mesh->x + 3 * n[0], v);
        vec3_cross(u, v, normal);
        ck_assert_double_eq_tol(normal[axis], 2 * mesh->triangle_area[t], ROUNDING);
    }
}

TEST(equilateral_counts_and_positions)
{
    scoped_context *ctx = make_context();
    drape_setting settings[2];
    const double l = 0.37;
    for (int c = 1; c <= 23; c++) {
        const drape_mesh_def def = equilateral(settings, c, l);
        drape_mesh mesh = make(ctx, &def);
        ck_assert_int_eq(mesh.node_count, (c + 1) * (c + 1));
        ck_assert_int_eq(mesh.rows, c + 1);
        ck_assert_int_eq(mesh.columns, c + 1);
        ck_assert_int_eq(mesh.triangle_count, 2 * c * c);
        ck_assert_int_eq(mesh.edge_count, c * (3 * c + 2));
        ck_assert_int_eq(mesh.hinge_count, c * (3 * c - 2));
        ck_assert_int_eq(euler_characteristic(&mesh), 1);
        assert_consistent(&mesh, true);
        assert_normals(&mesh, 1);
        for (int r = 0; r <= c; r++)
            for (int k = 0; k <= c; k++) {
                const double *x = mesh.x + 3 * (r * (c + 1) + k);
                ck_assert_double_eq_tol(x[0], (k + 0.5 * (r % 2)) * l, 30 * ROUNDING);
                ck_assert_double_eq(x[1], 0);
                ck_assert_double_eq_tol(x[2], -r * sqrt(3.0) / 2 * l, 30 * ROUNDING);
            }
        drape_mesh_free(&mesh);
        assert_empty(&mesh);
    }
}

static bool has_edge(const drape_mesh *mesh, int32_t a, int32_t b)
{
    for (int32_t e = 0; e < mesh->edge_count; e++)
        if (mesh->edge[2 * e] == a && mesh->edge[2 * e + 1] == b)
            return true;
    return false;
}

static void check_square(drape_context *ctx, const char *diagonals, const char *orientation)
{
    drape_setting settings[6];
    const int columns = 5, rows = 4;
    const bool vertical = strcmp(orientation, "vertical") == 0;
    const drape_mesh_def def = square(settings, columns, rows, diagonals, orientation);
    drape_mesh mesh = make(ctx, &def);
    ck_assert_int_eq(mesh.node_count, columns * rows);
    ck_assert_int_eq(mesh.columns, columns);
    ck_assert_int_eq(mesh.rows, rows);
    ck_assert_int_eq(mesh.triangle_count, 2 * (columns - 1) * (rows - 1));
    ck_assert_int_eq(euler_characteristic(&mesh), 1);
    assert_consistent(&mesh, true);
    assert_normals(&mesh, vertical ? 2 : 1);
    ck_assert_double_eq_tol(area_sum(mesh.triangle_area, mesh.triangle_count), 1.5 * 0.75, 20 * ROUNDING);
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            const int32_t node = r * columns + c;
            ck_assert_double_eq(mesh.x[3 * node], c * 1.5 / (columns - 1));
            ck_assert_double_eq(mesh.x[3 * node + (vertical ? 1 : 2)], -(r * 0.75) / (rows - 1));
            ck_assert_double_eq(mesh.x[3 * node + (vertical ? 2 : 1)], 0);
            if (r + 1 == rows || c + 1 == columns)
                continue;
            const bool falling = strcmp(diagonals, "parallel") == 0 || (r + c) % 2 == 0;
            ck_assert_int_eq(has_edge(&mesh, node, node + columns + 1), falling);
            ck_assert_int_eq(has_edge(&mesh, node + 1, node + columns), !falling);
        }
    drape_mesh_free(&mesh);
}

TEST(square_grids)
{
    scoped_context *ctx = make_context();
    check_square(ctx, "alternating", "horizontal");
    check_square(ctx, "alternating", "vertical");
    check_square(ctx, "parallel", "horizontal");
    check_square(ctx, "parallel", "vertical");
}

TEST(equilateral_strips)
{
    scoped_context *ctx = make_context();
    const drape_setting settings[] = {{"edges", 2, NULL}, {"edge_length", 0.1, NULL}, {"strips", 5, NULL}};
    drape_mesh_def def;
    drape_mesh_def_init(&def, sizeof def);
    def.grid = (drape_entry_def){"equilateral", settings, 3};
    drape_mesh mesh = make(ctx, &def);
    ck_assert_int_eq(mesh.rows, 6);
    ck_assert_int_eq(mesh.columns, 3);
    ck_assert_int_eq(mesh.triangle_count, 2 * 2 * 5);
    ck_assert_double_eq_tol(mesh.x[3 * 17 + 2], -5 * sqrt(3) / 2 * 0.1, 1e-15);
    drape_mesh_free(&mesh);
}

/* Twice the signed area of a triangle in the plane y = 0, positive if it is counterclockwise seen from +y. */
static double twice_area(const drape_mesh *mesh, int32_t t)
{
    const double *a = mesh->x + 3 * mesh->triangle[3 * t], *b = mesh->x + 3 * mesh->triangle[3 * t + 1],
                 *c = mesh->x + 3 * mesh->triangle[3 * t + 2];
    return (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]);
}

/* Its triangles all face up and fill the area between the polygons of its two rims. It is closed, so V - E
 * + F = 0, and only the rims are boundary. */
TEST(annuli)
{
    enum { ROWS = 4, SPOKES = 7 };
    scoped_context *ctx = make_context();
    const drape_setting settings[] = {{"rows", ROWS, NULL},
                                      {"columns", SPOKES, NULL},
                                      {"inner_radius", 0.5, NULL},
                                      {"outer_radius", 2, NULL}};
    drape_mesh_def def;
    drape_mesh_def_init(&def, sizeof def);
    def.grid = (drape_entry_def){"annulus", settings, 4};
    drape_mesh mesh = make(ctx, &def);
    double area = 0;
    ck_assert_int_eq(mesh.triangle_count, 2 * (ROWS - 1) * SPOKES);
    for (int32_t t = 0; t < mesh.triangle_count; t++) {
        ck_assert_double_gt(twice_area(&mesh, t), 0);
        area += twice_area(&mesh, t) / 2;
    }
    for (int32_t i = 0; i < mesh.node_count; i++)
        ck_assert_double_eq_tol(hypot(mesh.x[3 * i], mesh.x[3 * i + 2]), 0.5 + (i / SPOKES) * 0.5, 1e-15);
    const double polygon = SPOKES * sin(2 * acos(-1.0) / SPOKES) / 2;
    ck_assert_double_eq_tol(area, polygon * (4 - 0.25), 1e-13);
    int edges = 0;
    for (int32_t a = 0; a < mesh.node_count; a++)
        for (int32_t b = a + 1; b < mesh.node_count; b++)
            edges += has_edge(&mesh, a, b);
    ck_assert_int_eq(mesh.node_count - edges + mesh.triangle_count, 0);
    drape_mesh_free(&mesh);
    drape_setting wrong[4];
    memcpy(wrong, settings, sizeof wrong);
    wrong[3].number = 0.5;
    def.grid.settings = wrong;
    assert_refused(&def, "/m/outer_radius: 0.5 m; it is larger than inner_radius, 0.5 m");
}

/* A quarter of a hemisphere with a hole: all nodes on the sphere, evenly spaced along meridians, all
 * triangles outwards. A closed ring is slit: first and last column at the same places. */
TEST(surfaces_of_revolution)
{
    enum { ROWS = 5, COLUMNS = 4 };
    const double pi = acos(-1.0), top = pi / 10;
    scoped_context *ctx = make_context();
    drape_setting settings[] = {
        {"rows", ROWS, NULL},       {"columns", COLUMNS, NULL},     {"top_radius", 2 * sin(top), NULL},
        {"bottom_radius", 2, NULL}, {"height", 2 * cos(top), NULL}, {"arc_radius", 2, NULL},
        {"angle", 90, NULL}};
    drape_mesh_def def;
    drape_mesh_def_init(&def, sizeof def);
    def.grid = (drape_entry_def){"revolution", settings, 7};
    drape_mesh mesh = make(ctx, &def);
    ck_assert_int_eq(mesh.rows, ROWS);
    ck_assert_int_eq(mesh.columns, COLUMNS);
    for (int32_t i = 0; i < mesh.node_count; i++) {
        const double polar = top + (pi / 2 - top) * (i / COLUMNS) / (ROWS - 1),
                     angle = pi / 2 * (i % COLUMNS) / (COLUMNS - 1), *x = mesh.x + 3 * i;
        ck_assert_double_eq_tol(x[0], 2 * sin(polar) * cos(angle), 1e-14);
        ck_assert_double_eq_tol(x[1], 2 * cos(polar) - 2 * cos(top), 1e-14);
        ck_assert_double_eq_tol(x[2], -2 * sin(polar) * sin(angle), 1e-14);
    }
    for (int32_t t = 0; t < mesh.triangle_count; t++)
        ck_assert_double_gt(twice_area(&mesh, t), 0); /* outwards is upwards here */
    drape_mesh_free(&mesh);
    def.grid.setting_count = 4;
    settings[2].number = 1;
    mesh = make(ctx, &def);
    for (int32_t r = 0; r < ROWS; r++)
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol(mesh.x[3 * r * COLUMNS + k], mesh.x[3 * (r * COLUMNS + COLUMNS - 1) + k],
                                    1e-14);
    ck_assert_double_eq_tol(mesh.x[3 * COLUMNS], 1.25, 1e-15);
    for (int32_t t = 0; t < mesh.triangle_count; t++)
        ck_assert_double_gt(twice_area(&mesh, t), 0);
    drape_mesh_free(&mesh);
    settings[2].number = 2;
    assert_refused(&def, "/m/height: 0 m, and both circles have the radius 2 m");
    settings[2].number = 1;
    def.grid.setting_count = 6;
    settings[4].number = 0;
    settings[5].number = 0.4;
    assert_refused(&def, "/m/arc_radius: 0.4 m; it is at least half the distance of the circles, 0.5 m");
}

TEST(grid_faults)
{
    drape_setting s[6];
    drape_mesh_def def = equilateral(s, 0, 1);
    assert_refused(&def, "/m/edges: 0 is not allowed; edges is an integer in [1, 16383]");
    def = equilateral(s, 16384, 1);
    assert_refused(&def, "/m/edges: 16384 is not allowed; edges is an integer in [1, 16383]");
    def = equilateral(s, 1, 0);
    assert_refused(&def, "/m/edge_length: 0 is not allowed; edge_length is a number in (0, 1e9] m");
    def = equilateral(s, 1, NAN);
    assert_refused(&def, "/m/edge_length: nan is not allowed; edge_length is a number in (0, 1e9] m");
    def = equilateral(s, 1, 1);
    def.grid.setting_count = 1;
    assert_refused(&def, "/m: \"edge_length\" is missing: length of every edge; a number in (0, 1e9] m");
    def = equilateral(s, 3, 5e8);
    assert_refused(&def, "/m: node 3 is at (1.5e+09, 0, 0) m; coordinates must be finite and within 1e+09 m");
    def.grid.type = "equilaterale";
    assert_refused(
        &def, "/m/grid: there is no grid \"equilaterale\"; there are <*>; did you mean \"equilateral\"?");
    def.grid.type = "hexagons";
    assert_refused(&def, "/m/grid: there is no grid \"hexagons\"; there are equilateral, <*>");
    def = square(s, 1, 2, "parallel", "vertical");
    assert_refused(&def, "/m/columns: 1 is not allowed; columns is an integer in [2, 134217728]");
    def = square(s, 20000, 20000, "parallel", "vertical");
    assert_refused(&def, "/m/columns: 20000 columns x 20000 rows are 400000000 nodes; at most 268435456 are "
                         "allowed");
    def = square(s, 2, 2, "paralel", "vertical");
    assert_refused(&def,
                   "/m/diagonals: \"paralel\" is not allowed; diagonals is one of: alternating, parallel; "
                   "did you mean \"parallel\"?");
    def = square(s, 2, 2, "parallel", "vertical");
    s[2].number = 1e-13; /* the width: slivers */
    assert_refused(&def,
                   "/m: triangle 0 (nodes 0 3 1) is degenerate: altitude / longest edge is 1.33333e-13, at "
                   "least 1e-12 is needed");
}

TEST(too_many_nodes_are_refused_before_memory_is_taken)
{
    failing_allocator memory = {0};
    scoped_context *ctx = failing_context(&memory);
    drape_setting settings[6];
    const drape_mesh_def def = square(settings, 1 << 27, 1 << 27, "parallel", "vertical");
    drape_mesh mesh;
    ck_assert_int_eq(drape_mesh_make(ctx, "/m", &def, NULL, &mesh), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(memory.calls, 0);
    static const int32_t triangle[3] = {0, 1, 2};
    static const double x[9] = {0};
    ck_assert_int_eq(drape_mesh_from_arrays(ctx, "/m", x, SIZE_MAX, triangle, 1, &mesh), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_mesh_from_arrays(ctx, "/m", x, 3, triangle, SIZE_MAX, &mesh), DRAPE_E_ARGUMENT);
    ck_assert_str_eq(drape_context_message(ctx),
                     "/m: 18446744073709551615 triangles; at most 536870912 are allowed");
    ck_assert_int_eq(memory.calls, 0);
}

TEST(transform_scales_then_rotates_then_translates)
{
    scoped_context *ctx = make_context();
    static const double x[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    static const int32_t triangle[] = {0, 1, 2};
    drape_mesh_def def = empty_def();
    def.positions = x;
    def.triangles = triangle;
    def.node_count = 3;
    def.triangle_count = 1;
    const double scale[3] = {2, 3, 4}, rotate[4] = {0, 0, 5, 90}, translate[3] = {10, 20, 30};
    memcpy(def.scale, scale, sizeof scale);
    memcpy(def.rotate, rotate, sizeof rotate);
    memcpy(def.translate, translate, sizeof translate);
    drape_mesh mesh = make(ctx, &def);
    /* (2,0,0) -> (0,2,0); (0,3,0) -> (-3,0,0); (0,0,4) stays; then the translation. Exact. */
    static const double expected[] = {10, 22, 30, 7, 20, 30, 10, 20, 34};
    for (int i = 0; i < 9; i++)
        ck_assert_double_eq(mesh.x[i], expected[i]);
    drape_mesh_free(&mesh);
}

static void rotated_x_axis(const double rotate[4], double out[3])
{
    static const double one[3] = {1, 1, 1}, none[3] = {0, 0, 0};
    double x[3] = {1, 0, 0};
    drape_mesh mesh = {.node_count = 1, .x = x};
    drape_mesh_transform(&mesh, one, rotate, none);
    memcpy(out, x, sizeof x);
}

TEST(rotation_is_exact_at_right_angles_and_right_between)
{
    double out[3];
    for (int quarter = -9; quarter <= 9; quarter++) { /* about y: (1,0,0) -> (cos, 0, -sin) */
        static const double cosines[] = {1, 0, -1, 0}, sines[] = {0, 1, 0, -1};
        const double rotate[4] = {0, 2, 0, 90.0 * quarter};
        rotated_x_axis(rotate, out);
        ck_assert_double_eq(out[0], cosines[(quarter + 12) % 4]);
        ck_assert_double_eq(out[1], 0);
        ck_assert_double_eq(out[2], -sines[(quarter + 12) % 4]);
    }
    for (double degrees = -700; degrees <= 700; degrees += 12.5) {
        const double rotate[4] = {0, 0, 1e-300, degrees}, a = degrees * acos(-1.0) / 180;
        rotated_x_axis(rotate, out);
        ck_assert_double_eq_tol(out[0], cos(a), 20 * ROUNDING);
        ck_assert_double_eq_tol(out[1], sin(a), 20 * ROUNDING);
    }
    const double diagonal[4] = {1e200, 1e200, 1e200, 120}; /* rotates x onto y */
    rotated_x_axis(diagonal, out);
    ck_assert_double_eq_tol(out[0], 0, ROUNDING);
    ck_assert_double_eq_tol(out[1], 1, ROUNDING);
    ck_assert_double_eq_tol(out[2], 0, ROUNDING);
}

TEST(transform_faults)
{
    drape_setting settings[2];
    drape_mesh_def def = equilateral(settings, 1, 1);
    def.scale[1] = -1;
    assert_refused(&def,
                   "/m/transform/scale: 1 -1 1; each must be finite and > 0, a mirror image would turn the "
                   "mesh inside out");
    def.scale[1] = NAN;
    assert_refused(&def,
                   "/m/transform/scale: 1 nan 1; each must be finite and > 0, a mirror image would turn the "
                   "mesh inside out");
    def.scale[1] = 1;
    def.rotate[3] = 90;
    assert_refused(&def,
                   "/m/transform/rotate: the axis of a rotation by 90 degrees is 0 0 0; it must not be zero");
    def.rotate[0] = INFINITY;
    assert_refused(&def, "/m/transform/rotate: inf 0 0 90; axis and angle must be finite");
    def.rotate[0] = 1;
    def.translate[2] = NAN;
    assert_refused(&def, "/m/transform/translate: 0 0 nan; each must be finite");
    def.translate[2] = 2e9;
    assert_refused(
        &def, "/m/transform: node 0 is at (0, 0, 2e+09) m; coordinates must be finite and within 1e+09 m");
}

TEST(exactly_one_source)
{
    drape_setting settings[2];
    drape_mesh_def def = empty_def();
    assert_refused(&def, "/m: 0 sources; a mesh has exactly one of grid, file, positions");
    def = equilateral(settings, 1, 1);
    def.file = "a.obj";
    assert_refused(&def, "/m: 2 sources, grid, file; a mesh has exactly one of grid, file, positions");
}

static drape_mesh_def arrays(const double *x, size_t node_count, const int32_t *triangle,
                             size_t triangle_count)
{
    drape_mesh_def def = empty_def();
    def.positions = x;
    def.triangles = triangle;
    def.node_count = node_count;
    def.triangle_count = triangle_count;
    return def;
}

/* Points of a parabola: no three are on a line. */
static const double points[] = {0, 0, 0, 1, 0, 1, 2, 0, 4, 3, 0, 9, 4, 0, 16, 5, 0, 25, 6, 0, 36};

static void assert_triangles_refused(const int32_t *triangle, size_t numbers, size_t nodes,
                                     const char *message)
{
    const drape_mesh_def def = arrays(points, nodes, triangle, numbers / 3);
    assert_refused(&def, message);
}
#define REFUSED(nodes, message, ...)                                                                         \
    assert_triangles_refused((const int32_t[]){__VA_ARGS__}, COUNT(((const int32_t[]){__VA_ARGS__})), nodes, \
                             message)

/* What files may have, too, is in tests/bad. */
TEST(array_faults)
{
    REFUSED(3, "/m: triangle 0 (nodes 0 1 3): there is no node 3, range is 0 to 2", 0, 1, 3);
    REFUSED(3, "/m: triangle 1 (nodes 0 1 -7): there is no node -7, range is 0 to 2", 0, 1, 2, 0, 1, -7);
    REFUSED(3, "/m: triangle 1 (nodes 2 1 1) uses a node twice", 0, 1, 2, 2, 1, 1);
    REFUSED(3, "/m: triangle 0 (nodes 2 1 2) uses a node twice", 2, 1, 2);
    REFUSED(3, "/m: triangle 0 (nodes 2 2 1) uses a node twice", 2, 2, 1);
    REFUSED(4, "/m: triangles 0 and 2 have the same nodes 0 1 2; remedy: delete one of them", 0, 1, 2, 1, 2,
            3, 2, 1, 0);
    drape_mesh_def def = arrays(points, 3, NULL, 1);
    assert_refused(&def, "/m: \"triangles\" is missing: a mesh needs positions and triangles");
    def = arrays(points, 0, (const int32_t[]){0, 1, 2}, 1);
    assert_refused(&def, "/m: the mesh has no nodes");
    def = arrays(points, 3, (const int32_t[]){0, 1, 2}, 0);
    assert_refused(&def, "/m: the mesh has no triangles");
    static const double point[9] = {0};
    def = arrays(point, 3, (const int32_t[]){0, 1, 2}, 1);
    assert_refused(&def,
                   "/m: triangle 0 (nodes 0 1 2) is degenerate: altitude / longest edge is 0, at least 1e-12 "
                   "is needed; remedy: merge nodes 1 and 2, which are 0 m apart");
    static const double wild[] = {0, 0, 0, 1, NAN, 0, 2, 0, 1};
    def = arrays(wild, 3, (const int32_t[]){0, 1, 2}, 1);
    assert_refused(&def, "/m: node 1 is at (1, nan, 0) m; coordinates must be finite and within 1e+09 m");
}

/* Two closed fans at one node have valid counts of edges and triangles: only a walk around the node finds
 * them. */
TEST(two_closed_fans_at_one_node_are_refused)
{
    static const double x[] = {0, 0, 0, 1, 1, 0, -1, 1, 1, -1, 1, -1, 1, -1, 0, -1, -1, 1, -1, -1, -1};
    static const int32_t triangle[] = {0, 1, 2, 0, 2, 3, 0, 3, 1, 0, 4, 5, 0, 5, 6, 0, 6, 4};
    const drape_mesh_def def = arrays(x, 7, triangle, 6);
    assert_refused(&def,
                   "/m: triangles 0 and 3 touch only at node 0; the triangles around a node must be joined "
                   "by edges; remedy: give one of them a vertex of its own there, at (0, 0, 0) m, or join "
                   "them by faces");
}

TEST(every_failed_allocation_is_reported_and_none_leaks)
{
    drape_setting settings[2];
    const drape_mesh_def def = equilateral(settings, 3, 0.1);
    drape_status status = DRAPE_E_MEMORY;
    int failures = -1;
    for (long n = 1; status; n++, failures++) {
        failing_allocator memory = {.fail_at = n};
        drape_context *ctx = failing_context(&memory);
        drape_mesh mesh;
        status = drape_mesh_make(ctx, "/m", &def, NULL, &mesh);
        ck_assert(status == DRAPE_OK || status == DRAPE_E_MEMORY);
        if (status)
            assert_empty(&mesh);
        drape_mesh_free(&mesh);
        drape_context_destroy(&ctx);
        ck_assert_int_eq(memory.live, 0);
    }
    ck_assert_int_ge(failures, 15); /* otherwise the allocator was not called */
}
