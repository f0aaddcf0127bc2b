/*
 * test_riding.c: pins that colliders carry. They follow a body that shifts and turns, and the triangle of one
 * that deforms, in every frame and with every method; their velocities are those of their paths; force and
 * torque on the body are what the momentum of the cloth says; a body that hangs from cloth, moved by these,
 * comes to rest where they carry its weight.
 */
#include "base/rotation.h"
#include "base/vec3.h"
#include "support/bytes.h"
#include "support/frames.h"
#include "support/host.h"
#include "support/scene.h"

#define GRAVITY 9.81

/* ---- A body that shifts and turns ---- */

#define SHIFT  0.1 /* [m/s] along x until 0.1 s, then along y */
#define DEGREE 50  /* per second, about y */
#define PIVOTS                                                                                               \
    {                                                                                                        \
        0.1, 0.5, 0                                                                                          \
    }

static void place_of_body(double t, const double *rest, double x[3])
{
    const double pivot[3] = PIVOTS, turn[3] = {0, DEGREE * acos(-1.0) / 180 * t, 0};
    double R[9], from[3];
    drape_rotation_exp(turn, R);
    vec3_sub(rest, pivot, from);
    drape_rotation_turn(R, from, x);
    vec3_add_scaled(1, pivot, x);
    x[0] += SHIFT * fmin(t, 0.1);
    x[1] += SHIFT * fmax(t - 0.1, 0);
}

/* Frames at 101 per second are within steps. The largest distance from the path, after the first step. */
typedef struct followed {
    const scene *s;
    double largest;
    int frames;
} followed;

static drape_status follow(void *user, const drape_event *event)
{
    followed *f = user;
    for (int32_t i = 0; event->kind == DRAPE_EVENT_FRAME && i < 5; i++) {
        double x[3];
        place_of_body(event->time, f->s->model->rest + 3 * i, x);
        f->largest = fmax(f->largest, distance(x, event->positions + 3 * i));
        f->frames += i == 0;
    }
    return DRAPE_OK;
}

#define CARRIED                                                                                              \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.5, 'height': "   \
    "0.375, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': "   \
    "200}, 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'top', 'attach': 'body'}]}],"          \
    " 'colliders': [{'name': 'body', 'type': 'sphere', 'center': [0.1, 0.5, 0], 'radius': 0.05,"             \
    " 'enabled': false, 'track': [[0, [0,0,0]], [0.1, [0.01,0,0]], [0.4, [0.01,0.03,0]]],"                   \
    " 'turns': [{'time': 0, 'rotate': [0,1,0,0]}, {'time': 0.4, 'rotate': [0,1,0,20]}]}],"                   \
    " 'integrator': {'method': '%s', 'dt': %g}, 'frame_rate': 101, 'duration': 0.25}"

/* Coordinates of up to 1 m are rounded to 1e-16 some ten times. */
TEST(pins_follow_a_body_with_every_method)
{
    for (int m = 0; m < METHODS; m++) {
        scoped_scene s = scene_open(CARRIED, methods[m], strcmp(methods[m], "verlet") == 0 ? 1e-4 : 0.008);
        followed f = {.s = &s};
        double x[3];
        ck_assert_int_eq(drape_sim_observe(s.sim, follow, &f), DRAPE_OK);
        scene_advance(&s, 0.25);
        ck_assert_int_eq(f.frames, 26);
        place_of_body(0.25, s.model->rest, x);
        printf("# %s: frames %.3g m off, the state %.3g m\n", methods[m], f.largest,
               distance(x, drape_sim_positions(s.sim)));
        assert_below(f.largest, 1e-14);
        assert_below(distance(x, drape_sim_positions(s.sim)), 1e-14);
    }
}

/* ---- A body that deforms ---- */

#define RINGS     5
#define AROUND    8
#define POINTS    FRAMES_BALL_POINTS(RINGS, AROUND)
#define TRIANGLES FRAMES_BALL_TRIANGLES(RINGS, AROUND)

static double ball_x[3 * POINTS];
static int ball_triangle[3 * TRIANGLES];

/* From 0 to 0.2 s the ball is stretched along x, flattened along y, sheared and lifted, linearly. */
static void ball_at(double t, double *x)
{
    const double s = fmin(t / 0.2, 1), shape[9] = {1 + 0.3 * s, 0.2 * s, 0, 0, 1 - 0.2 * s, 0, 0.1 * s, 0, 1};
    for (int i = 0; i < POINTS; i++) {
        drape_rotation_turn(shape, ball_x + 3 * i, x + 3 * i);
        x[3 * i + 1] += 0.1 * s;
    }
}

static void write_ball(const frames_folder *f)
{
    static double all[2 * 3 * POINTS];
    char shape[64];
    frames_ball(RINGS, AROUND, ball_x, ball_triangle);
    for (int i = 0; i < 3 * POINTS; i++)
        ball_x[i] *= 0.2;
    ball_at(0, all);
    ball_at(0.2, all + 3 * POINTS);
    frames_obj(f, "ball.obj", POINTS, ball_x, TRIANGLES, ball_triangle);
    snprintf(shape, sizeof shape, "(2, %d, 3)", POINTS);
    frames_npy(f, "ball.npy", shape, 2 * 3 * POINTS, all);
}

#define DEFORMING                                                                                            \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': 0.3, 'height': "   \
    "0.2, 'orientation': 'vertical', 'transform': {'translate': [0.05, 0, 0.24]}}, 'ignore': ['body'], "     \
    "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], "     \
    "'pins': [{'edge': 'top'%s}]}], 'colliders': [{'name': 'body', 'type': 'animated_mesh',"                 \
    " 'file': '%s/ball.npy', 'mesh': '%s/ball.obj', 'frame_rate': 5%s}],"                                    \
    " 'integrator': {'method': '%s', 'dt': 0.01}, 'frame_rate': 100, 'duration': 0.3}"

/* The matrix of the columns p1 - p0, p2 - p0 and n. */
static void frame_of(const double *x, int triangle, double M[9], double from[3])
{
    const int *t = ball_triangle + 3 * triangle;
    double a[3], b[3], n[3];
    vec3_sub(x + 3 * t[1], x + 3 * t[0], a);
    vec3_sub(x + 3 * t[2], x + 3 * t[0], b);
    vec3_cross(a, b, n);
    const double length = vec3_norm(n);
    for (int k = 0; k < 3; k++) {
        M[3 * k] = a[k], M[3 * k + 1] = b[k], M[3 * k + 2] = n[k] / length;
        from[k] = x[3 * t[0] + k];
    }
}

static double determinant(const double M[9])
{
    double rest[3];
    vec3_cross(M + 3, M + 6, rest);
    return vec3_dot(M, rest);
}

/* The coordinates in a triangle's frame at rest, by Cramer's rule, used again in its frame at time t. */
static void carried_to(int triangle, double t, const double *rest, double x[3])
{
    static double now[3 * POINTS];
    double M[9], from[3], r[3], c[3];
    frame_of(ball_x, triangle, M, from);
    vec3_sub(rest, from, r);
    for (int j = 0; j < 3; j++) {
        double N[9];
        memcpy(N, M, sizeof N);
        for (int k = 0; k < 3; k++)
            N[3 * k + j] = r[k];
        c[j] = determinant(N) / determinant(M);
    }
    ball_at(t, now);
    frame_of(now, triangle, M, from);
    drape_rotation_turn(M, c, x);
    vec3_add_scaled(1, from, x);
}

/* On a named triangle, which is far from some of the nodes: they are carried by its plane. */
TEST(pins_follow_a_triangle)
{
    static const char *const some[] = {"be", "midpoint", "ida", "radau", "newton_k"};
    scoped_frames f = frames_folder_make();
    write_ball(&f);
    for (size_t m = 0; m < sizeof some / sizeof *some; m++)
        for (int triangle = 3; triangle < TRIANGLES; triangle += 31) {
            char more[64];
            double largest = 0;
            snprintf(more, sizeof more, ", 'attach': 'body', 'triangle': %d", triangle);
            scoped_scene s = scene_open(DEFORMING, more, f.path, f.path, "", some[m]);
            scene_advance(&s, 0.17);
            for (int32_t i = 0; i < 4; i++) {
                double x[3];
                carried_to(triangle, 0.17, s.model->rest + 3 * i, x);
                largest = fmax(largest, distance(x, drape_sim_positions(s.sim) + 3 * i));
            }
            assert_below(largest, 1e-13); /* weights of up to 10 multiply the rounding of 1e-16 m */
        }
}

/* The nearest triangle of each node, on a body that turns as well, and then on paths of a host: the velocity
 * of a pin is the slope of its path, to the error of the difference, d^2/6 of a third derivative of 1e3 m/s3,
 * and the rounding of 1e-16 m over d. */
TEST(velocities_are_slopes)
{
    scoped_frames f = frames_folder_make();
    const double d = 1e-6, times[] = {0.03, 0.11, 0.16, 0.23, 0.27};
    write_ball(&f);
    scoped_scene s = scene_open(
        DEFORMING, ", 'attach': 'body'", f.path, f.path,
        ", 'turns': [{'time': 0, 'rotate': [0,0,1,0]}, {'time': 0.3, 'rotate': [1,0,1,90]}]", "be");
    static double p[3 * POINTS], v[3 * POINTS];
    for (size_t k = 0; k < sizeof times / sizeof *times; k++) {
        const drape_motion *motion = drape_system_motion(s.sim->system);
        if (times[k] == 0.23) {
            const double to[3] = {0.1, 0.2, 0.3}, w[3] = {1, 2, -3}, rotation[4] = {0.9, 0.1, -0.4, 0.1};
            scene_advance(&s, 0.2);
            ball_at(0.07, p);
            for (int i = 0; i < 3 * POINTS; i++)
                v[i] = sin(i);
            ck_assert_int_eq(drape_sim_deform_collider(s.sim, 0, 0.1, POINTS, p, v), DRAPE_OK);
            ck_assert_int_eq(drape_sim_move_collider_pose(s.sim, 0, 0.1, to, rotation, to, w), DRAPE_OK);
        }
        for (int32_t i = 0; i < 4; i++) {
            double a[3], b[3], velocity[3], slope[3];
            ck_assert_int_eq(drape_sim_attached(s.sim, i), 0);
            drape_motion_place_pin(motion, i, times[k] - d, a);
            drape_motion_place_pin(motion, i, times[k] + d, b);
            drape_motion_pin_velocity(motion, motion->place[i], times[k], times[k], velocity);
            vec3_sub(b, a, slope);
            for (int j = 0; j < 3; j++)
                slope[j] /= 2 * d;
            ck_assert_double_gt(vec3_norm(velocity), 0.05);
            assert_below(distance(velocity, slope), d * d / 6 * 1e3 + 10 * 1e-16 / d);
        }
    }
}

/* ---- Forces ---- */

/* The force of gravity on all nodes, and m (v - before) / h of the free ones, with their moments about 0. */
static void rates_of(const scene *s, const double *before, double h, double force[3], double torque[3])
{
    const double *x = drape_sim_positions(s->sim), *v = drape_sim_velocities(s->sim);
    memset(force, 0, 3 * sizeof *force);
    memset(torque, 0, 3 * sizeof *torque);
    for (int32_t i = 0; i < s->model->node_count; i++) {
        const double m = s->model->mass[i], *at = x + 3 * (size_t)i;
        double rate[3] = {0, m * GRAVITY, 0}, moment[3];
        for (int k = 0; k < 3 && !s->model->pinned[i]; k++)
            rate[k] += m * (v[3 * i + k] - before[3 * i + k]) / h;
        vec3_cross(at, rate, moment);
        vec3_add_scaled(1, rate, force);
        vec3_add_scaled(1, moment, torque);
    }
}

/* In a step of backward Euler the momentum of the free nodes, and their angular momentum with x at the end
 * of the step, change by h times what acts from outside: gravity, on all nodes, and what the body gives,
 * the opposite of the force on it. Without friction, which acts on two points a gap apart. To the
 * residual, 1e-9 N on 20 nodes at 1 m. */
TEST(force_and_torque_are_those_of_the_cloth)
{
    const double h = 0.005, origin[3] = {0};
    double before[60], force[3], torque[3], on_body[3], about[3];
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.5, 'height': "
        "0.375, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': "
        "200}, 'terms': ['stretch.edge', 'bend.hinge'],"
        " 'pins': [{'edge': 'top', 'attach': 'body'}]}], 'gravity': [0, -9.81, 0],"
        " 'colliders': [{'name': 'body', 'type': 'sphere', 'center': [0.25, -0.2, 0.06], 'radius': 0.1,"
        " 'turns': [{'time': 0, 'rotate': [0,0,1,0]}, {'time': 0.5, 'rotate': "
        "[1,0,1,90]}]}],"
        " 'integrator': {'method': 'be', 'dt': %g, 'tolerance': 1e-9}, 'duration': 1}",
        h);
    double touched = 0;
    int compared = 0;
    scene_watch(&s);
    for (int step = 1; step <= 60; step++) {
        const long steps = s.accepted;
        memcpy(before, drape_sim_velocities(s.sim), sizeof before);
        scene_advance(&s, h * step);
        if (s.accepted > steps + 1) /* a rejected step was made in parts */
            continue;
        compared++;
        rates_of(&s, before, h, force, torque);
        ck_assert_int_eq(drape_sim_collider_force(s.sim, 0, on_body), DRAPE_OK);
        ck_assert_int_eq(drape_sim_collider_torque(s.sim, 0, origin, about), DRAPE_OK);
        ck_assert_int_eq(drape_sim_contact_forces(s.sim, before), DRAPE_OK);
        for (int32_t i = 0; i < 60; i++)
            touched = fmax(touched, fabs(before[i]));
        for (int k = 0; k < 3; k++) {
            ck_assert_double_eq_tol(on_body[k], -force[k], 20 * 1e-9 + 1e-12 * vec3_norm(force));
            ck_assert_double_eq_tol(about[k], -torque[k], 20 * 1e-9 + 1e-12 * vec3_norm(force));
        }
    }
    ck_assert_int_gt(compared, 40);
    ck_assert_double_gt(touched, 1e-3); /* the sheet touches the ball, too */
}

/* ---- A body of the host's, which hangs from cloth ---- */

typedef struct body {
    double mass, inertia; /* [kg], [kg m2] of a ball */
    double x[3], v[3], q[4], w[3];
} body;

/* Semi-implicit Euler: velocities from the forces now, then the pose from these; the body turns by w h. */
static void step_body(const scene *s, body *b, double gravity, double drag, double h)
{
    double force[3], torque[3], turn[3], R[9], Q[9], next[9], displacement[3];
    ck_assert_int_eq(drape_sim_collider_force(s->sim, 0, force), DRAPE_OK);
    ck_assert_int_eq(drape_sim_collider_torque(s->sim, 0, b->x, torque), DRAPE_OK);
    for (int k = 0; k < 3; k++) {
        b->v[k] += h * ((force[k] - drag * b->v[k]) / b->mass - (k == 1 ? gravity : 0));
        b->w[k] += h * (torque[k] - drag * 0.01 * b->w[k]) / b->inertia;
        b->x[k] += h * b->v[k];
        displacement[k] = b->x[k] - s->model->colliders[0].pivot[k];
        turn[k] = h * b->w[k];
    }
    drape_rotation_exp(turn, R);
    drape_rotation_of_quaternion(b->q, Q);
    drape_rotation_product(R, Q, next);
    drape_rotation_quaternion(next, b->q);
    ck_assert_int_eq(drape_sim_move_collider_pose(s->sim, 0, h, displacement, b->q, NULL, NULL), DRAPE_OK);
}

static scene open_hanging(double gravity, double h, const char *top, const char *damping)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.5, 'height': "
        "0.375, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': "
        "200}, 'terms': ['stretch.edge', 'bend.hinge'%s],"
        " 'pins': [%s{'edge': 'bottom', 'attach': 'body'}]}], 'gravity': [0, %g, 0],"
        " 'colliders': [{'name': 'body', 'type': 'sphere', 'center': [0.25, -0.5, 0], 'radius': 0.05}],"
        " 'integrator': {'method': 'be', 'dt': %g, 'tolerance': 1e-10}, 'duration': 10}",
        damping, top, -gravity, h);
}

static body body_at(const scene *s, double mass)
{
    body b = {.mass = mass, .inertia = 2.0 / 5 * mass * 0.05 * 0.05, .q = {1, 0, 0, 0}};
    memcpy(b.x, s->model->colliders[0].pivot, sizeof b.x);
    for (int32_t i = 0; i < s->model->node_count; i++) /* the nodes that it carries move with it */
        if (drape_sim_attached(s->sim, i) == 0) {
            b.mass += s->model->mass[i];
            b.inertia += s->model->mass[i] * distance(s->model->rest + 3 * i, b.x) *
                         distance(s->model->rest + 3 * i, b.x);
        }
    return b;
}

/* At rest the force on the body is its weight, without that of the nodes that it carries, which is in the
 * force already: to what is left of the motion, which the drag has damped by e^-20 from 1 N. */
TEST(hanging_body_has_its_weight)
{
    const double h = 0.01, mass = 0.2;
    double force[3];
    scoped_scene s =
        open_hanging(GRAVITY, h, "{'edge': 'top'}, ", ", {'type': 'damp.kelvin_voigt', 'beta': 0.02}");
    body b = body_at(&s, mass);
    for (int step = 1; step <= 800; step++) {
        /* gravity of the body alone: that of its nodes is a part of the force */
        step_body(&s, &b, GRAVITY * mass / b.mass, 1, h);
        scene_advance(&s, h * step);
    }
    ck_assert_int_eq(drape_sim_collider_force(s.sim, 0, force), DRAPE_OK);
    printf("# force %.9g %.9g %.9g N, weight %.9g N, down by %.4g m\n", force[0], force[1], force[2],
           mass * GRAVITY, b.x[1] + 0.5);
    ck_assert_double_lt(b.x[1], -0.5 - 1e-3); /* the cloth has stretched */
    assert_below(fabs(force[1] / (mass * GRAVITY) - 1), 1e-6);
    assert_below(hypot(force[0], force[2]), 1e-6 * mass * GRAVITY);
}
