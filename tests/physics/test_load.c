/* test_load.c: loads that follow the surface or act on nodes, against closed forms. */
#include "integrators/integrator.h"
#include "support/bytes.h"
#include "support/scene.h"

#define RADIUS    0.1  /* [m] */
#define THICKNESS 1e-3 /* [m] */
#define MODULUS   1e7  /* [Pa] */
#define POISSON   0.3
#define PRESSURE  3.0 /* [Pa]: strains of 1e-5 */

enum { FINEST = 16, NODES = (FINEST + 1) * (FINEST + 2) / 2, TRIANGLES = FINEST * FINEST };

/* ---- An octant of a sphere ---- */

static int32_t number(int n, int i, int j)
{
    return i * (n + 1) - i * (i - 1) / 2 + j;
}

/* The triangle between the axes, n parts a side, projected onto the sphere. Triangles turn counterclockwise
 * from outside. */
static void octant(int n, double *x, int32_t *triangle)
{
    for (int i = 0; i <= n; i++)
        for (int j = 0; i + j <= n; j++) {
            const double a[3] = {i, j, n - i - j}, length = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
            for (int k = 0; k < 3; k++)
                x[3 * number(n, i, j) + k] = RADIUS * a[k] / length;
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; i + j < n; j++) {
            const int32_t a = number(n, i, j), b = number(n, i + 1, j), c = number(n, i, j + 1);
            memcpy(triangle, (int32_t[]){a, b, c}, 3 * sizeof *triangle), triangle += 3;
            if (i + j + 1 < n)
                memcpy(triangle, (int32_t[]){b, number(n, i + 1, j + 1), c}, 3 * sizeof *triangle),
                    triangle += 3;
        }
}

/* With planes of symmetry, or free. */
static scene inflated(int n, bool symmetric, const double *point)
{
    static double x[3 * NODES];
    static int32_t triangle[3 * TRIANGLES];
    const drape_setting material[] = {{.name = "young_modulus", .number = MODULUS},
                                      {.name = "poisson_ratio", .number = POISSON},
                                      {.name = "thickness", .number = THICKNESS},
                                      {.name = "areal_density", .number = 0.1}};
    const drape_setting pressure[] = {{.name = "pressure", .number = PRESSURE},
                                      {.name = "point", .vector = point, .vector_count = 3}};
    const drape_setting tolerance[] = {{.name = "tolerance", .number = 1e-12}};
    const drape_entry_def terms[] = {{"stretch.cst", NULL, 0}, {"load.pressure", pressure, 2}};
    scene s = scene_empty();
    drape_cloth_def cloth = cloth_def();
    drape_scene_def def = scene_def();
    drape_pin_def pins[3];
    octant(n, x, triangle);
    cloth.mesh.positions = x, cloth.mesh.node_count = (size_t)(n + 1) * (size_t)(n + 2) / 2;
    cloth.mesh.triangles = triangle, cloth.mesh.triangle_count = (size_t)n * (size_t)n;
    cloth.material = material, cloth.material_count = 4;
    cloth.terms = terms, cloth.term_count = 2;
    for (int k = 0; k < 3; k++) {
        drape_pin_def_init(&pins[k], sizeof pins[k]);
        pins[k].has_box = true;
        for (int i = 0; i < 3; i++) {
            pins[k].box_min[i] = i == k ? 0 : -1;
            pins[k].box_max[i] = i == k ? 0 : 1;
            pins[k].normal[i] = i == k;
        }
    }
    cloth.pins = pins, cloth.pin_count = symmetric ? 3 : 0;
    def.cloths = &cloth, def.cloth_count = 1;
    memset(def.gravity, 0, sizeof def.gravity);
    def.integrator = (drape_entry_def){"static", tolerance, 1};
    assert_ok(s.ctx, drape_model_create(s.ctx, &def, &s.model));
    scene_start(&s, NULL);
    return s;
}

/* On nodes in the interior the force is a third of p times the areas around them as vectors, wherever the
 * point is; and its derivatives, which in one triangle depend on the point, are exact. */
TEST(pressure_on_the_interior_does_not_depend_on_the_point)
{
    static const double points[2][3] = {{0}, {0.3, -0.2, 0.5}};
    enum { N = 6, COUNT = (N + 1) * (N + 2) / 2 };
    double g[2][3 * COUNT], exact[3 * COUNT] = {0};
    for (int c = 0; c < 2; c++) {
        scoped_scene s = inflated(N, false, points[c]);
        const drape_state *state = scene_state(&s);
        drape_check_result rows[32];
        int32_t count = 0;
        memset(g[c], 0, sizeof g[c]);
        drape_system_term(s.sim->system, 1,
                          &(drape_point){.x = state->x, .v = state->v, .internal = state->internal}, NULL,
                          g[c], NULL);
        ck_assert_str_eq(s.model->terms[1].ops->entry.name, "load.pressure");
        for (int32_t t = 0; c == 0 && t < s.model->triangle_count; t++) {
            const int32_t *n = s.model->triangle + 3 * t;
            double a[3], b[3], area[3];
            for (int k = 0; k < 3; k++) {
                a[k] = state->x[3 * n[1] + k] - state->x[3 * n[0] + k];
                b[k] = state->x[3 * n[2] + k] - state->x[3 * n[0] + k];
            }
            for (int k = 0; k < 3; k++)
                area[k] = (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) / 2;
            for (int i = 0; i < 9; i++)
                exact[3 * n[i / 3] + i % 3] -= PRESSURE * area[i % 3] / 3;
        }
        ck_assert_int_eq(drape_model_check_derivatives(s.model, 1, rows, 32, &count), DRAPE_OK);
        for (int32_t i = 0; i < count && i < 32; i++)
            ck_assert_msg(rows[i].pass, "%s %s: %g", rows[i].term, rows[i].what, rows[i].error);
    }
    for (int i = 1; i < N; i++)
        for (int j = 1; i + j < N; j++)
            for (int c = 0; c < 6; c++)
                ck_assert_double_eq_tol(g[c / 3][3 * number(N, i, j) + c % 3],
                                        exact[3 * number(N, i, j) + c % 3],
                                        64 * DBL_EPSILON * PRESSURE); /* terms of p |X|^2 < p 1 m2 cancel */
}

/* ---- Point loads ---- */

static scene loaded(const char *method, const char *terms, double gravity)
{
    return scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, "
                      "'width': 0.3, 'height': 0.2},"
                      "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2},"
                      "'masses': [{'box': [[-1, -1, -1], [1, 1, 1]], 'mass': 0.01}],"
                      "'terms': [%s 'stretch.cst', 'bend.hinge'], 'pins': [{'nodes': [0]}]}], 'gravity': "
                      "[0, %g, 0],"
                      "'integrator': {'method': '%s', 'dt': 0.01, 'atol_v': 1e-6, 'atol_x': 1e-7, "
                      "'tolerance': 1e-9,"
                      "'error': 1e-7, 'substeps': 20}, 'duration': 1}",
                      terms, gravity, method);
}

/* Equal masses with equal forces, of two loads, move as under gravity, by every method and to what it
 * leaves: residuals, or errors of 1e-6 of a size of 0.3 m. */
TEST(equal_forces_on_equal_masses_are_gravity)
{
    for (int m = 0; drape_integrators[m]; m++) {
        const char *name = drape_integrators[m]->entry.name;
        scene a = loaded(name, "", -5), b = loaded(name,
                                                   "{'type': 'load.point', 'force': [0, -0.02, 0]},"
                                                   "{'type': 'load.point', 'force': [0, -0.03, 0]},",
                                                   0);
        double most = 0;
        scene_advance(&a, 0.05);
        scene_advance(&b, 0.05);
        for (int i = 0; i < 36; i++)
            most = fmax(most, fabs(scene_state(&a)->x[i] - scene_state(&b)->x[i]));
        printf("# %s: %.2g\n", name, most);
        ck_assert_msg(most < 1e-6, "%s: %g", name, most);
        scene_close(&a), scene_close(&b);
    }
}

/* A folded, spinning cloth on supports, with a pin that turns and loads that rise, goes on from a checkpoint
 * with the same bits, under every integrator. */
static scene everything(const char *method)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.3, "
        "'height': 0.3},"
        "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2},"
        "'start': {'folds': [{'point': [0.15, 0, 0], 'axis': [0, 0, 1], 'side': [1, 0, 0], 'angle': 60,"
        "'radius': 0.02}], 'spin': [0, 1, 0]}, 'terms': ['stretch.cst', 'bend.midedge',"
        "{'type': 'load.pressure', 'pressure': 2, 'ramp': 0.1},"
        "{'type': 'load.point', 'node': 10, 'force': [0, 0.01, 0], 'ramp': 0.2},"
        "{'type': 'load.line', 'edge': 'right', 'force': [0, 0.05, 0], 'history': 'up'},"
        "{'type': 'load.moment', 'edge': 'right', 'moment': 1e-4, 'history': 'gust'},"
        "{'type': 'load.follower', 'pressure': 0.5, 'history': 'gust'},"
        "{'type': 'drag.wind', 'wind': [0, 1, 0], 'history': 'gust'}],"
        "'pins': [{'edge': 'left', 'normal': [1, 1, 0]}, {'corner': 'bottom-right', 'pivot': [0, 0, 0],"
        "'turns': [{'time': 0, 'rotate': [0, 1, 0, 0]}, {'time': 0.3, 'rotate': [0, 1, 0, 90]}]}]}],"
        "'histories': [{'name': 'up', 'times': [0, 0.06], 'values': [0.5, 1]}, {'name': 'gust', 'times': [0, "
        "0.03, 0.1], 'values': [0, 1, 0.2], 'interpolation': 'cubic'}], 'gravity_history': 'up',"
        "'integrator': {'method': '%s', 'dt': 0.01}, 'controller': {'type': '%s'}, 'duration': 1}",
        method, strcmp(method, "verlet") == 0 ? "stable" : "halving");
}

TEST(all_of_it_goes_on_from_a_checkpoint)
{
    for (int m = 0; drape_integrators[m]; m++) {
        const char *name = drape_integrators[m]->entry.name;
        scoped_bytes saved = {0};
        scene a = everything(name), b = everything(name);
        scene_advance(&a, 0.05);
        ck_assert_int_eq(drape_sim_save_to(a.sim, bytes_keep, &saved), DRAPE_OK);
        ck_assert_int_eq(drape_sim_restore_from(b.sim, saved.data, saved.size), DRAPE_OK);
        scene_advance(&a, 0.1);
        scene_advance(&b, 0.1);
        ck_assert_msg(drape_state_hash(a.model, scene_state(&a)) ==
                          drape_state_hash(b.model, scene_state(&b)),
                      "%s", name);
        scene_close(&a), scene_close(&b);
    }
}
