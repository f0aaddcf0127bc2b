/*
 * test_drop.c: cloth that falls on things. With every integrator and on every kind of collider no vertex,
 * edge or face is ever inside, according to a separate check (support/solids.h), neither in states nor in
 * frames between them; cloth that falls on itself never passes through itself.
 */
#include "geometry/intersect.h"
#include "support/folder.h"
#include "support/methods.h"
#include "support/sample.h"
#include "support/scene.h"
#include "support/solids.h"

#include <unistd.h>

#define DEEPEST 1e-9 /* [m] */

/* ---- Solids ---- */

static double in_cylinder(const double *x) /* axis z, radius 0.08, length 0.2 */
{
    return fmin(0.08 - hypot(x[0], x[1]), 0.1 - fabs(x[2]));
}

static double in_round_box(
    const double *x) /* size 0.16 0.12 0.2, rounding 0.03: the core is smaller by that */
{
    const double beyond[3] = {fmax(fabs(x[0]) - 0.05, 0), fmax(fabs(x[1]) - 0.03, 0),
                              fmax(fabs(x[2]) - 0.07, 0)};
    return 0.03 - sqrt(solid_dot(beyond, beyond));
}

/* |x| + |y| + |z| <= 0.15 */
static const char octahedron[] = "v 0.15 0 0\nv -0.15 0 0\nv 0 0.15 0\nv 0 -0.15 0\nv 0 0 0.15\nv 0 0 -0.15\n"
                                 "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
#define T 0.57735026918962576 /* 1/sqrt 3 */

static const struct target {
    const char *text;
    double top; /* [m] highest point */
    solid body;
    bool sharp; /* edges or corners that may pierce a sheet */
} targets[] = {
    {"{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0], 'friction': 0.3}",
     0,
     {.planes = 1, .plane = {{0, 1, 0, 0}}}},
    {"{'type': 'sphere', 'center': [0,0,0], 'radius': 0.1, 'friction': 0.3}",
     0.1,
     {.round = true, .radius = 0.1}},
    {"{'type': 'capsule', 'a': [-0.05,0,0], 'b': [0.05,0,0.03], 'radius': 0.06}",
     0.06,
     {.round = true, .a = {-0.05, 0, 0}, .b = {0.05, 0, 0.03}, .radius = 0.06}},
    {"{'type': 'box', 'center': [0,0,0], 'size': [0.16,0.12,0.2], 'friction': 0.2}",
     0.06,
     {.planes = 6,
      .plane = {{1, 0, 0, 0.08},
                {-1, 0, 0, 0.08},
                {0, 1, 0, 0.06},
                {0, -1, 0, 0.06},
                {0, 0, 1, 0.1},
                {0, 0, -1, 0.1}}},
     true},
    {"{'type': 'box', 'center': [0,0,0], 'size': [0.16,0.12,0.2], 'rounding': 0.03}",
     0.06,
     {.depth = in_round_box,
      .planes = 6,
      .plane = {{1, 0, 0, 0.05},
                {-1, 0, 0, 0.05},
                {0, 1, 0, 0.03},
                {0, -1, 0, 0.03},
                {0, 0, 1, 0.07},
                {0, 0, -1, 0.07}}}},
    {"{'type': 'cylinder', 'a': [0,0,-0.1], 'b': [0,0,0.1], 'radius': 0.08, 'friction': 0.3}",
     0.08,
     {.depth = in_cylinder},
     true},
    {"{'type': 'mesh', 'file': 'octahedron.obj', 'friction': 0.3}",
     0.15,
     {.planes = 8,
      .plane = {{T, T, T, 0.15 * T},
                {-T, T, T, 0.15 * T},
                {T, -T, T, 0.15 * T},
                {T, T, -T, 0.15 * T},
                {-T, -T, T, 0.15 * T},
                {-T, T, -T, 0.15 * T},
                {T, -T, -T, 0.15 * T},
                {-T, -T, -T, 0.15 * T}}},
     true},
};
#define TARGETS (sizeof targets / sizeof *targets)

/* ---- Watching ---- */

typedef struct watch {
    scene *s;
    const solid *body;
    double state, frame; /* [m] deepest penetration in any state, in any frame */
    int64_t crossings;   /* in frames */
    int frames;
} watch;

static double deepest(const watch *w, const double *x, double t)
{
    const drape_model *m = w->s->model;
    const drape_collider_motion at = drape_model_collider(m, 0, t);
    double max = -INFINITY;
    for (int32_t f = 0; f < m->triangle_count; f++) {
        double corner[3][3];
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < 3; k++)
                corner[a][k] = x[3 * m->triangle[3 * f + a] + k] - at.displacement[k];
        max = fmax(max, solid_depth(w->body, corner, DEEPEST));
    }
    return max;
}

static drape_status look(void *user, const drape_event *event)
{
    watch *w = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT) {
        if (event->attempt->accepted && w->body)
            w->state =
                fmax(w->state, deepest(w, drape_sim_positions(event->sim), drape_sim_time(event->sim)));
        return DRAPE_OK;
    }
    w->frames++;
    if (w->body)
        w->frame = fmax(w->frame, deepest(w, event->positions, event->time));
    if (w->s->model->contact.self) {
        drape_intersections found;
        ck_assert_int_eq(drape_find_intersections(w->s->ctx, w->s->model, event->positions, &found),
                         DRAPE_OK);
        w->crossings += found.count;
    }
    return DRAPE_OK;
}

/* 0.3 m wide and off center by some millimetres, so that nothing is symmetric; there are frames between
 * steps. */
static scene open_drop(const char *method, const struct target *on, double speed)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 7, 'width': 0.3, 'height': "
        "0.3,"
        " 'transform': {'translate': [-0.147, %g, 0.155]}}, 'velocity': [0, %g, 0],"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 2e-3}]}],"
        " 'colliders': [%s], 'contact': {'distance': 2e-3}, 'integrator': {'method': '%s', 'dt': 0.01},"
        " 'duration': 1, 'frame_rate': 60}",
        on->top + 0.03, -speed, on->text, method);
}

TEST(nothing_is_ever_inside)
{
    folder_enter();
    folder_write("octahedron.obj", octahedron);
    double states = -INFINITY, frames = -INFINITY;
    for (size_t i = 0; i < TARGETS; i++)
        for (size_t k = 0; k < METHODS; k++) {
            if (!in_sample(i, k, 3))
                continue;
            scoped_scene s = open_drop(methods[k], &targets[i], 0.8);
            watch w = {.s = &s, .body = &targets[i].body, .state = -INFINITY, .frame = -INFINITY};
            ck_assert_int_eq(drape_sim_observe(s.sim, look, &w), DRAPE_OK);
            scene_advance(&s, 0.25);
            const drape_statistics did = drape_sim_statistics(s.sim);
            printf(
                "# %s, %.20s: %lld steps, %lld rejected, %lld iterations, %.2f s; deepest in states %.3g, in "
                "frames %.3g\n",
                methods[k], targets[i].text, (long long)did.steps_accepted, (long long)did.steps_rejected,
                (long long)did.newton_iterations, did.wall_steps, w.state, w.frame);
            ck_assert_int_eq(w.frames, 16);
            states = fmax(states, w.state);
            frames = fmax(frames, w.frame);
        }
    folder_leave();
    assert_below(states, DEEPEST);
    assert_below(frames, DEEPEST);
}

/* A ball that rises into a sheet held at its corners, and out of it again. */
TEST(nothing_is_ever_inside_a_moving_collider)
{
    const solid ball = {.round = true, .radius = 0.1};
    for (size_t k = 0; k <= METHODS; k++) { /* the last time "be" with states that have not converged */
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 7, 'width': 0.3,"
            " 'height': 0.3, 'transform': {'translate': [-0.147, 0.12, 0.155]}},"
            " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
            " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 2e-3}],"
            " 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}, {'corner': 'bottom-left'}]}],"
            " 'colliders': [{'type': 'sphere', 'center': [0,0,0], 'radius': 0.1, 'friction': 0.5, 'track':"
            " [[0, [0,0,0]], [0.1, [0.01,0.08,0]], [0.2, [0,0,0.01]]]}], 'contact': {'distance': 2e-3},"
            " 'integrator': {'method': '%s', 'dt': 0.01%s}, 'duration': 1, 'frame_rate': 60}",
            methods[k % METHODS], k < METHODS ? "" : ", 'on_failure': 'accept', 'max_iterations': 2");
        watch w = {.s = &s, .body = &ball, .state = -INFINITY, .frame = -INFINITY};
        ck_assert_int_eq(drape_sim_observe(s.sim, look, &w), DRAPE_OK);
        scene_advance(&s, 0.25);
        const drape_statistics did = drape_sim_statistics(s.sim);
        printf("# %s: %lld steps, %lld rejected; deepest in states %.3g, in frames %.3g\n",
               methods[k % METHODS], (long long)did.steps_accepted, (long long)did.steps_rejected, w.state,
               w.frame);
        ck_assert(w.state > -0.002); /* the ball reached the sheet */
        assert_below(w.state, DEEPEST);
        assert_below(w.frame, DEEPEST);
    }
}

/* ---- Starts that are not free ---- */

/* The sheet begins on the top or 0.5 mm inside. It comes out and then stays outside. */
TEST(what_begins_inside_comes_out)
{
    folder_enter();
    folder_write("octahedron.obj", octahedron);
    for (size_t i = 0; i < TARGETS; i++)
        for (size_t k = 0; k < 2 * METHODS; k++) {
            if ((targets[i].sharp && k < METHODS) || !in_sample(i, k, 3))
                continue;
            struct target on = targets[i];
            on.top -= 0.03 + (k < METHODS ? 0.0005 : 0);
            scoped_scene s = open_drop(methods[k % METHODS], &on, 0);
            watch w = {.s = &s, .body = &targets[i].body, .state = -INFINITY, .frame = -INFINITY};
            const double before = deepest(&w, drape_sim_positions(s.sim), 0);
            scene_advance(&s, 0.05);
            const double after = deepest(&w, drape_sim_positions(s.sim), 0.05);
            ck_assert_int_eq(drape_sim_observe(s.sim, look, &w), DRAPE_OK);
            scene_advance(&s, 0.15);
            printf("# %s, %.20s: from %.3g m to %.3g m\n", methods[k % METHODS], on.text, before, after);
            ck_assert(k >= METHODS || before > 1e-4);
            assert_below(fmax(after, fmax(w.state, w.frame)), DEEPEST);
        }
    folder_leave();
}

/* ---- Cloth on itself ---- */

static scene open_fold(const char *method, const char *self)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 13, 'width': 0.05,"
        " 'height': 0.3, 'orientation': 'vertical', 'transform': {'rotate': [1, 0.2, 0, 4],"
        " 'translate': [0, 0.302, 0]}}, 'velocity': [0, -1, 0],"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 2e-3}]}],"
        " 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0], 'friction': 0.4}],"
        " 'contact': {'distance': 2e-3}%s, 'integrator': {'method': '%s', 'dt': 0.01}, 'duration': 1}",
        self, method);
}

/* A strip dropped edge-on onto a floor folds onto itself; it passes through itself only without
 * self-contact. */
TEST(a_fold_never_crosses_itself)
{
    const solid floor = {.planes = 1, .plane = {{0, 1, 0, 0}}};
    for (size_t k = 0; k <= METHODS; k++) {
        scoped_scene s =
            open_fold(methods[k % METHODS],
                      k < METHODS ? ", 'self_contact': {'thickness': 2e-3, 'friction': 0.2}" : "");
        watch w = {.s = &s, .body = &floor, .state = -INFINITY, .frame = -INFINITY};
        drape_intersections found;
        int64_t without = 0;
        ck_assert_int_eq(drape_sim_observe(s.sim, look, &w), DRAPE_OK);
        for (int i = 1; i <= 20; i++) {
            scene_advance(&s, i / 60.0);
            ck_assert_int_eq(drape_find_intersections(s.ctx, s.model, drape_sim_positions(s.sim), &found), 0);
            without += found.count;
        }
        const drape_statistics did = drape_sim_statistics(s.sim);
        printf("# %s%s: %lld steps, %lld rejected, %lld iterations, %.2f s; %lld crossings in %d frames\n",
               methods[k % METHODS], k < METHODS ? "" : " without self_contact",
               (long long)did.steps_accepted, (long long)did.steps_rejected, (long long)did.newton_iterations,
               did.wall_steps, (long long)(k < METHODS ? w.crossings : without), w.frames);
        if (k < METHODS)
            ck_assert_int_eq(w.crossings + without, 0);
        else
            ck_assert_int_gt(without, 0);
        assert_below(fmax(w.state, w.frame), DEEPEST);
    }
}

/* The reported depth is that of the sheet without its thickness. One sheet is above the plane, the other
 * below it. */
TEST(what_is_inside_a_collider_is_reported)
{
    static const double heights[] = {0.02, -0.01};
    for (int i = 0; i < 2; i++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': 0.3, "
            "'height': 0.2, "
            "'transform': {'translate': [0, %g, 0]}}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, "
            "'density': 200}, 'terms': ['stretch.edge']}], 'colliders': [{'type': 'plane', 'point': [0, 0, "
            "0], 'normal': [0, 1, 0]}], 'duration': 1}",
            heights[i]);
        double deepest = -1;
        ck_assert_int_eq(drape_sim_inside(s.sim, 0, &deepest), i ? s.model->triangle_count : 0);
        ck_assert_double_eq_tol(deepest, i ? 0.01 : 0, 1e-15);
        ck_assert_int_eq(drape_sim_inside(s.sim, 1, NULL), -1);
        ck_assert_int_eq(drape_sim_inside(s.sim, -1, NULL), -1);
    }
    ck_assert_int_eq(drape_sim_inside(NULL, 0, NULL), -1);
}

/* The rows of a tilted sheet land on a floor one after the other. If each pair halves its gap until the
 * barrier holds it, 6.2 iterations a step; where they arrive together, with predicted forces, 2.3. The bound
 * is between. */
TEST(a_landing_takes_few_iterations)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 8, 'rows': 8, 'width': 2, "
                   "'height': 2, 'orientation': 'horizontal', 'transform': {'rotate': [1, 0, 0, 35]}}, "
                   "'material': {'young_modulus': 1e6, 'thickness': 5e-4, 'areal_density': 0.3}, "
                   "'velocity': [0, -4, 0], 'terms': ['stretch.edge', 'bend.hinge']}], 'colliders': "
                   "[{'type': 'plane', 'point': [0, -1, 0], 'normal': [0, 1, 0]}], 'integrator': {'method': "
                   "'be', 'dt': 0.016666666666666666}, 'duration': 0.6}");
    scene_advance(&s, 0.6);
    const drape_statistics done = drape_sim_statistics(s.sim);
    const double mean = (double)done.newton_iterations / (double)done.steps_accepted;
    printf("# %.1f iterations a step, %lld rejected\n", mean, (long long)done.steps_rejected);
    ck_assert_double_lt(mean, 4);
}
