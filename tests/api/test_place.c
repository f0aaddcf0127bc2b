/* test_place.c: cloth, pins and colliders that a host places elsewhere, by drape_sim_place or because it
 * sends pins faster than teleport_speed. */
#include <float.h>

#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64) /* [s], exact in binary */

/* The scene's sim under another integrator, with a teleport_speed. */
static void use(host *h, const char *method, double teleport_speed)
{
    drape_sim_def def = sim_def();
    def.integrator = method;
    def.dt = FRAME / 2;
    def.teleport_speed = teleport_speed;
    drape_sim_destroy(&h->sim);
    good(h, drape_sim_create(h->ctx, h->model, &def, &h->sim));
}

/* The largest edge strain of the triangles. */
static double strain_of(const host *h)
{
    double strain[2 * 1000], most = -1;
    const int32_t count = drape_model_triangle_count(h->model);
    ck_assert_int_le(count, 1000);
    drape_model_strain(h->model, drape_sim_positions(h->sim), strain);
    for (int32_t i = 0; i < 2 * count; i++)
        most = fmax(most, strain[i]);
    return most;
}

#define TRACK "'track': [[0, [0,0,0]], [1, [0.1,0,0.3]]]"
#define MOVING                                                                                               \
    "'colliders': [{'type': 'sphere', 'center': [0.25, -0.3, 0.16], 'radius': 0.1, 'friction': 0.3, "        \
    "'track': [[0, [0,0,0]], [1, [0,0,-0.6]]]}, {'type': 'plane', 'point': [0, -0.6, 0], 'normal': "         \
    "[0, 1, 0]}], 'contact': {'stiffness': 2000}, "

/* A sheet with a fixed pin, one on a track and one that the host moves, swept by a ball on a track. */
static host swept(const char *method)
{
    host h =
        open_scene(SHEET, "", "{'corner': 'top-left'}, {'corner': 'top-right', " TRACK "}, {'nodes': [2]}",
                   "'tolerance': 1e-9, 'rtol': 1e-7", MOVING);
    use(&h, method, 0);
    return h;
}

static void send(const host *h, int frame, const double to[3])
{
    const int32_t node = 2;
    good(h, drape_sim_move_pins(h->sim, 1, &node, FRAME, to, NULL));
    good(h, drape_sim_advance(h->sim, frame * FRAME));
}

/* A quarter turn about the vertical through c, then t: x = c_x + (z - c_z) + t_x, z = c_z - (x - c_x) +
 * t_z. */
static const double center[3] = {0.5, 0, -0.25}, shift[3] = {2, 0.5, -1};

static void quarter(const double x[3], double y[3])
{
    y[0] = center[0] + (x[2] - center[2]) + shift[0];
    y[1] = x[1] + shift[1];
    y[2] = center[2] - (x[0] - center[0]) + shift[2];
}

static drape_place_def quarter_def(void)
{
    drape_place_def def = place_def();
    const double rotate[4] = {0, 2, 0, 90};
    memcpy(def.rotate, rotate, sizeof def.rotate);
    memcpy(def.center, center, sizeof def.center);
    memcpy(def.translate, shift, sizeof def.translate);
    return def;
}

/*
 * Two sims of a swept sheet, one of which is placed a quarter turn elsewhere in the middle, the other where
 * it is: both start anew there. A quarter turn exchanges coordinates, so what follows is the same up to
 * rounding of coordinates of 3 m, 7e-16 m, and what contact of 2000 N/m and Newton's tolerance of 1e-9 N on
 * springs of 10 N/m make of it: 1e-10 m a step at most, over 16 steps; the tolerance of verlet's substeps
 * is as small. What stops short of convergence, newton_k, is compared by the same sums in
 * another order. dirk and ida choose each step by the estimated error of the one before, or by its matrices.
 * At this rtol the first steps have errors near rounding, which so shows in the sizes, until a step is made
 * that was rejected in the other sim: the motion is the same to the tolerance only, rtol times the sheet's
 * 0.6 m in each of 8 frames, and sqrt(60) times that where one of the 60 coordinates has all of the error.
 * rosenbrock takes differences of forces over 1e-4 of a step: it makes of the rounding of a turned collider,
 * 1e-15 m, forces of 1e-15 2e4/1e-4 N, which move a node of 2e-3 kg by 1e-9 m in a step of 3 ms; over some
 * 100 steps it may be 1e-7 m.
 */
TEST(a_placed_sim_goes_on_as_before)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host here = swept(methods[i]), there = swept(methods[i]);
        const drape_place_def nowhere = place_def(), def = quarter_def();
        double worst = 0;
        for (int f = 1; f <= 16; f++) {
            const double to[3] = {0.25, 0.01 * f, 0};
            double placed[3];
            quarter(to, placed);
            send(&here, f, to);
            send(&there, f, f <= 8 ? to : placed);
            if (f == 8) {
                const drape_energy before = drape_sim_energy(there.sim);
                good(&here, drape_sim_place(here.sim, &nowhere));
                good(&there, drape_sim_place(there.sim, &def));
                const drape_energy after = drape_sim_energy(there.sim);
                ck_assert_double_eq_tol(after.elastic, before.elastic, 1e-12 * before.elastic + 1e-15);
                ck_assert_double_eq_tol(after.kinetic, before.kinetic, 1e-12 * before.kinetic);
                ck_assert_double_eq_tol(after.contact, before.contact, 1e-9 * before.contact + 1e-15);
                ck_assert_double_eq_tol(after.numerical, before.numerical, 1e-12);
            }
            for (int n = 0; f >= 8 && n < 20; n++) {
                double expected[3];
                quarter(drape_sim_positions(here.sim) + 3 * n, expected);
                worst = fmax(worst, distance(expected, drape_sim_positions(there.sim) + 3 * n));
            }
        }
        printf("# %s: %.2g m apart\n", methods[i], worst);
        const bool adaptive = strcmp(methods[i], "dirk") == 0 || strcmp(methods[i], "ida") == 0;
        const bool differences = strcmp(methods[i], "rosenbrock") == 0;
        const double most = adaptive ? 8 * sqrt(60) * 0.6 * 1e-7 : differences ? 1e-7 : 1e-8;
        ck_assert_msg(worst <= most, "%s: %g m apart", methods[i], worst);
        ck_assert_double_gt(fabs(drape_sim_positions(here.sim)[3 * 17 + 2]), 0.01); /* the ball met it */
    }
}

/* Any rotation, about any axis: strain and elastic energy of cloth without colliders stay, velocities turn,
 * to rounding; placing it back by the opposite rotation restores it. */
TEST(any_rotation_keeps_the_strain)
{
    scoped_host h = open_scene(SHEET, "", "{'corner': 'top-left'}", "", "");
    double x[60], v[60];
    good(&h, drape_sim_advance(h.sim, 16 * FRAME));
    memcpy(x, drape_sim_positions(h.sim), sizeof x);
    memcpy(v, drape_sim_velocities(h.sim), sizeof v);
    const double strain = strain_of(&h), elastic = drape_sim_energy(h.sim).elastic,
                 gravity = drape_sim_energy(h.sim).gravity, numerical = drape_sim_energy(h.sim).numerical;
    drape_place_def def = place_def();
    const double rotate[4] = {1, -2, 0.5, 137};
    memcpy(def.rotate, rotate, sizeof rotate);
    def.center[0] = 0.3;
    good(&h, drape_sim_place(h.sim, &def));
    ck_assert_double_eq_tol(strain_of(&h), strain, 1e-12);
    ck_assert_double_eq_tol(drape_sim_energy(h.sim).elastic, elastic, 1e-11 * elastic);
    ck_assert_double_gt(fabs(drape_sim_energy(h.sim).gravity - gravity), 0.01 * fabs(gravity));
    ck_assert_double_eq_tol(drape_sim_energy(h.sim).numerical, numerical, 1e-12);
    def.rotate[3] = -137;
    good(&h, drape_sim_place(h.sim, &def));
    for (int i = 0; i < 60; i++) {
        ck_assert_double_eq_tol(drape_sim_positions(h.sim)[i], x[i], 100 * DBL_EPSILON);
        ck_assert_double_eq_tol(drape_sim_velocities(h.sim)[i], v[i], 1000 * DBL_EPSILON);
    }
    def.stop = true;
    good(&h, drape_sim_place(h.sim, &def));
    for (int i = 0; i < 60; i++)
        ck_assert(drape_sim_velocities(h.sim)[i] == 0);
    ck_assert_double_eq_tol(drape_sim_energy(h.sim).numerical, numerical, 1e-12);
}

#define SMALL(name)                                                                                          \
    "{'name': '" name                                                                                        \
    "', 'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.2, 'height': 0.2}, "                  \
    "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], "     \
    "'pins': [{'corner': 'top-left'}]}"

static host several(void)
{
    return open_scene("{'drape': 1, 'cloth': [" SMALL("a") ", " SMALL(
        "b") "], 'colliders': [{'type': 'box', "
             "'center': [9, 0, 0], 'size': [2, 1, 1], 'name': 'crate'}, {'type': 'sphere', 'center': "
             "[0, -5, 0], 'radius': 1}, {'type': 'capsule', 'a': [5, 1, 0], 'b': [5, 2, 0], 'radius': "
             "0.1}, "
             "{'type': 'cylinder', 'a': [6, 1, 0], 'b': [6, 2, 0], 'radius': 0.1}], "
             "'integrator': {'method': 'be'}, 'duration': 1}");
}

/* Only what is chosen moves; the rest keeps its bits. */
TEST(only_what_is_chosen_is_placed)
{
    scoped_host h = several();
    double x[54];
    const int32_t second = 1;
    drape_place_def def = place_def();
    def.translate[0] = 0.5;
    def.cloths = def.colliders = &second;
    def.cloth_count = 1;
    def.collider_count = 0;
    good(&h, drape_sim_advance(h.sim, 4 * FRAME));
    memcpy(x, drape_sim_positions(h.sim), sizeof x);
    good(&h, drape_sim_place(h.sim, &def));
    ck_assert(memcmp(drape_sim_positions(h.sim), x, 27 * sizeof *x) == 0);
    for (int i = 27; i < 54; i++)
        ck_assert(drape_sim_positions(h.sim)[i] == x[i] + (i % 3 == 0 ? 0.5 : 0));
    ck_assert(drape_sim_collider(h.sim, 1).displacement[0] == 0);
    def.cloth_count = 0;
    def.collider_count = 1;
    good(&h, drape_sim_place(h.sim, &def));
    ck_assert(drape_sim_collider(h.sim, 1).displacement[0] == 0.5 &&
              drape_sim_collider(h.sim, 0).displacement[0] == 0);
    good(&h, drape_sim_advance(h.sim, 8 * FRAME));
    ck_assert(drape_sim_positions(h.sim)[27] == x[27] + 0.5); /* the pin */
    /* a state may be set that has the pin where it was placed, and only there */
    double set[54], v[54] = {0};
    memcpy(set, drape_sim_positions(h.sim), sizeof set);
    good(&h, drape_sim_set_state(h.sim, 0, set, v));
    set[27] -= 0.5;
    ck_assert_int_eq(drape_sim_set_state(h.sim, 0, set, v), DRAPE_E_ARGUMENT);
}

/* Contact becomes stiffer when forces are read where cloth was placed a fiftieth of the contact distance
 * from a ball. That is work of whoever placed it, and no energy is lost by the integrator: what is numerical
 * stays, to rounding of the sum of all parts. */
TEST(forces_of_placed_cloth_keep_the_account)
{
    scoped_host h =
        open_scene(SHEET, "", "{'corner': 'top-left'}, {'corner': 'top-right'}", "'dt': 0.0078125",
                   "'colliders': [{'type': 'sphere', 'center': [0.25, -0.2, -1], 'radius': 0.1}], ");
    drape_place_def def = place_def();
    double force[3 * 20];
    def.translate[2] = -0.89998;
    def.collider_count = 0;
    good(&h, drape_sim_advance(h.sim, FRAME));
    const double numerical = drape_sim_energy(h.sim).numerical;
    good(&h, drape_sim_place(h.sim, &def));
    good(&h, drape_sim_contact_forces(h.sim, force));
    const drape_energy e = drape_sim_energy(h.sim);
    ck_assert_double_gt(e.contact, 0);
    ck_assert_double_eq_tol(e.numerical, numerical,
                            1e-14 * (e.contact + e.elastic + fabs(e.gravity) + e.kinetic));
}

/* A checkpoint has the placements: the restored sim continues with the same bits. */
TEST(a_checkpoint_keeps_placements)
{
    scoped_host h = swept("be"), other = swept("be");
    const drape_place_def def = quarter_def();
    good(&h, drape_sim_advance(h.sim, 4 * FRAME));
    good(&h, drape_sim_place(h.sim, &def));
    good(&h, drape_sim_advance(h.sim, 6 * FRAME));
    bytes b = bytes_save(h.sim);
    good(&other, drape_sim_restore_from(other.sim, b.data, b.size));
    free(b.data);
    good(&h, drape_sim_advance(h.sim, 12 * FRAME));
    good(&other, drape_sim_advance(other.sim, 12 * FRAME));
    ck_assert_uint_eq(drape_sim_hash(h.sim), drape_sim_hash(other.sim));
}

/* ---- Pins that are sent too fast ---- */

#define CAPE                                                                                                 \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 12, 'rows': 12, 'width': 1, 'height': "   \
    "1, "                                                                                                    \
    "'orientation': 'vertical'}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200}, "    \
    "'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'top'}]}], 'integrator': {'method': "        \
    "'newton_k', 'iterations': 2, 'dt': 0.015625}, 'duration': 10}"

enum { PINS = 12 };

/* Row 0 of the cape after its pins turned by an angle about the vertical through the origin, and moved. */
static void pose(const host *h, double angle, const double by[3], double *to)
{
    const double *rest = drape_model_rest_positions(h->model);
    for (int i = 0; i < PINS; i++) {
        to[3 * i] = cos(angle) * rest[3 * i] + sin(angle) * rest[3 * i + 2] + by[0];
        to[3 * i + 1] = rest[3 * i + 1] + by[1];
        to[3 * i + 2] = -sin(angle) * rest[3 * i] + cos(angle) * rest[3 * i + 2] + by[2];
    }
}

/* Pins that walk at 1 m/s are sent 2 m away and turned by a radian within a frame. */
static void walk(host *h, double *strain)
{
    int32_t nodes[PINS];
    double to[3 * PINS], by[3] = {0};
    for (int i = 0; i < PINS; i++)
        nodes[i] = i;
    for (int f = 1; f <= 67; f++) {
        by[0] += FRAME + (f == 65 ? 2 : 0);
        by[1] -= f == 65 ? 0.5 : 0;
        pose(h, f < 65 ? 0 : 1, by, to);
        good(h, drape_sim_move_pins(h->sim, PINS, nodes, FRAME, to, NULL));
        good(h, drape_sim_advance(h->sim, f * FRAME));
        if (f >= 64)
            strain[f - 64] = strain_of(h);
        for (int i = 0; i < 3 * PINS; i++)
            ck_assert(drape_sim_positions(h->sim)[i] == to[i]);
    }
}

/* Frames 65 to 67 have the strain of frame 64: the cloth hangs at its pins as before. Without teleport_speed
 * it is strained by more than a fifth. */
TEST(pins_that_are_sent_far_take_their_cloth_along)
{
    scoped_host h = open_scene(CAPE);
    double strain[4];
    use(&h, NULL, 20);
    walk(&h, strain);
    printf("# strain %.4f, then %.4f, %.4f, %.4f\n", strain[0], strain[1], strain[2], strain[3]);
    for (int f = 1; f < 4; f++)
        ck_assert_double_le(strain[f], strain[0] + 0.02);
    use(&h, NULL, 0);
    walk(&h, strain);
    printf("# without: strain %.4f, then %.4f, %.4f, %.4f\n", strain[0], strain[1], strain[2], strain[3]);
    ck_assert_double_gt(strain[3], 0.2);
}

/* A body under the cape, sent as far in the same frame, is there at once; both keep their contact, whichever
 * is sent first. */
TEST(colliders_that_are_sent_far_are_there)
{
    for (int first = 0; first < 2; first++) {
        scoped_host h =
            open_scene(SHEET, "", "{'edge': 'top'}", "'method': 'be', 'dt': 0.0078125",
                       "'colliders': [{'type': 'sphere', 'center': [0.25, -0.3, 0.09], 'radius': 0.1, "
                       "'friction': 0.3}], 'contact': {'stiffness': 2000, 'distance': 4e-3}, ");
        const double to[3] = {0, 0, 3}, speed[3] = {0, 0, 1};
        int32_t nodes[5];
        double pins[15], v[15];
        use(&h, NULL, 20);
        good(&h, drape_sim_advance(h.sim, 32 * FRAME));
        for (int i = 0; i < 15; i++) {
            nodes[i / 3] = i / 3;
            pins[i] = drape_sim_positions(h.sim)[i] + to[i % 3];
            v[i] = speed[i % 3];
        }
        const double strain = strain_of(&h);
        for (int k = 0; k < 2; k++)
            if (k == first)
                good(&h, drape_sim_move_pins(h.sim, 5, nodes, FRAME, pins, v));
            else
                good(&h, drape_sim_move_collider(h.sim, 0, FRAME, to, speed));
        ck_assert_double_eq_tol(drape_sim_collider(h.sim, 0).displacement[2], 3 - FRAME, 1e-12);
        ck_assert_double_eq_tol(drape_sim_positions(h.sim)[2], pins[2] - FRAME, 1e-9);
        good(&h, drape_sim_advance(h.sim, 33 * FRAME));
        ck_assert_double_eq_tol(drape_sim_collider(h.sim, 0).displacement[2], 3, 1e-12);
        ck_assert_double_le(strain_of(&h), strain + 0.05);
        ck_assert_int_eq(drape_sim_inside(h.sim, 0, NULL), 0);
    }
}

/* One pin, and pins on a line, leave rotations free: none is made about the pin, or about the line. */
TEST(a_free_rotation_is_not_made)
{
    scoped_host h = open_scene(SHEET, "", "{'corner': 'top-left'}", "", "");
    const int32_t node = 0;
    double x[60], to[3];
    use(&h, NULL, 20);
    good(&h, drape_sim_advance(h.sim, 16 * FRAME));
    memcpy(x, drape_sim_positions(h.sim), sizeof x);
    for (int k = 0; k < 3; k++)
        to[k] = x[k] + 4;
    good(&h, drape_sim_move_pins(h.sim, 1, &node, FRAME, to, NULL));
    for (int i = 0; i < 60; i++)
        ck_assert_double_eq_tol(drape_sim_positions(h.sim)[i], x[i] + 4, 20 * DBL_EPSILON);
    close_scene(&h);

    h = open_scene(CAPE);
    use(&h, NULL, 20);
    int32_t nodes[PINS];
    double row[3 * PINS], most = 0;
    const double by[3] = {0, 3, 0};
    for (int i = 0; i < PINS; i++)
        nodes[i] = i;
    pose(&h, 0, by, row);
    good(&h, drape_sim_move_pins(h.sim, PINS, nodes, FRAME, row, NULL));
    for (int i = 0; i < 3 * 144; i++)
        most = fmax(most,
                    fabs(drape_sim_positions(h.sim)[i] - drape_model_rest_positions(h.model)[i] - by[i % 3]));
    ck_assert_double_le(most,
                        1e-9); /* rounding of the products, 1e-16, over the share 1e-6 against rotations */
}

/* ---- Refusals ---- */

/* Two cloths of 9 nodes each, with the pins 0 and 1. The first is sent 100 m away, the second so far that its
 * nodes would be beyond the limit although the pin is not. Colliders are sent beyond it by what they would
 * have covered at their own velocity. */
static void send_wrongly(host *h)
{
    const drape_status e = DRAPE_E_ARGUMENT;
    const int32_t pins[2] = {0, 9}, free_node[2] = {0, 8}, nowhere[2] = {0, 99};
    const double near[6] = {0, 0, 0, 0, 0, 0}, far[6] = {100, 0, 0, 1e9, 0, 0},
                 none[6] = {0, 0, 0, 0, NAN, 0}, beyond[6] = {0, 0, 0, 2e9, 0, 0}, fast[3] = {-1e9, 0, 0};
    says(h, drape_sim_move_pins(h->sim, 2, free_node, 1, near, NULL), e, "is free");
    says(h, drape_sim_move_pins(h->sim, 2, nowhere, 1, near, NULL), e, "node 99");
    says(h, drape_sim_move_pins(h->sim, 2, pins, 0, near, NULL), e, "seconds = 0");
    says(h, drape_sim_move_pins(h->sim, 2, pins, 1, none, NULL), e, "position and velocity of node 9");
    says(h, drape_sim_move_pins(h->sim, 2, pins, 1, near, none), e, "position and velocity of node 9");
    says(h, drape_sim_move_pins(h->sim, 2, pins, 1, beyond, NULL), e, "position and velocity of node 9");
    says(h, drape_sim_move_pins(h->sim, 2, pins, 1, far, NULL), e, "of b would be beyond");
    for (int32_t c = 0; c < 4; c++) {
        says(h, drape_sim_move_collider(h->sim, c, 0, near, NULL), e, "seconds = 0");
        says(h, drape_sim_move_collider(h->sim, c, 1, none + 3, NULL), e, "displacement and velocity");
        says(h, drape_sim_move_collider(h->sim, c, 1, near, none + 3), e, "displacement and velocity");
        says(h, drape_sim_move_collider(h->sim, c, 1, beyond + 3, NULL), e, "displacement and velocity");
        says(h, drape_sim_move_collider(h->sim, c, 2, far, fast), e, "would be beyond");
    }
    drape_place_def def = place_def();
    def.translate[0] = 1e9;
    says(h, drape_sim_place(h->sim, &def), e, "would be beyond");
    def.collider_count = 0;
    says(h, drape_sim_place(h->sim, &def), e, "would be beyond");
}

/* After a step, whose beginning is kept for the frames within it, all that a checkpoint contains is the same
 * byte for byte. */
TEST(what_is_sent_wrongly_changes_nothing)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host h = several();
        const int32_t node = 0;
        const double at[3] = {0.01, 0, 0};
        use(&h, methods[i], 20);
        good(&h, drape_sim_move_pins(h.sim, 1, &node, 1, at, NULL));
        for (int32_t c = 0; c < 4; c++)
            good(&h, drape_sim_move_collider(h.sim, c, 1, at, NULL));
        good(&h, drape_sim_advance(h.sim, 3.3 * FRAME));
        scoped_bytes before = bytes_save(h.sim);
        send_wrongly(&h);
        scoped_bytes after = bytes_save(h.sim);
        ck_assert_uint_eq(before.size, after.size);
        ck_assert_msg(memcmp(before.data, after.data, before.size) == 0, "%s", methods[i]);
    }
}
