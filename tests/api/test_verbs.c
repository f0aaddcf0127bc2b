/* test_verbs.c: all functions that change, move or read a running sim, alike: wrong arguments are refused
 * with one line that names the function, and leave every byte of a checkpoint as it was; an observer may
 * not change the sim, and may read all of it. */
#include <stdlib.h>

#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64)

/* A sheet on a ball, which is collider 0; collider 1 is a mesh that deforms, and is far below. Node 0 is
 * pinned, node 7 is free; there are 20. */
static host open_sheet(const char *method)
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
    host h = open_scene(SHEET, "", "{'edge': 'top'}", integrator, rest);
    good(&h, drape_sim_advance(h.sim, 2 * FRAME));
    return h;
}

/* ---- What is wrong ---- */

/* What calls need; `nan` has a number that is not finite. */
static const double zero[60], one[3] = {1, 1, 1}, nan_[60] = {NAN}, far[60] = {2e9}, spin[3] = {1e9, 0, 0},
                              same[4] = {1, 0, 0, 0}, twice[4] = {1.6, 0, 1.2, 0}, less[4] = {0.98, 0, 0, 0};
static const int32_t pin = 0, node = 7, out = 20, under = -1;
static double forces[60];
static drape_hit hit;
static int32_t counted;

static drape_status place_with(drape_sim *sim, void (*edit)(drape_place_def *))
{
    drape_place_def def = place_def();
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

static drape_status pose(drape_sim *sim, int32_t collider, const double *rotation, const double *velocity,
                         const double *spin_)
{
    return drape_sim_move_collider_pose(sim, collider, FRAME, zero, rotation, velocity, spin_);
}

static void calm(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    (void)user, (void)t, (void)count, (void)x, (void)wind, (void)gradient;
}

static drape_status write_nothing(void *user, const void *data, size_t size)
{
    (void)user, (void)data, (void)size;
    return DRAPE_E_FILE;
}

/* What is wrong, as an expression of `sim`, and what the message begins with. What is NULL is in api/null. */
#define WRONG(CALL)                                                                                          \
    CALL("drape_sim_pin: node 20; there are 0 to 19", drape_sim_pin(sim, 1, &out))                           \
    CALL("drape_sim_pin: -1 nodes", drape_sim_pin(sim, -1, &node))                                           \
    CALL("drape_sim_unpin: node -1", drape_sim_unpin(sim, 1, &under))                                        \
    CALL("drape_sim_set_masses: node 20; there are 0 to 19", mass(sim, out, 1))                              \
    CALL("drape_sim_set_masses: mass of node 7 = 0 kg", mass(sim, node, 0))                                  \
    CALL("drape_sim_set_masses: mass of node 7 = -1 kg", mass(sim, node, -1))                                \
    CALL("drape_sim_set_masses: mass of node 7 = nan", mass(sim, node, NAN))                                 \
    CALL("drape_sim_set_masses: mass of node 7 = inf", mass(sim, node, INFINITY))                            \
    CALL("drape_sim_set_masses: mass of node 7 = 2e+12", mass(sim, node, 2e12))                              \
    CALL("drape_sim_set_masses: -1 nodes, but no list of them", drape_sim_set_masses(sim, -1, &node, one))   \
    CALL("drape_sim_attach: collider 2; the model has 2", drape_sim_attach(sim, 2, 1, &node, NULL))          \
    CALL("drape_sim_attach: collider -1; the model has 2", drape_sim_attach(sim, -1, 1, &node, NULL))        \
    CALL("drape_sim_attach: node 20; there are 0 to 19", drape_sim_attach(sim, 0, 1, &out, NULL))            \
    CALL("drape_sim_attach: node -1; there are 0 to 19", drape_sim_attach(sim, 0, 1, &under, NULL))          \
    CALL("drape_sim_attach: -1 nodes", drape_sim_attach(sim, 0, -1, &node, NULL))                            \
    CALL("drape_sim_attach: triangles, but ball is a sphere, which is rigid",                                \
         drape_sim_attach(sim, 0, 1, &node, &pin))                                                           \
    CALL("drape_sim_attach:", drape_sim_attach(sim, 1, 1, &node, &under))                                    \
    CALL("drape_sim_detach: no collider carries node 7, which is free", drape_sim_detach(sim, 1, &node))     \
    CALL("drape_sim_detach: no collider carries node 0, which is pinned otherwise",                          \
         drape_sim_detach(sim, 1, &pin))                                                                     \
    CALL("drape_sim_detach: node 20; there are 0 to 19", drape_sim_detach(sim, 1, &out))                     \
    CALL("drape_sim_set_drag_spring: node 20", spring(sim, out, 1, zero))                                    \
    CALL("drape_sim_set_drag_spring: node -1", spring(sim, under, 1, zero))                                  \
    CALL("drape_sim_set_drag_spring: node 0 is pinned", spring(sim, pin, 1, zero))                           \
    CALL("drape_sim_set_drag_spring: stiffness = -1", spring(sim, node, -1, zero))                           \
    CALL("drape_sim_set_drag_spring: stiffness = nan", spring(sim, node, NAN, zero))                         \
    CALL("drape_sim_set_drag_spring: stiffness = inf", spring(sim, node, INFINITY, zero))                    \
    CALL("drape_sim_set_drag_spring: the target", spring(sim, node, 1, nan_))                                \
    CALL("drape_sim_set_drag_springs: 65", drape_sim_set_drag_springs(sim, 65, &node, one, zero))            \
    CALL("drape_sim_set_drag_springs: -1", drape_sim_set_drag_springs(sim, -1, &node, one, zero))            \
    CALL("drape_sim_place: the axis of a rotation", place_with(sim, no_axis))                                \
    CALL("drape_sim_place: rotation, center and translation must be finite", place_with(sim, not_finite))    \
    CALL("drape_sim_place:", place_with(sim, too_far))                                                       \
    CALL("drape_sim_place: cloth 20; the model has 1", place_with(sim, no_cloth))                            \
    CALL("drape_sim_place: collider 20; the model has 2", place_with(sim, no_collider))                      \
    CALL("drape_sim_place: 1 cloths, but no list of them", place_with(sim, no_list))                         \
    CALL("drape_sim_untangle: sweeps = 0", untangle_with(sim, 0, 0.5))                                       \
    CALL("drape_sim_untangle: gap = nan", untangle_with(sim, 10, NAN))                                       \
    CALL("drape_sim_move_pins: node 7 is free", drape_sim_move_pins(sim, 1, &node, FRAME, zero, NULL))       \
    CALL("drape_sim_move_pins: node 20; there are 0 to 19",                                                  \
         drape_sim_move_pins(sim, 1, &out, FRAME, zero, NULL))                                               \
    CALL("drape_sim_move_pins: node -1", drape_sim_move_pins(sim, 1, &under, FRAME, zero, NULL))             \
    CALL("drape_sim_move_pins: -1 nodes", drape_sim_move_pins(sim, -1, &pin, FRAME, zero, NULL))             \
    CALL("drape_sim_move_pins: seconds = 0", drape_sim_move_pins(sim, 1, &pin, 0, zero, NULL))               \
    CALL("drape_sim_move_pins: seconds = nan", drape_sim_move_pins(sim, 1, &pin, NAN, zero, NULL))           \
    CALL("drape_sim_move_pins: seconds = 1e-300", drape_sim_move_pins(sim, 1, &pin, 1e-300, zero, NULL))     \
    CALL("drape_sim_move_pins: position and velocity of node 0",                                             \
         drape_sim_move_pins(sim, 1, &pin, FRAME, nan_, NULL))                                               \
    CALL("drape_sim_move_pins: position and velocity of node 0",                                             \
         drape_sim_move_pins(sim, 1, &pin, FRAME, far, NULL))                                                \
    CALL("drape_sim_move_pins: position and velocity of node 0",                                             \
         drape_sim_move_pins(sim, 1, &pin, FRAME, zero, nan_))                                               \
    CALL("drape_sim_move_collider: collider 2; the model has 2",                                             \
         drape_sim_move_collider(sim, 2, FRAME, zero, NULL))                                                 \
    CALL("drape_sim_move_collider: seconds = -1", drape_sim_move_collider(sim, 0, -1, zero, NULL))           \
    CALL("drape_sim_move_collider: displacement", drape_sim_move_collider(sim, 0, FRAME, far, NULL))         \
    CALL("drape_sim_move_collider: displacement", drape_sim_move_collider(sim, 0, FRAME, nan_, NULL))        \
    CALL("drape_sim_move_collider_pose: collider -1", pose(sim, -1, same, NULL, NULL))                       \
    CALL("drape_sim_move_collider_pose: the rotation has length 2; it is a quaternion w x y z",              \
         pose(sim, 0, twice, NULL, NULL))                                                                    \
    CALL("drape_sim_move_collider_pose: the rotation has length 0.98", pose(sim, 0, less, NULL, NULL))       \
    CALL("drape_sim_move_collider_pose: the rotation has length 0", pose(sim, 0, zero, NULL, NULL))          \
    CALL("drape_sim_move_collider_pose: the rotation has length nan", pose(sim, 0, nan_, NULL, NULL))        \
    CALL("drape_sim_move_collider_pose: the rotation is NULL", pose(sim, 0, NULL, NULL, NULL))               \
    CALL("drape_sim_move_collider_pose: velocity and angular velocity", pose(sim, 0, same, zero, NULL))      \
    CALL("drape_sim_move_collider_pose: angular_velocity[0] = 1e+09", pose(sim, 0, same, zero, spin))        \
    CALL("drape_sim_deform_collider: collider 0 is a sphere, which is rigid; an animated_mesh deforms",      \
         drape_sim_deform_collider(sim, 0, FRAME, 1, zero, NULL))                                            \
    CALL("drape_sim_deform_collider: 1 points; limb has 380",                                                \
         drape_sim_deform_collider(sim, 1, FRAME, 1, zero, NULL))                                            \
    CALL("drape_sim_deform_collider: collider 5; the model has 2",                                           \
         drape_sim_deform_collider(sim, 5, FRAME, 1, zero, NULL))                                            \
    CALL("drape_sim_collider_points: collider 0 is a sphere",                                                \
         drape_sim_collider_points(sim, 0, forces, NULL))                                                    \
    CALL("drape_sim_push: the force on node", drape_sim_push(sim, nan_))                                     \
    CALL("drape_sim_set_wind: the model has no term that feels the wind",                                    \
         drape_sim_set_wind(sim, calm, NULL))                                                                \
    CALL("drape_sim_set_state:", drape_sim_set_state(sim, 0, nan_, zero))                                    \
    CALL("drape_sim_set_state:", drape_sim_set_state(sim, 0, far, zero))                                     \
    CALL("drape_sim_closest: what = 0", drape_sim_closest(sim, 0, 1, zero, 1, &hit))                         \
    CALL("drape_sim_closest: what = 4", drape_sim_closest(sim, 4, 1, zero, 1, &hit))                         \
    CALL("drape_sim_closest:", drape_sim_closest(sim, 1, 1, zero, 0, &hit))                                  \
    CALL("drape_sim_closest:", drape_sim_closest(sim, 1, 1, zero, -1, &hit))                                 \
    CALL("drape_sim_closest:", drape_sim_closest(sim, 1, 1, nan_, 1, &hit))                                  \
    CALL("drape_sim_cast:", drape_sim_cast(sim, 1, 1, zero, zero, 1, &hit))                                  \
    CALL("drape_sim_cast:", drape_sim_cast(sim, 1, 1, zero, nan_, 1, &hit))                                  \
    CALL("drape_sim_cast:", drape_sim_cast(sim, 1, 1, zero, one, INFINITY, &hit))                            \
    CALL("drape_sim_contacts:", drape_sim_contacts(sim, -1, NULL, &counted))                                 \
    CALL("drape_sim_collider_force: collider 2", drape_sim_collider_force(sim, 2, forces))                   \
    CALL("drape_sim_collider_torque: collider 2", drape_sim_collider_torque(sim, 2, NULL, forces))           \
    CALL("drape_sim_collider_torque:", drape_sim_collider_torque(sim, 0, nan_, forces))                      \
    CALL("drape_sim_advance:", drape_sim_advance(sim, NAN))                                                  \
    CALL("drape_sim_advance: t_end is not finite", drape_sim_advance(sim, INFINITY))                         \
    CALL("drape_sim_advance_realtime: frame_dt = 0", drape_sim_advance_realtime(sim, 0, 1, NULL))            \
    CALL("drape_sim_advance_realtime: budget", drape_sim_advance_realtime(sim, FRAME, -1, NULL))

#define SAYS(says, call) says,
#define MAKE(says, call)                                                                                     \
    if (which-- == 0)                                                                                        \
        return call;

static const char *const wrongs[] = {WRONG(SAYS)};
enum { WRONGS = sizeof wrongs / sizeof *wrongs };

static drape_status call_wrong(drape_sim *sim, int which)
{
    WRONG(MAKE)
    return DRAPE_OK;
}

/* ---- Refusals ---- */

static void expect_as_before(const host *h, const bytes *before, const char *what)
{
    const bytes after = bytes_save(h->sim);
    ck_assert_msg(before->size == after.size && memcmp(before->data, after.data, after.size) == 0, "%s",
                  what);
    free(after.data);
}

TEST(wrong_calls_change_nothing)
{
    scoped_host h = open_sheet("be");
    const bytes before = bytes_save(h.sim);
    for (int i = 0; i < WRONGS; i++) {
        drape_context_set_message(h.ctx, "%s", "");
        const drape_status status = call_wrong(h.sim, i);
        const char *said = drape_context_message(h.ctx);
        ck_assert_msg(status == DRAPE_E_ARGUMENT && strncmp(said, wrongs[i], strlen(wrongs[i])) == 0 &&
                          !strchr(said, '\n'),
                      "%s: %s: %s", wrongs[i], drape_status_name(status), said);
        expect_as_before(&h, &before, wrongs[i]);
    }
    for (size_t i = 0; i < 4; i++) { /* not initialised, only its size, a member short, too long */
        drape_place_def def = {.struct_size = (const size_t[]){0, 8, sizeof def - 8, sizeof def + 8}[i]};
        says(&h, drape_sim_place(h.sim, &def), DRAPE_E_VERSION, "drape_place_def_init");
    }
    ck_assert_int_eq(drape_sim_save_to(h.sim, write_nothing, NULL), DRAPE_E_FILE);
    expect_as_before(&h, &before, "a save that fails");
    free(before.data);
    good(&h, drape_sim_advance(h.sim, 4 * FRAME));
}

/* Empty lists are no mistake. */
TEST(nothing_is_done_for_nothing)
{
    scoped_host h = open_sheet("be");
    const uint64_t hash = drape_sim_hash(h.sim);
    good(&h, drape_sim_attach(h.sim, 0, 0, NULL, NULL));
    good(&h, drape_sim_detach(h.sim, 0, NULL));
    good(&h, drape_sim_set_masses(h.sim, 0, NULL, NULL));
    good(&h, drape_sim_move_pins(h.sim, 0, NULL, 1, NULL, NULL));
    good(&h, drape_sim_closest(h.sim, 3, 0, NULL, 1, NULL));
    good(&h, drape_sim_place(h.sim, &(drape_place_def){.struct_size = sizeof(drape_place_def)}));
    ck_assert_uint_eq(drape_sim_hash(h.sim), hash);
}

/* The method moves nodes out of contact, so that there are no forces. */
TEST(verlet_has_no_contact_forces)
{
    scoped_host h = open_scene(SHEET, "", "", "'method': 'verlet'",
                               "'colliders': [{'type': 'sphere', 'center': [0, -9, 0], 'radius': 0.1}],");
    says(&h, drape_sim_contact_forces(h.sim, forces), DRAPE_E_ARGUMENT, "resolves contact by moving nodes");
    says(&h, drape_sim_collider_force(h.sim, 0, forces), DRAPE_E_ARGUMENT, "no contact force");
}

/* ---- Observers ---- */

static drape_status right_place(drape_sim *sim)
{
    drape_place_def def = place_def();
    return drape_sim_place(sim, &def);
}

static drape_status right_deform(drape_sim *sim)
{
    static double points[3 * 380];
    ck_assert_int_eq(drape_sim_collider_points(sim, 1, points, NULL), DRAPE_OK);
    return drape_sim_deform_collider(sim, 1, FRAME, 380, points, NULL);
}

#define CHANGES(CALL)                                                                                        \
    CALL(drape_sim_pin(sim, 1, &node))                                                                       \
    CALL(drape_sim_unpin(sim, 1, &pin))                                                                      \
    CALL(mass(sim, node, 1))                                                                                 \
    CALL(drape_sim_attach(sim, 0, 1, &node, NULL))                                                           \
    CALL(spring(sim, node, 1, zero))                                                                         \
    CALL(drape_sim_set_drag_springs(sim, 0, NULL, NULL, NULL))                                               \
    CALL(drape_sim_change_model(sim, drape_sim_model(sim)))                                                  \
    CALL(drape_sim_untangle(sim, NULL, NULL))                                                                \
    CALL(drape_sim_move_pins(sim, 1, &pin, FRAME, zero, NULL))                                               \
    CALL(drape_sim_move_collider(sim, 0, FRAME, zero, NULL))                                                 \
    CALL(drape_sim_move_collider_pose(sim, 0, FRAME, zero, same, NULL, NULL))                                \
    CALL(drape_sim_push(sim, zero))                                                                          \
    CALL(drape_sim_set_wind(sim, NULL, NULL))                                                                \
    CALL(drape_sim_advance(sim, 1))                                                                          \
    CALL(drape_sim_advance_realtime(sim, FRAME, 1, NULL))                                                    \
    CALL(drape_sim_set_state(sim, 0, drape_sim_positions(sim), drape_sim_velocities(sim)))                   \
    CALL(right_place(sim))                                                                                   \
    CALL(right_deform(sim))                                                                                  \
    CALL(drape_sim_restore(sim, "nowhere"))                                                                  \
    CALL(drape_sim_restore_from(sim, zero, sizeof zero))

#define REFUSED(call) says(h, call, DRAPE_E_ARGUMENT, "an observer must not call it");

static drape_status watch(void *user, const drape_event *event)
{
    const host *h = user;
    drape_sim *sim = event->sim;
    drape_contact_point contact;
    drape_warning warning;
    CHANGES(REFUSED)
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

TEST(observers_read_and_change_nothing)
{
    scoped_host h = open_sheet("be"), alone = open_sheet("be");
    good(&h, drape_sim_observe(h.sim, watch, &h));
    good(&h, drape_sim_advance(h.sim, 8 * FRAME));
    good(&alone, drape_sim_advance(alone.sim, 8 * FRAME));
    ck_assert(drape_sim_hash(h.sim) == drape_sim_hash(alone.sim));
}

/* ---- Embeddings ---- */

TEST(wrong_embeddings)
{
    scoped_host h = open_sheet("be");
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
}
