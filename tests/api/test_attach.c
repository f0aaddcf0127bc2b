/* test_attach.c: pins that a host gives to colliders to carry while a sim runs, and lets go; what becomes of
 * them when cloth or colliders are placed, changed or restored. */
#include <float.h>

#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64) /* [s], exact in binary */

/* A sheet hung by its top, and a body beside it, which is not enabled or far off. */
#define BODIES                                                                                               \
    "'colliders': [{'name': 'body', 'type': 'box', 'center': [0.25, 0.3, 0], 'size': [0.2, 0.2, 0.2], "      \
    "'enabled': false}, {'name': 'other', 'type': 'sphere', 'center': [0, -3, 0], 'radius': 0.1}], "

static host open_sheet(const char *method, const char *pins)
{
    char integrator[200];
    snprintf(integrator, sizeof integrator, "'method': '%s', 'dt': %.17g", method,
             strcmp(method, "verlet") == 0 ? FRAME / 64 : FRAME / 2);
    return open_scene(SHEET, "", pins, integrator, BODIES);
}

static const double *at(const host *h, int32_t node)
{
    return drape_sim_positions(h->sim) + 3 * (size_t)node;
}

/* Sends the body: by a shift, and turned about y. */
static void send(host *h, double seconds, double x, double y, double degrees)
{
    const double half = degrees / 2 * acos(-1.0) / 180, q[4] = {cos(half), 0, sin(half), 0},
                 displacement[3] = {x, y, 0};
    good(h, drape_sim_move_collider_pose(h->sim, 0, seconds, displacement, q, NULL, NULL));
}

/* Where the body has a point that was at `from` when it had not moved: about (0.25, 0.3, 0). */
static void on_body(const double *from, double x, double y, double degrees, double to[3])
{
    const double c = cos(degrees * acos(-1.0) / 180), s = sin(degrees * acos(-1.0) / 180);
    to[0] = 0.25 + c * (from[0] - 0.25) + s * from[2] + x;
    to[1] = from[1] + y;
    to[2] = c * from[2] - s * (from[0] - 0.25);
}

static void expect_on_body(const host *h, const int32_t *nodes, int count, const double *from, double x,
                           double y, double degrees)
{
    for (int i = 0; i < count; i++) {
        double to[3];
        on_body(from + 3 * i, x, y, degrees, to);
        ck_assert_double_le(distance(at(h, nodes[i]), to), 1e-14); /* some roundings of 1 m */
    }
}

/* ---- Made and released ---- */

/* A free node and a pinned one: both are where they were, go with the body, and one is let go with the
 * velocity that it has there: that of the step's mean, on a path of constant speed without turning. */
TEST(nodes_are_attached_and_detached)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host h = open_sheet(methods[i], "{'edge': 'top'}");
        const int32_t nodes[2] = {12, 0};
        double from[6], all[60], v[3];
        good(&h, drape_sim_advance(h.sim, 8 * FRAME));
        for (int k = 0; k < 2; k++)
            memcpy(from + 3 * k, at(&h, nodes[k]), 3 * sizeof *from);
        memcpy(all, at(&h, 0), sizeof all);
        ck_assert_int_eq(drape_sim_attached(h.sim, 12), -1);
        const double numerical = drape_sim_energy(h.sim).numerical;
        good(&h, drape_sim_attach(h.sim, 0, 2, nodes, NULL));
        ck_assert_double_eq_tol(drape_sim_energy(h.sim).numerical, numerical, 1e-12);
        ck_assert_mem_eq(all, at(&h, 0), sizeof all);
        ck_assert_int_eq(drape_sim_attached(h.sim, 12), 0);
        ck_assert_int_eq(drape_sim_attached(h.sim, 0), 0);
        ck_assert_int_eq(drape_sim_attached(h.sim, 1), -1);
        send(&h, 8 * FRAME, 0.02, 0.01, 20);
        good(&h, drape_sim_advance(h.sim, 16 * FRAME));
        expect_on_body(&h, nodes, 2, from, 0.02, 0.01, 20);
        send(&h, 8 * FRAME, 0.04, 0.01, 20);
        good(&h, drape_sim_advance(h.sim, 20 * FRAME));
        expect_on_body(&h, nodes, 2, from, 0.03, 0.01, 20);
        memcpy(all, at(&h, 0), sizeof all);
        good(&h, drape_sim_detach(h.sim, 1, nodes));
        ck_assert_mem_eq(all, at(&h, 0), sizeof all);
        ck_assert_int_eq(drape_sim_attached(h.sim, 12), -1);
        memcpy(v, drape_sim_velocities(h.sim) + 36, sizeof v);
        ck_assert_double_eq_tol(v[0], 0.02 / (8 * FRAME), 1e-9);
        ck_assert_double_eq_tol(v[1], 0, 1e-9);
        good(&h, drape_sim_advance(h.sim, 24 * FRAME));
        expect_on_body(&h, nodes + 1, 1, from + 3, 0.04, 0.01, 20);
        ck_assert_double_gt(distance(at(&h, 12), all + 36), 1e-3);
    }
}

static double velocity_error(const double *v, const double *x, double turning)
{
    const double exact[3] = {0.4 + turning * x[2], 0.2, -turning * (x[0] - 0.25)};
    return distance(v, exact);
}

typedef struct seen {
    double error[2]; /* largest one of the first two frames */
    double turning;
} seen;

static drape_status watch(void *user, const drape_event *event)
{
    seen *s = user;
    const double x[3] = {event->positions ? event->positions[0] - 0.4 * event->time : 0, 0,
                         event->positions ? event->positions[2] : 0};
    if (event->kind == DRAPE_EVENT_FRAME && event->frame < 2)
        s->error[event->frame] = velocity_error(event->velocities, x, s->turning);
    return DRAPE_OK;
}

/* Pins of a body that moves and turns from the start have its velocity there, and in the frame in the middle
 * of the first step that of the method: the mean over the step of a point that goes round at w r is off by at
 * most w^2 r h / 2 at its end, r < 0.3 m. */
TEST(pins_of_a_moving_body_begin_with_its_velocity)
{
    const double w = 120 * acos(-1.0) / 180, step = 1.0 / 32;
    for (int i = 0; i < METHODS; i++) {
        const char *method = methods[i];
        char integrator[100];
        seen s = {.turning = w};
        snprintf(integrator, sizeof integrator, "'method': '%s', 'dt': %.17g", method,
                 strcmp(method, "verlet") == 0 ? step / 64 : step);
        scoped_host h = open_scene(
            SHEET, "", "{'edge': 'top', 'attach': 'mover'}", integrator,
            "'colliders': [{'name': 'mover', 'type': 'sphere', 'center': [0.25, 0.3, 0], 'radius': 0.01, "
            "'enabled': false, 'track': [[0, [0, 0, 0]], [1, [0.4, 0.2, 0]]], "
            "'turns': [{'time': 0, 'rotate': [0, 1, 0, 0]}, {'time': 1, 'rotate': [0, 1, 0, 120]}]}],");
        for (int k = 0; k < 5; k++)
            ck_assert_double_le(velocity_error(drape_sim_velocities(h.sim) + 3 * k, at(&h, k), w), 1e-14);
        good(&h, drape_sim_observe(h.sim, watch, &s));
        good(&h, drape_sim_advance(h.sim, step));
        ck_assert_double_le(s.error[0], 1e-14);
        ck_assert_msg(s.error[1] <= w * w * 0.3 * step / 2, "%s: %g", method, s.error[1]);
    }
}

/* A pin of the scene that a host sends leaves the body; attached again, it rides from where it is. */
TEST(a_pin_that_is_sent_leaves_its_body)
{
    scoped_host h = open_sheet("be", "{'edge': 'top', 'attach': 'body'}");
    const int32_t node = 0;
    const double to[3] = {0, 0.05, 0};
    double from[3];
    ck_assert_int_eq(drape_sim_attached(h.sim, 0), 0);
    good(&h, drape_sim_move_pins(h.sim, 1, &node, 4 * FRAME, to, NULL));
    ck_assert_int_eq(drape_sim_attached(h.sim, 0), -1);
    send(&h, 4 * FRAME, 0, 0.1, 0);
    good(&h, drape_sim_advance(h.sim, 6 * FRAME));
    ck_assert_double_le(distance(at(&h, 0), to), 0);
    ck_assert_double_eq_tol(at(&h, 1)[1], 0.1, 1e-15);
    good(&h, drape_sim_attach(h.sim, 0, 1, &node, NULL)); /* contact has its memory from here on */
    const long calls = h.memory->calls;
    good(&h, drape_sim_attach(h.sim, 0, 1, &node, NULL));
    ck_assert_int_eq(h.memory->calls, calls);
    memcpy(from, to, sizeof from);
    from[1] -= 0.1; /* where it is on the body */
    send(&h, 4 * FRAME, 0.02, 0.1, -20);
    good(&h, drape_sim_advance(h.sim, 12 * FRAME));
    expect_on_body(&h, &node, 1, from, 0.02, 0.1, -20);
}

/* A host restores a run that it has attached nodes in, in the middle of the body's path, to the same bits. */
TEST(checkpoints_keep_what_is_attached)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host h = open_sheet(methods[i], "{'corner': 'top-left'}, {'corner': 'top-right', 'attach': "
                                               "'other'}"),
                    again = open_sheet(methods[i], "{'corner': 'top-left'}, {'corner': 'top-right', "
                                                   "'attach': 'other'}");
        const int32_t nodes[2] = {12, 0};
        good(&h, drape_sim_advance(h.sim, 4 * FRAME));
        good(&h, drape_sim_attach(h.sim, 0, 2, nodes, NULL));
        send(&h, 8 * FRAME, 0.02, 0.01, 20);
        good(&h, drape_sim_advance(h.sim, 7 * FRAME));
        scoped_bytes b = bytes_save(h.sim);
        good(&again, drape_sim_restore_from(again.sim, b.data, b.size));
        ck_assert_int_eq(drape_sim_attached(again.sim, 12), 0);
        ck_assert_int_eq(drape_sim_attached(again.sim, 4), 1);
        good(&h, drape_sim_advance(h.sim, 16 * FRAME));
        good(&again, drape_sim_advance(again.sim, 16 * FRAME));
        ck_assert_msg(drape_sim_hash(h.sim) == drape_sim_hash(again.sim), "%s", methods[i]);
    }
}

/* ---- Placed ---- */

static void place(host *h, bool cloth, bool body)
{
    static const int32_t zero = 0;
    drape_place_def def = place_def();
    def.rotate[1] = 1, def.rotate[3] = 90;
    def.translate[0] = 1;
    def.cloths = def.colliders = &zero;
    def.cloth_count = cloth;
    def.collider_count = body;
    good(h, drape_sim_place(h->sim, &def));
}

/* With its body, without it, and the body without the cloth: nothing is strained, and the pins ride on from
 * where they are. The body turns by 30 degrees about its pivot, and they with it. */
TEST(placed_cloth_rides_on)
{
    for (int kind = 1; kind < 4; kind++) {
        const bool cloth = kind & 1, body = kind & 2;
        scoped_host h = open_sheet("be", "{'edge': 'top', 'attach': 'body'}");
        double before[60], now[60], pivot[3], c = cos(acos(-1.0) / 6), s = sin(acos(-1.0) / 6), q[4];
        send(&h, 4 * FRAME, 0.02, 0.01, 10);
        good(&h, drape_sim_advance(h.sim, 8 * FRAME));
        memcpy(before, at(&h, 0), sizeof before);
        const double elastic = drape_sim_energy(h.sim).elastic;
        place(&h, cloth, body);
        memcpy(now, at(&h, 0), sizeof now);
        ck_assert_double_eq_tol(now[0], cloth ? 1 + before[2] : before[0], 1e-15);
        ck_assert_double_eq_tol(drape_sim_energy(h.sim).elastic, elastic, 1e-12);
        ck_assert_int_eq(drape_sim_attached(h.sim, 0), 0);
        ck_assert(drape_sim_collider_rotation(h.sim, 0, q, NULL, pivot));
        const double turn[4] = {q[0] * cos(acos(-1.0) / 12) - q[2] * sin(acos(-1.0) / 12), 0,
                                q[0] * sin(acos(-1.0) / 12) + q[2] * cos(acos(-1.0) / 12), 0};
        const drape_collider_motion motion = drape_sim_collider(h.sim, 0);
        good(&h, drape_sim_move_collider_pose(h.sim, 0, 8 * FRAME, motion.displacement, turn, NULL, NULL));
        good(&h, drape_sim_advance(h.sim, 16 * FRAME));
        for (int i = 0; i < 5; i++) {
            const double x = now[3 * i] - pivot[0], z = now[3 * i + 2] - pivot[2],
                         to[3] = {pivot[0] + c * x + s * z, now[3 * i + 1], pivot[2] + c * z - s * x};
            ck_assert_double_le(distance(at(&h, i), to), 1e-14);
        }
    }
}

static double strain_of(const host *h)
{
    double largest = 0;
    for (int32_t e = 0; e < 15; e++) { /* along the columns, at rest 0.125 m */
        const double *a = at(h, e), *b = at(h, e + 5);
        largest = fmax(largest, fabs(distance(a, b) / 0.125 - 1));
    }
    return largest;
}

/* Sent metres away in one frame, a body takes the cloth that hangs from it along. So does each of two
 * bodies that carry one cloth together, one after the other: by the best fit, whose rotation is within
 * 1e-6 of it. */
TEST(a_body_that_is_sent_far_takes_its_cloth_along)
{
    for (int bodies = 1; bodies <= 2; bodies++) {
        scoped_host h = open_sheet(
            "be", bodies == 1 ? "{'edge': 'top', 'attach': 'body'}"
                              : "{'corner': 'top-left', 'attach': 'body'}, {'corner': 'top-right', "
                                "'attach': 'other'}");
        const double far[3] = {3, 1, 2};
        double before[60];
        drape_sim_def def = sim_def();
        drape_sim_destroy(&h.sim);
        def.teleport_speed = 20;
        good(&h, drape_sim_create(h.ctx, h.model, &def, &h.sim));
        good(&h, drape_sim_advance(h.sim, 16 * FRAME));
        memcpy(before, at(&h, 0), sizeof before);
        const double strain = strain_of(&h);
        for (int b = 0; b < bodies; b++)
            good(&h, drape_sim_move_collider(h.sim, b, FRAME, far, NULL));
        for (int i = 0; i < 60; i++)
            ck_assert_double_eq_tol(at(&h, 0)[i], before[i] + far[i % 3], bodies == 1 ? 1e-14 : 1e-5);
        good(&h, drape_sim_advance(h.sim, 18 * FRAME));
        printf("# strain %.4f, then %.4f\n", strain, strain_of(&h));
        ck_assert_double_le(strain_of(&h), strain + 0.02);
    }
}

/* ---- Changed ---- */

/* A scene that no longer attaches a pin leaves it where it is; one that begins to takes it from there. */
TEST(changed_pins_ride_from_where_they_are)
{
    scoped_host h = open_sheet("be", "{'edge': 'top', 'attach': 'body'}");
    scoped_host fixed = open_sheet("be", "{'edge': 'top'}");
    double all[60], from[15];
    const int32_t top[5] = {0, 1, 2, 3, 4};
    send(&h, 4 * FRAME, 0.02, 0.01, 20);
    good(&h, drape_sim_advance(h.sim, 3 * FRAME));
    memcpy(all, at(&h, 0), sizeof all);
    good(&h, drape_sim_change_model(h.sim, fixed.model));
    ck_assert_int_eq(drape_sim_attached(h.sim, 0), -1);
    good(&h, drape_sim_advance(h.sim, 6 * FRAME));
    ck_assert_mem_eq(all, at(&h, 0), 15 * sizeof *all);
    good(&h, drape_sim_change_model(h.sim, h.model));
    ck_assert_int_eq(drape_sim_attached(h.sim, 0), 0);
    ck_assert_mem_eq(all, at(&h, 0), 15 * sizeof *all);
    /* the body is turned by 20 degrees now: where the nodes would be if it were not */
    for (int i = 0; i < 5; i++) {
        const double back[3] = {all[3 * i] - 0.02, all[3 * i + 1] - 0.01, all[3 * i + 2]};
        on_body(back, 0, 0, -20, from + 3 * i);
    }
    send(&h, 4 * FRAME, -0.05, 0, 45);
    good(&h, drape_sim_advance(h.sim, 12 * FRAME));
    expect_on_body(&h, top, 5, from, -0.05, 0, 45);
    drape_sim_destroy(&h.sim);
}

/* ---- A state that is set ---- */

TEST(a_state_has_its_pins_on_the_body)
{
    scoped_host h = open_sheet("be", "{'edge': 'top', 'attach': 'body'}");
    double x[60], v[60];
    send(&h, 4 * FRAME, 0.02, 0.01, 20);
    good(&h, drape_sim_advance(h.sim, 4 * FRAME));
    memcpy(x, at(&h, 0), sizeof x);
    memcpy(v, drape_sim_velocities(h.sim), sizeof v);
    good(&h, drape_sim_advance(h.sim, 8 * FRAME));
    good(&h, drape_sim_set_state(h.sim, 4 * FRAME, x, v));
    ck_assert_mem_eq(x, at(&h, 0), sizeof x);
    ck_assert_int_eq(drape_sim_attached(h.sim, 0), 0);
    x[0] += 0.01;
    says(&h, drape_sim_set_state(h.sim, 4 * FRAME, x, v), DRAPE_E_ARGUMENT, "node 0 of cloth0 is at");
}

/* ---- Refused ---- */

/* Each allocation fails once: then nothing has changed. */
TEST(without_memory_nothing_changes)
{
    scoped_host h = open_sheet("be", "{'edge': 'top', 'attach': 'body'}");
    const int32_t nodes[2] = {12, 0};
    good(&h, drape_sim_advance(h.sim, 4 * FRAME));
    for (int kind = 0; kind < 2; kind++) {
        const uint64_t hash = drape_sim_hash(h.sim);
        drape_status status = DRAPE_E_MEMORY;
        long n = 1;
        for (; status == DRAPE_E_MEMORY; n++) {
            h.memory->fail_at = h.memory->calls + n;
            status = kind == 0 ? drape_sim_attach(h.sim, 1, 2, nodes, NULL)
                               : drape_sim_detach(h.sim, 1, nodes + 1);
            h.memory->fail_at = 0;
            if (!status)
                break;
            ck_assert_int_eq(status, DRAPE_E_MEMORY);
            ck_assert(drape_sim_hash(h.sim) == hash);
            ck_assert_int_eq(drape_sim_attached(h.sim, 0), kind);
            ck_assert_int_eq(drape_sim_attached(h.sim, 12), kind ? 1 : -1);
        }
        good(&h, status);
        ck_assert_int_gt(n, 3);
    }
    good(&h, drape_sim_advance(h.sim, 8 * FRAME));
}
