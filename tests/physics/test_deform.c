/* test_deform.c: colliders that deform: a rigid motion as frames, a ball that grows inside a ball of cloth,
 * the work that it does, points that a host sends, checkpoints and threads. */
#include "colliders/deformed.h"
#include "support/frames.h"
#include "support/scene.h"

#define RINGS     9
#define AROUND    14
#define POINTS    FRAMES_BALL_POINTS(RINGS, AROUND)
#define TRIANGLES FRAMES_BALL_TRIANGLES(RINGS, AROUND)

/* Frames of the ball, (frames x POINTS x 3): frame f is scaled by size[f] and shifted by shift[f] along y. */
static void write_frames(const frames_folder *f, const char *name, int frames, const double *size,
                         const double *shift)
{
    static double x[3 * POINTS], all[8 * 3 * POINTS];
    static int triangle[3 * TRIANGLES];
    char shape[64];
    frames_ball(RINGS, AROUND, x, triangle);
    for (int i = 0; i < frames * 3 * POINTS; i++)
        all[i] = size[i / (3 * POINTS)] * x[i % (3 * POINTS)] + (i % 3 == 1 ? shift[i / (3 * POINTS)] : 0);
    frames_obj(f, "ball.obj", POINTS, x, TRIANGLES, triangle);
    snprintf(shape, sizeof shape, "(%d, %d, 3)", frames, POINTS);
    frames_npy(f, name, shape, (size_t)(frames * 3 * POINTS), all);
}

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.6,"              \
    " 'height': 0.6, 'transform': {'translate': [-0.3, 0.23, 0.3]}},"                                        \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"                                \
    " 'terms': ['stretch.cst', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 0.002}]}],"               \
    " 'gravity': [0, -9.81, 0], 'contact': {'distance': 0.01, 'stiffness': 340}, 'colliders': [%s],"         \
    " 'integrator': {'method': 'be', 'dt': 0.01, 'tolerance': 1e-9}, 'duration': 1}"

static scene open_sheet(const char *format, ...)
{
    char collider[1024];
    va_list values;
    va_start(values, format);
    vsnprintf(collider, sizeof collider, format, values);
    va_end(values);
    return scene_open(SHEET, collider);
}

/* The ball of radius 0.2 rises by 0.1 m in 0.2 s and rests; as a rigid mesh on a track, and as frames. Both
 * meet the cloth by the same pairs, in the same order, and their points differ by rounding; guesses are put
 * aside by other rules, so that positions differ by what the tolerance leaves: 1e-9 N moves a node of 1e-3 kg
 * by 1e-10 m in a step. */
TEST(rigid_motion_as_frames)
{
    scoped_frames f = frames_folder_make();
    double force[2][3];
    write_frames(&f, "up.npy", 3, (const double[]){0.2, 0.2, 0.2}, (const double[]){0, 0.1, 0.1});
    scoped_scene rigid = open_sheet("{'type': 'mesh', 'file': '%s/ball.obj', 'scale': 0.2, 'friction': 0.3,"
                                    " 'track': [[0, [0, 0, 0]], [0.2, [0, 0.1, 0]]]}",
                                    f.path);
    scoped_scene frames = open_sheet("{'type': 'animated_mesh', 'file': '%s/up.npy', 'mesh': '%s/ball.obj',"
                                     " 'frame_rate': 5, 'friction': 0.3}",
                                     f.path, f.path);
    scene_advance(&rigid, 0.3);
    scene_advance(&frames, 0.3);
    const double *x = drape_sim_positions(rigid.sim), *y = drape_sim_positions(frames.sim);
    double largest = 0;
    for (int32_t i = 0; i < 3 * rigid.model->node_count; i++)
        largest = fmax(largest, fabs(x[i] - y[i]));
    ck_assert_double_gt(x[1 + 3 * 40], 0.28); /* the middle was lifted */
    ck_assert_double_lt(largest, 1e-8);
    ck_assert_int_eq(drape_sim_collider_force(rigid.sim, 0, force[0]), DRAPE_OK);
    ck_assert_int_eq(drape_sim_collider_force(frames.sim, 0, force[1]), DRAPE_OK);
    ck_assert_double_gt(-force[0][1], 0.1);
    ck_assert_double_eq_tol(force[0][1], force[1][1], 1e-6 * fabs(force[0][1]));
    /* what is left of the balance has the work of the collider in it: 0.01 J of lifting and pushing */
    const drape_energy a = drape_sim_energy(rigid.sim), b = drape_sim_energy(frames.sim);
    ck_assert_double_gt(a.gravity + a.elastic + a.kinetic, 0.01);
    ck_assert_double_eq_tol(a.numerical, b.numerical, 1e-8);
}

/*
 * A ball of cloth around a ball that grows by 2 % in 1 s: strain e in all directions of the surface. Its
 * elastic energy per area at rest is E h/(1 - nu) e^2 for small e, with e of the cloth's own size; second
 * order terms of the strain measure are of relative size e. The cloth is the same polyhedron, so that it
 * scales as a whole. Nothing else takes energy but damping and what is left of motion: what the ball has
 * done is in the account.
 */
TEST(ball_grows_in_a_ball_of_cloth)
{
    scoped_frames f = frames_folder_make();
    const double membrane = 1e5 * 1e-3 / (1 - 0.25), rest = 0.205;
    write_frames(&f, "grow.npy", 2, (const double[]){0.2, 0.21}, (const double[]){0, 0});
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'file': '%s/ball.obj', 'transform': {'scale': %g}},"
        " 'material': {'young_modulus': 1e5, 'poisson_ratio': 0.25, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.cst', {'type': 'damp.kelvin_voigt', 'beta': 0.01}]}],"
        " 'gravity': [0, 0, 0], 'contact': {'distance': 0.002},"
        " 'colliders': [{'type': 'animated_mesh', 'file': '%s/grow.npy', 'mesh': '%s/ball.obj',"
        " 'frame_rate': 1, 'thickness': 0.001}],"
        " 'integrator': {'method': 'be', 'dt': 0.02}, 'duration': 2}",
        f.path, rest, f.path, f.path);
    scene_advance(&s, 1.5);
    const double *x = drape_sim_positions(s.sim);
    double mean = 0, area = 0;
    for (int32_t i = 0; i < s.model->node_count; i++)
        mean += sqrt(x[3 * i] * x[3 * i] + x[3 * i + 1] * x[3 * i + 1] + x[3 * i + 2] * x[3 * i + 2]) /
                s.model->node_count;
    for (int32_t t = 0; t < s.model->triangle_count; t++)
        area += s.model->cloths[0].mesh.triangle_area[t];
    ck_assert_double_gt(mean, 0.211);         /* the ball and its thickness */
    ck_assert_double_lt(mean, 0.211 + 0.002); /* and at most the activation distance */
    const double e = mean / rest - 1, expected = membrane * e * e * area;
    const drape_energy energy = drape_sim_energy(s.sim);
    ck_assert_double_eq_tol(energy.elastic, expected, 3 * e * expected);
    ck_assert_int_eq(drape_sim_inside(s.sim, 0, NULL), 0);
    ck_assert_int_eq(drape_sim_intersections(s.sim, 0), 0);
    /* All of it is the work of the ball. Backward Euler takes the force at the end of a step, which grows as
     * the strain: with the stiffness k, sum k e_i (e_i - e_(i-1)) is larger than k e^2/2 by 1/50 of it in
     * the 1/h steps in which it grows, more if they begin later; and what moves at first comes to rest. */
    ck_assert_double_gt(energy.numerical, 0);
    ck_assert_double_lt(energy.numerical, 0.06 * energy.elastic);
}

/* Sends the ball, in its coordinates, to a size and a height. */
static void send(scene *s, double seconds, double size, double height, const double *speed)
{
    static double x[3 * POINTS], v[3 * POINTS];
    static int triangle[3 * TRIANGLES];
    frames_ball(RINGS, AROUND, x, triangle);
    for (int i = 0; i < 3 * POINTS; i++) {
        v[i] = speed ? speed[i % 3] : 0;
        x[i] = size * x[i] + (i % 3 == 1 ? height : 0);
    }
    assert_ok(s->ctx, drape_sim_deform_collider(s->sim, 0, seconds, POINTS, x, speed ? v : NULL));
}

static scene open_host(const frames_folder *f)
{
    return open_sheet("{'type': 'animated_mesh', 'file': '%s/ball.obj', 'scale': 0.2, 'friction': 0.3}",
                      f->path);
}

/* A host that sends the points as the frames have them moves the cloth as they do: to rounding, since pieces
 * of the motion are the same straight lines. A checkpoint in the middle of a path goes on with the same
 * bits, and so does another number of threads. */
TEST(host_sends_points)
{
    scoped_frames f = frames_folder_make();
    write_frames(&f, "up.npy", 3, (const double[]){0.2, 0.22, 0.2}, (const double[]){0, 0.05, 0.1});
    scoped_scene frames = open_sheet("{'type': 'animated_mesh', 'file': '%s/up.npy', 'mesh': '%s/ball.obj',"
                                     " 'frame_rate': 10, 'friction': 0.3}",
                                     f.path, f.path);
    scoped_scene host = open_host(&f), again = open_host(&f);
    drape_sim_def def = sim_def();
    def.threads = 3;
    drape_sim_destroy(&again.sim);
    scene_start(&again, &def);
    scene_advance(&frames, 0.2);
    send(&host, 0.1, 0.22, 0.05, NULL);
    scene_advance(&host, 0.1);
    send(&host, 0.1, 0.2, 0.1, NULL);
    send(&again, 0.1, 0.22, 0.05, NULL);
    scene_advance(&again, 0.1);
    send(&again, 0.1, 0.2, 0.1, NULL);
    scene_advance(&host, 0.15);

    char path[100];
    snprintf(path, sizeof path, "%s/middle.drape", f.path);
    ck_assert_int_eq(drape_sim_save(host.sim, path), DRAPE_OK);
    scoped_scene restored = open_host(&f);
    assert_ok(restored.ctx, drape_sim_restore(restored.sim, path));
    scene_advance(&host, 0.2);
    scene_advance(&again, 0.2);
    scene_advance(&restored, 0.2);
    const size_t n = 3 * (size_t)host.model->node_count;
    const double *x = drape_sim_positions(host.sim), *y = drape_sim_positions(frames.sim);
    ck_assert_mem_eq(x, drape_sim_positions(restored.sim), n * sizeof *x);
    ck_assert_mem_eq(x, drape_sim_positions(again.sim), n * sizeof *x);
    for (size_t i = 0; i < n; i++)
        ck_assert_double_eq_tol(x[i], y[i], 1e-11);

    /* points and velocities: a cubic that arrives with 0.5 m/s */
    static double p[3 * POINTS], v[3 * POINTS];
    send(&host, 0.1, 0.2, 0.15, (const double[]){0, 0.5, 0});
    scene_advance(&host, 0.35);
    ck_assert_int_eq(drape_sim_collider_points(host.sim, 0, p, v), DRAPE_OK);
    ck_assert_double_eq_tol(p[1], 0.35, 1e-12);
    ck_assert_double_eq(v[1], 0); /* after the end of the path it rests */
}

/* A host that computes its times as k dt calls a rounding error after the end of the last path: the velocity
 * with which that ended goes on. */
TEST(velocity_goes_on_from_frame_to_frame)
{
    scoped_frames f = frames_folder_make();
    write_frames(&f, "up.npy", 1, (const double[]){0.2}, (const double[]){0});
    scoped_scene s = open_host(&f);
    static double x[3 * POINTS], v[3 * POINTS];
    for (int k = 1; k < 60; k++) {
        send(&s, 1.0 / 60, 0.2, -2 - k / 60.0, (const double[]){0, -1, 0});
        if (k > 1) {
            ck_assert_int_eq(drape_sim_collider_points(s.sim, 0, x, v), DRAPE_OK);
            ck_assert_double_eq_tol(v[1], -1, 1e-9);
        }
        scene_advance(&s, k * (1.0 / 60));
    }
}

/* A rigid collider may take the place of one that a host has deformed. */
TEST(a_rigid_body_takes_its_place)
{
    scoped_frames f = frames_folder_make();
    write_frames(&f, "up.npy", 1, (const double[]){0.2}, (const double[]){0});
    scoped_scene s = open_host(&f),
                 rigid = open_sheet("{'type': 'mesh', 'file': '%s/ball.obj', 'scale': 0.2}", f.path);
    send(&s, 0.1, 0.22, 0.05, NULL);
    scene_advance(&s, 0.1);
    ck_assert_int_eq(drape_sim_change_model(s.sim, rigid.model), DRAPE_OK);
    scene_advance(&s, 0.2);
    ck_assert_double_eq_tol(drape_sim_collider(s.sim, 0).velocity[1], 0, 1e-15);
}

TEST(faults_of_a_host)
{
    scoped_frames f = frames_folder_make();
    static double x[3 * POINTS], v[3 * POINTS];
    static int triangle[3 * TRIANGLES];
    write_frames(&f, "up.npy", 1, (const double[]){0.2}, (const double[]){0});
    scoped_scene s = open_sheet("{'type': 'animated_mesh', 'file': '%s/ball.obj', 'scale': 0.2},"
                                " {'type': 'sphere', 'center': [5, 0, 0], 'radius': 0.1}",
                                f.path);
    frames_ball(RINGS, AROUND, x, triangle);
    ck_assert_int_eq(drape_model_collider_points(s.model, 0), POINTS);
    ck_assert_int_eq(drape_model_collider_points(s.model, 1), 0);
    ck_assert_int_eq(drape_model_collider_points(s.model, 2), -1);
    const struct {
        int32_t collider, points;
        double seconds;
        int place;
        double value;
        const char *message;
    } cases[] = {
        {2, POINTS, 1, -1, 0, "collider 2; the model has 2"},
        {1, POINTS, 1, -1, 0, "collider 1 is a sphere, which is rigid; an animated_mesh deforms"},
        {0, POINTS - 1, 1, -1, 0, "127 points; collider0 has 128"},
        {0, POINTS, 0, -1, 0, "seconds = 0"},
        {0, POINTS, 1, 7, NAN, "drape_sim_deform_collider: point 2 is at ("},
        {0, POINTS, 1, 3, 1e10, "m/s; they must be finite and within 1e+09 m and m/s"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const double kept = x[cases[i].place < 0 ? 0 : cases[i].place];
        if (cases[i].place >= 0)
            x[cases[i].place] = cases[i].value;
        ck_assert_int_eq(
            drape_sim_deform_collider(s.sim, cases[i].collider, cases[i].seconds, cases[i].points, x, NULL),
            DRAPE_E_ARGUMENT);
        ck_assert_msg(strstr(drape_context_message(s.ctx), cases[i].message), "%s",
                      drape_context_message(s.ctx));
        x[cases[i].place < 0 ? 0 : cases[i].place] = kept;
    }
    v[4] = NAN;
    ck_assert_int_eq(drape_sim_deform_collider(s.sim, 0, 1, POINTS, x, v), DRAPE_E_ARGUMENT);
    for (int i = 0; i < 3 * POINTS; i += 3) /* mirrored */
        x[i] = -x[i];
    ck_assert_int_eq(drape_sim_deform_collider(s.sim, 0, 1, POINTS, x, NULL), DRAPE_E_ARGUMENT);
    ck_assert_msg(strstr(drape_context_message(s.ctx),
                         "drape_sim_deform_collider: the mesh is inside out: its volume is -"),
                  "%s", drape_context_message(s.ctx));
    for (int i = 0; i < 3 * POINTS; i += 3)
        x[i] = -x[i];
    memcpy(x + 3, x + 6, 3 * sizeof *x);
    ck_assert_int_eq(drape_sim_deform_collider(s.sim, 0, 1, POINTS, x, NULL), DRAPE_E_ARGUMENT);
    ck_assert_msg(strstr(drape_context_message(s.ctx), "is degenerate"), "%s", drape_context_message(s.ctx));
    ck_assert_int_eq(drape_sim_collider_points(s.sim, 1, x, NULL), DRAPE_E_ARGUMENT);
}

/* A body that turns inside out, here in its third frame, is refused with the file and the frame; an open
 * one has no inside. A number that is not finite is found in any frame. */
TEST(later_frames_are_checked)
{
    scoped_frames f = frames_folder_make();
    const struct {
        double size;
        const char *open, *message;
    } cases[] = {{-0.2, "false", "frames.npy: frame 2: the mesh is inside out: its volume is -"},
                 {-0.2, "true", NULL},
                 {NAN, "true", "frames.npy: frame 2: node 0 is at (nan, nan, nan) m"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_scene s = scene_empty();
        scoped_parsed *parsed = NULL;
        char text[2048], collider[512];
        write_frames(&f, "frames.npy", 3, (const double[]){0.2, 0.2, cases[i].size},
                     (const double[]){0, 0, 0});
        snprintf(collider, sizeof collider,
                 "{'type': 'animated_mesh', 'file': '%s/frames.npy', 'mesh': '%s/ball.obj', 'open': %s}",
                 f.path, f.path, cases[i].open);
        snprintf(text, sizeof text, SHEET, collider);
        quote(text);
        ck_assert_int_eq(drape_scene_parse(s.ctx, text, "test", &parsed), DRAPE_OK);
        const drape_status status = drape_scene_compile(parsed, &s.model);
        ck_assert_int_eq(status != DRAPE_OK, cases[i].message != NULL);
        if (cases[i].message)
            ck_assert_msg(strstr(drape_context_message(s.ctx), cases[i].message) &&
                              strstr(drape_context_message(s.ctx), "/colliders/0/file"),
                          "%s", drape_context_message(s.ctx));
    }
}

/* The inside of a body that intersects itself: two balls of one mesh that overlap wind twice around what they
 * share. A bowl has no inside, but for those that say it is open. */
TEST(inside_by_winding)
{
    scoped_frames f = frames_folder_make();
    static double x[6 * POINTS];
    static int triangle[6 * TRIANGLES];
    frames_ball(RINGS, AROUND, x, triangle);
    for (int i = 0; i < 3 * POINTS; i++)
        x[3 * POINTS + i] = x[i] + (i % 3 == 0 ? 0.8 : 0);
    for (int i = 0; i < 3 * TRIANGLES; i++)
        triangle[3 * TRIANGLES + i] = triangle[i] + POINTS;
    frames_obj(&f, "two.obj", 2 * POINTS, x, 2 * TRIANGLES, triangle);
    char text[300];
    snprintf(text, sizeof text, "{'type': 'animated_mesh', 'file': '%s/two.obj'}", f.path);
    scoped_scene s = scene_model(SHEET, text);
    const drape_collider *c = &s.model->colliders[0];
    const drape_collider_pose pose = {.t = 0};
    const double inside[][3] = {{0.4, 0.1, 0}, {0, 0, 0}, {0.8, 0, 0}, {0.4, 0.7, 0.1}, {-0.9, 0, 0}},
                 outside[][3] = {{2.1, 0, 0}, {0.4, 1, 0}, {-1.2, 0, 0}, {0, 1, 0.1}, {0.4, 0, 3}};
    for (size_t i = 0; i < 5; i++) {
        double n[3];
        ck_assert_double_lt(drape_collider_distance(c, &pose, inside[i], n, NULL), 0);
        ck_assert_double_gt(drape_collider_distance(c, &pose, outside[i], n, NULL), 0);
        ck_assert_double_eq_tol(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-12);
    }
}

/* Rules of contact for rigid bodies are refused, with the reason. */
TEST(verlet_is_refused)
{
    scoped_frames f = frames_folder_make();
    drape_sim_def def = sim_def();
    write_frames(&f, "up.npy", 1, (const double[]){0.2}, (const double[]){0});
    scoped_scene s = open_host(&f);
    drape_sim_destroy(&s.sim);
    def.integrator = "verlet";
    ck_assert_int_eq(drape_sim_create(s.ctx, s.model, &def, &s.sim), DRAPE_E_ARGUMENT);
    ck_assert_msg(
        strstr(drape_context_message(s.ctx), "collider0 is of the type animated_mesh, which deforms"), "%s",
        drape_context_message(s.ctx));
}
