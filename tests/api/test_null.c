/* NULL for any argument: a function that returns a status refuses it, and any other leaves alone what it
 * cannot read or write, as a mistake of a host must not crash it. Each call is made in a process of its own.
 */
#include "support/host.h"
#include "support/suite.h"

#include "drape/extend.h"

#include <sys/wait.h>
#include <unistd.h>

static drape_context *ctx;
static drape_scene *scene;
static drape_model *model;
static drape_sim *sim;
static drape_embedding *embedding;
static drape_model *made;
static drape_sim *made_sim;
static drape_scene *made_scene;
static drape_embedding *made_embedding;
static const int32_t node[] = {7};
static double x[3 * 64];
static float vertices[3];
static drape_hit hit;
static drape_contact_point contact_point;
static drape_check_result checked;
static drape_place_def a_place;
static drape_event_def an_event;

static drape_status measure(void *user, double t, const double *positions, const double *velocities,
                            double *value)
{
    (void)user, (void)t, (void)velocities;
    *value = positions[0];
    return DRAPE_OK;
}

static drape_status observe(void *user, const drape_event *event)
{
    (void)user, (void)event;
    return DRAPE_OK;
}

static drape_status keep(void *user, const void *bytes, size_t size)
{
    (void)user, (void)bytes, (void)size;
    return DRAPE_OK;
}

/* Those that must return DRAPE_E_ARGUMENT. */
#define REFUSED(CALL)                                                                                        \
    CALL(drape_context_create(NULL, NULL))                                                                   \
    CALL(drape_scene_load(NULL, "x.json", &made_scene))                                                      \
    CALL(drape_scene_load(ctx, NULL, &made_scene))                                                           \
    CALL(drape_scene_load(ctx, "x.json", NULL))                                                              \
    CALL(drape_scene_parse(NULL, "{}", "x", &made_scene))                                                    \
    CALL(drape_scene_parse(ctx, NULL, "x", &made_scene))                                                     \
    CALL(drape_scene_parse(ctx, "{}", "x", NULL))                                                            \
    CALL(drape_scene_set(NULL, "/duration", "1"))                                                            \
    CALL(drape_scene_set(scene, NULL, "1"))                                                                  \
    CALL(drape_scene_compile(NULL, &made))                                                                   \
    CALL(drape_scene_compile(scene, NULL))                                                                   \
    CALL(drape_model_create(NULL, &(drape_scene_def){0}, &made))                                             \
    CALL(drape_model_create(ctx, &(drape_scene_def){0}, NULL))                                               \
    CALL(drape_model_load(NULL, "x.json", &made))                                                            \
    CALL(drape_model_load(ctx, NULL, &made))                                                                 \
    CALL(drape_model_load(ctx, "x.json", NULL))                                                              \
    CALL(drape_sim_create(NULL, model, NULL, &made_sim))                                                     \
    CALL(drape_sim_create(ctx, NULL, NULL, &made_sim))                                                       \
    CALL(drape_sim_create(ctx, model, NULL, NULL))                                                           \
    CALL(drape_sim_advance(NULL, 1))                                                                         \
    CALL(drape_sim_advance_realtime(NULL, 0.01, 1, NULL))                                                    \
    CALL(drape_sim_set_state(NULL, 0, x, x))                                                                 \
    CALL(drape_sim_set_state(sim, 0, NULL, x))                                                               \
    CALL(drape_sim_set_state(sim, 0, x, NULL))                                                               \
    CALL(drape_sim_place(NULL, &a_place))                                                                    \
    CALL(drape_sim_place(sim, NULL))                                                                         \
    CALL(drape_sim_untangle(NULL, NULL, NULL))                                                               \
    CALL(drape_sim_change(NULL, scene))                                                                      \
    CALL(drape_sim_change(sim, NULL))                                                                        \
    CALL(drape_sim_change_model(NULL, model))                                                                \
    CALL(drape_sim_change_model(sim, NULL))                                                                  \
    CALL(drape_sim_pin(NULL, 1, node))                                                                       \
    CALL(drape_sim_pin(sim, 1, NULL))                                                                        \
    CALL(drape_sim_unpin(NULL, 1, node))                                                                     \
    CALL(drape_sim_unpin(sim, 1, NULL))                                                                      \
    CALL(drape_sim_set_masses(NULL, 1, node, x))                                                             \
    CALL(drape_sim_set_masses(sim, 1, NULL, x))                                                              \
    CALL(drape_sim_set_masses(sim, 1, node, NULL))                                                           \
    CALL(drape_sim_attach(NULL, 0, 1, node, NULL))                                                           \
    CALL(drape_sim_attach(sim, 0, 1, NULL, NULL))                                                            \
    CALL(drape_sim_detach(NULL, 1, node))                                                                    \
    CALL(drape_sim_detach(sim, 1, NULL))                                                                     \
    CALL(drape_sim_set_drag_spring(NULL, 7, 1, x))                                                           \
    CALL(drape_sim_set_drag_spring(sim, 7, 1, NULL))                                                         \
    CALL(drape_sim_set_drag_springs(NULL, 1, node, x, x))                                                    \
    CALL(drape_sim_set_drag_springs(sim, 1, NULL, x, x))                                                     \
    CALL(drape_sim_set_drag_springs(sim, 1, node, NULL, x))                                                  \
    CALL(drape_sim_set_drag_springs(sim, 1, node, x, NULL))                                                  \
    CALL(drape_sim_move_pins(NULL, 1, node, 1, x, x))                                                        \
    CALL(drape_sim_move_pins(sim, 1, NULL, 1, x, x))                                                         \
    CALL(drape_sim_move_pins(sim, 1, node, 1, NULL, x))                                                      \
    CALL(drape_sim_move_collider(NULL, 0, 1, x, x))                                                          \
    CALL(drape_sim_move_collider(sim, 0, 1, NULL, x))                                                        \
    CALL(drape_sim_move_collider_pose(NULL, 0, 1, x, x, x, x))                                               \
    CALL(drape_sim_move_collider_pose(sim, 0, 1, NULL, x, x, x))                                             \
    CALL(drape_sim_move_collider_pose(sim, 0, 1, x, NULL, x, x))                                             \
    CALL(drape_sim_deform_collider(NULL, 1, 1, 4, x, x))                                                     \
    CALL(drape_sim_deform_collider(sim, 1, 1, 4, NULL, x))                                                   \
    CALL(drape_sim_collider_points(NULL, 1, x, x))                                                           \
    CALL(drape_sim_collider_points(sim, 1, NULL, x))                                                         \
    CALL(drape_sim_push(NULL, x))                                                                            \
    CALL(drape_sim_set_wind(NULL, NULL, NULL))                                                               \
    CALL(drape_sim_closest(NULL, DRAPE_QUERY_CLOTH, 1, x, 1, &hit))                                          \
    CALL(drape_sim_closest(sim, DRAPE_QUERY_CLOTH, 1, NULL, 1, &hit))                                        \
    CALL(drape_sim_closest(sim, DRAPE_QUERY_CLOTH, 1, x, 1, NULL))                                           \
    CALL(drape_sim_cast(NULL, DRAPE_QUERY_CLOTH, 1, x, x + 3, 1, &hit))                                      \
    CALL(drape_sim_cast(sim, DRAPE_QUERY_CLOTH, 1, NULL, x + 3, 1, &hit))                                    \
    CALL(drape_sim_cast(sim, DRAPE_QUERY_CLOTH, 1, x, NULL, 1, &hit))                                        \
    CALL(drape_sim_cast(sim, DRAPE_QUERY_CLOTH, 1, x, x + 3, 1, NULL))                                       \
    CALL(drape_sim_contacts(NULL, 1, &contact_point, &(int32_t){0}))                                         \
    CALL(drape_sim_contacts(sim, 1, NULL, &(int32_t){0}))                                                    \
    CALL(drape_sim_contacts(sim, 1, &contact_point, NULL))                                                   \
    CALL(drape_embedding_create(NULL, model, 0, 1, vertices, NULL, &made_embedding))                         \
    CALL(drape_embedding_create(ctx, NULL, 0, 1, vertices, NULL, &made_embedding))                           \
    CALL(drape_embedding_create(ctx, model, 0, 1, NULL, NULL, &made_embedding))                              \
    CALL(drape_embedding_create(ctx, model, 0, 1, vertices, NULL, NULL))                                     \
    CALL(drape_sim_reactions(NULL, x))                                                                       \
    CALL(drape_sim_reactions(sim, NULL))                                                                     \
    CALL(drape_sim_contact_forces(NULL, x))                                                                  \
    CALL(drape_sim_contact_forces(sim, NULL))                                                                \
    CALL(drape_sim_collider_force(NULL, 0, x))                                                               \
    CALL(drape_sim_collider_force(sim, 0, NULL))                                                             \
    CALL(drape_sim_collider_torque(NULL, 0, x, x))                                                           \
    CALL(drape_sim_collider_torque(sim, 0, NULL, NULL))                                                      \
    CALL(drape_sim_add_event(NULL, &an_event, measure, NULL))                                                \
    CALL(drape_sim_add_event(sim, NULL, measure, NULL))                                                      \
    CALL(drape_sim_add_event(sim, &an_event, NULL, NULL))                                                    \
    CALL(drape_sim_save(NULL, "x.state"))                                                                    \
    CALL(drape_sim_save(sim, NULL))                                                                          \
    CALL(drape_sim_save_to(NULL, keep, NULL))                                                                \
    CALL(drape_sim_save_to(sim, NULL, NULL))                                                                 \
    CALL(drape_sim_restore(NULL, "x.state"))                                                                 \
    CALL(drape_sim_restore(sim, NULL))                                                                       \
    CALL(drape_sim_restore_from(NULL, x, 8))                                                                 \
    CALL(drape_sim_restore_from(sim, NULL, 8))                                                               \
    CALL(drape_sim_observe(NULL, observe, NULL))                                                             \
    CALL(drape_sim_observe(sim, NULL, NULL))                                                                 \
    CALL(drape_context_add_term(NULL, NULL))                                                                 \
    CALL(drape_context_add_term(ctx, NULL))                                                                  \
    CALL(drape_context_add_collider(NULL, NULL))                                                             \
    CALL(drape_context_add_collider(ctx, NULL))                                                              \
    CALL(drape_model_check_derivatives(NULL, 1, &checked, 1, &(int32_t){0}))                                 \
    CALL(drape_model_check_derivatives(model, 1, NULL, 1, &(int32_t){0}))                                    \
    CALL(drape_model_check_derivatives(model, 1, &checked, 1, NULL))

/* Those that return what stands for nothing. */
#define NOTHING(CALL)                                                                                        \
    CALL(drape_model_node_count(NULL))                                                                       \
    CALL(drape_model_triangle_count(NULL))                                                                   \
    CALL(drape_model_dof_count(NULL))                                                                        \
    CALL(drape_model_nonzero_count(NULL))                                                                    \
    CALL(drape_model_triangles(NULL))                                                                        \
    CALL(drape_model_rest_positions(NULL))                                                                   \
    CALL(drape_model_masses(NULL))                                                                           \
    CALL(drape_model_pinned(NULL))                                                                           \
    CALL(drape_model_cloth_count(NULL))                                                                      \
    CALL(*drape_model_cloth(NULL, 0).name)                                                                   \
    CALL(drape_model_collider_count(NULL))                                                                   \
    CALL(*drape_model_collider(NULL, 0, 0).name)                                                             \
    CALL(drape_model_collider_points(NULL, 0) != -1)                                                         \
    CALL(drape_model_duration(NULL))                                                                         \
    CALL(drape_model_frame_rate(NULL))                                                                       \
    CALL(drape_sim_untangling(NULL, NULL, NULL))                                                             \
    CALL(drape_sim_attached(NULL, 0) != -1)                                                                  \
    CALL(drape_sim_time(NULL))                                                                               \
    CALL(drape_sim_positions(NULL))                                                                          \
    CALL(drape_sim_velocities(NULL))                                                                         \
    CALL(drape_sim_model(NULL))                                                                              \
    CALL(drape_sim_hash(NULL))                                                                               \
    CALL(drape_sim_inside(NULL, 0, x) != -1)                                                                 \
    CALL(drape_sim_relaxed(NULL, 0, NULL))                                                                   \
    CALL(drape_sim_intersections(NULL, -1) != -1)                                                            \
    CALL(drape_sim_seam(NULL, 0, NULL))                                                                      \
    CALL(*drape_sim_collider(NULL, 0).name)                                                                  \
    CALL(drape_sim_collider_rotation(NULL, 0, x, x, x))                                                      \
    CALL(drape_sim_energy(NULL).kinetic)                                                                     \
    CALL(drape_sim_statistics(NULL).steps_accepted)                                                          \
    CALL(drape_sim_reason(NULL, 0, NULL))                                                                    \
    CALL(drape_sim_warning(NULL, 0, NULL))

/* All others. */
#define LEFT_ALONE(CALL)                                                                                     \
    CALL(drape_context_def_init(NULL, sizeof(drape_context_def)))                                            \
    CALL(drape_scene_def_init(NULL, sizeof(drape_scene_def)))                                                \
    CALL(drape_cloth_def_init(NULL, sizeof(drape_cloth_def)))                                                \
    CALL(drape_mesh_def_init(NULL, sizeof(drape_mesh_def)))                                                  \
    CALL(drape_pin_def_init(NULL, sizeof(drape_pin_def)))                                                    \
    CALL(drape_mass_def_init(NULL, sizeof(drape_mass_def)))                                                  \
    CALL(drape_periodic_def_init(NULL, sizeof(drape_periodic_def)))                                          \
    CALL(drape_history_def_init(NULL, sizeof(drape_history_def)))                                            \
    CALL(drape_event_def_init(NULL, sizeof(drape_event_def)))                                                \
    CALL(drape_seam_def_init(NULL, sizeof(drape_seam_def)))                                                  \
    CALL(drape_collider_def_init(NULL, sizeof(drape_collider_def)))                                          \
    CALL(drape_sim_def_init(NULL, sizeof(drape_sim_def)))                                                    \
    CALL(drape_place_def_init(NULL, sizeof(drape_place_def)))                                                \
    CALL(drape_untangle_def_init(NULL, sizeof(drape_untangle_def)))                                          \
    CALL(drape_context_destroy(NULL))                                                                        \
    CALL(drape_scene_destroy(NULL))                                                                          \
    CALL(drape_model_destroy(NULL))                                                                          \
    CALL(drape_sim_destroy(NULL))                                                                            \
    CALL(drape_embedding_destroy(NULL))                                                                      \
    CALL(drape_context_message(NULL))                                                                        \
    CALL(drape_context_set_message(NULL, "x"))                                                               \
    CALL(drape_context_set_message(ctx, NULL))                                                               \
    CALL(drape_model_render_mesh(NULL, 0))                                                                   \
    CALL(drape_model_render_positions(NULL, 0, x, NULL, x))                                                  \
    CALL(drape_model_render_positions(model, 0, NULL, NULL, x))                                              \
    CALL(drape_model_render_positions(model, 0, x, NULL, NULL))                                              \
    CALL(drape_model_collider_rotation(NULL, 0, 0, x, x, x))                                                 \
    CALL(drape_model_collider_rotation(model, 0, 0, NULL, NULL, NULL))                                       \
    CALL(drape_model_strain(NULL, x, x))                                                                     \
    CALL(drape_model_strain(model, NULL, x))                                                                 \
    CALL(drape_model_strain(model, x, NULL))                                                                 \
    CALL(drape_model_normals(NULL, x, x))                                                                    \
    CALL(drape_model_normals(model, NULL, x))                                                                \
    CALL(drape_model_normals(model, x, NULL))                                                                \
    CALL(drape_sim_untangling(sim, NULL, NULL))                                                              \
    CALL(drape_sim_drag_spring_force(NULL, x))                                                               \
    CALL(drape_sim_drag_spring_force(sim, NULL))                                                             \
    CALL(drape_sim_cancel(NULL))                                                                             \
    CALL(drape_sim_inside(sim, 0, NULL))                                                                     \
    CALL(drape_sim_relaxed(sim, 0, NULL))                                                                    \
    CALL(drape_embedding_carry(NULL, x, vertices, NULL))                                                     \
    CALL(drape_embedding_carry(embedding, NULL, vertices, NULL))                                             \
    CALL(drape_embedding_carry(embedding, x, NULL, NULL))                                                    \
    CALL(drape_sim_normals(NULL, x))                                                                         \
    CALL(drape_sim_normals(sim, NULL))                                                                       \
    CALL(drape_sim_seam(sim, 0, NULL))                                                                       \
    CALL(drape_sim_collider_rotation(sim, 0, NULL, NULL, NULL))                                              \
    CALL(drape_sim_energy_density(NULL, x))                                                                  \
    CALL(drape_sim_energy_density(sim, NULL))                                                                \
    CALL(drape_sim_reason(sim, 0, NULL))                                                                     \
    CALL(drape_sim_warning(sim, 0, NULL))                                                                    \
    CALL(drape_sim_event(NULL, 0, NULL))                                                                     \
    CALL(drape_sim_event(sim, 0, NULL))                                                                      \
    CALL(drape_sim_stopped_by(NULL))

#define NAME(call) #call,
#define NONE(call)                                                                                           \
    if (which-- == 0)                                                                                        \
        return !(call);
#define CHECK(call)                                                                                          \
    if (which-- == 0)                                                                                        \
        return (call) == DRAPE_E_ARGUMENT && names_a_function();
#define MAKE(call)                                                                                           \
    if (which-- == 0)                                                                                        \
        (void)(call);

static const char *const calls[] = {REFUSED(NAME) NOTHING(NAME) LEFT_ALONE(NAME)};

/* The message, if there is an object that has one, begins with the name of a function. */
static bool names_a_function(void)
{
    return !*drape_context_message(ctx) || strncmp(drape_context_message(ctx), "drape_", 6) == 0;
}

static bool make_call(int which)
{
    REFUSED(CHECK)
    NOTHING(NONE)
    LEFT_ALONE(MAKE)
    return true;
}

TEST(null_arguments_do_no_harm)
{
    scoped_host h = open_scene(SHEET, "", "{'edge': 'top'}", "",
                               "'colliders': [{'type': 'sphere', 'center': [0, -9, 0], 'radius': 0.1}],");
    char failed[4096] = "";
    ctx = h.ctx, model = h.model, sim = h.sim;
    ck_assert_int_eq(drape_scene_parse(ctx, "{}", "x.json", &scene), DRAPE_OK);
    ck_assert_int_eq(drape_embedding_create(ctx, model, 0, 1, vertices, NULL, &embedding), DRAPE_OK);
    drape_place_def_init(&a_place, sizeof a_place);
    drape_event_def_init(&an_event, sizeof an_event);
    an_event.name = "event";
    memcpy(x, drape_sim_positions(sim), 3 * (size_t)drape_model_node_count(model) * sizeof *x);
    for (size_t i = 0; i < sizeof calls / sizeof *calls; i++) {
        int status = 0;
        const pid_t child = fork();
        ck_assert_int_ge(child, 0);
        if (child == 0)
            _exit(make_call((int)i) ? 0 : 1);
        ck_assert_int_eq(waitpid(child, &status, 0), child);
        if (status)
            snprintf(failed + strlen(failed), sizeof failed - strlen(failed), "\n%s %s", calls[i],
                     WIFEXITED(status) ? "is not refused" : "crashes");
    }
    ck_assert_msg(!*failed, "%s", failed);
    drape_embedding_destroy(&embedding);
    drape_scene_destroy(&scene);
}
