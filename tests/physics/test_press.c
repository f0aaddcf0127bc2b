/*
 * test_press.c: cloth that is pressed. Small scenes of the kinds that tools/press draws, by every method
 * with contact: nothing passes through anything, in any accepted state or frame, as counted by
 * support/crossings.h. A run may stop, with a reason and, where contact rejected the last steps, the
 * pieces that met.
 */
#include <stdio.h>

#include "geometry/intersect.h"
#include "sim/inside.h"
#include "support/crossings.h"
#include "support/folder.h"
#include "support/sample.h"
#include "support/scene.h"

/* Accepted states of a run, after which it ends: ida makes thousands. */
#define STATES (complete_sweep() ? 1500 : 300)

static const char *const methods[] = {"'method': 'be', 'dt': %g",
                                      "'method': 'bdf2', 'dt': %g",
                                      "'method': 'midpoint', 'dt': %g",
                                      "'method': 'trbdf2', 'dt': %g",
                                      "'method': 'newton_k', 'iterations': 1, 'dt': %g",
                                      "'method': 'newton_k', 'iterations': 2, 'dt': %g",
                                      "'method': 'newton_k', 'iterations': 4, 'dt': %g",
                                      "'method': 'ida'"};
#define METHODS (sizeof methods / sizeof *methods)

/* ---- The counter ---- */

/* A sheet of two triangles, 1 m wide, in the plane y = 0, and colliders. */
static scene plate(const char *colliders)
{
    return scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, "
        "'height': 1, 'diagonals': 'parallel', 'transform': {'translate': [-0.3, 0, 0.3]}}, "
        "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200}, 'terms': "
        "['stretch.edge']}], 'colliders': [%s], 'self_contact': {'thickness': 1e-3}, 'duration': 1}",
        colliders);
}

/* A cube of 1 cm with a corner up. 45 degrees about one axis and acos(1/sqrt 3) about another: in one
 * rotation about (1, 0, -1) by acos(1/sqrt 3) the diagonal (1, 1, 1) points up. top: height of the corner.
 * */
static scene plate_and_corner(double top)
{
    char text[256];
    snprintf(text, sizeof text,
             "{'type': 'box', 'center': [0.1, %.17g, 0.05], 'size': 0.01, 'rotate': [1, 0, -1, %.17g]}",
             top - 0.005 * sqrt(3), acos(1 / sqrt(3)) * 180 / acos(-1));
    return plate(text);
}

/* The counter, and inside, see a corner as soon as it is through: its three edges, and at a height h above
 * the sheet a depth of h/sqrt 3, the distance of its faces from a point h below it on the diagonal.
 * Sampled points are 0.17 m apart and see nothing. */
TEST(a_corner_through_a_face_is_counted)
{
    static const double heights[] = {-1e-12, 1e-12, 3e-3};
    for (int i = 0; i < 3; i++) {
        scoped_scene s = plate_and_corner(heights[i]);
        const drape_collider_pose pose = {{0}, {0}};
        drape_inside inside;
        int32_t pierced;
        const crossings found = crossings_count(s.model, s.model->rest, 0);
        ck_assert_int_eq(found.colliders, i > 0 ? 3 : 0);
        ck_assert_int_eq(found.cloth + found.inside, 0);
        ck_assert_int_eq(
            drape_find_inside(s.ctx, s.model, &s.model->colliders[0], &pose, s.model->rest, &inside),
            DRAPE_OK);
        ck_assert_int_eq(inside.intersections, i > 0 ? 3 : 0);
        ck_assert_int_eq(inside.triangles, i > 0);
        ck_assert_int_eq(
            drape_find_pierced(s.ctx, s.model, &s.model->colliders[0], &pose, s.model->rest, &pierced),
            DRAPE_OK);
        ck_assert_int_eq(pierced, i > 0);
        /* coordinates of up to 1 m are rounded by DBL_EPSILON/2; 20 such errors */
        ck_assert_double_eq_tol(inside.deepest, i > 0 ? heights[i] / sqrt(3) : 0, 20 * DBL_EPSILON);
    }
}

static double random_between(uint64_t *seed, double low, double high)
{
    *seed = *seed * UINT64_C(6364136223846793005) + 1;
    return low + (high - low) * ((double)(*seed >> 11) / 9007199254740992.0);
}

/* In crumpled states the counter finds what the library finds: of cloth with cloth, and with a box, whose
 * corners are scattered through it. */
TEST(the_counter_agrees_with_the_library)
{
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 7, 'width': 1, "
                    "'height': 1}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200}, "
                    "'terms': ['stretch.edge']}], 'colliders': [{'type': 'box', 'center': [0.5, 0, -0.5], "
                    "'size': 0.4, 'rotate': [1, 2, 3, 40]}], 'self_contact': {'thickness': 1e-3}, "
                    "'duration': 1}");
    double *x = s.model->rest;
    uint64_t seed = 3;
    int64_t cloth = 0, box = 0;
    for (int i = 0; i < 30; i++) {
        const drape_collider_pose pose = {{0}, {0}};
        drape_intersections found;
        drape_inside inside;
        for (int32_t k = 0; k < 3 * s.model->node_count; k++)
            x[k] += random_between(&seed, -0.05, 0.05);
        const crossings counted = crossings_count(s.model, x, 0);
        ck_assert_int_eq(drape_find_intersections(s.ctx, s.model, x, &found), DRAPE_OK);
        ck_assert_int_eq(counted.cloth, found.count);
        ck_assert_int_eq(drape_find_inside(s.ctx, s.model, &s.model->colliders[0], &pose, x, &inside),
                         DRAPE_OK);
        ck_assert_int_eq(counted.colliders, inside.intersections);
        cloth += found.count;
        box += inside.intersections;
    }
    ck_assert_int_gt(cloth, 100);
    ck_assert_int_gt(box, 100);
}

/* ---- Runs ---- */

typedef struct press {
    crossings_run crossed;
    int64_t accepted;
} press;

static drape_status watch(void *user, const drape_event *event)
{
    press *p = user;
    const drape_status status = crossings_observe(&p->crossed, event);
    p->accepted += event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted;
    return status ? status : p->accepted < STATES ? DRAPE_OK : DRAPE_E_STOPPED;
}

/* Runs a scene, up to the members of its integrator, by all methods, or by a sample of them, which depends on
 * the scene's number; dt [s] is for those of fixed steps. */
static void run_all(size_t number, const char *name, const char *text, double dt)
{
    int crossed = 0, unnamed = 0;
    for (size_t i = 0; i < METHODS; i++) {
        char method[128];
        press p = {.accepted = 0};
        if (!in_sample(number, i, 2))
            continue;
        snprintf(method, sizeof method, methods[i], dt);
        scoped_scene s = scene_open(
            "{'drape': 1, %s, 'integrator': {%s}, 'frame_rate': 240, 'duration': 0.2}", text, method);
        ck_assert_int_eq(drape_sim_observe(s.sim, watch, &p), DRAPE_OK);
        const drape_status status = drape_sim_advance(s.sim, 0.2);
        const char *message = drape_context_message(s.ctx);
        ck_assert_msg(!status || status == DRAPE_E_STOPPED || status == DRAPE_E_STEP_TOO_SMALL, "%s: %s",
                      method, message);
        const int64_t found = p.crossed.crossed_states + p.crossed.crossed_frames;
        printf("# %s, %s: %s after %lld states, %lld with crossings, and %lld of %lld frames; %s\n", name,
               method, drape_status_name(status), (long long)p.crossed.states,
               (long long)p.crossed.crossed_states, (long long)p.crossed.crossed_frames,
               (long long)p.crossed.frames, p.crossed.first);
        fflush(stdout); /* a failed test ends without */
        ck_assert_int_gt(p.crossed.states + (status == DRAPE_E_STEP_TOO_SMALL), 0);
        crossed += found > 0;
        unnamed += status == DRAPE_E_STEP_TOO_SMALL && strstr(message, "(retry_rejected)") &&
                   !strstr(message, "node");
    }
    ck_assert_msg(crossed == 0 && unnamed == 0,
                  "%s: %d methods let something pass, %d stopped without naming it", name, crossed, unnamed);
}

/* The cloths: %s stands for more members. Two opposite sides of a square of 0.3 m are pinned and go down. */
#define STIFF "'material': {'young_modulus': 1e8, 'thickness': 1e-3, 'areal_density': 0.1}"
#define SOFT  "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.1}"
#define SQUARE(height)                                                                                       \
    "'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.3, 'height': 0.3, 'transform': "         \
    "{'translate': [-0.15, " height ", 0.15]}}, 'terms': ['stretch.edge', 'bend.hinge']"
#define SIDES                                                                                                \
    "'pins': [{'nodes': [0, 1, 2, 3, 4, 20, 21, 22, 23, 24], 'track': [[0, [0, 0, 0]], [0.2, [0, -0.1, "     \
    "0]]]}]"

/* A plane at `at` whose normal leads inwards; it moves by `to` in 0.2 s. */
#define WALL(at, normal, to)                                                                                 \
    "{'type': 'plane', 'point': [" at "], 'normal': [" normal "], 'track': [[0, [0, 0, 0]], [0.2, [" to "]]" \
    "]}"
#define WALLS                                                                                                \
    WALL("-0.16, 0, 0", "1, 0, 0", "0.08, 0, 0")                                                             \
    "," WALL("0.16, 0, 0", "-1, 0, 0", "-0.08, 0, 0") "," WALL(                                              \
        "0, -0.08, 0", "0, 1, 0",                                                                            \
        "0, 0.04, 0") "," WALL("0, 0.08, 0", "0, -1, 0",                                                     \
                               "0, -0.04, 0") "," WALL("0, 0, -0.16", "0, 0, 1",                             \
                                                       "0, 0, 0.08") "," WALL("0, 0, 0.16", "0, 0, -1",      \
                                                                              "0, 0, -0.08")

#define TIP                                                                                                  \
    "v 0.05 -0.2 0.01\nv -0.03 -0.2 0.06\nv -0.03 -0.2 -0.04\nv 0.01 0 0.013\n"                              \
    "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n"
#define BLADE                                                                                                \
    "v -0.06 0 0.02\nv -0.06 -0.2 0.03\nv -0.06 -0.2 0\nv 0.05 0 -0.01\nv 0.05 -0.2 0.01\n"                  \
    "v 0.05 -0.2 -0.02\nf 1 3 2\nf 4 5 6\nf 1 2 5\nf 1 5 4\nf 1 4 6\nf 1 6 3\nf 2 3 6\nf 2 6 5\n"
#define CORNER "{'type': 'box', 'center': [0.01, -0.0606, 0.01], 'size': 0.07, 'rotate': [1, 0, -1, 54.7356]}"
#define PULLED "'cloth': [{" SQUARE("0.01") ", " STIFF ", " SIDES "}], 'colliders': "

static const struct {
    const char *name, *solid; /* a closed mesh, as solid.obj */
    const char *text;
} scenes[] = {
    {"over a tip", TIP, PULLED "[{'type': 'mesh', 'file': 'solid.obj'}]"},
    {"over a blade", BLADE, PULLED "[{'type': 'mesh', 'file': 'solid.obj'}]"},
    {"over the corner of a box", NULL, PULLED "[" CORNER "]"},
    {"over a wire", NULL,
     PULLED "[{'type': 'capsule', 'a': [-0.1, -0.001, 0.02], 'b': [0.1, -0.001, -0.03], 'radius': 3e-4}]"},
    /* the ends of a strip above another are pulled down past it; the ends of both are pinned */
    {"a strip over a strip", NULL,
     "'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 2, 'width': 0.3, 'height': 0.05, "
     "'transform': {'translate': [-0.15, 0, 0.025]}}, 'terms': ['stretch.edge', 'bend.hinge'], 'pins': "
     "[{'nodes': [0, 6, 7, 13]}], " STIFF
     "}, {'mesh': {'grid': 'square', 'columns': 2, 'rows': 7, 'width': 0.05, 'height': 0.3, 'transform': "
     "{'translate': [-0.02, 0.01, 0.15]}}, 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'nodes': [0, "
     "1, 12, 13], 'track': [[0, [0, 0, 0]], [0.2, [0, -0.08, 0]]]}], " STIFF
     "}], 'self_contact': {'thickness': 1e-3}"},
    {"blown onto a sheet", NULL,
     "'cloth': [{" SQUARE(
         "0") ", 'pins': [{'nodes': [0, 1, 2, 3, 4, 20, 21, 22, 23, 24]}], " SOFT
              "}, {'mesh': {'grid': 'irregular', 'columns': 5, 'rows': 5, 'width': 0.25, 'height': 0.25, "
              "'transform': {'translate': [-0.12, 0.01, 0.13]}}, 'terms': ['stretch.edge', 'bend.hinge', "
              "{'type': "
              "'drag.wind', 'wind': [2, -30, 1]}], " SOFT "}], 'self_contact': {'thickness': 1e-3}"},
    {"dropped at 50 m/s", NULL,
     "'cloth': [{" SQUARE("0.1") ", 'velocity': [5, -50, 0], " SOFT "}], 'colliders': [" CORNER
                                 ", {'type': 'plane', 'point': [0, -0.1, 0], 'normal': [0, 1, 0]}], "
                                 "'self_contact': {'thickness': "
                                 "1e-3}"},
    {"in a shrinking box", NULL,
     "'cloth': [{" SQUARE("0") ", " SOFT "}], 'self_contact': {'thickness': 1e-3}, 'colliders': [" WALLS "]"},
    /* until there is no room left: the runs stop */
    {"between two bodies", NULL,
     "'cloth': [{" SQUARE("0") ", " STIFF "}], 'colliders': [{'type': 'box', 'center': [0.02, 0.06, 0], "
                               "'size': 0.08, 'rotate': [1, 2, 0, 30], "
                               "'track': [[0, [0, 0, 0]], [0.15, [0, -0.03, 0]]]}, {'type': 'sphere', "
                               "'center': [0, -0.1, 0.01], "
                               "'radius': 0.08, 'track': [[0, [0, 0, 0]], [0.15, [0, 0.03, 0]]]}]"}};

TEST(nothing_passes_through_anything)
{
    folder_enter();
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        if (scenes[i].solid)
            folder_write("solid.obj", scenes[i].solid);
        run_all(i, scenes[i].name, scenes[i].text, 1.0 / 60);
    }
    folder_leave();
}

/* ---- Frames between steps ---- */

/* A ball that turns back within steps pushes a sheet: the frames between are free of it, too. Where it turns,
 * neither the interpolant nor the straight line is. */
TEST(frames_are_free_of_a_ball_that_turns_back)
{
    int64_t frames = 0;
    for (int i = 0; i < 4; i++) {
        press p = {.accepted = INT64_MIN};
        const double end = 0.03 + 0.01 * i, turn = 0.4 * end;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{" SQUARE("0") ", " SOFT "}], 'colliders': [{'type': 'sphere', "
                                                   "'center': [0.01, -0.08, 0.02], 'radius': 0.05, 'track': "
                                                   "[[0, [0, 0, 0]], [%g, [0, 0.15, "
                                                   "0]], [%g, [0.02, -0.1, 0]]]}], 'integrator': {'dt': %g}, "
                                                   "'frame_rate': 1000, 'duration': "
                                                   "0.1}",
            turn, end, 1.0 / 30);
        ck_assert_int_eq(drape_sim_observe(s.sim, watch, &p), DRAPE_OK);
        scene_advance(&s, 0.1);
        printf("# %d: %lld of %lld frames, %lld of %lld states; %s\n", i, (long long)p.crossed.crossed_frames,
               (long long)p.crossed.frames, (long long)p.crossed.crossed_states, (long long)p.crossed.states,
               p.crossed.first);
        ck_assert_int_eq(p.crossed.crossed_frames + p.crossed.crossed_states, 0);
        frames += p.crossed.frames;
    }
    ck_assert_int_eq(frames, 4 * 101);
}

/* The times of frames, which must not decrease, and those that are not at their nominal time. */
typedef struct times {
    double last, rate;
    int64_t frames, late;
    press press;
} times;

static drape_status note_times(void *user, const drape_event *event)
{
    times *w = user;
    if (event->kind == DRAPE_EVENT_FRAME) {
        ck_assert(event->time >= w->last);
        const double nominal = (double)event->frame / w->rate;
        ck_assert(event->time >= nominal - 1e-9);
        w->late += event->time > nominal + 1e-9;
        w->frames++;
        w->last = event->time;
    }
    return watch(&w->press, event);
}

/* A ball below a sheet at rest. */
#define BELOW(track)                                                                                         \
    "{'drape': 1, 'cloth': [{" SQUARE(                                                                       \
        "0") ", " SOFT "}], 'gravity': [0, 0, 0], 'colliders': [{'type': 'sphere', 'center': [0.01, -0.2, "  \
             "0.02], 'radius': "                                                                             \
             "0.05" track "}], 'integrator': {'dt': 0.01}, 'frame_rate': 1000, 'duration': 0.05}"

/* The ball turns where the sheet is, and is back within one step, at whose ends it is far away: steps are
 * rejected until they feel it. */
TEST(a_ball_that_turns_within_a_step_is_felt)
{
    times w = {.rate = 1000, .last = 0};
    scoped_scene s =
        scene_open(BELOW(", 'track': [[0.021, [0, 0, 0]], [0.025, [0, 0.2, 0]], [0.029, [0, 0, 0]]]"));
    scene_watch(&s);
    ck_assert_int_eq(drape_sim_observe(s.sim, note_times, &w), DRAPE_OK);
    scene_advance(&s, 0.05);
    ck_assert_int_eq(w.press.crossed.crossed_frames + w.press.crossed.crossed_states, 0);
    ck_assert_int_gt(s.rejected, 0);
    ck_assert_double_gt(drape_sim_energy(s.sim).kinetic, 0);
}

/* A host sends the ball through the sheet and back within one step, on a cubic, so a step sees it at rest;
 * at the time of the frames between no state of the cloth is free of it, and they show the state at the end
 * of the step. From rest at 0, with the velocity V after T seconds, the cubic is T V s^2 (s - 1): 4/27 T V
 * high. */
TEST(frames_without_room_show_the_end_of_the_step)
{
    times w = {.rate = 1000, .last = 0, .press = {.accepted = INT64_MIN}};
    scoped_scene s = scene_open(BELOW(""));
    ck_assert_int_eq(drape_sim_observe(s.sim, note_times, &w), DRAPE_OK);
    scene_advance(&s, 0.02);
    ck_assert_int_eq(
        drape_sim_move_collider(s.sim, 0, 0.01, (double[]){0, 0, 0}, (double[]){0, -0.2 * 27 / 4 / 0.01, 0}),
        DRAPE_OK);
    scene_advance(&s, 0.05);
    ck_assert_int_eq(w.press.crossed.crossed_frames + w.press.crossed.crossed_states, 0);
    ck_assert_int_eq(w.frames, 51);
    ck_assert_int_gt(w.late, 0);
    ck_assert_int_le(w.late, 9); /* those between 0.02 and 0.03 s */
}

/* A ball comes from below and lifts a sheet at rest: the first contact stores energy, all of which is work
 * of the ball, however small the step is. */
TEST(a_sheet_at_rest_may_be_met)
{
    static const char *const some[] = {"be", "bdf2", "midpoint", "trbdf2"};
    for (int k = 0; k < 4; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{" SQUARE(
                "0") ", " SOFT "}], 'gravity': [0, 0, 0], 'contact': {'distance': 1e-3}, 'colliders': "
                     "[{'type': 'sphere', "
                     "'center': [0.01, -0.06, 0.02], 'radius': 0.05, 'track': [[0, [0, 0, 0]], [0.2, [0, "
                     "0.02, 0]]]}], 'integrator': {'method': '%s', 'dt': 0.0166}, 'duration': 0.12}",
            some[k]);
        scene_watch(&s);
        scene_advance(&s, 0.12);
        printf("# %s: %ld steps, %ld rejected\n", some[k], s.accepted, s.rejected);
        ck_assert_int_le(s.rejected, 10);
    }
}
