/* test_poses.c: the poses of colliders that a host turns: pivots that change, turns that are sent within a
 * moment, teleports of what turns. */
#include <float.h>

#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64) /* [s], exact in binary */

/* A small sheet far above, and a box of .2 x .2 x .2 m around the origin. */
#define BOX                                                                                                  \
    "'colliders': [{'type': 'box', 'name': 'box', 'center': [0, 0, 0], 'size': [0.2, 0.2, 0.2], 'pivot': "   \
    "[0.1, 0, 0]%s}], "

typedef struct turned {
    host h;
    drape_scene *scene;
} turned;

static turned open_turned(const char *motion, double teleport_speed)
{
    char text[1024];
    turned t = {.h = empty_host()};
    drape_sim_def def = sim_def();
    snprintf(
        text, sizeof text,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.1, "
        "'height': 0.1, 'transform': {'translate': [0, 5, 0]}}, 'material': {'young_modulus': 1e4, "
        "'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], 'pins': [{'edge': 'top'}]}], " BOX
        "'integrator': {'method': 'be', 'dt': 0.0078125}, 'duration': 10}",
        motion);
    quote(text);
    def.teleport_speed = teleport_speed;
    good(&t.h, drape_scene_parse(t.h.ctx, text, "s.json", &t.scene));
    good(&t.h, drape_scene_compile(t.scene, &t.h.model));
    good(&t.h, drape_sim_create(t.h.ctx, t.h.model, &def, &t.h.sim));
    return t;
}

static void close_turned(turned *t)
{
    drape_scene_destroy(&t->scene);
    close_scene(&t->h);
}

#define scoped_turned SCOPED(close_turned) turned

static void advance(const turned *t, double seconds)
{
    good(&t->h, drape_sim_advance(t->h.sim, drape_sim_time(t->h.sim) + seconds));
}

/* The pose in space: where a corner of the box is, by rotation and pivot as they are reported, and the
 * velocity of that corner. */
static void corner_of(const turned *t, const double own_pivot[3], double x[3], double v[3])
{
    const double own[3] = {0.1, 0.1, -0.1};
    const drape_collider_motion at = drape_sim_collider(t->h.sim, 0);
    double q[4], w[3], pivot[3], r[3], u[3], uu[3], arm[3];
    ck_assert(drape_sim_collider_rotation(t->h.sim, 0, q, w, pivot));
    for (int k = 0; k < 3; k++)
        r[k] = own[k] - own_pivot[k];
    for (int k = 0; k < 3; k++) /* u = q_vec x r, uu = q_vec x u */
        u[k] = q[1 + (k + 1) % 3] * r[(k + 2) % 3] - q[1 + (k + 2) % 3] * r[(k + 1) % 3];
    for (int k = 0; k < 3; k++)
        uu[k] = q[1 + (k + 1) % 3] * u[(k + 2) % 3] - q[1 + (k + 2) % 3] * u[(k + 1) % 3];
    for (int k = 0; k < 3; k++)
        arm[k] = r[k] + 2 * (q[0] * u[k] + uu[k]);
    for (int k = 0; k < 3; k++) {
        x[k] = pivot[k] + arm[k];
        v[k] = at.velocity[k] + w[(k + 1) % 3] * arm[(k + 2) % 3] - w[(k + 2) % 3] * arm[(k + 1) % 3];
    }
}

static void same(const double a[3], const double b[3], double tolerance)
{
    for (int k = 0; k < 3; k++)
        ck_assert_double_eq_tol(a[k], b[k], tolerance);
}

static const double first[3] = {0.1, 0, 0}, second[3] = {0, -0.3, 0.2};

static void change_pivot(const turned *t, const char *value)
{
    good(&t->h, drape_scene_set(t->scene, "/colliders/0/pivot", value));
    good(&t->h, drape_sim_change(t->h.sim, t->scene));
}

/* ---- Pivots that change ---- */

/* On a track of its own, placed elsewhere or not, a body stays where it is and goes on turning about the new
 * pivot, which then rests. 100 roundings of lengths and speeds of about 1. */
TEST(a_turning_body_stays_where_it_is)
{
    for (int placed = 0; placed < 2; placed++) {
        scoped_turned t =
            open_turned(", 'turns': [{'time': 0, 'rotate': [0, 0, 1, 0]}, {'time': 4, 'rotate': "
                        "[0, 0, 1, 720]}]",
                        0);
        double before[3], after[3], v[3], pivot[2][3];
        drape_place_def place = place_def();
        place.rotate[1] = 1, place.rotate[3] = 50;
        place.translate[2] = 0.7;
        advance(&t, 24 * FRAME);
        if (placed)
            good(&t.h, drape_sim_place(t.h.sim, &place));
        corner_of(&t, first, before, v);
        change_pivot(&t, "[0, -0.3, 0.2]");
        corner_of(&t, second, after, v);
        same(after, before, 100 * DBL_EPSILON);
        drape_sim_collider_rotation(t.h.sim, 0, NULL, NULL, pivot[0]);
        advance(&t, 24 * FRAME);
        drape_sim_collider_rotation(t.h.sim, 0, NULL, NULL, pivot[1]);
        same(pivot[1], pivot[0], 100 * DBL_EPSILON);
        corner_of(&t, second, after, v);
        ck_assert_double_gt(distance(before, after), 0.1);
    }
}

/* A body on its path to a pose that a host has sent has the same pose and the same velocities at the moment
 * of the change, and the pose that was sent at its end; also if the change comes at the end, or after it.
 * */
TEST(a_sent_body_arrives_where_it_was_sent)
{
    for (int frames = 1; frames <= 5; frames += 2)
        for (int smooth = 0; smooth < 2; smooth++) {
            scoped_turned t = open_turned("", 0), plain = open_turned("", 0);
            const double to[3] = {0.3, 0.1, -0.2}, q[4] = {0.8, 0, 0.6, 0}, v[3] = {0.5, 1, 0},
                         w[3] = {0.1, 2, -0.3}, next[4] = {0.6, 0, 0.8, 0};
            double x[2][3], u[2][3];
            const turned *both[] = {&t, &plain};
            for (int i = 0; i < 2; i++) {
                good(&both[i]->h, drape_sim_move_collider_pose(both[i]->h.sim, 0, 3 * FRAME, to, q,
                                                               smooth ? v : NULL, smooth ? w : NULL));
                advance(both[i], frames * FRAME);
                corner_of(both[i], first, x[i], u[i]);
            }
            same(x[0], x[1], DBL_MIN);
            change_pivot(&t, "[0, -0.3, 0.2]");
            corner_of(&t, second, x[0], u[0]);
            /* positions to roundings of 1; velocities of up to 20 m/s, from a turn in 3/64 s */
            same(x[0], x[1], 100 * DBL_EPSILON);
            same(u[0], u[1], 5000 * DBL_EPSILON);
            if (frames < 3) {
                advance(&t, 2 * FRAME);
                advance(&plain, 2 * FRAME);
                corner_of(&t, second, x[0], u[0]);
                corner_of(&plain, first, x[1], u[1]);
                same(x[0], x[1], 100 * DBL_EPSILON);
            }
            good(&t.h, drape_sim_move_collider_pose(t.h.sim, 0, FRAME, to, next, NULL, NULL));
            advance(&t, FRAME);
            const drape_collider_motion at = drape_sim_collider(t.h.sim, 0);
            same(at.displacement, to, 100 * DBL_EPSILON);
        }
}

/* The pivot that no scene gives is the middle of the shape: a box that is put elsewhere in the scene turns
 * about its middle there. */
TEST(a_middle_moves_with_its_shape)
{
    scoped_turned t = open_turned(", 'turns': [{'time': 0, 'rotate': [0, 0, 1, 0]}, {'time': 4, 'rotate': "
                                  "[0, 0, 1, 720]}]",
                                  0);
    double pivot[3];
    const double there[3] = {1, 2, 3};
    good(&t.h, drape_scene_set(t.scene, "/colliders/0/pivot", NULL));
    good(&t.h, drape_sim_change(t.h.sim, t.scene));
    advance(&t, 24 * FRAME);
    good(&t.h, drape_scene_set(t.scene, "/colliders/0/center", "[1, 2, 3]"));
    good(&t.h, drape_sim_change(t.h.sim, t.scene));
    drape_sim_collider_rotation(t.h.sim, 0, NULL, NULL, pivot);
    same(pivot, there, 100 * DBL_EPSILON);
}

/* ---- Spins ---- */

/* Half a turn in a microsecond would be 3.1e6 rad/s: it is refused, with one line, and nothing changes; in
 * 1 ms it is allowed. */
TEST(a_turn_within_a_moment_is_refused)
{
    scoped_turned t = open_turned("", 0);
    const double here[3] = {0}, still[3] = {0}, q[4] = {0, 0, 1, 0};
    const uint64_t hash = drape_sim_hash(t.h.sim);
    for (int i = 0; i < 2; i++)
        says(&t.h,
             drape_sim_move_collider_pose(t.h.sim, 0, 1e-6, here, q, i ? still : NULL, i ? still : NULL),
             DRAPE_E_ARGUMENT,
             "box would turn by 3.142 rad in 1e-06 s; its angular velocity is within 10000 rad/s");
    ck_assert_ptr_null(strchr(drape_context_message(t.h.ctx), '\n'));
    ck_assert(drape_sim_hash(t.h.sim) == hash);
    good(&t.h, drape_sim_move_collider_pose(t.h.sim, 0, 1e-3, here, q, NULL, NULL));
    advance(&t, FRAME);
}

/* With a teleport_speed of 5 m/s a body that would have to turn by 2 rad in 1/64 s is there at once, less
 * the turn at its velocity on arrival, whether that is given or is the one that it had. Its corners are .37
 * m from the pivot at most: a turn of .1 rad, at 2.4 m/s, is made. */
TEST(what_turns_too_fast_is_placed)
{
    for (int given = 0; given < 2; given++) {
        scoped_turned t = open_turned("", 5);
        const double here[3] = {0}, w[3] = {0, 3, 0};
        double q[4] = {cos(0.05), 0, sin(0.05), 0}, got[4];
        good(&t.h, drape_sim_move_collider_pose(t.h.sim, 0, FRAME, here, q, here, w));
        drape_sim_collider_rotation(t.h.sim, 0, got, NULL, NULL);
        ck_assert_double_eq(got[0], 1);
        advance(&t, FRAME);
        q[0] = cos(1), q[2] = sin(1);
        good(&t.h,
             drape_sim_move_collider_pose(t.h.sim, 0, FRAME, here, q, given ? here : NULL, given ? w : NULL));
        drape_sim_collider_rotation(t.h.sim, 0, got, NULL, NULL);
        ck_assert_double_eq_tol(2 * atan2(got[2], got[0]), 2 - 3 * FRAME, 1e-14);
        advance(&t, FRAME);
        drape_sim_collider_rotation(t.h.sim, 0, got, NULL, NULL);
        ck_assert_double_eq_tol(2 * atan2(got[2], got[0]), 2, 1e-14);
    }
}
