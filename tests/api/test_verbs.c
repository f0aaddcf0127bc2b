/* test_verbs.c: all functions that change, move or read a running sim, alike: wrong arguments are refused
 * with one line that names the function, and leave every byte of a checkpoint as it was; NULL in place of a
 * sim is refused; an observer may not change the sim, and may read all of it. */
#include <stdlib.h>

#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64)

/* A sheet on a ball, which is collider 0; collider 1 is a mesh that deforms, and is far below. Node 0 is
 * pinned, node 7 is free; there are 20. */
static host open_sheet(failing_allocator *memory, const char *method)
{
    char rest[1024];
    const char *source = getenv("DRAPE_SOURCE");
    ck_assert_ptr_nonnull(source);
    snprintf(rest, sizeof rest,
             "'colliders': [{'type': 'sphere', 'center': [0.25, 0.1, 0.12], 'radius': 0.1, 'name': 'ball'}, "
             "{'type': 'animated_mesh', 'file': '%s/examples/scenes/limb.obj', 'translate': [0, -5, 0], "
             "'name': 'limb'}], 'self_contact': {'thickness': 0.01}, ",
             source);
    char integrator[100];
    snprintf(integrator, sizeof integrator, "'method': '%s'", method);
    host h = open_scene(memory, SHEET, "", "{'edge': 'top'}", integrator, rest);
    good(&h, drape_sim_advance(h.sim, 2 * FRAME));
    return h;
}

/* ---- What is wrong ---- */

/* What calls need; `nan` has a number that is not finite. */
static const double zero[60], one[3] = {1, 1, 1}, nan_[60] = {NAN}, far[60] = {2e9}, spin[3] = {1e9, 0, 0},
                              same[4] = {1, 0, 0, 0}, long_[4] = {100, 0, 0, 0};
static const int32_t pin = 0, node = 7, out = 20, under = -1;
static double forces[60];
static drape_hit hit;
static int32_t counted;

static drape_status place_with(drape_sim *sim, void (*edit)(drape_place_def *))
{
    drape_place_def def;
    drape_place_def_init(&def, sizeof def);
    edit(&def);
    return drape_sim_place(sim, &def);
}

static void no_axis(drape_place_def *def)
{
    def->rotate[3] = 90;
}

static void not_finite(drape_place_def *def)
{
    def->translate[1] = NAN;
}

static void too_far(drape_place_def *def)
{
    def->translate[1] = 2e9;
}

static void no_cloth(drape_place_def *def)
{
    def->cloths = &out, def->cloth_count = 1;
}

static void no_collider(drape_place_def *def)
{
    def->colliders = &out, def->collider_count = 1;
}

static void no_list(drape_place_def *def)
{
    def->cloth_count = 1;
}

static drape_status untangle_with(drape_sim *sim, int sweeps, double gap)
{
    drape_untangle_def def;
    drape_untangle_def_init(&def, sizeof def);
    def.sweeps = sweeps, def.gap = gap;
    return drape_sim_untangle(sim, &def, NULL);
}

static drape_status spring(drape_sim *sim, int32_t at, double stiffness, const double *target)
{
    return drape_sim_set_drag_spring(sim, at, stiffness, target);
}

static drape_status mass(drape_sim *sim, int32_t at, double kilograms)
{
    return drape_sim_set_masses(sim, 1, &at, &kilograms);
}

static drape_status write_nothing(void *user, const void *data, size_t size)
{
    (void)user, (void)data, (void)size;
    return DRAPE_E_FILE;
}

/* One wrong call: as an expression of `sim`. */
#define WRONG(name, call)                                                                                    \
    static drape_status name(drape_sim *sim)                                                                 \
    {                                                                                                        \
        return call;                                                                                         \
    }

WRONG(change_null, drape_sim_change(sim, NULL))
WRONG(change_model_null, drape_sim_change_model(sim, NULL))
WRONG(pin_none, drape_sim_pin(sim, 1, &out))
WRONG(pin_count, drape_sim_pin(sim, -1, &node))
WRONG(unpin_none, drape_sim_unpin(sim, 1, &under))
WRONG(unpin_list, drape_sim_unpin(sim, 1, NULL))
WRONG(masses_none, mass(sim, out, 1))
WRONG(masses_zero, mass(sim, node, 0))
WRONG(masses_nan, mass(sim, node, NAN))
WRONG(masses_list, drape_sim_set_masses(sim, 1, &node, NULL))
WRONG(attach_none, drape_sim_attach(sim, 2, 1, &node, NULL))
WRONG(attach_node, drape_sim_attach(sim, 0, 1, &out, NULL))
WRONG(attach_rigid, drape_sim_attach(sim, 0, 1, &node, &pin))
WRONG(attach_triangle, drape_sim_attach(sim, 1, 1, &node, &under))
WRONG(detach_free, drape_sim_detach(sim, 1, &node))
WRONG(detach_pin, drape_sim_detach(sim, 1, &pin))
WRONG(spring_none, spring(sim, out, 1, zero))
WRONG(spring_pin, spring(sim, pin, 1, zero))
WRONG(spring_soft, spring(sim, node, -1, zero))
WRONG(spring_nan, spring(sim, node, NAN, zero))
WRONG(spring_target, spring(sim, node, 1, nan_))
WRONG(spring_null, spring(sim, node, 1, NULL))
WRONG(springs_many, drape_sim_set_drag_springs(sim, 65, &node, one, zero))
WRONG(springs_list, drape_sim_set_drag_springs(sim, 1, NULL, one, zero))
WRONG(springs_count, drape_sim_set_drag_springs(sim, -1, &node, one, zero))
WRONG(place_null, drape_sim_place(sim, NULL))
WRONG(place_axis, place_with(sim, no_axis))
WRONG(place_nan, place_with(sim, not_finite))
WRONG(place_far, place_with(sim, too_far))
WRONG(place_cloth, place_with(sim, no_cloth))
WRONG(place_collider, place_with(sim, no_collider))
WRONG(place_list, place_with(sim, no_list))
WRONG(untangle_sweeps, untangle_with(sim, 0, 0.5))
WRONG(untangle_gap, untangle_with(sim, 10, NAN))
WRONG(move_pins_free, drape_sim_move_pins(sim, 1, &node, FRAME, zero, NULL))
WRONG(move_pins_none, drape_sim_move_pins(sim, 1, &out, FRAME, zero, NULL))
WRONG(move_pins_seconds, drape_sim_move_pins(sim, 1, &pin, 0, zero, NULL))
WRONG(move_pins_nan, drape_sim_move_pins(sim, 1, &pin, FRAME, nan_, NULL))
WRONG(move_none, drape_sim_move_collider(sim, 2, FRAME, zero, NULL))
WRONG(move_far, drape_sim_move_collider(sim, 0, FRAME, far, NULL))
WRONG(pose_none, drape_sim_move_collider_pose(sim, -1, FRAME, zero, same, NULL, NULL))
WRONG(pose_length, drape_sim_move_collider_pose(sim, 0, FRAME, zero, long_, NULL, NULL))
WRONG(pose_null, drape_sim_move_collider_pose(sim, 0, FRAME, zero, NULL, NULL, NULL))
WRONG(pose_alone, drape_sim_move_collider_pose(sim, 0, FRAME, zero, same, zero, NULL))
WRONG(pose_spin, drape_sim_move_collider_pose(sim, 0, FRAME, zero, same, zero, spin))
WRONG(deform_rigid, drape_sim_deform_collider(sim, 0, FRAME, 1, zero, NULL))
WRONG(deform_points, drape_sim_deform_collider(sim, 1, FRAME, 1, zero, NULL))
WRONG(deform_none, drape_sim_deform_collider(sim, 5, FRAME, 1, zero, NULL))
WRONG(points_rigid, drape_sim_collider_points(sim, 0, forces, NULL))
WRONG(points_null, drape_sim_collider_points(sim, 1, NULL, NULL))
WRONG(push_nan, drape_sim_push(sim, nan_))
WRONG(state_null, drape_sim_set_state(sim, 0, NULL, NULL))
WRONG(state_nan, drape_sim_set_state(sim, 0, nan_, zero))
WRONG(state_pin, drape_sim_set_state(sim, 0, far, zero))
WRONG(closest_what, drape_sim_closest(sim, 0, 1, zero, 1, &hit))
WRONG(closest_null, drape_sim_closest(sim, 1, 1, NULL, 1, &hit))
WRONG(closest_within, drape_sim_closest(sim, 1, 1, zero, -1, &hit))
WRONG(closest_nan, drape_sim_closest(sim, 1, 1, nan_, 1, &hit))
WRONG(cast_still, drape_sim_cast(sim, 1, 1, zero, zero, 1, &hit))
WRONG(cast_null, drape_sim_cast(sim, 1, 1, zero, one, 1, NULL))
WRONG(cast_far, drape_sim_cast(sim, 1, 1, zero, one, INFINITY, &hit))
WRONG(contacts_room, drape_sim_contacts(sim, -1, NULL, &counted))
WRONG(contacts_null, drape_sim_contacts(sim, 0, NULL, NULL))
WRONG(forces_null, drape_sim_contact_forces(sim, NULL))
WRONG(reactions_null, drape_sim_reactions(sim, NULL))
WRONG(force_null, drape_sim_collider_force(sim, 0, NULL))
WRONG(force_none, drape_sim_collider_force(sim, 2, forces))
WRONG(torque_null, drape_sim_collider_torque(sim, 0, NULL, NULL))
WRONG(torque_none, drape_sim_collider_torque(sim, 2, NULL, forces))
WRONG(torque_nan, drape_sim_collider_torque(sim, 0, nan_, forces))
WRONG(save_null, drape_sim_save(sim, NULL))
WRONG(save_to_null, drape_sim_save_to(sim, NULL, NULL))
WRONG(restore_null, drape_sim_restore_from(sim, NULL, 0))
WRONG(restore_path, drape_sim_restore(sim, NULL))
WRONG(advance_nan, drape_sim_advance(sim, NAN))
WRONG(realtime_frame, drape_sim_advance_realtime(sim, 0, 1, NULL))
WRONG(realtime_budget, drape_sim_advance_realtime(sim, FRAME, -1, NULL))
WRONG(observe_null, drape_sim_observe(sim, NULL, NULL))
WRONG(event_null, drape_sim_add_event(sim, NULL, NULL, NULL))

/* What else the message says: the argument that is wrong. */
static const struct wrong {
    const char *says;
    drape_status (*call)(drape_sim *sim);
} wrongs[] = {{"drape_sim_change: the scene is NULL", change_null},
              {"drape_sim_change_model: the model is NULL", change_model_null},
              {"drape_sim_pin: node 20; there are 0 to 19", pin_none},
              {"drape_sim_pin: -1 nodes", pin_count},
              {"drape_sim_unpin: node -1", unpin_none},
              {"drape_sim_unpin: 1 nodes, but no list", unpin_list},
              {"drape_sim_set_masses: node 20", masses_none},
              {"drape_sim_set_masses: mass of node 7 = 0 kg", masses_zero},
              {"drape_sim_set_masses: mass of node 7 = nan", masses_nan},
              {"drape_sim_set_masses: 1 nodes, but no list", masses_list},
              {"drape_sim_attach: collider 2", attach_none},
              {"drape_sim_attach: node 20", attach_node},
              {"drape_sim_attach:", attach_rigid},
              {"drape_sim_attach:", attach_triangle},
              {"drape_sim_detach: no collider carries node 7", detach_free},
              {"drape_sim_detach: no collider carries node 0", detach_pin},
              {"drape_sim_set_drag_spring: node 20", spring_none},
              {"drape_sim_set_drag_spring: node 0 is pinned", spring_pin},
              {"drape_sim_set_drag_spring: stiffness = -1", spring_soft},
              {"drape_sim_set_drag_spring: stiffness = nan", spring_nan},
              {"drape_sim_set_drag_spring: the target", spring_target},
              {"drape_sim_set_drag_spring:", spring_null},
              {"drape_sim_set_drag_springs: 65", springs_many},
              {"drape_sim_set_drag_springs:", springs_list},
              {"drape_sim_set_drag_springs: -1", springs_count},
              {"drape_sim_place: the def is NULL", place_null},
              {"drape_sim_place: the axis of a rotation", place_axis},
              {"drape_sim_place: rotation, center and translation", place_nan},
              {"drape_sim_place:", place_far},
              {"drape_sim_place: cloth 20", place_cloth},
              {"drape_sim_place: collider 20", place_collider},
              {"drape_sim_place: 1 cloths, but no list", place_list},
              {"drape_sim_untangle: sweeps = 0", untangle_sweeps},
              {"drape_sim_untangle: gap = nan", untangle_gap},
              {"drape_sim_move_pins: node 7 is free", move_pins_free},
              {"drape_sim_move_pins: node 20", move_pins_none},
              {"drape_sim_move_pins: seconds = 0", move_pins_seconds},
              {"drape_sim_move_pins: position and velocity of node 0", move_pins_nan},
              {"drape_sim_move_collider: collider 2", move_none},
              {"drape_sim_move_collider: displacement", move_far},
              {"drape_sim_move_collider_pose: collider -1", pose_none},
              {"drape_sim_move_collider_pose: the rotation has length", pose_length},
              {"drape_sim_move_collider_pose: the rotation is NULL", pose_null},
              {"drape_sim_move_collider_pose: velocity and angular velocity", pose_alone},
              {"drape_sim_move_collider_pose: angular_velocity[0] = 1e+09", pose_spin},
              {"drape_sim_deform_collider: collider 0 is a sphere", deform_rigid},
              {"drape_sim_deform_collider: 1 points; limb has 380", deform_points},
              {"drape_sim_deform_collider: collider 5", deform_none},
              {"drape_sim_collider_points: collider 0 is a sphere", points_rigid},
              {"drape_sim_collider_points:", points_null},
              {"drape_sim_push:", push_nan},
              {"drape_sim_set_state:", state_null},
              {"drape_sim_set_state:", state_nan},
              {"drape_sim_set_state:", state_pin},
              {"drape_sim_closest: what = 0", closest_what},
              {"drape_sim_closest: 1 points, but no array", closest_null},
              {"drape_sim_closest:", closest_within},
              {"drape_sim_closest:", closest_nan},
              {"drape_sim_cast:", cast_still},
              {"drape_sim_cast: 1", cast_null},
              {"drape_sim_cast:", cast_far},
              {"drape_sim_contacts:", contacts_room},
              {"drape_sim_contacts:", contacts_null},
              {"drape_sim_contact_forces:", forces_null},
              {"drape_sim_reactions:", reactions_null},
              {"drape_sim_collider_force:", force_null},
              {"drape_sim_collider_force: collider 2", force_none},
              {"drape_sim_collider_torque:", torque_null},
              {"drape_sim_collider_torque: collider 2", torque_none},
              {"drape_sim_collider_torque:", torque_nan},
              {"drape_sim_save:", save_null},
              {"drape_sim_save_to:", save_to_null},
              {"drape_sim_restore_from:", restore_null},
              {"drape_sim_restore:", restore_path},
              {"drape_sim_advance:", advance_nan},
              {"drape_sim_advance_realtime: frame_dt = 0", realtime_frame},
              {"drape_sim_advance_realtime: budget", realtime_budget},
              {"drape_sim_observe: the function is NULL", observe_null},
              {"drape_sim_add_event:", event_null}};
enum { WRONGS = sizeof wrongs / sizeof *wrongs };

/* ---- Refusals ---- */

static void expect_as_before(const host *h, const bytes *before, const char *what)
{
    const bytes after = bytes_save(h->sim);
    ck_assert_msg(before->size == after.size && memcmp(before->data, after.data, after.size) == 0, "%s",
                  what);
    free(after.data);
}

START_TEST(wrong_calls_change_nothing)
{
    failing_allocator memory = {0};
    host h = open_sheet(&memory, "be");
    const bytes before = bytes_save(h.sim);
    for (int i = 0; i < WRONGS; i++) {
        drape_context_set_message(h.ctx, "%s", "");
        const drape_status status = wrongs[i].call(h.sim);
        const char *said = drape_context_message(h.ctx);
        ck_assert_msg(status == DRAPE_E_ARGUMENT, "%s: %s: %s", wrongs[i].says, drape_status_name(status),
                      said);
        ck_assert_msg(strncmp(said, wrongs[i].says, strlen(wrongs[i].says)) == 0, "\"%s\" does not begin: %s",
                      wrongs[i].says, said);
        ck_assert_msg(!strchr(said, '\n'), "%s", said);
        expect_as_before(&h, &before, wrongs[i].says);
    }
    ck_assert_int_eq(drape_sim_save_to(h.sim, write_nothing, NULL), DRAPE_E_FILE);
    expect_as_before(&h, &before, "a save that fails");
    free(before.data);
    good(&h, drape_sim_advance(h.sim, 4 * FRAME));
    close_scene(&h, &memory);
}
END_TEST

START_TEST(no_sim_is_refused)
{
    drape_untangling report;
    drape_place_def def;
    drape_place_def_init(&def, sizeof def);
    for (int i = 0; i < WRONGS; i++)
        ck_assert_msg(wrongs[i].call(NULL) == DRAPE_E_ARGUMENT, "%s", wrongs[i].says);
    ck_assert_int_eq(drape_sim_place(NULL, &def), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_attached(NULL, 0), -1);
    ck_assert_int_eq(drape_sim_inside(NULL, 0, NULL), -1);
    ck_assert_int_eq((int)drape_sim_intersections(NULL, -1), -1);
    ck_assert_int_eq(drape_sim_relaxed(NULL, 0, NULL), 0);
    ck_assert_int_eq(drape_sim_seam(NULL, 0, NULL), 0);
    ck_assert(!drape_sim_untangling(NULL, &report, NULL));
    ck_assert(!drape_sim_collider_rotation(NULL, 0, forces, NULL, NULL));
    ck_assert_str_eq(drape_sim_collider(NULL, 0).name, "");
    ck_assert_ptr_null(drape_sim_positions(NULL));
    ck_assert_int_eq(drape_model_collider_points(NULL, 0), -1);
    drape_sim_drag_spring_force(NULL, forces);
    drape_sim_normals(NULL, forces);
    drape_sim_energy_density(NULL, forces);
    drape_embedding_carry(NULL, zero, NULL, NULL);
    drape_embedding_destroy(NULL);
}
END_TEST

/* ---- Observers ---- */

WRONG(right_pin, drape_sim_pin(sim, 1, &node))
WRONG(right_unpin, drape_sim_unpin(sim, 1, &pin))
WRONG(right_mass, mass(sim, node, 1))
WRONG(right_attach, drape_sim_attach(sim, 0, 1, &node, NULL))
WRONG(right_spring, spring(sim, node, 1, zero))
WRONG(right_springs, drape_sim_set_drag_springs(sim, 0, NULL, NULL, NULL))
WRONG(right_model, drape_sim_change_model(sim, drape_sim_model(sim)))
WRONG(right_untangle, drape_sim_untangle(sim, NULL, NULL))
WRONG(right_pins, drape_sim_move_pins(sim, 1, &pin, FRAME, zero, NULL))
WRONG(right_move, drape_sim_move_collider(sim, 0, FRAME, zero, NULL))
WRONG(right_pose, drape_sim_move_collider_pose(sim, 0, FRAME, zero, same, NULL, NULL))
WRONG(right_push, drape_sim_push(sim, zero))
WRONG(right_wind, drape_sim_set_wind(sim, NULL, NULL))
WRONG(right_advance, drape_sim_advance(sim, 1))
WRONG(right_realtime, drape_sim_advance_realtime(sim, FRAME, 1, NULL))
WRONG(right_state, drape_sim_set_state(sim, 0, drape_sim_positions(sim), drape_sim_velocities(sim)))

static drape_status right_place(drape_sim *sim)
{
    drape_place_def def;
    drape_place_def_init(&def, sizeof def);
    return drape_sim_place(sim, &def);
}

static drape_status right_deform(drape_sim *sim)
{
    static double points[3 * 380];
    ck_assert_int_eq(drape_sim_collider_points(sim, 1, points, NULL), DRAPE_OK);
    return drape_sim_deform_collider(sim, 1, FRAME, 380, points, NULL);
}

static drape_status (*const changes[])(drape_sim *) = {
    right_pin,   right_unpin, right_mass,     right_attach,  right_spring,   right_springs,
    right_model, right_place, right_pins,     right_move,    right_pose,     right_deform,
    right_push,  right_wind,  right_untangle, right_advance, right_realtime, right_state};

static drape_status watch(void *user, const drape_event *event)
{
    const host *h = user;
    drape_sim *sim = event->sim;
    drape_contact_point contact;
    drape_warning warning;
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++)
        says(h, changes[i](sim), DRAPE_E_ARGUMENT, "an observer must not call it");
    good(h, drape_sim_closest(sim, DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS, 1, zero, 1, &hit));
    good(h, drape_sim_cast(sim, DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS, 1, zero, one, 1, &hit));
    good(h, drape_sim_contacts(sim, 1, &contact, &counted));
    good(h, drape_sim_contact_forces(sim, forces));
    good(h, drape_sim_reactions(sim, forces));
    good(h, drape_sim_collider_force(sim, 0, forces));
    good(h, drape_sim_collider_torque(sim, 0, NULL, forces));
    ck_assert_int_ge(drape_sim_inside(sim, 0, NULL), 0);
    ck_assert_int_ge((int)drape_sim_intersections(sim, -1), 0);
    drape_sim_normals(sim, forces);
    drape_sim_energy(sim);
    drape_sim_energy_density(sim, forces);
    drape_sim_warning(sim, 0, &warning);
    free(bytes_save(sim).data);
    return DRAPE_OK;
}

START_TEST(observers_read_and_change_nothing)
{
    failing_allocator memory = {0}, other = {0};
    host h = open_sheet(&memory, "be"), alone = open_sheet(&other, "be");
    good(&h, drape_sim_observe(h.sim, watch, &h));
    good(&h, drape_sim_advance(h.sim, 8 * FRAME));
    good(&alone, drape_sim_advance(alone.sim, 8 * FRAME));
    ck_assert(drape_sim_hash(h.sim) == drape_sim_hash(alone.sim));
    close_scene(&h, &memory);
    close_scene(&alone, &other);
}
END_TEST

/* ---- Embeddings ---- */

START_TEST(wrong_embeddings)
{
    failing_allocator memory = {0};
    host h = open_sheet(&memory, "be");
    const float vertex[3] = {0, 0, 0}, bad[3] = {NAN, 0, 0};
    drape_embedding *mesh = NULL;
    const drape_status e = DRAPE_E_ARGUMENT;
    says(&h, drape_embedding_create(h.ctx, NULL, 0, 1, vertex, NULL, &mesh), e, "drape_embedding_create:");
    says(&h, drape_embedding_create(h.ctx, h.model, 1, 1, vertex, NULL, &mesh), e, "cloth 1");
    says(&h, drape_embedding_create(h.ctx, h.model, 0, -1, vertex, NULL, &mesh), e,
         "drape_embedding_create:");
    says(&h, drape_embedding_create(h.ctx, h.model, 0, 1, NULL, NULL, &mesh), e, "drape_embedding_create:");
    says(&h, drape_embedding_create(h.ctx, h.model, 0, 1, bad, NULL, &mesh), e, "finite");
    says(&h, drape_embedding_create(h.ctx, h.model, 0, 1, vertex, bad, &mesh), e, "finite");
    says(&h, drape_embedding_create(h.ctx, h.model, 0, 1, vertex, NULL, NULL), e, "drape_embedding_create:");
    ck_assert_ptr_null(mesh);
    ck_assert_int_eq(drape_embedding_create(NULL, h.model, 0, 1, vertex, NULL, &mesh), e);
    close_scene(&h, &memory);
}
END_TEST

SUITE("verbs", wrong_calls_change_nothing, no_sim_is_refused, observers_read_and_change_nothing,
      wrong_embeddings)
