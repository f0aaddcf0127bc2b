/* test_change.c: a running sim that goes on with another model of the same cloth, or with other pins. */
#include <float.h>

#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64) /* [s], exact in binary */

/* A host that keeps the text of its scene to change it. */
typedef struct changing {
    host h;
    drape_scene *scene;
} changing;

static changing open_changing(const char *method, const char *text)
{
    char copy[4096];
    changing c = {.h = empty_host()};
    drape_sim_def def = sim_def();
    size_t n = 0;
    for (; text[n] && n + 1 < sizeof copy; n++)
        copy[n] = (char)(text[n] == '\'' ? '"' : text[n]);
    copy[n] = 0;
    def.integrator = method;
    def.dt = strcmp(method, "verlet") == 0 ? FRAME / 64 : FRAME / 2;
    good(&c.h, drape_scene_parse(c.h.ctx, copy, "s.json", &c.scene));
    good(&c.h, drape_scene_compile(c.scene, &c.h.model));
    good(&c.h, drape_sim_create(c.h.ctx, c.h.model, &def, &c.h.sim));
    return c;
}

static void close_changing(changing *c)
{
    drape_scene_destroy(&c->scene);
    close_scene(&c->h);
}

#define scoped_changing SCOPED(close_changing) changing

static void set(const changing *c, const char *pointer, const char *value)
{
    good(&c->h, drape_scene_set(c->scene, pointer, value));
}

static void advance(const changing *c, double seconds)
{
    good(&c->h, drape_sim_advance(c->h.sim, drape_sim_time(c->h.sim) + seconds));
}

static int32_t nodes_of(const changing *c)
{
    return drape_model_node_count(drape_sim_model(c->h.sim));
}

/* ---- Scenes ---- */

#define GRID     "'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.5, 'height': 0.375}"
#define MATERIAL "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}"
#define CLOTH    GRID ", " MATERIAL ", 'terms': ['stretch.edge', 'bend.hinge']"

static const char on_ball[] =
    "{'drape': 1, 'cloth': [{" CLOTH ", 'pins': [{'corner': 'top-left', 'track': [[0, [0,0,0]], [1, "
    "[0.1,0,0]]]}]}], 'colliders': [{'type': 'plane', 'point': [0, -0.3, 0], 'normal': [0, 1, 0], 'name': "
    "'floor'}, {'type': 'sphere', 'center': [0.25, -0.11, 0.15], 'radius': 0.1, 'name': 'ball', 'friction': "
    "0.3}], 'self_contact': {'thickness': 0.004}, 'integrator': {'tolerance': 1e-9, 'rtol': 1e-7}, "
    "'frame_rate': 64, 'duration': 1}";

static const char free_sheet[] =
    "{'drape': 1, 'cloth': [{" CLOTH ", 'velocity': [1, 2, 0.5]}], 'integrator': "
    "{'tolerance': 1e-9, 'rtol': 1e-8}, 'frame_rate': 64, 'duration': 1}";

static const char hanging[] = "{'drape': 1, 'cloth': [{" CLOTH ", 'pins': [{'edge': 'top'}]}], 'integrator': "
                              "{'tolerance': 1e-9}, 'frame_rate': 64, 'duration': 1}";

/* ---- The state ---- */

/* Through a change to the same model a sim has the same state to the bit, energies to rounding, and it goes
 * on as without: a one-step method to the bit, also in contact; the others start anew with a smaller step or
 * order, within their error. */
TEST(same_model_changes_nothing)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_changing a = open_changing(methods[i], on_ball), b = open_changing(methods[i], on_ball);
        const size_t n = 3 * (size_t)nodes_of(&a);
        advance(&a, 12 * FRAME);
        advance(&b, 12 * FRAME);
        const drape_energy before = drape_sim_energy(a.h.sim);
        const drape_statistics counted = drape_sim_statistics(a.h.sim);
        const uint64_t hash = drape_sim_hash(a.h.sim);
        good(&a.h, drape_sim_change(a.h.sim, a.scene));
        const drape_energy after = drape_sim_energy(a.h.sim);
        ck_assert(drape_sim_hash(a.h.sim) == hash);
        ck_assert_double_eq(drape_sim_time(a.h.sim), 12 * FRAME);
        ck_assert(drape_sim_statistics(a.h.sim).steps_accepted == counted.steps_accepted);
        ck_assert(drape_sim_statistics(a.h.sim).newton_iterations == counted.newton_iterations);
        ck_assert_double_eq(after.kinetic, before.kinetic);
        ck_assert_double_eq(after.elastic, before.elastic);
        ck_assert_double_eq(after.dissipated, before.dissipated);
        /* a few roundings of the sum of all parts */
        const double size = before.kinetic + before.elastic + fabs(before.gravity) + before.dissipated;
        ck_assert_double_eq_tol(after.numerical, before.numerical, 100 * DBL_EPSILON * size);
        advance(&a, 12 * FRAME);
        advance(&b, 12 * FRAME);
        const double *x = drape_sim_positions(a.h.sim), *y = drape_sim_positions(b.h.sim);
        const bool one_step = strcmp(methods[i], "be") == 0 || strcmp(methods[i], "midpoint") == 0 ||
                              strcmp(methods[i], "trbdf2") == 0;
        double most = 0;
        for (size_t k = 0; k < n; k++)
            most = fmax(most, fabs(x[k] - y[k]));
        if (one_step)
            ck_assert_msg(most == 0, "%s: %g", methods[i], most);
        ck_assert_msg(most < 0.02, "%s: %g", methods[i], most);
    }
}

/* Nodes that supports hold, at rest and moving, along directions of space and oblique ones, keep their state
 * to the bit through a change to the same model, new masses and set_state with the sim's own arrays. */
TEST(supports_keep_their_velocities)
{
    static const char *const holds[] = {"'normal': [1, 0, 0]", "'normal': [1, 0, 0.2]",
                                        "'axis': [1, 0.3, 0.2]"};
    static const char *const tracks[] = {"", ", 'track': [[0, [0, 0, 0]], [1, [-0.1, 0.04, 0]]]"};
    for (int i = 0; i < METHODS; i++)
        for (int k = 0; k < 6; k++) {
            char text[1024];
            snprintf(text, sizeof text,
                     "{'drape': 1, 'cloth': [{" CLOTH ", 'pins': [{'corner': 'top-left'}, {'edge': 'right', "
                     "%s%s}]}], 'integrator': {'rtol': 1e-5}, 'frame_rate': 64, 'duration': 1}",
                     holds[k % 3], tracks[k / 3]);
            scoped_changing c = open_changing(methods[i], text);
            const size_t size = 3 * (size_t)nodes_of(&c) * sizeof(double);
            const int32_t node = 7;
            double mass = 1e-3, x[60], v[60];
            ck_assert_uint_le(size, sizeof x);
            advance(&c, 4 * FRAME);
            const uint64_t hash = drape_sim_hash(c.h.sim);
            const double kinetic = drape_sim_energy(c.h.sim).kinetic;
            for (int again = 0; again < 2; again++) {
                good(&c.h, drape_sim_change(c.h.sim, c.scene));
                ck_assert_msg(drape_sim_hash(c.h.sim) == hash, "%s: %s", methods[i], text);
            }
            ck_assert_double_eq(drape_sim_energy(c.h.sim).kinetic, kinetic);
            memcpy(x, drape_sim_positions(c.h.sim), size);
            memcpy(v, drape_sim_velocities(c.h.sim), size);
            good(&c.h, drape_sim_set_state(c.h.sim, drape_sim_time(c.h.sim), x, v));
            ck_assert_mem_eq(drape_sim_velocities(c.h.sim), v, size);
            good(&c.h, drape_sim_set_masses(c.h.sim, 1, &node, &mass));
            ck_assert_mem_eq(drape_sim_positions(c.h.sim), x, size);
            ck_assert_mem_eq(drape_sim_velocities(c.h.sim), v, size);
            /* planes of another direction take out what lies across them, those that come to rest as well */
            set(&c, "/cloth/0/pins/1", "{\"edge\": \"right\", \"normal\": [0, 1, 0]}");
            good(&c.h, drape_sim_change(c.h.sim, c.scene));
            for (int j = 4; j < 20; j += 5)
                ck_assert_double_eq(drape_sim_velocities(c.h.sim)[3 * j + 1], 0);
        }
}

/* ---- Gravity and materials ---- */

/* Springs have an energy in proportion to Young's modulus. The change adds to the energy, and as the host
 * gave that, nothing to the numerical dissipation; the guard against energy out of nothing has no alarm in
 * the steps after. */
TEST(a_stiffer_cloth_has_the_energy_of_its_strain)
{
    scoped_changing c = open_changing("be", hanging);
    advance(&c, 16 * FRAME);
    const drape_energy before = drape_sim_energy(c.h.sim);
    set(&c, "/cloth/0/material/young_modulus", "1e6");
    good(&c.h, drape_sim_change(c.h.sim, c.scene));
    const drape_energy after = drape_sim_energy(c.h.sim);
    ck_assert_double_gt(before.elastic, 0);
    ck_assert_double_eq_tol(after.elastic, 100 * before.elastic, 1e-12 * after.elastic);
    ck_assert_double_eq_tol(after.numerical, before.numerical, 1e-13 * after.elastic);
    advance(&c, 16 * FRAME);
    ck_assert_int_eq((int)drape_sim_statistics(c.h.sim).steps_rejected, 0);
    ck_assert_double_gt(drape_sim_energy(c.h.sim).numerical, after.numerical);
}

/* What goes on is the same as in a sim that had the value from the start and was put into the state: backward
 * Euler to the bit. */
TEST(goes_on_as_with_the_value_from_the_start)
{
    static const char *const changes[][2] = {
        {"/gravity", "[1, -5, 0.5]"},
        {"/cloth/0/material/young_modulus", "3e4"},
        {"/cloth/0/material/density", "300"},
        {"/cloth/0/terms/1", "{\"type\": \"bend.hinge\", \"rest\": \"flat\"}"},
        {"/cloth/0/terms/-", "{\"type\": \"drag.viscous\", \"coefficient\": 0.2}"},
        {"/cloth/0/terms/1", NULL},
        {"/colliders/1/friction", "0.05"},
        {"/colliders/1", NULL},
        {"/colliders/-", "{\"type\": \"plane\", \"point\": [0, -0.2, 0], "
                         "\"normal\": [0.1, 1, 0]}"},
        {"/contact/stiffness", "5000"},
        {"/self_contact/thickness", "0.002"},
        {"/cloth/0/pins/-", "{\"corner\": \"bottom-right\"}"},
        {"/cloth/0/pins", "[]"}};
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        scoped_changing a = open_changing("be", on_ball), b = open_changing("be", on_ball);
        const int32_t corner = 19;
        advance(&a, 8 * FRAME);
        set(&a, changes[i][0], changes[i][1]);
        good(&a.h, drape_sim_change(a.h.sim, a.scene));
        set(&b, changes[i][0], changes[i][1]);
        drape_model_destroy(&b.h.model);
        drape_sim_destroy(&b.h.sim);
        good(&b.h, drape_scene_compile(b.scene, &b.h.model));
        drape_sim_def def = sim_def();
        def.dt = FRAME / 2;
        good(&b.h, drape_sim_create(b.h.ctx, b.h.model, &def, &b.h.sim));
        if (drape_model_pinned(b.h.model)[corner]) /* it is pinned where it is, not where it began */
            good(&b.h, drape_sim_move_pins(b.h.sim, 1, &corner, FRAME,
                                           drape_sim_positions(a.h.sim) + 3 * (size_t)corner, NULL));
        good(&b.h, drape_sim_set_state(b.h.sim, drape_sim_time(a.h.sim), drape_sim_positions(a.h.sim),
                                       drape_sim_velocities(a.h.sim)));
        advance(&a, 8 * FRAME);
        advance(&b, 8 * FRAME);
        ck_assert_msg(memcmp(drape_sim_positions(a.h.sim), drape_sim_positions(b.h.sim),
                             3 * (size_t)nodes_of(&a) * sizeof(double)) == 0,
                      "%s", changes[i][0]);
    }
}

/* ---- Colliders ---- */

static double lowest(const changing *c)
{
    double least = INFINITY;
    for (int32_t i = 0; i < nodes_of(c); i++)
        least = fmin(least, drape_sim_positions(c->h.sim)[3 * (size_t)i + 1]);
    return least;
}

/* A floor that is put below a falling sheet catches it; friction that is taken away lets it slide: on a
 * plane of slope 1 : 2 with g sin a = 9.81 / sqrt(5) m/s2, as the normal forces have no part along the
 * plane. A floor that is taken away lets it fall. */
TEST(floors_come_and_go)
{
    scoped_changing c = open_changing("be", free_sheet);
    set(&c, "/cloth/0/velocity", "[0,0,0]");
    set(&c, "/cloth/0/mesh/orientation", "\"horizontal\"");
    drape_model_destroy(&c.h.model);
    drape_sim_destroy(&c.h.sim);
    good(&c.h, drape_scene_compile(c.scene, &c.h.model));
    good(&c.h, drape_sim_create(c.h.ctx, c.h.model, NULL, &c.h.sim));
    advance(&c, 8 * FRAME);
    set(&c, "/colliders/-",
        "{\"type\": \"plane\", \"point\": [0.25, -0.4, 0], \"normal\": [1, 2, 0], \"friction\": 1}");
    set(&c, "/contact/friction_velocity", "1e-5"); /* a stuck sheet creeps at less */
    good(&c.h, drape_sim_change(c.h.sim, c.scene));
    ck_assert_int_eq(drape_model_collider_count(drape_sim_model(c.h.sim)), 1);
    advance(&c, 96 * FRAME);
    double mean[2][3] = {{0}}, speed[2] = {0};
    for (int pass = 0; pass < 2; pass++) {
        const double *v = drape_sim_velocities(c.h.sim), *mass = drape_model_masses(drape_sim_model(c.h.sim));
        double sum = 0;
        for (int32_t i = 0; i < nodes_of(&c); i++) {
            sum += mass[i];
            for (int k = 0; k < 3; k++)
                mean[pass][k] += mass[i] * v[3 * i + k];
        }
        speed[pass] = (2 * mean[pass][0] - mean[pass][1]) / sqrt(5) / sum; /* downhill */
        if (pass == 0) {
            set(&c, "/colliders/0/friction", "0");
            good(&c.h, drape_sim_change(c.h.sim, c.scene));
            advance(&c, 16 * FRAME);
        }
    }
    ck_assert_double_lt(fabs(speed[0]), 1e-4);
    /* the solver's tolerance of 1e-9 N on 1e-3 kg */
    ck_assert_double_eq_tol(speed[1] - speed[0], 9.81 / sqrt(5) * 16 * FRAME, 1e-5);
    const double height = lowest(&c);
    set(&c, "/colliders/0", NULL);
    good(&c.h, drape_sim_change(c.h.sim, c.scene));
    ck_assert_int_eq(drape_model_collider_count(drape_sim_model(c.h.sim)), 0);
    advance(&c, 32 * FRAME);
    ck_assert_double_lt(lowest(&c), height - 9.81 / 2 * 0.5 * 0.5);
}

/* ---- Pins ---- */

/* The velocity of the centre of mass, for all nodes free. */
static void mean_velocity(const changing *c, double mean[3])
{
    const double *v = drape_sim_velocities(c->h.sim), *mass = drape_model_masses(drape_sim_model(c->h.sim));
    double sum = 0;
    memset(mean, 0, 3 * sizeof *mean);
    for (int32_t i = 0; i < nodes_of(c); i++) {
        sum += mass[i];
        for (int k = 0; k < 3; k++)
            mean[k] += mass[i] * v[3 * i + k];
    }
    for (int k = 0; k < 3; k++)
        mean[k] /= sum;
}

/* Without its pins a sheet falls freely: its centre of mass gains g t. A pinned node stays where it is to
 * the bit, and pins that carry a sheet at rest have its weight. */
TEST(pins_come_and_go)
{
    scoped_changing c = open_changing("be", hanging);
    const int32_t top[] = {0, 1, 2, 3, 4}, two[] = {7, 13};
    double before[3], after[3], held[2][3], forces[60];
    advance(&c, 4 * FRAME);
    good(&c.h, drape_sim_unpin(c.h.sim, 5, top));
    ck_assert_int_eq((int)drape_model_dof_count(drape_sim_model(c.h.sim)), 60);
    mean_velocity(&c, before);
    advance(&c, 8 * FRAME);
    mean_velocity(&c, after);
    /* the tolerance of 1e-9 N on a node of 5e-4 kg at least, for 1/8 s */
    ck_assert_double_eq_tol(after[1] - before[1], -9.81 * 8 * FRAME, 1e-6);
    good(&c.h, drape_sim_pin(c.h.sim, 2, two));
    for (int i = 0; i < 2; i++)
        memcpy(held[i], drape_sim_positions(c.h.sim) + 3 * (size_t)two[i], sizeof held[i]);
    scoped_bytes kept = bytes_save(c.h.sim);
    advance(&c, 8 * FRAME);
    for (int i = 0; i < 2; i++)
        ck_assert_mem_eq(held[i], drape_sim_positions(c.h.sim) + 3 * (size_t)two[i], sizeof held[i]);
    const uint64_t hash = drape_sim_hash(c.h.sim);
    good(&c.h, drape_sim_reactions(c.h.sim, forces));
    ck_assert_double_ne(forces[3 * 7 + 1], 0);
    ck_assert_double_eq(forces[1], 0);
    drape_sim_def def; /* a checkpoint has these pins */
    drape_sim_def_init(&def, sizeof def);
    def.dt = FRAME / 2;
    drape_sim_destroy(&c.h.sim);
    good(&c.h, drape_sim_create(c.h.ctx, c.h.model, &def, &c.h.sim));
    good(&c.h, drape_sim_restore_from(c.h.sim, kept.data, kept.size));
    advance(&c, 8 * FRAME);
    ck_assert(drape_sim_hash(c.h.sim) == hash);
}

/* ---- What else goes on ---- */

static drape_status count_frames(void *user, const drape_event *event)
{
    *(int *)user += event->kind == DRAPE_EVENT_FRAME;
    return DRAPE_OK;
}

/* Loads, frames, events by name and the length of a budget's frame. */
TEST(the_rest_goes_on)
{
    scoped_changing c = open_changing("be", hanging);
    const int32_t dragged[] = {17, 12};
    const double targets[] = {0.3, -0.2, 0.4, 0.1, -0.1, 0.2}, stiffness[] = {2, 1};
    double push[60] = {0}, force[3], now[3];
    int frames = 0;
    push[3 * 9] = 0.01;
    set(&c, "/events", "[{\"type\": \"height\", \"height\": -0.01, \"name\": \"low\"}]");
    good(&c.h, drape_sim_change(c.h.sim, c.scene));
    good(&c.h, drape_sim_observe(c.h.sim, count_frames, &frames));
    good(&c.h, drape_sim_push(c.h.sim, push));
    good(&c.h, drape_sim_set_drag_springs(c.h.sim, 2, dragged, stiffness, targets));
    advance(&c, 8 * FRAME);
    drape_event_record low;
    ck_assert_int_eq(drape_sim_event(c.h.sim, 0, &low), 1);
    const int64_t count = low.count;
    ck_assert_int_gt((int)count, 0);
    drape_sim_drag_spring_force(c.h.sim, force);
    const uint64_t hash = drape_sim_hash(c.h.sim);
    set(&c, "/events/-", "{\"type\": \"energy\", \"of\": \"kinetic\", \"bound\": 100, \"name\": \"hot\"}");
    good(&c.h, drape_sim_change(c.h.sim, c.scene));
    drape_sim_event(c.h.sim, 0, &low);
    ck_assert_int_eq((int)low.count, (int)count);
    drape_sim_drag_spring_force(c.h.sim, now);
    ck_assert_mem_eq(force, now, sizeof now);
    ck_assert(drape_sim_hash(c.h.sim) == hash);
    advance(&c, 8 * FRAME);
    ck_assert_int_eq(frames, 17);
}

/* ---- Refusals ---- */

TEST(refusals_leave_the_sim_as_it_was)
{
    static const char *const wrong[][3] = {
        {"/cloth/0/mesh/rows", "5", "the meshes of cloth stay the same"},
        {"/cloth/0/mesh/grid", "\"equilateral\"", "/cloth/0/mesh"},
        {"/cloth/-",
         "{\"mesh\": {\"grid\": \"square\", \"columns\": 3, \"rows\": 3, \"width\": 1, \"height\": 1}, "
         "\"material\": {\"young_modulus\": 1e4, \"thickness\": 1e-3, \"density\": 200}}",
         "the model has 2 cloths, and the sim 1"},
        {"/cloth/0/material/density", "-1", "/cloth/0/material/density"},
        {"/cloth/0/pins/0/track", "[[0, [0,0,1]]]", "a track that is new must begin where its nodes are"}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        scoped_changing c = open_changing("be", on_ball);
        advance(&c, 4 * FRAME);
        const uint64_t hash = drape_sim_hash(c.h.sim);
        const drape_model *model = drape_sim_model(c.h.sim);
        set(&c, wrong[i][0], wrong[i][1]);
        says(&c.h, drape_sim_change(c.h.sim, c.scene), DRAPE_E_ARGUMENT, wrong[i][2]);
        ck_assert(drape_sim_hash(c.h.sim) == hash);
        ck_assert_ptr_eq(drape_sim_model(c.h.sim), model);
        advance(&c, FRAME);
    }
}

/* Each allocation of a change fails once: the sim is as it was, nothing leaks, and then it changes. */
TEST(a_change_without_memory)
{
    scoped_changing c = open_changing("be", on_ball);
    advance(&c, 8 * FRAME);
    const uint64_t hash = drape_sim_hash(c.h.sim);
    const int32_t node = 19;
    set(&c, "/colliders/-", "{\"type\": \"box\", \"center\": [0, -5, 0], \"size\": [1, 1, 1]}");
    for (int kind = 0; kind < 2; kind++) {
        drape_status status = DRAPE_E_MEMORY;
        for (long n = 1; status; n++) {
            c.h.memory->fail_at = c.h.memory->calls + n;
            status = kind == 0 ? drape_sim_change(c.h.sim, c.scene) : drape_sim_pin(c.h.sim, 1, &node);
            c.h.memory->fail_at = 0;
            if (!status)
                break;
            ck_assert(drape_sim_hash(c.h.sim) == hash);
            ck_assert_int_eq(status, DRAPE_E_MEMORY);
            ck_assert_int_lt(n, 5000);
        }
    }
    advance(&c, 2 * FRAME);
}
