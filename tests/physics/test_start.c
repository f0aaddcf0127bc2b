/* test_start.c: cloth that starts folded, strained, turned or in motion, against closed forms. */
#include "integrators/integrator.h"
#include "support/scene.h"

#include <stdlib.h>

#define PI    3.14159265358979323846
#define WIDTH 1.0 /* [m] */

/* A free sheet without weight in the plane y = 0, x from 0 to WIDTH. */
static scene sheet(const char *method, const char *start, int nodes)
{
    return scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': 3, 'width': "
                      "%g, 'height': 0.4,"
                      "'orientation': 'horizontal'}, 'material': {'young_modulus': 1e4, 'poisson_ratio': "
                      "0.3, 'thickness': 1e-3,"
                      "'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.hinge'], %s}],"
                      "'gravity': [0, 0, 0], 'integrator': {'method': '%s', 'dt': 0.01}, 'duration': 1}",
                      nodes, WIDTH, start, method);
}

static double largest_distance(const double *x, const double *y, int32_t count)
{
    double most = 0;
    for (int32_t i = 0; i < 3 * count; i++)
        most = fmax(most, fabs(x[i] - y[i]));
    return most;
}

/* Half of the sheet is bent by half a turn around a cylinder of radius r: what is at x = 1/2 + s is at the
 * angle s / r, and behind the arc goes back at the height 2 r. Rounding of numbers of size 1. */
TEST(a_fold_rolls_the_sheet_by_its_arc_length)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        char start[256];
        snprintf(start, sizeof start,
                 "'start': {'folds': [{'point': [0.5, 0, 3], 'axis': [0, 0, %d], 'side': [2, 0, 1], 'angle': "
                 "180, 'radius': 0.1}]}",
                 2 * sign);
        scoped_scene s = sheet("be", start, 41);
        const double *x = scene_state(&s)->x;
        for (int32_t i = 0; i < s.model->node_count; i++) {
            const double *rest = s.model->rest + 3 * i, along = rest[0] - 0.5, angle = fmin(along / 0.1, PI);
            const double to[3] = {along > 0 ? 0.5 + 0.1 * sin(angle) - fmax(along - 0.1 * PI, 0) : rest[0],
                                  along > 0 ? sign * 0.1 * (1 - cos(angle)) : 0, rest[2]};
            ck_assert_double_le(largest_distance(x + 3 * i, to, 1), 8 * DBL_EPSILON);
        }
        ck_assert_ptr_eq(drape_model_rest_positions(s.model), s.model->rest);
    }
}

/* A copy that is rotated and displaced has no forces: under every integrator it stays where it starts.
 * Forces of rounding are below 1e4 N/m^2 1e-3 m 1 m DBL_EPSILON = 2e-15 N; on a mass of 3e-4 kg they move a
 * node by less than 1e-12 m in 0.05 s. */
TEST(a_rigid_copy_stays_where_it_starts)
{
    for (int i = 0; drape_integrators[i]; i++) {
        const char *method = drape_integrators[i]->entry.name;
        scoped_scene s = sheet(
            method, "'start': {'transform': {'rotate': [1, 2, 3, 40], 'translate': [0.1, 0.2, 0.3]}}", 5);
        double before[45];
        ck_assert_int_eq(s.model->node_count, 15);
        memcpy(before, scene_state(&s)->x, sizeof before);
        ck_assert_double_gt(largest_distance(before, s.model->rest, 15), 0.1);
        scene_advance(&s, 0.05);
        ck_assert_msg(largest_distance(before, scene_state(&s)->x, 15) < 1e-12, "%s", method);
    }
}

/* The law of Saint Venant and Kirchhoff under equal strains e = (1.1^2 - 1)/2 in the plane: E = A h Y / (1
 * - nu) e^2. At equilibrium all of it is gone. */
TEST(a_strained_start_has_its_energy_and_loses_it_at_equilibrium)
{
    scoped_scene s = sheet("static", "'start': {'transform': {'scale': [1.1, 1, 1.1]}}", 5);
    double elastic = 0, gravity = 0, strain = (1.1 * 1.1 - 1) / 2;
    const drape_state *state = scene_state(&s);
    drape_system_energy(s.sim->system,
                        &(drape_point){.x = state->x, .v = state->v, .internal = state->internal}, &elastic,
                        &gravity);
    const double exact = 0.4 * WIDTH * 1e-3 * 1e4 / (1 - 0.3) * strain * strain;
    ck_assert_double_eq_tol(elastic, exact, 1e-12 * exact);
    scene_advance(&s, 1);
    const drape_state *end = scene_state(&s);
    drape_system_energy(s.sim->system, &(drape_point){.x = end->x, .v = end->v, .internal = end->internal},
                        &elastic, &gravity);
    ck_assert_double_le(elastic, 1e-9 * exact);
}

/* v = v0 + w x (x - p), and p is the centre of mass unless it is given, so that the momentum is m v0. */
TEST(spin_is_about_the_centre_of_mass_or_a_pivot)
{
    static const double w[3] = {3, -1, 2}, v0[3] = {0.5, 0, -0.25}, given[3] = {0.1, 0.2, -0.3};
    for (int pivoted = 0; pivoted < 2; pivoted++) {
        scoped_scene s = sheet(
            "be",
            pivoted ? "'velocity': [0.5, 0, -0.25], 'start': {'spin': [3, -1, 2], 'pivot': [0.1, 0.2, -0.3]}"
                    : "'velocity': [0.5, 0, -0.25], 'start': {'spin': [3, -1, 2]}",
            5);
        const drape_state *state = scene_state(&s);
        double momentum[3] = {0}, mass = 0, centre[3] = {0};
        for (int32_t i = 0; i < 3 * s.model->node_count; i++) {
            momentum[i % 3] += s.model->mass[i / 3] * state->v[i];
            centre[i % 3] += s.model->mass[i / 3] * state->x[i];
            mass += i % 3 == 0 ? s.model->mass[i / 3] : 0;
        }
        for (int k = 0; k < 3; k++)
            centre[k] = pivoted ? given[k] : centre[k] / mass;
        for (int32_t i = 0; i < s.model->node_count; i++) {
            const double *x = state->x + 3 * i,
                         arm[3] = {x[0] - centre[0], x[1] - centre[1], x[2] - centre[2]};
            const double v[3] = {v0[0] + w[1] * arm[2] - w[2] * arm[1], v0[1] + w[2] * arm[0] - w[0] * arm[2],
                                 v0[2] + w[0] * arm[1] - w[1] * arm[0]};
            ck_assert_double_le(largest_distance(state->v + 3 * i, v, 1), 16 * DBL_EPSILON);
        }
        for (int k = 0; k < 3 && !pivoted; k++)
            ck_assert_double_eq_tol(momentum[k], mass * v0[k], 64 * DBL_EPSILON * mass);
    }
}

/* Pinned nodes begin at the start, not at rest, and a track displaces them from there. */
TEST(pins_hold_the_start)
{
    scoped_scene s =
        sheet("be",
              "'velocity': [1, 0, 0], 'start': {'transform': {'translate': [0, 5, 0]}},"
              "'pins': [{'edge': 'left'}, {'edge': 'right', 'track': [[0, [0, 0, 0]], [1, [0.5, 0, 0]]]}]",
              5);
    scene_advance(&s, 0.1);
    const drape_state *state = scene_state(&s);
    for (int32_t i = 0; i < s.model->node_count; i++) {
        const double *rest = s.model->rest + 3 * i, moved = i % 5 == 4 ? 0.05 : 0;
        const double to[3] = {rest[0] + moved, rest[1] + 5, rest[2]};
        if (s.model->pinned[i])
            ck_assert_double_le(largest_distance(state->x + 3 * i, to, 1), 4 * DBL_EPSILON);
    }
}

/* ---- Files and arrays ---- */

static const char obj[] = "v 0 0 1\nv 1 0 1\nv 0 2 1\nv 1 1 1\nf 1 2 3\nf 2 4 3\n";

static void in_build(const char *name, char *path, size_t size)
{
    snprintf(path, size, "%s/test_start_%s", getenv("DRAPE_BUILD"), name);
}

static void write_file(const char *path, const void *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    ck_assert_ptr_nonnull(file);
    ck_assert_uint_eq(fwrite(data, 1, size, file), size);
    ck_assert_int_eq(fclose(file), 0);
}

static void write_velocities(const char *path)
{
    char data[128 + 12 * sizeof(double)];
    memset(data, ' ', sizeof data);
    memcpy(data, "\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (4, 3)}", 67);
    data[127] = '\n';
    for (int i = 0; i < 12; i++)
        memcpy(data + 128 + 8 * i, &(double){0.5 * i}, sizeof(double));
    write_file(path, data, sizeof data);
}

TEST(shape_and_velocities_come_from_files)
{
    static const double x[12] = {0, 0, 1, 1, 0, 1, 0, 2, 1, 1, 1, 1};
    static const char flat[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";
    char shape[512], velocities[512];
    in_build("shape.obj", shape, sizeof shape);
    in_build("velocities.npy", velocities, sizeof velocities);
    scoped_memory char *rest = strdup(shape);
    strcpy(strstr(rest, "shape.obj"), "flat.obj");
    write_file(shape, obj, sizeof obj - 1);
    write_file(rest, flat, sizeof flat - 1);
    write_velocities(velocities);
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'file': '%s'}, 'start': {'file': '%s', 'velocities': '%s'}, "
        "'material':"
        "{'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': ['stretch.cst'],"
        "'velocity': [1, 0, 0]}], 'gravity': [0, 0, 0], 'duration': 1}",
        rest, shape, velocities);
    ck_assert_double_eq(largest_distance(scene_state(&s)->x, x, 4), 0);
    for (int i = 0; i < 12; i++)
        ck_assert_double_eq(scene_state(&s)->v[i], 0.5 * i + (i % 3 == 0));
    scene_close(&s);
    remove(shape), remove(rest), remove(velocities);
}

/* The same from arrays of a host, whose faults are reported. */
TEST(shape_and_velocities_come_from_arrays)
{
    static const double rest[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, x[9] = {0, 0, 1, 2, 0, 1, 0, 1, 1},
                        flat[9] = {0, 0, 1, 2, 0, 1, 1, 0, 1};
    static const int32_t triangle[3] = {0, 1, 2};
    const drape_setting material[] = {{.name = "young_modulus", .number = 1e4},
                                      {.name = "thickness", .number = 1e-3},
                                      {.name = "areal_density", .number = 1}};
    struct {
        const char *file;
        const double *x;
        size_t x_count, v_count;
        const char *message;
    } const cases[] = {{NULL, x, 9, 9, NULL},
                       {"shape.obj", x, 9, 9, "/cloth/0/start"},
                       {NULL, x, 8, 9, "8 numbers in positions"},
                       {NULL, flat, 9, 9, "degenerate"},
                       {NULL, x, 9, 3, "3 numbers in velocities"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_scene s = scene_empty();
        drape_cloth_def cloth = cloth_def();
        drape_scene_def def = scene_def();
        cloth.mesh.positions = rest, cloth.mesh.node_count = 3;
        cloth.mesh.triangles = triangle, cloth.mesh.triangle_count = 1;
        cloth.material = material, cloth.material_count = 3;
        cloth.start.file = cases[i].file;
        cloth.start.positions = cases[i].x, cloth.start.position_count = cases[i].x_count;
        cloth.start.velocities = x, cloth.start.velocity_count = cases[i].v_count;
        def.cloths = &cloth, def.cloth_count = 1;
        const drape_status status = drape_model_create(s.ctx, &def, &s.model);
        if (cases[i].message) {
            ck_assert_int_lt(status, 0);
            ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), cases[i].message));
        } else {
            ck_assert_int_eq(status, DRAPE_OK);
            scene_start(&s, NULL);
            ck_assert_double_eq(largest_distance(scene_state(&s)->x, x, 3), 0);
            ck_assert_double_eq(largest_distance(scene_state(&s)->v, x, 3), 0);
        }
    }
}
