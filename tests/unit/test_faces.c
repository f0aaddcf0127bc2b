/* test_faces.c: polygons, texture coordinates and materials of a mesh file: how they are divided into
 * triangles, and that frames have them again. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec3.h"
#include "io/recorder.h"
#include "mesh/mesh.h"
#include "mesh/remedy.h"
#include "support/failing_allocator.h"
#include "support/folder.h"
#include "support/frames.h"
#include "support/scene.h"

extern const drape_import_ops drape_import_obj, drape_import_ply;

static void parse(drape_context *ctx, const drape_import_ops *import, const char *text, drape_mesh *mesh)
{
    const drape_mesh_source source = {"/m/file", "a.obj", NULL};
    *mesh = (drape_mesh){0};
    assert_ok(ctx, import->read(ctx, &source, text, strlen(text), mesh));
}

static void divides_into(const char *text, int triangles, const int *expected)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    parse(ctx, &drape_import_obj, text, &mesh);
    ck_assert_int_eq(mesh.triangle_count, triangles);
    for (int i = 0; i < 3 * triangles; i++)
        ck_assert_msg(mesh.triangle[i] == expected[i], "%s: number %d is %d, not %d", text, i,
                      mesh.triangle[i], expected[i]);
    drape_mesh_free(&mesh);
}

TEST(a_quadrilateral_gets_its_shorter_diagonal)
{
    static const int first[] = {0, 1, 2, 0, 2, 3}, second[] = {0, 1, 3, 1, 2, 3};
    divides_into("v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 1 0\nf 1 2 3 4\n", 2, second);
    divides_into("v 0 0 0\nv 1 0 0\nv 0 1 0\nv -1 1 0\nf 1 2 3 4\n", 2, first);
    /* alike to a thousandth, whatever the rounding of the coordinates: from the first corner */
    divides_into("v 0 0 0\nv 1 0 0\nv 1.0004 1 0\nv 0 1 0\nf 1 2 3 4\n", 2, first);
    divides_into("v 0 0 0\nv 1 0 0\nv 0.9996 1 0\nv 0 1 0\nf 1 2 3 4\n", 2, first);
    /* Concave at the second corner, at the first: the shorter diagonal, between the others, is outside. */
    divides_into("v 0 0 0\nv .4 .4 0\nv 1 0 0\nv .4 3 0\nf 1 2 3 4\n", 2, second);
    divides_into("v .4 .4 0\nv 1 0 0\nv .4 3 0\nv 0 0 0\nf 1 2 3 4\n", 2, first);
}

/* The area of the triangles of a polygon in the plane, and the largest of the areas that are turned over. */
static double area_of(const drape_mesh *mesh, double *least)
{
    double sum = 0;
    *least = INFINITY;
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
        const double *p[3];
        double ab[3], ac[3], n[3];
        for (int k = 0; k < 3; k++)
            p[k] = mesh->x + 3 * (size_t)mesh->triangle[3 * (size_t)t + (size_t)k];
        vec3_sub(p[1], p[0], ab);
        vec3_sub(p[2], p[0], ac);
        vec3_cross(ab, ac, n);
        sum += n[2] / 2;
        *least = fmin(*least, n[2] / 2);
    }
    return sum;
}

/* A star of n points with radii 1 and r: its area is n r sin(pi / n), and it is concave at every second
 * corner. Sums of n products have rounding errors below n^2 2^-53 < 1e-11. */
TEST(a_polygon_loses_ears)
{
    scoped_context *ctx = make_context();
    for (int n = 3; n <= 128; n += n < 8 ? 1 : 40) {
        char text[65536];
        size_t used = 0;
        const double r = .4, step = acos(-1) / n;
        for (int i = 0; i < 2 * n; i++)
            used += (size_t)snprintf(text + used, sizeof text - used, "v %.17g %.17g 0\n",
                                     (i % 2 ? r : 1) * cos(i * step), (i % 2 ? r : 1) * sin(i * step));
        used += (size_t)snprintf(text + used, sizeof text - used, "f");
        for (int i = 0; i < 2 * n; i++)
            used += (size_t)snprintf(text + used, sizeof text - used, " %d", i + 1);
        drape_mesh mesh;
        double least;
        parse(ctx, &drape_import_obj, text, &mesh);
        ck_assert_int_eq(mesh.triangle_count, 2 * n - 2);
        ck_assert_double_eq_tol(area_of(&mesh, &least), n * r * sin(step), 1e-11);
        ck_assert(least > 0);
        ck_assert_int_eq(mesh.faces.count, 1);
        drape_mesh_free(&mesh);
    }
}

/* No such polygon can be divided well, but each becomes as many triangles as it must, and ends. */
TEST(polygons_of_any_kind_are_divided)
{
    static const char *const texts[] = {
        "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nv .5 2 0\nf 1 2 3 4 5\n",                 /* crosses itself */
        "v 0 0 0\nv 0 0 0\nv 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3 4 5\n",                  /* one place */
        "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 0 0\nf 1 2 3 4 5\n",                  /* a line */
        "v 1e300 0 0\nv -1e300 0 0\nv 0 1e300 0\nv 0 0 1e300\nv 1 1 1\nf 1 2 3 4 5\n", /* overflows */
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3 1 2\n"};                                   /* nodes repeat */
    scoped_context *ctx = make_context();
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        drape_mesh mesh;
        parse(ctx, &drape_import_obj, texts[i], &mesh);
        ck_assert_int_eq(mesh.triangle_count, 3);
        drape_mesh_free(&mesh);
    }
    char text[16384] = "f";
    for (int i = 0; i < 1001; i++)
        snprintf(text + strlen(text), sizeof text - strlen(text), " %d", i % 3 + 1);
    drape_mesh mesh;
    strcat(text, "\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
    parse(ctx, &drape_import_obj, text, &mesh);
    ck_assert_int_eq(mesh.triangle_count, 999);
    drape_mesh_free(&mesh);
}

TEST(what_a_simulation_does_not_need_is_not_refused)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    /* coordinates that are not defined, are no numbers, or are missing at a corner */
    parse(ctx, &drape_import_obj,
          "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt x 1\nvt\nvt .5\n"
          "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 1/1 3/3 4/9\nf 1/1 3 4/2\nf 1/1 2/5 3/2\nf 1/6 2/-5 3/2\n",
          &mesh);
    static const int has[] = {1, 0, 0, 0, 0, 1};
    ck_assert_int_eq(mesh.faces.count, 6);
    for (int f = 0; f < 6; f++)
        for (int k = 0; k < 3; k++)
            ck_assert_int_eq(mesh.faces.uv_of[3 * f + k] >= 0, has[f]);
    ck_assert_double_eq(mesh.faces.uv[2 * mesh.faces.uv_of[15]], .5);
    ck_assert_double_eq(mesh.faces.uv[2 * mesh.faces.uv_of[15] + 1], 0);
    drape_mesh_free(&mesh);
    /* corners in a row at one node are one, the first; the arrays have no gap */
    parse(
        ctx, &drape_import_obj,
        "mtllib a.mtl\nmtllib\nmtllib b c.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\n"
        "f 1/1 2/2 2/1 3/1 1/2\nf 1/1 1 3 3/2 4/2 4 1/2\nf 2 1 3 4\n",
        &mesh);
    ck_assert_int_eq(mesh.triangle_count, 4);
    static const int32_t first[] = {0, 3, 6, 10}, node[] = {0, 1, 2, 0, 2, 3, 1, 0, 2, 3};
    static const int32_t uv_of[] = {0, 1, 0, -1, -1, -1, -1, -1, -1, -1};
    ck_assert_int_eq(mesh.faces.corner_count, 10);
    ck_assert_int_eq(memcmp(mesh.faces.first, first, sizeof first), 0);
    ck_assert_int_eq(memcmp(mesh.faces.node, node, sizeof node), 0);
    ck_assert_int_eq(memcmp(mesh.faces.uv_of, uv_of, sizeof uv_of), 0);
    ck_assert_str_eq(mesh.faces.material_file, "a.mtl\nb c.mtl");
    drape_mesh_free(&mesh);
    /* nothing of all that: the mesh has triangles only */
    parse(ctx, &drape_import_obj, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl\nf 1/2 2/1 3\n",
          &mesh);
    ck_assert_int_eq(mesh.faces.count, 0);
    ck_assert_ptr_null(mesh.faces.first);
    drape_mesh_free(&mesh);
}

/* In OBJ coordinates are often repeated for each corner; a vertex is split only where they differ. */
TEST(equal_coordinates_are_one)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    drape_vertices vertices;
    parse(ctx, &drape_import_obj,
          "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt .3 0\nvt 1 0\nvt 1 1\nvt -0 0\nvt 1 1\nvt 0 1\nvt .3 0\n"
          "f 1/4 2/2 3/3\nf 1/7 3/5 4/6\n",
          &mesh);
    ck_assert_int_eq(mesh.faces.uv_count, 5);
    drape_arena arena = drape_arena_of(ctx);
    ck_assert_int_eq(drape_faces_vertices(&arena, &mesh, &vertices), DRAPE_OK);
    static const int node[] = {0, 0, 1, 2, 3}, at[] = {0, 2, 3, 1, 3, 4};
    ck_assert_int_eq(vertices.count, 5); /* node 0 is on the seam */
    for (int i = 0; i < 5; i++)
        ck_assert_int_eq(vertices.node[i], node[i]);
    for (int i = 0; i < 6; i++)
        ck_assert_int_eq(vertices.at[i], at[i]);
    drape_arena_free(&arena);
    drape_mesh_free(&mesh);
}

static void check_uvs(const drape_mesh *mesh, const double *expected)
{
    ck_assert_int_eq(mesh->faces.corner_count, 4);
    for (int c = 0; c < 4; c++)
        for (int k = 0; k < 2; k++)
            ck_assert_double_eq(mesh->faces.uv[2 * mesh->faces.uv_of[c] + k], expected[2 * c + k]);
}

TEST(ply_has_them_at_vertices_or_corners)
{
    static const double uvs[] = {0, .25, 1, 0, 1, 1, 0, 1};
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    static const char *const names[][2] = {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}};
    for (int i = 0; i < 3; i++) {
        char text[512];
        snprintf(
            text, sizeof text,
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float %s\nproperty float y\n"
            "property float z\nproperty float %s\nelement face 1\nproperty list uchar int vertex_indices\n"
            "end_header\n0 0 0 0 .25\n1 1 0 0 0\n1 1 1 0 1\n0 0 1 0 1\n4 0 1 2 3\n",
            names[i][0], names[i][1]);
        parse(ctx, &drape_import_ply, text, &mesh);
        check_uvs(&mesh, uvs);
        drape_mesh_free(&mesh);
    }
    static const char *const orders[] = {"8 0 .25 1 0 1 1 0 1 4 0 1 2 3\n",
                                         "4 0 1 2 3 8 0 .25 1 0 1 1 0 1\n"};
    for (int i = 0; i < 2; i++) {
        char text[512];
        const char *lists[] = {"property list uchar float texcoord\n",
                               "property list uchar int vertex_indices\n"};
        snprintf(
            text, sizeof text,
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            "property float s\nproperty float t\nelement face 1\n%s%send_header\n"
            "0 0 0 9 9\n1 0 0 9 9\n1 1 0 9 9\n0 1 0 9 9\n%s",
            lists[i], lists[1 - i], orders[i]);
        parse(ctx, &drape_import_ply, text, &mesh);
        check_uvs(&mesh, uvs);
        drape_mesh_free(&mesh);
    }
}

/* ---- Remedies ---- */

static void open_has_remedy(drape_context *ctx, const char *text, const char *expected)
{
    const drape_mesh_source source = {"/m/file", "a.obj", NULL};
    char remedy[DRAPE_REMEDY_SIZE];
    drape_mesh mesh;
    parse(ctx, &drape_import_obj, text, &mesh);
    ck_assert_int_eq(drape_mesh_connect(ctx, &source, &mesh), DRAPE_OK);
    drape_remedy_open(ctx, &mesh, remedy);
    ck_assert_str_eq(remedy, expected);
    drape_mesh_free(&mesh);
}

#define CORNERS "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"

/* A tetrahedron without a face has a hole; one whose faces have vertices of their own is to be welded, by
 * more than these are apart; and a sheet that was torn apart by more than an edge has nothing to be welded.
 * */
TEST(an_open_mesh_has_a_remedy)
{
    scoped_context *ctx = make_context();
    open_has_remedy(
        ctx, CORNERS "f 1 3 2\nf 1 2 4\nf 1 4 3\n",
        "; remedy: fill the holes, which have 3 open edges, this one from (1, 0, 0) to (0, 1, 0) m");
    open_has_remedy(ctx, CORNERS CORNERS CORNERS CORNERS "f 1 3 2\nf 5 6 8\nf 9 12 11\nf 14 15 16\n",
                    "; remedy: merge vertices by a distance of 0.001 m: that closes its 12 open edges, whose "
                    "nodes are at "
                    "most 0 m apart");
    open_has_remedy(ctx,
                    CORNERS
                    "v .01 0 0\nv 1.01 0 0\nv .01 0 1\nv 0 .02 0\nv 0 .02 1\nv 0 1.02 0\nv 1 0 .03\nv 0 1 "
                    ".03\nv 0 0 1.03\nf 1 3 2\nf 5 6 7\nf 8 9 10\nf 11 12 13\n",
                    "; remedy: merge vertices by a distance of 0.063 m: that closes its 12 open edges, whose "
                    "nodes are at "
                    "most 0.032 m apart");
    open_has_remedy(/* one face has a corner of its own: only that is doubled */
                    ctx, CORNERS "v 0 0 1.002\nf 1 3 2\nf 1 2 4\nf 1 5 3\nf 2 3 4\n",
                    "; remedy: merge vertices by a distance of 0.004 m: that closes its 4 open edges, whose "
                    "nodes are at "
                    "most 0.002 m apart");
    open_has_remedy(/* a doubled corner beside a hole: merging does not close it */
                    ctx, CORNERS "v 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 5 3\n",
                    "; remedy: fill the holes, which have 5 open edges, this one from (0, 0, 0) to (0, 0, 1) "
                    "m");
    open_has_remedy(
        ctx, CORNERS "f 1 2 3\n",
        "; remedy: fill the holes, which have 3 open edges, this one from (0, 0, 0) to (1, 0, 0) m");
    drape_context_destroy(&ctx);
    failing_allocator memory = {.fail_at = 1, .stay_broken = true};
    ctx = make_context();
    scoped_context *none = failing_context(&memory);
    drape_mesh mesh;
    char remedy[DRAPE_REMEDY_SIZE];
    const drape_mesh_source source = {"/m/file", "a.obj", NULL};
    parse(ctx, &drape_import_obj, CORNERS CORNERS "f 1 3 2\nf 5 6 8\n", &mesh);
    ck_assert_int_eq(drape_mesh_connect(ctx, &source, &mesh), DRAPE_OK);
    drape_remedy_open(none, &mesh, remedy);
    ck_assert_ptr_nonnull(strstr(remedy, "fill the holes"));
    drape_mesh_free(&mesh);
}

TEST(a_degenerate_triangle_has_a_remedy)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    char remedy[DRAPE_REMEDY_SIZE];
    parse(ctx, &drape_import_obj, "v 0 0 0\nv 1 0 0\nv 3 0 0\nv 3 0 1e-14\nf 1 2 3\nf 1 3 4\n", &mesh);
    drape_remedy_degenerate(&mesh, mesh.triangle, true, remedy);
    ck_assert_str_eq(
        remedy, "; remedy: move node 1, at (1, 0, 0) m, off the line between the others, or dissolve it");
    drape_remedy_degenerate(&mesh, mesh.triangle + 3, true, remedy);
    ck_assert_str_eq(remedy, "; remedy: merge nodes 2 and 3, which are 1e-14 m apart");
    drape_remedy_degenerate(&mesh, mesh.triangle, false, remedy); /* as in the start of a cloth */
    ck_assert_str_eq(remedy, "; remedy: move node 1, at (1, 0, 0) m, off the line between the others");
    drape_remedy_degenerate(&mesh, mesh.triangle + 3, false, remedy);
    ck_assert_str_eq(remedy, "; remedy: move nodes 2 and 3, which are 1e-14 m apart, away from each other");
    drape_mesh_free(&mesh);
}

/* ---- Round trips ---- */

/* A tube of 4 x 3 quadrilaterals and a lid of 4 corners: its seam has the coordinates 0 and 1 on one line of
 * nodes, its materials alternate, and one name has a blank. */
#define SIDES 4
#define RINGS 4
#define NODES (SIDES * RINGS)
#define QUADS (SIDES * (RINGS - 1))
#define UVS   ((SIDES + 1) * RINGS)

static void write_tube(const frames_folder *f, const char *name)
{
    FILE *file = frames_file(f, name);
    fprintf(file, "mtllib tube of\tcloth.mtl\nmtllib other.mtl\n");
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < SIDES; s++)
            fprintf(file, "v %.6f %.6f %.6f\n", .1 * cos(s * 1.5707963), .1 * r, .1 * sin(s * 1.5707963));
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s <= SIDES; s++)
            fprintf(file, "vt %g %g\n", (double)s / SIDES, (double)r / RINGS);
    for (int r = 0; r + 1 < RINGS; r++) {
        fprintf(file, "usemtl %s\n", r % 2 ? "lining" : "light denim");
        for (int s = 0; s < SIDES; s++) {
            const int a = r * SIDES + s + 1, b = r * SIDES + (s + 1) % SIDES + 1;
            const int u = r * (SIDES + 1) + s + 1;
            fprintf(file, "f %d/%d %d/%d %d/%d %d/%d\n", b, u + 1, a, u, a + SIDES, u + SIDES + 1, b + SIDES,
                    u + SIDES + 2);
        }
    }
    fprintf(file, "f 16 13 14 15\n"); /* without coordinates, of the last material */
    fclose(file);
}

static scene tube_scene(const frames_folder *f)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'name': 'tube', 'mesh': {'file': '%s/tube.obj'}, 'material': "
        "{'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], "
        "'pins': [{'nodes': [0, 1]}]}, {'name': 'grid', 'mesh': {'grid': 'square', 'columns': 3, "
        "'rows': 3, 'width': 0.2, 'height': 0.2}, 'material': {'young_modulus': 1e4, 'thickness': "
        "1e-3, 'density': 200}, 'terms': ['stretch.edge'], 'pins': [{'corner': 'top-left'}]}], "
        "'integrator': {'dt': 0.01}, 'duration': 0.05, 'frame_rate': 40}",
        f->path);
}

static void record(scene *s, const frames_folder *f, const char *format)
{
    char out[100];
    snprintf(out, sizeof out, "%s/out", f->path);
    const drape_recorder_def def = {.folder = out, .formats = &format, .format_count = 1};
    drape_recorder *recorder = NULL;
    assert_ok(s->ctx, drape_recorder_create(s->ctx, s->sim, &def, &recorder));
    ck_assert_int_eq(drape_sim_advance(s->sim, 0.05), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    drape_recorder_destroy(&recorder);
}

/* Frames have the faces that the mesh had: the frame read again, the grid apart, is the mesh but for
 * positions. */
TEST(obj_frames_have_the_faces_of_the_mesh)
{
    scoped_frames f = frames_folder_make();
    write_tube(&f, "tube.obj");
    scoped_scene s = tube_scene(&f);
    ck_assert_int_eq(s.model->cloths[0].mesh.triangle_count, 2 * QUADS + 2);
    record(&s, &f, "obj");
    static const char *const frames[] = {"out/frame_000000.obj", "out/frame_000002.obj"};
    for (int i = 0; i < 2; i++) {
        drape_mesh mesh = {0};
        const drape_faces *from = &s.model->cloths[0].mesh.faces, *to = &mesh.faces;
        ck_assert_int_eq(drape_mesh_read(s.ctx, "/m", f.path, frames[i], &mesh), DRAPE_OK);
        ck_assert_int_eq(mesh.node_count, NODES + 9);
        ck_assert_int_eq(to->count, QUADS + 1 + 8); /* the triangles of the grid, in no material */
        ck_assert_int_eq(to->corner_count, 4 * QUADS + 4 + 24);
        ck_assert_int_eq(memcmp(to->node, from->node, (size_t)from->corner_count * sizeof *to->node), 0);
        ck_assert_int_eq(to->uv_count, UVS);
        for (int32_t c = 0; c < from->corner_count; c++) {
            ck_assert_int_eq(to->uv_of[c] >= 0, from->uv_of[c] >= 0);
            for (int k = 0; k < 2 && from->uv_of[c] >= 0; k++)
                ck_assert_double_eq(to->uv[2 * to->uv_of[c] + k], from->uv[2 * from->uv_of[c] + k]);
        }
        for (int32_t face = 0; face < QUADS + 1; face++)
            ck_assert_str_eq(to->name[to->material[face]], face / SIDES == 1 ? "lining" : "light denim");
        ck_assert_str_eq(to->name[to->material[QUADS + 1]], "cloth");
        ck_assert_str_eq(to->material_file,
                         "tube of_cloth.mtl\nother.mtl"); /* without the control character */
        drape_mesh_free(&mesh);
    }
}

static uint32_t word_at(const char *data, size_t at)
{
    const unsigned char *b = (const unsigned char *)data + at;
    return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

static float float_at(const char *data, size_t at)
{
    float value;
    memcpy(&value, data + at, sizeof value); /* tests run on little endian machines */
    return value;
}

typedef struct glb {
    char *data;
    size_t size, binary; /* where the binary chunk begins */
    json_t *json;
} glb;

static glb glb_load(const frames_folder *f)
{
    glb g = {.data = file_read(frames_path(f, "out/positions.glb"), &g.size)};
    const uint32_t text = word_at(g.data, 12);
    json_error_t error;
    g.binary = 28 + (size_t)text;
    g.json = json_loadb(g.data + 20, text, JSON_REJECT_DUPLICATES, &error);
    ck_assert_msg(g.json != NULL, "%s", error.text);
    return g;
}

static void glb_free(glb *g)
{
    json_decref(g->json);
    free(g->data);
}

static json_t *item(const json_t *object, const char *list, json_int_t index)
{
    json_t *found = json_array_get(json_object_get(object, list), (size_t)index);
    ck_assert_msg(found != NULL, "%s has no item %d", list, (int)index);
    return found;
}

static json_int_t number(const json_t *object, const char *key)
{
    return json_integer_value(json_object_get(object, key)); /* 0 if it is missing, as in glTF */
}

/* Where an accessor's data begin; they must be within the file. */
static size_t place(const glb *g, json_int_t accessor, size_t width, json_int_t *count)
{
    const json_t *a = item(g->json, "accessors", accessor),
                 *v = item(g->json, "bufferViews", number(a, "bufferView"));
    const size_t at = g->binary + (size_t)number(v, "byteOffset") + (size_t)number(a, "byteOffset");
    *count = number(a, "count");
    ck_assert_uint_le((size_t)number(a, "byteOffset") + width * (size_t)*count,
                      (size_t)number(v, "byteLength"));
    ck_assert_uint_le(at + width * (size_t)*count, g->size);
    return at;
}

/* One primitive a material with its name, all corners with the positions and coordinates of the mesh, v
 * downwards; the nodes of the seam have two vertices, and those of the lid one more. */
TEST(glb_has_texture_coordinates_and_materials)
{
    scoped_frames f = frames_folder_make();
    write_tube(&f, "tube.obj");
    scoped_scene s = tube_scene(&f);
    record(&s, &f, "glb");
    glb g = glb_load(&f);
    static const char *const names[] = {"cloth", "light denim", "lining"};
    static const int triangles[] = {8, 4 * SIDES + 2, 2 * SIDES};
    const drape_mesh *mesh = &s.model->cloths[0].mesh;
    const json_t *drawn = item(g.json, "meshes", 0);
    ck_assert_uint_eq(json_array_size(json_object_get(drawn, "primitives")), 3);
    size_t seen = 0;
    for (json_int_t p = 0; p < 3; p++) {
        const json_t *primitive = item(drawn, "primitives", p),
                     *attributes = json_object_get(primitive, "attributes");
        const json_t *material = item(g.json, "materials", number(primitive, "material"));
        ck_assert_str_eq(json_string_value(json_object_get(material, "name")), names[p]);
        ck_assert_uint_eq(json_array_size(json_object_get(primitive, "targets")), 2);
        json_int_t corners, vertices, same;
        const size_t index = place(&g, number(primitive, "indices"), 4, &corners);
        const size_t position = place(&g, number(attributes, "POSITION"), 12, &vertices);
        const size_t uv = place(&g, number(attributes, "TEXCOORD_0"), 8, &same);
        ck_assert_int_eq(corners, 3 * triangles[p]);
        ck_assert_int_eq(vertices, NODES + RINGS + SIDES + 9);
        ck_assert_int_eq(same, vertices);
        for (json_int_t c = 0; c < corners; c++) {
            const uint32_t vertex = word_at(g.data, index + 4 * (size_t)c);
            ck_assert_uint_lt(vertex, (uint32_t)vertices);
            bool found = p == 0; /* the grid has no coordinates */
            for (int32_t i = 0; i < 3 * mesh->triangle_count && !found; i++) {
                const int32_t own = mesh->faces.uv_of[mesh->faces.corner[i]];
                found = own >= 0 || p == 1;
                for (size_t k = 0; k < 3; k++)
                    found = found && float_at(g.data, position + 12 * vertex + 4 * k) ==
                                         (float)mesh->x[3 * mesh->triangle[i] + (int)k];
                const double u = own < 0 ? 0 : mesh->faces.uv[2 * own],
                             v = own < 0 ? 0 : 1 - mesh->faces.uv[2 * own + 1];
                found = found && float_at(g.data, uv + 8 * vertex) == (float)u &&
                        float_at(g.data, uv + 8 * vertex + 4) == (float)v;
            }
            ck_assert_msg(found, "corner %d of primitive %d", (int)c, (int)p);
            seen++;
        }
    }
    ck_assert_uint_eq(seen, 3 * (2 * QUADS + 2 + 8));
    glb_free(&g);
}

/* Each failed allocation is reported, by the importer and where vertices are split, and none leaks. */
TEST(each_allocation_may_fail)
{
    scoped_frames f = frames_folder_make();
    write_tube(&f, "tube.obj");
    drape_status status = DRAPE_E_MEMORY;
    for (int n = 1; status; n++) {
        failing_allocator memory = {.fail_at = n};
        drape_context *ctx = failing_context(&memory);
        drape_mesh mesh = {0};
        drape_vertices vertices;
        ck_assert_int_lt(n, 200);
        status = drape_mesh_read(ctx, "/m", f.path, "tube.obj", &mesh);
        drape_arena arena = drape_arena_of(ctx);
        if (!status)
            status = drape_faces_vertices(&arena, &mesh, &vertices);
        ck_assert(status == DRAPE_OK || status == DRAPE_E_MEMORY);
        drape_arena_free(&arena);
        drape_mesh_free(&mesh);
        drape_context_destroy(&ctx);
        ck_assert_int_eq(memory.live, 0);
    }
}
