/* test_periodic.c: cloth with periodic edges, under every integrator. */
#include "integrators/integrator.h"
#include "support/resume.h"

/* The methods that step in time. */
static const char *methods[64];
static size_t method_count;

__attribute__((constructor)) static void list_methods(void)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (!drape_integrators[i]->steady_state)
            methods[method_count++] = drape_integrators[i]->entry.name;
}

static const char *controller(const char *method)
{
    return strcmp(method, "verlet") == 0 ? "stable" : "halving";
}

/* A periodic sheet drawn out to `stretch` of its width, with the other edges free. */
static scene drawn_out(double stretch)
{
    return scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 4, 'width': "
                      "0.5, 'height': 0.3},"
                      "'material': {'young_modulus': 1e5, 'poisson_ratio': 0.25, 'thickness': 1e-3, "
                      "'areal_density': 0.2},"
                      "'terms': ['stretch.cst'], 'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': "
                      "'right'}, 'period': [%.17g, 0, 0]}], 'pins': [{'nodes': [8]}]}],"
                      "'gravity': [0, 0, 0], 'integrator': {'method': 'static', 'tolerance': 1e-12}, "
                      "'duration': 1}",
                      0.5 * stretch);
}

#define MEMBRANE "'stretch.cst'"
#define BENT     "'stretch.cst', 'bend.midedge'"
#define CELL_SCENE                                                                                           \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': 3, 'width': %.17g, "          \
    "'height': 0.1, 'orientation': 'horizontal'},"                                                           \
    "'material': {'young_modulus': 1e3, 'poisson_ratio': 0.3, 'thickness': 1e-2, 'areal_density': 0.2},"     \
    "'terms': [%s, {'type': 'damp.kelvin_voigt', 'beta': 0.005}, {'type': 'drag.viscous', "                  \
    "'coefficient': 0.05}], 'velocity': [0.1, 0, 0.2], 'pins': [{'edge': 'top'}],"                           \
    "'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': 'right'}, 'period': [%.17g, 0, 0]}],"            \
    "'masses': [{'nodes': [%s], 'add': 0.002}, {'nodes': [%s], 'add': 0.003}]}],"                            \
    "'colliders': [{'type': 'plane', 'point': [0, %g, 0], 'normal': [0, 1, 0], 'friction': 0.3}],"           \
    "'contact': {'distance': 0.005, 'stiffness': 5e4},"                                                      \
    "'integrator': {'method': '%s', 'dt': 0.005, 'tolerance': 1e-10, 'rtol': 1e-7, 'error': 1e-9, "          \
    "'iterations': 8, 'substeps': 20}, 'controller': {'type': '%s'}, "                                       \
    "'duration': 1}"

/* A sheet of cells of 4 x 2, in each a weight within and one on its edge, that hangs from a line and falls,
 * onto a plane with friction at this height. A weight on the periodic edge is on one of its two nodes. */
static scene cells(const char *method, const char *terms, int count, double plane)
{
    return count == 1
               ? scene_open(CELL_SCENE, 5, 0.2, terms, 0.206, "12", "10", plane, method, controller(method))
               : scene_open(CELL_SCENE, 13, 0.6, terms, 0.618, "28,32,36", "26,30,34", plane, method,
                            controller(method));
}

/* The largest distance of a node of three cells from its image of one. */
static double differ(const double *one, const double *three)
{
    double most = 0;
    for (int row = 0; row < 3; row++)
        for (int c = 0; c < 13; c++)
            for (int k = 0; k < 3; k++) {
                const int cell = c == 12 ? 2 : c / 4;
                const double shift = k == 0 ? 0.206 * cell : 0;
                most = fmax(most, fabs(three[3 * (13 * row + c) + k] - shift -
                                       one[3 * (5 * row + c - 4 * cell) + k]));
            }
    return most;
}

static void compare_cells(const char *method, const char *terms, double plane, double limit)
{
    scene one = cells(method, terms, 1, plane), three = cells(method, terms, 3, plane);
    scene_advance(&one, 0.1);
    scene_advance(&three, 0.1);
    const double *x = scene_state(&one)->x, *v = scene_state(&one)->v,
                 most = differ(x, scene_state(&three)->x);
    printf("# %s, %s, plane at %g m: %.2g, sag %.3g\n", method, terms, plane, most, -x[3 * 12 + 1]);
    ck_assert_double_gt(-x[3 * 12 + 1], 0.004);
    ck_assert_msg(most < limit, "%s, plane at %g m: %g", method, plane, most);
    for (int row = 1; row < 3; row++)
        for (int k = 0; k < 3; k++) {
            const int left = 15 * row + k, right = left + 12;
            ck_assert_double_eq_tol(x[right] - x[left], k == 0 ? 0.206 : 0, 1e-14);
            ck_assert_double_eq_tol(v[right], v[left], 1e-13);
        }
    scene_close(&one), scene_close(&three);
}

/* One cell moves as each of three: methods that solve their steps, to a residual of 1e-10 N, differ by that;
 * those that choose their steps, by their error of 1e-7 of the size. */
TEST(one_cell_moves_as_each_of_three)
{
    for (size_t i = 0; i < method_count; i++)
        compare_cells(methods[i], MEMBRANE, -9, 1e-7);
}

/* A flat sheet rolled into a closed tube of n sides: every hinge along it has the angle 2 pi/n, so that the
 * curvature is 2 pi over the length everywhere, and E = D/2 of its square and the area. */
TEST(a_closed_tube_is_bent_evenly)
{
    static const char *const bending[] = {"'bend.hinge'", "'bend.midedge'"};
    for (int k = 0; k < 2; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 4, 'width': 0.4, "
            "'height': "
            "0.15, 'diagonals': 'parallel'}, 'material': {'young_modulus': 1e6, 'poisson_ratio': 0, "
            "'thickness': 1e-3, 'areal_density': 0.2}, 'start': {'folds': [{'point': [0, 0, 0], 'axis': "
            "[0, 0, 1], 'side': [1, 0, 0], 'angle': 360, 'radius': %.17g}]}, 'terms': [%s], 'periodic': "
            "[{'from': {'edge': 'left'}, 'to': {'edge': 'right'}}]}], 'gravity': [0, 0, 0], 'duration': 1}",
            0.4 / (2 * acos(-1)), bending[k]);
        const double curvature = 2 * acos(-1) / 0.4,
                     expected = 1e6 * 1e-9 / 12 / 2 * curvature * curvature * 0.06;
        ck_assert_double_eq_tol(drape_sim_energy(s.sim).elastic, expected, 1e-12 * expected);
    }
}

/* The same onto the plane. Methods that choose their steps do so anew at each touch; those that keep the
 * energy of a bounce diverge where rounding decides which steps are rejected, and are left out. */
TEST(cells_touch_a_plane_alike)
{
    for (size_t i = 0; i < method_count; i++)
        if (strcmp(methods[i], "midpoint") != 0)
            compare_cells(methods[i], MEMBRANE, -0.02, 1e-5);
}

/* Periodic along both sides, where the corners are one node, a sheet falls freely at its velocity: backward
 * Euler, 10 steps, h^2 g (1 + ... + 10), and is at rest within itself. The nodes keep their whole mass. */
TEST(sheets_repeat_in_two_directions)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': "
                   "0.3, 'height': 0.2},"
                   "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.2},"
                   "'terms': ['stretch.cst', {'type': 'spring.shear', 'stiffness': 10}], 'velocity': [1, 0, "
                   "2], 'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': 'right'}, 'period': [0.32, "
                   "0, 0]}, {'from': {'edge': 'top'}, 'to': {'edge': 'bottom'}, 'period': [0, -0.19, 0]}]}],"
                   "'integrator': {'dt': 0.01, 'tolerance': 1e-12}, 'duration': 1}");
    double mass = 0, start[48];
    ck_assert_int_eq(s.model->image_set_count, 5);
    ck_assert_int_eq(s.model->image_start[1], 4);
    for (int i = 0; i < 16; i++)
        mass += s.model->mass[i];
    ck_assert_double_eq_tol(mass, 0.2 * 0.06, 1e-15);
    memcpy(start, scene_state(&s)->x, sizeof start);
    scene_advance(&s, 0.1);
    const double to[3] = {0.1, -9.81 * 1e-4 * 55, 0.2};
    for (int i = 0; i < 48; i++)
        ck_assert_double_eq_tol(scene_state(&s)->x[i] - start[i], to[i % 3], 1e-9);
}

/* Loads on an endless sheet between two lines are as everywhere at its periodic edges: they are no boundary
 * along which lines of force act, or that wind leaves. All columns are alike, to what a residual of 1e-12 N
 * leaves over the stiffness of some N/m. Without the load the sheet would be flat. */
TEST(loads_are_alike_everywhere)
{
    static const struct {
        const char *load;
        double least; /* [m] deflection of the middle */
    } loads[] = {{"{'type': 'load.follower', 'pressure': 1}", 0.001},
                 {"{'type': 'load.line', 'force': [0, 0.1, 0]}", 0},
                 {"{'type': 'load.line', 'edge': 'bottom', 'force': [0, 0.1, 0]}, {'type': 'load.moment', "
                  "'moment': 1e-3}",
                  1e-5},
                 {"{'type': 'drag.wind', 'wind': [3, 0.5, 0], 'friction': 0.01}", 0.001},
                 {"{'type': 'air.added_mass', 'span': 0.3, 'wind': [2, 0.5, 0]}", 0}};
    for (size_t i = 0; i < sizeof loads / sizeof *loads; i++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'diagonals': "
            "'parallel', 'width': 0.2, 'height': 0.2}, 'material': {'young_modulus': 1e5, 'thickness': "
            "2e-3, 'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.midedge', %s], 'pins': [{'edge': "
            "'top'}, {'edge': 'bottom'}], 'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': "
            "'right'}}]}], 'gravity': [0, 0, 0], 'integrator': {'method': 'static', 'tolerance': 1e-12}, "
            "'duration': 1}",
            loads[i].load);
        scene_advance(&s, 1);
        const double *x = scene_state(&s)->x;
        printf("# %s: %g m\n", loads[i].load, x[3 * 12 + 1]);
        ck_assert_double_ge(fabs(x[3 * 12 + 1]), loads[i].least);
        for (int n = 0; n < 25; n++)
            for (int k = 0; k < 3; k++)
                ck_assert_double_eq_tol(x[3 * n + k] - x[3 * (n - n % 5) + k], k == 0 ? 0.05 * (n % 5) : 0,
                                        1e-10);
    }
}

/* In a closed tube the volume of load.pressure is closed as well: its forces are those of load.follower. */
TEST(pressure_closes_in_a_tube)
{
    double x[2][3 * 36];
    for (int k = 0; k < 2; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 4, 'width': 0.4, "
            "'height': 0.15}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2}, "
            "'start': {'folds': [{'point': [0, 0, 0], 'axis': [0, 0, 1], 'side': [1, 0, 0], 'angle': 360, "
            "'radius': %.17g}]}, 'terms': ['stretch.cst', 'bend.hinge', {'type': '%s', 'pressure': -100}], "
            "'pins': [{'edge': 'top'}, {'edge': 'bottom'}], 'periodic': [{'from': {'edge': 'left'}, 'to': "
            "{'edge': 'right'}}]}], 'gravity': [0, 0, 0], 'integrator': {'method': 'static', 'tolerance': "
            "1e-11}, 'duration': 1}",
            0.4 / (2 * acos(-1)), k ? "load.pressure" : "load.follower");
        scene_advance(&s, 1);
        memcpy(x[k], scene_state(&s)->x, sizeof x[k]);
    }
    for (int i = 0; i < 3 * 36; i++)
        ck_assert_double_eq_tol(x[0][i], x[1][i], 1e-10);
}

TEST(the_jacobian_is_that_of_the_shared_forces)
{
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, "
                    "'width': 0.3, 'height': 0.3},"
                    "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2},"
                    "'terms': ['stretch.cst', {'type': 'damp.kelvin_voigt', 'beta': 0.01}, {'type': "
                    "'drag.viscous', 'coefficient': 1}], 'periodic': [{'from': {'edge': 'left'}, 'to': "
                    "{'edge': 'right'}}, {'from': {'edge': 'top'}, 'to': {'edge': 'bottom'}}],"
                    "'pins': [{'edge': 'left', 'normal': [1, 2, 3]}, {'edge': 'right', 'normal': [1, 2, 3]},"
                    "{'nodes': [12], 'normal': [1, 2, 3]}]}], 'duration': 1}");
    scene_check_derivatives(&s);
}

/* The same with bending and springs across both pairs of edges, of a cell that is drawn out, with rates and
 * the angle of a corner's hinges; and of a cell so narrow that an element meets images of its own nodes. */
TEST(derivatives_across_edges_are_exact)
{
    for (int columns = 2; columns <= 5; columns++) {
        scoped_scene s = scene_model(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': 4, 'width': 0.3, "
            "'height': "
            "0.3, 'diagonals': 'parallel'}, 'material': {'young_modulus': 1e4, 'thickness': 5e-3, "
            "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge', 'bend.midedge', {'type': "
            "'damp.kelvin_voigt', 'beta': 0.01}, {'type': 'relax.maxwell', 'fraction_1': 0.3, 'time_1': "
            "0.1}], "
            "'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': 'right'}, 'period': [0.31, 0, 0.02]}, "
            "{'from': {'edge': 'top'}, 'to': {'edge': 'bottom'}}]}], 'duration': 1}",
            columns);
        scene_check_derivatives(&s);
    }
}

/* Without damping the implicit midpoint rule keeps the energy of a weighted cell but for its error: that of
 * the account, which knows no work of the periodic edges. Threads change no bit. */
TEST(periodic_edges_do_no_work)
{
    uint64_t hash[2];
    for (int threads = 1; threads <= 3; threads += 2) {
        scoped_scene s =
            scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, "
                        "'width': 0.2, 'height': 0.15, 'orientation': 'horizontal'},"
                        "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2},"
                        "'terms': ['stretch.cst'], 'pins': [{'edge': 'top'}], 'masses': [{'nodes': [10], "
                        "'add': 0.002}], 'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': "
                        "'right'}, 'period': [0.21, 0, 0]}]}],"
                        "'integrator': {'method': 'midpoint', 'dt': 0.001, 'tolerance': 1e-12}, "
                        "'duration': 1}");
        drape_sim_def def = sim_def();
        def.threads = threads;
        scene_start(&s, &def);
        const drape_energy before = drape_sim_energy(s.sim);
        scene_advance(&s, 0.1);
        const drape_energy after = drape_sim_energy(s.sim);
        const double moved = after.kinetic - before.kinetic;
        ck_assert_double_gt(moved, 1e-3);
        const double change =
            after.kinetic + after.elastic + after.gravity - before.kinetic - before.elastic - before.gravity;
        printf("# energy %g of %g J\n", change, moved);
        ck_assert_double_le(fabs(change), 1e-3 * moved);
        hash[threads / 2] = drape_state_hash(s.model, scene_state(&s));
    }
    ck_assert_uint_eq(hash[0], hash[1]);
}

/* A run goes on from a checkpoint with the same bits; a scene of another period refuses it. */
TEST(checkpoints_keep_the_period)
{
    scene drawn[2] = {drawn_out(1.1), drawn_out(1.2)};
    bytes other = bytes_save(drawn[0].sim);
    scene_resumes(cells("be", BENT, 1, -0.02), cells("be", BENT, 1, -0.02), 0.05, 0.1, BENT);
    ck_assert_int_ne(drape_sim_restore_from(drawn[1].sim, other.data, other.size), DRAPE_OK);
    free(other.data);
    scene_close(&drawn[0]), scene_close(&drawn[1]);
}

/* A host cannot take images apart: not by a state, and not by pinning one of them. */
TEST(hosts_keep_the_period)
{
    scoped_scene s = cells("be", MEMBRANE, 1, -0.02);
    double x[45], v[45] = {0};
    const int32_t seam[2] = {5, 9};
    memcpy(x, scene_state(&s)->x, sizeof x);
    for (int k = 0; k < 2; k++)
        x[3 * seam[k] + 1] += 0.01;
    ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
    x[3 * 5 + 1] += 0.01;
    ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "0.01 m from where the period"));
    ck_assert_int_eq(drape_sim_pin(s.sim, 1, seam), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "only one of them is pinned"));
    ck_assert_int_eq(drape_sim_pin(s.sim, 2, seam), DRAPE_OK);
    scene_advance(&s, 0.02);
    ck_assert_int_eq(drape_sim_unpin(s.sim, 2, seam), DRAPE_OK);
    scene_advance(&s, 0.02);
    ck_assert_double_eq_tol(scene_state(&s)->x[3 * 9] - scene_state(&s)->x[3 * 5], 0.206, 1e-13);
}
