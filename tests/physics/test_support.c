/* test_support.c: pins that hold nodes in some directions only, and pins that turn, under every integrator.
 * */
#include "integrators/integrator.h"
#include "support/bytes.h"
#include "support/scene.h"

#define GRAVITY 9.81

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
/* How far a node has gone along a direction of length 1. */
static double along(const scene *s, const double *x, int32_t i, const double n[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += n[k] * (x[3 * i + k] - s->model->rest[3 * i + k]);
    return sum;
}

/* A sheet on inclined rails slides as one that falls freely with the part of gravity along the rails, by
 * every method: to rounding of 1 m and, as both solve their steps to a residual, 1e-9 m. */
TEST(a_rail_leaves_its_direction_free)
{
    static const double g[3] = {1, -9, 2}, a[3] = {2.0 / 3, -1.0 / 3, 2.0 / 3};
    const double fall = g[0] * a[0] + g[1] * a[1] + g[2] * a[2];
    for (size_t i = 0; i < method_count; i++) {
        double x[2][27];
        for (int railed = 0; railed < 2; railed++) {
            scoped_scene s = scene_open(
                "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': "
                "0.2, 'height': 0.2},"
                "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, "
                "'velocity': [0.4, -0.2, 0.4],"
                "'terms': ['stretch.cst', 'bend.midedge'], %s}], 'gravity': [%.17g, %.17g, %.17g],"
                "'integrator': {'method': '%s', 'dt': 0.01, 'atol_v': 1e-6, 'atol_x': 1e-7, "
                "'iterations': 5}, "
                "'controller': {'type': '%s'}, 'duration': 1}",
                railed ? "'pins': [{'box': [[-1, -1, -1], [1, 1, 1]], 'axis': [2, -1, 2]}]" : "'pins': []",
                railed ? g[0] : fall * a[0], railed ? g[1] : fall * a[1], railed ? g[2] : fall * a[2],
                methods[i], controller(methods[i]));
            ck_assert_int_eq(s.model->free_count, 9);
            scene_advance(&s, 0.1);
            memcpy(x[railed], scene_state(&s)->x, sizeof x[railed]);
        }
        for (int k = 0; k < 27; k++)
            ck_assert_msg(fabs(x[0][k] - x[1][k]) < 1e-9, "%s: %g", methods[i], x[0][k] - x[1][k]);
    }
}

/* A sheet with its edges on an inclined plane: its nodes stay in it to rounding, and the results do not
 * depend on threads. */
TEST(nodes_stay_in_an_inclined_plane)
{
    static const double n[3] = {2.0 / 7, 3.0 / 7, 6.0 / 7};
    for (int m = 0; drape_integrators[m]; m++) {
        uint64_t hash[2];
        for (int threads = 1; threads <= 3; threads += 2) {
            scoped_scene s =
                scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, "
                            "'rows': 5, 'width': 0.3, 'height': 0.3},"
                            "'material': {'young_modulus': 1e4, 'thickness': 1e-3, "
                            "'areal_density': 0.2},"
                            "'terms': ['stretch.cst', 'bend.hinge', {'type': 'damp.kelvin_voigt', "
                            "'beta': 0.01}],"
                            "'pins': [{'corner': 'top-left'}, {'edge': 'right', 'normal': [2, 3, "
                            "6]}, {'edge': 'left', 'normal': [2, 3, 6]}]}],"
                            "'integrator': {'method': '%s', 'dt': 0.01}, 'duration': 1}",
                            drape_integrators[m]->entry.name);
            drape_sim_def def = sim_def();
            def.threads = threads;
            scene_start(&s, &def);
            scene_advance(&s, 0.05);
            const drape_state *now = scene_state(&s);
            for (int32_t i = 0; i < s.model->support_count; i++) {
                const int32_t node = s.model->supports[i].node;
                ck_assert_double_le(fabs(along(&s, now->x, node, n)), 1e-15);
                ck_assert_double_le(
                    fabs(n[0] * now->v[3 * node] + n[1] * now->v[3 * node + 1] + n[2] * now->v[3 * node + 2]),
                    1e-14);
            }
            hash[threads / 2] = drape_state_hash(s.model, now);
        }
        ck_assert_uint_eq(hash[0], hash[1]);
    }
}

/* Supports in three planes leave nothing free; a plane given twice counts once; a pin that holds its node
 * altogether goes before them. The supports of a resting sheet carry its weight, along their directions
 * only. */
TEST(supports_combine_and_carry_the_weight)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, "
                   "'width': 0.3, 'height': 0.3,"
                   "'orientation': 'horizontal'}, 'material': {'young_modulus': 1e4, 'thickness': "
                   "1e-3, 'areal_density': 0.2},"
                   "'terms': ['stretch.cst', 'bend.hinge'],"
                   "'pins': [{'box': [[-9, -9, -9], [9, 9, 9]], 'normal': [0, 1, 0]}, {'nodes': "
                   "[5], 'normal': [0, -2, 0]},"
                   "{'nodes': [0], 'normal': [1, 0, 0]}, {'nodes': [0], 'axis': [1, 1, 0]}, "
                   "{'nodes': [3]}, {'nodes': [6], 'axis': [1, 0, 0]}]}],"
                   "'gravity': [0, %g, 0], 'integrator': {'method': 'static'}, 'duration': 1}",
                   -GRAVITY);
    double force[48], sum[3] = {0};
    ck_assert_int_eq(s.model->free_count, 14);
    ck_assert(s.model->pinned[0] && s.model->pinned[3]);
    for (int32_t i = 0; i < s.model->support_count; i++)
        ck_assert_int_eq(s.model->supports[i].count, s.model->supports[i].node == 6 ? 2 : 1);
    scene_advance(&s, 1);
    ck_assert_int_eq(drape_sim_reactions(s.sim, force), DRAPE_OK);
    for (int i = 0; i < 48; i++) {
        sum[i % 3] += force[i];
        if (i % 3 != 1)
            ck_assert_double_le(fabs(force[i]), 1e-12);
    }
    ck_assert_double_eq_tol(sum[1], GRAVITY * 0.2 * 0.09, 1e-12);
}

/* The matrix is that of the projected forces: differences of these along displacements that the supports
 * allow. */
TEST(the_jacobian_is_that_of_the_projected_forces)
{
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, "
                    "'width': 0.3, 'height': 0.3},"
                    "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2},"
                    "'terms': ['stretch.cst', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': "
                    "0.01}, {'type': 'drag.viscous', 'coefficient': 1}],"
                    "'pins': [{'row': 0, 'normal': [1, 2, 3]}, {'row': 2, 'axis': [1, -1, 1]}]}], "
                    "'duration': 1}");
    scene_check_derivatives(&s);
}

/* A host's velocities lose what is held; placed cloth takes its directions along: on a slope of 30 degrees
 * the sheet, which was held in a level plane, slides along the slope. */
TEST(states_and_placements_of_a_host)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, "
                   "'width': 0.3, 'height': 0.3,"
                   "'orientation': 'horizontal'}, 'material': {'young_modulus': 1e4, 'thickness': "
                   "1e-3, 'areal_density': 0.2},"
                   "'terms': ['stretch.cst'], 'velocity': [1, 2, 3], 'pins': [{'row': 0, 'normal': "
                   "[0, 1, 0]},"
                   "{'row': 1, 'normal': [0, 1, 0]}]}], 'integrator': {'dt': 0.01, 'tolerance': "
                   "1e-12}, 'duration': 1}");
    double x[12], v[12];
    drape_place_def def = place_def();
    for (int i = 0; i < 12; i++)
        ck_assert_double_eq(scene_state(&s)->v[i], i % 3 == 1 ? 0 : i % 3 + 1);
    memcpy(x, scene_state(&s)->x, sizeof x);
    memset(v, 0, sizeof v);
    for (int i = 0; i < 4; i++)
        v[3 * i + 1] = 5;
    ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
    for (int i = 0; i < 12; i++)
        ck_assert_double_eq(scene_state(&s)->v[i], 0);
    def.rotate[2] = 1, def.rotate[3] = 30;
    ck_assert_int_eq(drape_sim_place(s.sim, &def), DRAPE_OK);
    memcpy(x, scene_state(&s)->x, sizeof x);
    scene_advance(&s, 0.1);
    /* backward Euler, 10 steps: h^2 a (1 + 2 + ... + 10) */
    const double fall = 9.81 * 0.5 * 1e-4 * 55, to[3] = {-fall * sqrt(0.75), -fall * 0.5, 0};
    for (int i = 0; i < 12; i++)
        ck_assert_double_eq_tol(scene_state(&s)->x[i] - x[i], to[i % 3], 1e-9);
}

/* The sides of a strip, held in planes of symmetry and clamped there, turn in these planes as the strip
 * bends: without lateral contraction it deflects as without clamps. The diagonals of the mesh twist free
 * sides by some 1e-6 of that. */
TEST(a_clamped_edge_turns_in_its_plane)
{
    double drop[2];
    for (int clamped = 0; clamped < 2; clamped++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 11, 'rows': 4, 'width': 1, "
            "'height': 0.3,"
            "'orientation': 'horizontal'}, 'material': {'young_modulus': 12e6, 'poisson_ratio': 0, "
            "'thickness': 0.01,"
            "'areal_density': 0.1}, 'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'box': [[-1, -1, "
            "-1], [0.11, 1, 1]]},"
            "{'edge': 'top', 'normal': [0, 0, 1], 'clamp': %s}, {'edge': 'bottom', 'normal': [0, 0, 1], "
            "'clamp': %s}]}],"
            "'gravity': [0, -9.81, 0], 'integrator': {'method': 'static', 'tolerance': 1e-8}, 'duration': 1}",
            clamped ? "true" : "false", clamped ? "true" : "false");
        scene_advance(&s, 1);
        drop[clamped] = -scene_state(&s)->x[3 * 10 + 1];
    }
    ck_assert_double_gt(drop[0], 0.05);
    ck_assert_double_eq_tol(drop[1], drop[0], 1e-4 * drop[0]);
}

/* ---- Pins that turn ---- */

/* Both ends of a strip turn about the axis of the strip by 90 degrees in opposite senses, and one is drawn
 * away: at every time the nodes are where the rotation by 90 t degrees and the displacement take them, by
 * every method. */
TEST(pins_turn_as_one_body_about_their_pivot)
{
    for (int m = 0; drape_integrators[m]; m++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 3, 'width': 0.4, "
            "'height': 0.2,"
            "'orientation': 'horizontal'}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, "
            "'areal_density': 0.2},"
            "'terms': ['stretch.cst', 'bend.hinge'], 'start': {'transform': {'translate': [0, 1, 0]}}, "
            "'pins': ["
            "{'edge': 'left', 'turns': [{'time': 0, 'rotate': [1, 0, 0, 0]}, {'time': 1, 'rotate': [1, 0, 0, "
            "90]}]},"
            "{'edge': 'right', 'pivot': [0.4, 1.1, 0], 'track': [[0, [0, 0, 0]], [1, [0.1, 0, 0]]],"
            " 'turns': [{'time': 0, 'rotate': [1, 0, 0, 0]}, {'time': 1, 'rotate': [1, 0, 0, -90]}]}]}],"
            "'integrator': {'method': '%s', 'dt': 0.01}, 'controller': {'type': '%s'}, 'duration': 1}",
            drape_integrators[m]->entry.name, controller(drape_integrators[m]->entry.name));
        const double middle = s.model->rest[3 * 5 + 2]; /* z of the middle row */
        scene_advance(&s, 0.2);
        for (int32_t i = 0; i < 15; i++) {
            const double *x = scene_state(&s)->x + 3 * i, *rest = s.model->rest + 3 * i;
            const bool left = i % 5 == 0, right = i % 5 == 4;
            const double angle = (left ? 18 : -18) * acos(-1) / 180, y = left ? 0 : -0.1,
                         z = left ? rest[2] - middle : rest[2];
            const double to[3] = {rest[0] + (right ? 0.02 : 0),
                                  (left ? 1 : 1.1) + cos(angle) * y - sin(angle) * z,
                                  (left ? middle : 0) + sin(angle) * y + cos(angle) * z};
            for (int k = 0; (left || right) && k < 3; k++)
                ck_assert_msg(fabs(x[k] - to[k]) < 1e-14,
                              "%s: node %d: "
                              "%g",
                              drape_integrators[m]->entry.name, (int)i, x[k] - to[k]);
        }
    }
}

/* A state set by the host keeps nodes in their planes and on their lines: within 1e-9 of the scene. */
TEST(a_state_off_a_plane_is_refused)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.2, 'height': "
        "0.2}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': "
        "['stretch.cst'], 'pins': [{'edge': 'left', 'normal': [1, 1, 0]}, {'edge': 'right', 'axis': [0, 0, "
        "1]}]}], 'duration': 1}");
    double x[27], v[27] = {0}, from[27];
    memcpy(from, scene_state(&s)->x, sizeof from);
    for (int node = 0; node < 9; node++) {
        /* along (1, -1, 0): in the plane of the left edge, off the line of the right one */
        memcpy(x, from, sizeof x);
        x[3 * node] += 0.01;
        x[3 * node + 1] -= 0.01;
        ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), node % 3 == 2 ? DRAPE_E_ARGUMENT : DRAPE_OK);
        /* along (1, 1, 0): off both */
        memcpy(x, from, sizeof x);
        x[3 * node] += 0.01;
        x[3 * node + 1] += 0.01;
        const bool held = node % 3 != 1;
        ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), held ? DRAPE_E_ARGUMENT : DRAPE_OK);
        if (held)
            ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "off the plane or line"));
    }
}

/* ---- Supports that move ---- */

/* A sheet between a plane and rails that move steadily along V, where everything else starts with V. */
static scene carried(const char *method, const double V[3], bool moves)
{
    const double speed = moves ? 1 : 0;
    char track[128] = "";
    snprintf(track, sizeof track, ", 'track': [[0, [0, 0, 0]], [2, [%.17g, %.17g, %.17g]]]", 2 * speed * V[0],
             2 * speed * V[1], 2 * speed * V[2]);
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': 0.3, 'height': "
        "0.2},"
        "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, "
        "'velocity': [%.17g, %.17g, %.17g], 'terms': ['stretch.cst', 'bend.hinge', "
        "{'type': 'damp.kelvin_voigt', 'beta': 0.01}],"
        "'pins': [{'corner': 'top-left'%s}, {'edge': 'left', 'normal': [3, 0, 4]%s}, "
        "{'edge': 'right', 'axis': [0, 1, 0]%s}]}],"
        "'integrator': {'method': '%s', 'dt': 0.005, 'tolerance': 1e-11, 'rtol': 1e-7, 'error': 1e-10, "
        "'iterations': 8}, 'controller': {'type': '%s'}, 'duration': 1}",
        speed * V[0], speed * V[1], speed * V[2], track, track, track, method, controller(method));
}

/* In the frame that moves with V the same sheet swings between pins that rest: by every method, to the 1e-11
 * N to which steps are solved, over the 6.7 N/m by which the inertia of a node, 0.17 g, resists in a step of
 * 5 ms, in each of 20 steps, or to the error of 1e-7 of the size of 0.3 m in each of up to 100 steps of
 * those that choose their steps. Forces differ by that times the stiffness of an edge, 10 N/m. What is lost
 * in the balance of energies is what is lost at rest, up to the error of the rules that sum powers over a
 * step: (w h)^2/24 of a swing in the membrane, w = 240/s, which damping ends in the first tenth of the
 * time. */
TEST(moving_supports_are_those_at_rest_in_a_moving_frame)
{
    static const double V[3] = {0.6, 0, 0.8};
    for (size_t i = 0; i < method_count; i++) {
        scene rest = carried(methods[i], V, false), moves = carried(methods[i], V, true);
        double most = 0, force[2][36], worst = 0;
        ck_assert_int_eq(moves.model->support_count, 5);
        scene_advance(&rest, 0.1);
        scene_advance(&moves, 0.1);
        for (int k = 0; k < 36; k++)
            most = fmax(most, fabs(scene_state(&moves)->x[k] - 0.1 * V[k % 3] - scene_state(&rest)->x[k]));
        ck_assert_int_eq(drape_sim_reactions(rest.sim, force[0]), DRAPE_OK);
        ck_assert_int_eq(drape_sim_reactions(moves.sim, force[1]), DRAPE_OK);
        for (int k = 0; k < 36; k++)
            worst = fmax(worst, fabs(force[0][k] - force[1][k]));
        const double work = moves.sim->work[DRAPE_BY_PINS], lost = drape_sim_energy(rest.sim).numerical,
                     lost_moving = drape_sim_energy(moves.sim).numerical;
        const bool own_steps = moves.sim->chosen.integrator->own_steps;
        const double near = own_steps ? 3e-6 : 1e-10;
        printf("# %s: %.2g m, %.2g N, numerical %.3g and %.3g at rest, supports %.3g\n", methods[i], most,
               worst, lost_moving, lost, work);
        ck_assert_double_gt(fabs(work), 1e-3);
        ck_assert_msg(most < near, "%s: %g m", methods[i], most);
        ck_assert_msg(worst < 10 * near, "%s: %g N", methods[i], worst);
        ck_assert_msg(fabs(lost_moving - lost) < 1e-2 * fabs(work), "%s: %g J", methods[i],
                      lost_moving - lost);
        scene_close(&rest), scene_close(&moves);
    }
}

/* A strip that an oblique plane draws out, and lets back after a kink: the balance of energies holds
 * under every method, so that the work of the supports is the right one. Those that choose their steps
 * keep it to their tolerance of 1e-6, in some hundred steps; the others of second order to (w h)^2/12
 * = 0.5 % of the work, with w = 240/s of the membrane as above, more at kinks. Backward Euler takes
 * energy by itself; newton_k is backward Euler. */
TEST(the_work_of_moving_supports_is_in_the_balance)
{
    for (size_t i = 0; i < method_count; i++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 4, 'width': 0.3, "
            "'height': "
            "0.1, 'orientation': 'horizontal'}, 'material': {'young_modulus': 1e4, 'poisson_ratio': 0.3, "
            "'thickness': 1e-3, 'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.hinge', "
            "{'type': 'damp.kelvin_voigt', 'beta': 0.002}], 'pins': [{'edge': 'left'}, {'edge': 'right', "
            "'normal': "
            "[1, 1, 0], 'track': [[0, [0, 0, 0]], [0.1, [0.06, 0.02, 0.3]], [0.15, [0.03, 0.03, 0.3]]]}, "
            "{'edge': "
            "'top', 'normal': [0, 0, 1]}]}], 'integrator': {'method': '%s', 'dt': 0.001, 'rtol': 1e-6}, "
            "'controller': {'type': '%s'}, 'duration': 1}",
            methods[i], controller(methods[i]));
        scene_advance(&s, 0.2);
        const double work = s.sim->work[DRAPE_BY_PINS], lost = drape_sim_energy(s.sim).numerical;
        printf("# %s: work %.5g, numerical %.3g\n", methods[i], work, lost);
        ck_assert_double_gt(work, 1e-3);
        const double share = s.sim->chosen.integrator->mean_velocities ? 1
                             : s.sim->chosen.integrator->own_steps     ? 1e-3
                                                                       : 0.02;
        ck_assert_msg(fabs(lost) < share * work, "%s: %g of %g J", methods[i], lost, work);
    }
}

/* Edges that share a corner hold it along one direction: with tracks that are equal along it, by other keys
 * or with other parts across it, the sheet moves as with one pin of all these nodes. So it does where pins of
 * equal tracks hold a corner in all directions, and where a plane moves as a corner does along it. Steps are
 * solved to 1e-11 N at masses of 5e-4 kg and more: ten of them differ by 10 h^2 1e-11 / 5e-4 = 2e-11 m. */
TEST(pins_that_move_alike_share_nodes)
{
    static const char *const pins[][2] = {
        {"{'edge': 'top', 'normal': [1, 0, 2], 'track': [[0, [0, 0, 0]], [1, [0, 0, 0.5]]]}, {'edge': "
         "'right', "
         "'normal': [-2, 0, -4], 'track': [[0, [0, 9, 0]], [0.0625, [0.0625, 7, 0]], [1, [1, 0, 0]]]}",
         "{'nodes': [0, 1, 2, 5, 8], 'normal': [1, 0, 2], 'track': [[0, [0, 0, 0]], [1, [0, 0, 0.5]]]}"},
        {"{'edge': 'top', 'track': [[0, [0, 0, 0]], [1, [0, 0, 0.5]]]}, {'edge': 'right', 'track': [[0, [0, "
         "0, "
         "0]], [0.5, [0, 0, 0.25]], [1, [0, 0, 0.5]]]}",
         "{'nodes': [0, 1, 2, 5, 8], 'track': [[0, [0, 0, 0]], [1, [0, 0, 0.5]]]}"},
        {"{'edge': 'right', 'normal': [0, 0, 1], 'track': [[0, [0, 0, 0]], [1, [3, 0, 0.5]]]}, {'corner': "
         "'top-right', 'track': [[0, [0, 0, 0]], [1, [0, 0.1, 0.5]]]}",
         "{'corner': 'top-right', 'track': [[0, [0, 0, 0]], [1, [0, 0.1, 0.5]]]}, {'nodes': [5, 8], "
         "'normal': "
         "[0, 0, 1], 'track': [[0, [0, 0, 0]], [1, [0, 0, 0.5]]]}"}};
    for (size_t i = 0; i < sizeof pins / sizeof *pins; i++) {
        double x[2][27];
        for (int k = 0; k < 2; k++) {
            scoped_scene s =
                scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, "
                           "'width': 0.2, 'height': 0.2}, 'material': {'young_modulus': 1e4, "
                           "'thickness': 1e-3, 'areal_density': 0.2}, 'terms': ['stretch.cst'], 'pins': "
                           "[%s]}], 'integrator': {'dt': 0.01, 'tolerance': 1e-11}, 'duration': 1}",
                           pins[i][k]);
            scene_advance(&s, 0.1);
            memcpy(x[k], scene_state(&s)->x, sizeof x[k]);
        }
        ck_assert_double_gt(fabs(x[0][3 * 2 + 2]), 0.01);
        for (int j = 0; j < 27; j++)
            ck_assert_msg(fabs(x[0][j] - x[1][j]) <= 2e-11, "%zu: %d: %g", i, j, x[0][j] - x[1][j]);
    }
}
