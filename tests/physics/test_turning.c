/*
 * test_turning.c: colliders that turn. A patch on a turntable sticks by its centripetal force, or slides off;
 * the torque on a disc is the rate of the angular momentum that it takes from the cloth, and its work the
 * energy; edges that turn through cloth never cross it; a host turns what a track would, smoothly.
 */
#include "base/vec3.h"
#include "contact/barrier.h"
#include "contact/contact.h"
#include "contact/pair.h"
#include "support/bytes.h"
#include "support/crossings.h"
#include "support/scene.h"

#define GRAVITY 9.81
#define EPS     1e-3 /* [m/s] friction_velocity, its default */
#define MU      0.4
#define SIGMA   0.2 /* [kg/m2] */

/* The gap at which the barrier carries the weight: -K A b'(s) = m g, with b' rising from -inf to 0 at s =
 * 1. */
static double resting_gap(const drape_model *m)
{
    const double wanted = SIGMA * GRAVITY / m->contact.stiffness;
    double low = DRAPE_LEAST_GAP, high = 1;
    for (int i = 0; i < 200; i++) {
        const double s = (low + high) / 2;
        *(-drape_barrier_at(s, DRAPE_LEAST_GAP).db > wanted ? &low : &high) = s;
    }
    return low * m->contact.distance;
}

/* A patch of 3 x 3 nodes, 2 cm wide, with its middle `radius` from the axis of a floor that turns. */
static scene open_patch(const char *method, double radius, double rate, double dt)
{
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.02, "
        "'height': "
        "0.02, 'transform': {'translate': [%g, 0, 0.01]}},"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0], 'friction': %g,"
        " 'turns': [{'time': 0, 'rotate': [0,1,0,0]}, {'time': 100, 'rotate': [0,1,0,%.17g]}]}],"
        " 'integrator': {'method': '%s', 'dt': %g, 'tolerance': 1e-9, 'rtol': 1e-7}, 'duration': 1}",
        radius - 0.01, MU, 100 * rate * 180 / acos(-1.0), method, dt);
    drape_state *state = scene_state(&s);
    for (int32_t i = 0; i < s.model->node_count; i++) {
        state->x[3 * i + 1] = resting_gap(s.model);
        state->v[3 * i] = rate * state->x[3 * i + 2];
        state->v[3 * i + 2] = -rate * state->x[3 * i];
    }
    drape_sim_reset_energy(s.sim);
    return s;
}

/* The mean place of the nodes. */
static void middle_of(const scene *s, double middle[3])
{
    memset(middle, 0, 3 * sizeof *middle);
    for (int32_t i = 0; i < 3 * s->model->node_count; i++)
        middle[i % 3] += drape_sim_positions(s->sim)[i] / s->model->node_count;
}

/* Friction f(y) mu m g with f = 2 y - y^2 carries w^2 r at a creep of y eps outwards, by which the patch
 * drifts; within 1 % as it is not a point: w^2 r differs by its inertia over r^2, (0.01/0.1)^2/2, at most.
 * It turns with the floor but for the part of the creep along the path, the angle of a step, w h = 0.005,
 * of it at most. */
TEST(a_patch_sticks_to_a_turntable)
{
    static const char *const methods[] = {"be", "bdf2", "midpoint", "trbdf2", "ida", "rosenbrock", "radau"};
    const double radius = 0.1, rate = 5, begin = 0.1, t = 0.3;
    const double load = rate * rate * radius / (MU * GRAVITY), y = 1 - sqrt(1 - load);
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
        double middle[3];
        scoped_scene s = open_patch(methods[i], radius, rate, 0.001);
        scene_advance(&s, begin);
        middle_of(&s, middle);
        const double first = hypot(middle[0], middle[2]);
        scene_advance(&s, begin + t);
        middle_of(&s, middle);
        const double drift = hypot(middle[0], middle[2]) - first, turned = atan2(-middle[2], middle[0]);
        printf("# %s: drifted %.4g of %.4g m, turned by %.6g of %.6g\n", methods[i], drift, y * EPS * t,
               turned, remainder(rate * (begin + t), 2 * acos(-1.0)));
        assert_below(fabs(drift / (y * EPS * t) - 1), 0.01 + rate * 0.001);
        assert_below(fabs(remainder(turned - rate * (begin + t), 2 * acos(-1.0))), y * EPS * t / radius);
    }
}

/* With w^2 r = 2.4 mu g friction leaves at least 1.4 mu g outwards: more than half of mu g t^2 / 2 in 0.1
 * s. */
TEST(a_patch_slides_off_a_fast_turntable)
{
    const double radius = 0.1, rate = sqrt(2.4 * MU * GRAVITY / radius), t = 0.1;
    double middle[3];
    scoped_scene s = open_patch("be", radius, rate, 0.0025);
    scene_advance(&s, t);
    middle_of(&s, middle);
    ck_assert_double_gt(hypot(middle[0], middle[2]) - radius, 0.25 * MU * GRAVITY * t * t);
}

static double spin_of(const scene *s, const double *v)
{
    double sum = 0;
    for (int32_t i = 0; i < s->model->node_count; i++) {
        const double *x = drape_sim_positions(s->sim) + 3 * i;
        sum += s->model->mass[i] * (x[2] * v[3 * i] - x[0] * v[3 * i + 2]);
    }
    return sum;
}

/* A sheet at rest on a disc that turns fast is spun up. In a step of backward Euler, x1 x m (v1 - v0) is h
 * times the torque of what is outside, that of the disc, to the tolerance of the step, 1e-9 N at 0.2 m,
 * and to its rounding. The energy that the disc gives is what the sheet has, what friction takes, and the
 * sum of m/2 |v1 - v0|^2 that the method takes; the account calls the last numerical. Without the work of
 * the turning disc it would be below -0.001 J. */
TEST(torque_and_work_are_those_of_the_cloth)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.2, 'height': "
        "0.2,"
        " 'transform': {'translate': [-0.09, 1e-3, 0.1]}},"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'colliders': [{'type': 'cylinder', 'a': [0,-0.1,0], 'b': [0,0,0], 'radius': 0.3, 'friction': 0.3,"
        " 'restitution': 1, 'turns': [{'time': 0, 'rotate': [0,1,0,0]}, {'time': 1, 'rotate': "
        "[0,1,0,1200]}]}],"
        " 'integrator': {'method': 'be', 'dt': 0.002, 'tolerance': 1e-9}, 'duration': 1}");
    double taken = 0, *before = malloc(3 * (size_t)s.model->node_count * sizeof *before);
    const drape_energy start = drape_sim_energy(s.sim);
    for (int step = 1; step <= 20; step++) {
        double torque[3], about[3] = {0.1, 0.2, 0.3}, other[3], force[3], arm[3];
        memcpy(before, drape_sim_velocities(s.sim), 3 * (size_t)s.model->node_count * sizeof *before);
        scene_advance(&s, 0.002 * step);
        const double *v = drape_sim_velocities(s.sim);
        ck_assert_int_eq(drape_sim_collider_torque(s.sim, 0, NULL, torque), DRAPE_OK);
        const double rate = (spin_of(&s, v) - spin_of(&s, before)) / 0.002;
        if (step > 5)
            ck_assert_double_gt(rate, 1e-3);
        assert_below(fabs(torque[1] + rate), 25 * 0.2 * 1e-9 + 1e-9 * fabs(rate));
        ck_assert_int_eq(drape_sim_collider_torque(s.sim, 0, about, other), DRAPE_OK);
        ck_assert_int_eq(drape_sim_collider_force(s.sim, 0, force), DRAPE_OK);
        arm[0] = 0 - about[0], arm[1] = -0.05 - about[1], arm[2] = 0 - about[2];
        vec3_cross(arm, force, arm);
        for (int k = 0; k < 3; k++)
            assert_below(fabs(other[k] - torque[k] - arm[k]), 1e-14);
        for (int32_t i = 0; i < 3 * s.model->node_count; i++)
            taken += s.model->mass[i / 3] / 2 * (v[i] - before[i]) * (v[i] - before[i]);
    }
    const drape_energy end = drape_sim_energy(s.sim);
    printf("# numerical %.6g J, of the method %.6g J; dissipated %.4g J, kinetic %.4g J\n",
           end.numerical - start.numerical, taken, end.dissipated, end.kinetic);
    ck_assert_double_gt(end.dissipated, 1e-3);
    assert_below(fabs(end.numerical - taken), 0.02 * end.dissipated);
    free(before);
}

/* A bar with sharp edges that turns about its middle under, through and over a sheet hung by its upper
 * edge, by up to a seventh of a turn in a step. */
TEST(sharp_edges_turn_through_cloth)
{
    static const char *const shapes[] = {
        "'type': 'box', 'center': [0, 0.28, 0], 'size': [0.05, 0.5, 0.08]",
        "'type': 'box', 'center': [0, 0.28, 0], 'size': [0.05, 0.5, 0.08], 'rounding': 0.01",
        "'type': 'capsule', 'a': [0, 0.03, 0], 'b': [0, 0.53, 0], 'radius': 0.02"};
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++)
        for (int fast = 0; fast < (i == 0 ? 2 : 1); fast++) {
            crossings_run run = {0};
            scoped_scene s = scene_open(
                "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.4,"
                " 'height': 0.4, 'orientation': 'vertical', 'transform': {'translate': [-0.2, 0.6, 0.15]}},"
                " 'material': {'young_modulus': 2e4, 'thickness': 2e-3, 'density': 200},"
                " 'terms': ['stretch.cst', 'bend.hinge'], 'pins': [{'edge': 'top'}]}],"
                " 'colliders': [{%s, 'friction': 0.3, 'pivot': [0, 0.05, 0.02], 'turns': ["
                " {'time': 0, 'rotate': [1, 0, 0.2, -60]}, {'time': 0.3, 'rotate': [1, 0, 0.2, %d]}]}],"
                " 'self_contact': {'thickness': 2e-3}, 'integrator': {'dt': 0.0166666666666666666},"
                " 'duration': 0.3}",
                shapes[i], fast ? 400 : 240);
            ck_assert_int_eq(drape_sim_observe(s.sim, crossings_observe, &run), DRAPE_OK);
            assert_ok(s.ctx, drape_sim_advance(s.sim, 0.3));
            const drape_statistics got = drape_sim_statistics(s.sim);
            printf("# %.30s: %d states, %d crossed %s; %d rejected\n", shapes[i], (int)run.states,
                   (int)run.crossed_states, run.first, (int)got.steps_rejected);
            ck_assert_int_ge(run.states, 18);
            ck_assert_msg(run.crossed_states + run.crossed_frames == 0, "%s: at %g s %s", shapes[i],
                          run.first_time, run.first);
        }
}

/* ---- A host ---- */

static scene open_hosted(void)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.2, 'height': "
        "0.2, 'transform': {'translate': [-0.1, 0.101, 0.1]}},"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'colliders': [{'type': 'box', 'center': [0, 0.05, 0], 'size': [0.4, 0.1, 0.4], 'friction': 0.5}],"
        " 'integrator': {'dt': 0.01}, 'duration': 1}");
}

/* The rotation at time t of the pose that a host wants: a quaternion about y, with its angular velocity. */
static void wanted(double t, double q[4], double w[3])
{
    const double angle = 3 * t * t, rate = 6 * t;
    q[0] = cos(angle / 2);
    q[1] = q[3] = w[0] = w[2] = 0;
    q[2] = sin(angle / 2);
    w[1] = rate;
}

/* Poses that are sent frame by frame are reached, with their velocities; between them the angle is a
 * cubic, so that of a parabola is met everywhere. What is moved by a displacement alone stops turning. */
TEST(a_host_turns_a_collider)
{
    scoped_scene s = open_hosted();
    const double here[3] = {0}, up[3] = {0, 0.01, 0};
    double q[4], w[3], got[4], rate[3], pivot[3];
    for (int frame = 1; frame <= 10; frame++) {
        wanted(0.05 * frame, q, w);
        ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 0, 0.05, here, q, here, w), DRAPE_OK);
        for (int part = 0; part < 5; part++) {
            const double t = 0.05 * (frame - 1) + 0.01 * (part + 1);
            scene_advance(&s, t);
            wanted(t, q, w);
            ck_assert(drape_sim_collider_rotation(s.sim, 0, got, rate, pivot));
            for (int k = 0; k < 4; k++)
                ck_assert_double_eq_tol(got[k], q[k], 1e-13);
            if (part < 4) /* at the end of a path it is at rest */
                ck_assert_double_eq_tol(rate[1], w[1], 1e-11);
            ck_assert_double_eq_tol(pivot[1], 0.05, 1e-15);
        }
    }
    ck_assert_int_eq(drape_sim_move_collider(s.sim, 0, 0.05, up, NULL), DRAPE_OK);
    scene_advance(&s, 0.6);
    ck_assert(drape_sim_collider_rotation(s.sim, 0, got, rate, pivot));
    for (int k = 0; k < 4; k++)
        ck_assert_double_eq_tol(got[k], q[k], 1e-13);
    ck_assert(rate[1] == 0 && fabs(pivot[1] - 0.06) < 1e-15);
    ck_assert_int_eq(drape_sim_inside(s.sim, 0, NULL), 0);
    const double none[4] = {0}, fast[3] = {0, 1e5, 0};
    ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 0, 0.05, here, none, NULL, NULL), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 0, 0.05, here, NULL, NULL, NULL), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 0, 0.05, here, q, here, NULL), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 0, 0.05, here, q, here, fast), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 1, 0.05, here, q, NULL, NULL), DRAPE_E_ARGUMENT);
}
