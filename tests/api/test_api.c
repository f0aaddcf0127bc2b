/* test_api.c: the library as a host sees it, through the public headers only. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "drape/extend.h"
#include "support/suite.h"

/* ---- Helpers ---- */

static void check_message(const drape_context *ctx, const char *part)
{
    const char *message = drape_context_message(ctx);
    ck_assert_msg(strstr(message, part) != NULL, "\"%s\" is not in: %s", part, message);
    for (const char *p = message; *p; p++)
        ck_assert_msg((unsigned char)*p >= ' ' && *p != 127, "not one line: %s", message);
}

/* In the scene texts of these tests ' stands for ". */
static drape_status compile_text(drape_context *ctx, const char *text, drape_model **model)
{
    char quoted[4096];
    scoped_parsed *scene = NULL;
    snprintf(quoted, sizeof quoted, "%s", text);
    quote(quoted);
    *model = NULL;
    drape_status status = drape_scene_parse(ctx, quoted, "s.json", &scene);
    if (!status)
        status = drape_scene_compile(scene, model);
    return status;
}

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'equilateral', 'edges': 5, 'edge_length': "   \
    "0.1, 'transform': {'rotate': [1, 2, 3, 20]}},"                                                          \
    " 'material': {'young_modulus': 1e5, 'poisson_ratio': 0.3, 'thickness': 1e-3, 'density': 200},"          \
    " 'terms': ['stretch.edge', {'type': 'bend.hinge', 'stiffness': 'report'},"                              \
    "           {'type': 'damp.kelvin_voigt', 'beta': 1e-3}],"                                               \
    " 'pins': [{'nodes': [0]}, {'corner': 'top-right', 'track': [[0, [0,0,0]], [1, [0,0.5,0]]]}],"           \
    " 'velocity': [0, 0, 0.25]}],"                                                                           \
    " 'gravity': [0, -9.5, 0.5], 'integrator': {'method': 'be', 'dt': 0.01, 'tolerance': 1e-7},"             \
    " 'controller': {'type': 'halving', 'dt_min': 1e-6}, 'duration': 1, 'frame_rate': 30}"

static drape_model *make_sheet(drape_context *ctx)
{
    drape_model *model;
    assert_ok(ctx, compile_text(ctx, SHEET, &model));
    return model;
}

static drape_sim *make_sim(drape_context *ctx, const drape_model *model)
{
    drape_sim *sim = NULL;
    assert_ok(ctx, drape_sim_create(ctx, model, NULL, &sim));
    return sim;
}

/* The scene above as structs. */
typedef struct host_scene {
    drape_setting grid[2], material[4], stiffness, beta, integrator[2], controller;
    drape_entry_def terms[3];
    drape_pin_def pins[2];
    drape_track_key track[2];
    drape_cloth_def cloth;
    drape_scene_def scene;
} host_scene;

static const int32_t first_node[] = {0};

static void fill_scene(host_scene *s)
{
    *s = (host_scene){
        .grid = {{"edges", 5, NULL}, {"edge_length", 0.1, NULL}},
        .material = {{"young_modulus", 1e5, NULL},
                     {"poisson_ratio", 0.3, NULL},
                     {"thickness", 1e-3, NULL},
                     {"density", 200, NULL}},
        .stiffness = {"stiffness", 0, "report"},
        .beta = {"beta", 1e-3, NULL},
        .integrator = {{"dt", 0.01, NULL}, {"tolerance", 1e-7, NULL}},
        .controller = {"dt_min", 1e-6, NULL},
        .track = {{0, {0, 0, 0}}, {1, {0, 0.5, 0}}},
    };
    s->terms[0] = (drape_entry_def){.type = "stretch.edge"};
    s->terms[1] = (drape_entry_def){"bend.hinge", &s->stiffness, 1};
    s->terms[2] = (drape_entry_def){"damp.kelvin_voigt", &s->beta, 1};
    drape_scene_def_init(&s->scene, sizeof s->scene);
    drape_cloth_def_init(&s->cloth, sizeof s->cloth);
    drape_pin_def_init(&s->pins[0], sizeof s->pins[0]);
    drape_pin_def_init(&s->pins[1], sizeof s->pins[1]);
    s->pins[0].nodes = first_node;
    s->pins[0].node_count = 1;
    s->pins[1].corner = "top-right";
    s->pins[1].track = s->track;
    s->pins[1].key_count = 2;
    s->cloth.name = "sheet";
    s->cloth.mesh.grid = (drape_entry_def){"equilateral", s->grid, 2};
    memcpy(s->cloth.mesh.rotate, (const double[]){1, 2, 3, 20}, sizeof s->cloth.mesh.rotate);
    s->cloth.material = s->material;
    s->cloth.material_count = 4;
    s->cloth.terms = s->terms;
    s->cloth.term_count = 3;
    s->cloth.pins = s->pins;
    s->cloth.pin_count = 2;
    s->cloth.velocity[2] = 0.25;
    s->scene.cloths = &s->cloth;
    s->scene.cloth_count = 1;
    memcpy(s->scene.gravity, (const double[]){0, -9.5, 0.5}, sizeof s->scene.gravity);
    s->scene.integrator = (drape_entry_def){"be", s->integrator, 2};
    s->scene.controller = (drape_entry_def){"halving", &s->controller, 1};
    s->scene.frame_rate = 30;
}

static uint64_t hash_after(drape_context *ctx, const drape_model *model, double t)
{
    scoped_sim *sim = make_sim(ctx, model);
    assert_ok(ctx, drape_sim_advance(sim, t));
    uint64_t hash = drape_sim_hash(sim);
    return hash;
}

/* ---- Defs ---- */

TEST(defs_that_were_not_initialised_are_refused)
{
    drape_context *ctx = make_context(), *other = NULL;
    drape_context_def context_def = {0};
    drape_scene_def scene_def = {0};
    drape_sim_def sim_def = {0};
    drape_model *model = make_sheet(ctx), *no_model = NULL;
    drape_sim *sim = NULL;
    for (int i = 0; i < 3; i++) { /* not initialised, only its size, longer than this version's */
        context_def.struct_size = i == 0 ? 0 : i == 1 ? sizeof(size_t) : sizeof context_def + 1;
        scene_def.struct_size = i == 0 ? 0 : i == 1 ? sizeof(size_t) : sizeof scene_def + 1;
        sim_def.struct_size = i == 0 ? 0 : i == 1 ? sizeof(size_t) : sizeof sim_def + 1;
        ck_assert_int_lt(drape_context_create(&context_def, &other), 0);
        ck_assert_int_eq(drape_model_create(ctx, &scene_def, &no_model), DRAPE_E_VERSION);
        check_message(ctx, "drape_scene_def_init");
        ck_assert_int_eq(drape_sim_create(ctx, model, &sim_def, &sim), DRAPE_E_VERSION);
        check_message(ctx, "drape_sim_def_init");
    }
    ck_assert(!other && !no_model && !sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
}

/* An array of `count` defs as an older caller has them: only their first `size` bytes, without gaps. The
 * memory after the last one is not readable. */
static void *as_older(const void *defs, size_t count, size_t full, size_t size)
{
    char *older = malloc(count * size);
    ck_assert_ptr_nonnull(older);
    for (size_t i = 0; i < count; i++) {
        memcpy(older + i * size, (const char *)defs + i * full, size);
        memcpy(older + i * size, &size, sizeof size);
    }
    return older;
}

/* Every def in every shorter version, one for each of its members to end before. Members that an older caller
 * does not have get their defaults. */
TEST(every_older_def_is_read)
{
    static const size_t sims[] = {offsetof(drape_sim_def, controller),
                                  offsetof(drape_sim_def, dt),
                                  offsetof(drape_sim_def, dt_min),
                                  offsetof(drape_sim_def, frame_rate),
                                  offsetof(drape_sim_def, threads),
                                  offsetof(drape_sim_def, realtime_step),
                                  sizeof(drape_sim_def)},
                        scenes[] = {offsetof(drape_scene_def, formats),
                                    offsetof(drape_scene_def, folder),
                                    offsetof(drape_scene_def, colliders),
                                    offsetof(drape_scene_def, self_contact),
                                    offsetof(drape_scene_def, contact),
                                    offsetof(drape_scene_def, up),
                                    offsetof(drape_scene_def, untangle),
                                    sizeof(drape_scene_def)},
                        pins[] = {offsetof(drape_pin_def, clamp), sizeof(drape_pin_def)},
                        cloths[] = {sizeof(drape_cloth_def) - sizeof(double[3]), sizeof(drape_cloth_def)};
    scoped_context *ctx = make_context();
    host_scene s;
    fill_scene(&s);
    memset(s.cloth.velocity, 0, sizeof s.cloth.velocity);
    scoped_model *model = NULL;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_OK);
    uint64_t expected = hash_after(ctx, model, 0.05);
    drape_context *other = NULL;
    drape_context_def context_def;
    memset(&context_def, 0xee, sizeof context_def);
    drape_context_def_init(&context_def, offsetof(drape_context_def, log));
    ck_assert_int_eq(drape_context_create(&context_def, &other), DRAPE_OK);
    drape_context_destroy(&other);
    for (size_t i = 0; i < sizeof sims / sizeof *sims; i++) {
        scoped_memory drape_sim_def *def = malloc(sims[i]);
        scoped_sim *sim = NULL;
        drape_sim_def_init(def, sims[i]);
        ck_assert_msg(drape_sim_create(ctx, model, def, &sim) == DRAPE_OK, "%zu bytes: %s", sims[i],
                      drape_context_message(ctx));
        ck_assert_int_eq(drape_sim_advance(sim, 0.05), DRAPE_OK);
        ck_assert_uint_eq(drape_sim_hash(sim), expected);
    }
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++)
        for (size_t p = 0; p < sizeof pins / sizeof *pins; p++)
            for (size_t c = 0; c < sizeof cloths / sizeof *cloths; c++) {
                drape_model *same = NULL;
                drape_cloth_def cloth = s.cloth;
                drape_scene_def scene = s.scene;
                void *older_pins = as_older(s.pins, 2, sizeof *s.pins, pins[p]);
                cloth.pins = older_pins;
                void *older_cloth = as_older(&cloth, 1, sizeof cloth, cloths[c]);
                scene.cloths = older_cloth;
                void *older_scene = as_older(&scene, 1, sizeof scene, scenes[i]);
                ck_assert_msg(drape_model_create(ctx, older_scene, &same) == DRAPE_OK, "%zu %zu %zu: %s",
                              scenes[i], pins[p], cloths[c], drape_context_message(ctx));
                ck_assert_uint_eq(hash_after(ctx, same, 0.05), expected);
                drape_model_destroy(&same);
                free(older_scene), free(older_cloth), free(older_pins);
            }
}

/* A collider of an older caller; defs in arrays that are zeroed, too long, or of two sizes in one array. */
TEST(defs_in_arrays_are_checked)
{
    scoped_context *ctx = make_context();
    drape_model *model = NULL;
    drape_collider_def colliders[2];
    const double center[3] = {0, -1, 0};
    const drape_setting ball[] = {{.name = "center", .vector = center, .vector_count = 3},
                                  {.name = "radius", .number = 0.1}};
    host_scene s;
    fill_scene(&s);
    for (int i = 0; i < 2; i++) {
        drape_collider_def_init(&colliders[i], sizeof colliders[i]);
        colliders[i].entry = (drape_entry_def){"sphere", ball, 2};
    }
    void *older = as_older(colliders, 2, sizeof *colliders, offsetof(drape_collider_def, track));
    s.scene.colliders = older;
    s.scene.collider_count = 2;
    assert_ok(ctx, drape_model_create(ctx, &s.scene, &model));
    ck_assert_int_eq(drape_model_collider_count(model), 2);
    drape_model_destroy(&model);
    free(older);
    for (int i = 0; i < 6; i++) {
        const char *says = i < 2   ? "drape_collider_def_init"
                           : i < 5 ? "drape_pin_def_init"
                                   : "drape_cloth_def_init";
        fill_scene(&s);
        s.scene.colliders = colliders;
        s.scene.collider_count = 2;
        colliders[0].struct_size = sizeof *colliders + (i == 0 ? 8 : 0);
        colliders[1].struct_size = i == 1 ? 0 : sizeof *colliders;
        if (i == 2)
            s.pins[0].struct_size = 0;
        else if (i == 3)
            s.pins[1].struct_size -= 8;
        else if (i == 4)
            s.pins[0].struct_size = s.pins[1].struct_size = sizeof(size_t);
        else if (i == 5)
            s.cloth.struct_size = sizeof(size_t);
        ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_E_VERSION);
        check_message(ctx, says);
        ck_assert_ptr_null(model);
    }
}

static void *some_memory(void *user, size_t size)
{
    (void)user;
    return malloc(size);
}

TEST(half_an_allocator_is_refused)
{
    drape_context *ctx = NULL;
    drape_context_def def = context_def();
    def.allocate = some_memory;
    ck_assert_int_eq(drape_context_create(&def, &ctx), DRAPE_E_ARGUMENT);
    ck_assert_ptr_null(ctx);
}

/* Wrong values in a sim's def, and the message for each. */
TEST(sim_defs_are_checked)
{
    static const struct {
        const char *integrator, *controller, *key;
        double number;
        const char *text;
        double dt, dt_min, frame_rate, teleport_speed;
        int threads;
        const char *says;
    } cases[] = {
        {.integrator = "bee", .threads = 1, .says = "did you mean \"be\"?"},
        {.controller = "halvin", .threads = 1, .says = "did you mean \"halving\"?"},
        {.key = "tolerance", .number = -1, .threads = 1, .says = "/integrator/tolerance: -1 is not allowed"},
        {.key = "tolerance", .number = NAN, .threads = 1, .says = "/integrator/tolerance"},
        {.key = "tolerance", .text = "small", .threads = 1, .says = "\"small\" is not allowed"},
        {.key = "linear_solver", .text = "kluu", .threads = 1, .says = "did you mean \"klu\"?"},
        {.key = "linear_solver", .number = 1, .threads = 1, .says = "/integrator/linear_solver"},
        {.key = "max_iterations", .number = 2.5, .threads = 1, .says = "2.5 is not allowed"},
        {.key = "toleranc", .number = 1, .threads = 1, .says = "did you mean \"tolerance\"?"},
        {.dt = -1, .threads = 1, .says = "/integrator/dt: -1 is not allowed"},
        {.dt = INFINITY, .threads = 1, .says = "/integrator/dt"},
        {.dt_min = NAN, .threads = 1, .says = "/controller/dt_min"},
        {.frame_rate = -1, .threads = 1, .says = "frame_rate = -1"},
        {.teleport_speed = -1, .threads = 1, .says = "teleport_speed = -1"},
        {.threads = 0, .says = "threads = 0; it is 1 to 256"},
        {.threads = 257, .says = "threads = 257"},
    };
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        drape_sim *sim = (drape_sim *)(uintptr_t)1;
        const drape_setting setting = {cases[i].key, cases[i].number, cases[i].text};
        drape_sim_def def = sim_def();
        def.integrator = cases[i].integrator;
        def.controller = cases[i].controller;
        def.integrator_settings = &setting;
        def.integrator_setting_count = cases[i].key ? 1 : 0;
        def.dt = cases[i].dt;
        def.dt_min = cases[i].dt_min;
        def.frame_rate = cases[i].frame_rate;
        def.teleport_speed = cases[i].teleport_speed;
        def.threads = cases[i].threads;
        ck_assert_msg(drape_sim_create(ctx, model, &def, &sim) == DRAPE_E_ARGUMENT, "case %zu", i);
        ck_assert_ptr_null(sim);
        check_message(ctx, cases[i].says);
    }
}

/* Parts of a scene that are NULL where there should be something, or zeroed: assignments to the defs. */
#define ZEROED(PART)                                                                                         \
    PART(s.terms[1] = (drape_entry_def){0})                                                                  \
    PART(s.cloth.terms = NULL)                                                                               \
    PART(s.scene.cloths = NULL)                                                                              \
    PART(s.material[1].name = NULL)                                                                          \
    PART(s.cloth.material = NULL)                                                                            \
    PART(s.integrator[0].name = NULL)                                                                        \
    PART(s.grid[1].name = NULL)                                                                              \
    PART(s.pins[1].track = NULL)                                                                             \
    PART(s.cloth.pins = NULL)                                                                                \
    PART(memset(&s.cloth.mesh, 0, sizeof s.cloth.mesh))                                                      \
    PART(s.scene.format_count = 1)                                                                           \
    PART(memset(&s.pins[0], 0, sizeof s.pins[0]))                                                            \
    PART(s.scene.collider_count = 1)                                                                         \
    PART(s.scene.contact_count = 1)                                                                          \
    PART(s.scene.self_contact_count = 1)                                                                     \
    PART((s.scene.colliders = &collider, s.scene.collider_count = 1))                                        \
    PART((USE_BALL, collider.entry.setting_count = 1))                                                       \
    PART((USE_BALL, collider.key_count = 1))
#define USE_BALL   s.scene.colliders = &collider, s.scene.collider_count = 1, collider.entry.type = "sphere"
#define NAME(part) #part,
#define CLEAR(part)                                                                                          \
    if (which-- == 0)                                                                                        \
        part;

/* Whether a scene with such a part is refused. Runs in its own process, as a host's mistake must not crash
 * it. */
static bool zeroed_is_refused(int which)
{
    host_scene s;
    drape_context *ctx = make_context();
    drape_model *model = NULL;
    drape_collider_def collider = {0};
    fill_scene(&s);
    ZEROED(CLEAR)
    return drape_model_create(ctx, &s.scene, &model) < 0 && !model && *drape_context_message(ctx);
}

TEST(zeroed_parts_of_a_scene_are_refused)
{
    static const char *const parts[] = {ZEROED(NAME)};
    for (int which = 0; which < (int)(sizeof parts / sizeof *parts); which++) {
        int status = 0;
        pid_t child = fork();
        ck_assert_int_ge(child, 0);
        if (child == 0)
            _exit(zeroed_is_refused(which) ? 0 : 1);
        ck_assert_int_eq(waitpid(child, &status, 0), child);
        ck_assert_msg(status == 0, "%s: %s", parts[which], WIFEXITED(status) ? "taken" : "crash");
    }
}

/* ---- Scenes ---- */

TEST(a_scene_in_memory_is_the_same_as_in_a_file)
{
    scoped_context *ctx = make_context();
    host_scene s;
    scoped_model *text = make_sheet(ctx), *memory = NULL;
    fill_scene(&s);
    assert_ok(ctx, drape_model_create(ctx, &s.scene, &memory));
    memset(&s, 0xee, sizeof s); /* the model keeps no pointer into the defs */
    ck_assert_int_eq(drape_model_node_count(memory), 36);
    ck_assert_int_eq(drape_model_dof_count(memory), 3 * 34);
    ck_assert_int_eq(drape_model_nonzero_count(memory), drape_model_nonzero_count(text));
    ck_assert_double_eq(drape_model_frame_rate(memory), 30);
    ck_assert_double_eq(drape_model_duration(memory), 1);
    ck_assert_uint_eq(hash_after(ctx, memory, 0.2), hash_after(ctx, text, 0.2));
    ck_assert_uint_ne(hash_after(ctx, memory, 0.1), hash_after(ctx, text, 0.2));
}

/* The hash covers time, positions and velocities: a change of any one of them changes it. */
TEST(the_hash_sees_all_of_the_state)
{
    scoped_context *ctx = make_context();
    host_scene s;
    drape_model *models[3];
    uint64_t hashes[3];
    for (int i = 0; i < 3; i++) {
        fill_scene(&s);
        if (i == 1)
            s.cloth.velocity[2] = 0.26;
        if (i == 2)
            s.cloth.mesh.translate[0] = 1e-9;
        ck_assert_int_eq(drape_model_create(ctx, &s.scene, &models[i]), DRAPE_OK);
        hashes[i] = hash_after(ctx, models[i], 0);
        for (int k = 0; k < i; k++)
            ck_assert_uint_ne(hashes[i], hashes[k]);
        ck_assert_uint_eq(hashes[i], hash_after(ctx, models[i], 0));
    }
    for (int i = 0; i < 3; i++)
        drape_model_destroy(&models[i]);
    fill_scene(&s); /* only the time changes */
    memset(s.scene.gravity, 0, sizeof s.scene.gravity);
    memset(s.cloth.velocity, 0, sizeof s.cloth.velocity);
    s.cloth.pin_count = 0;
    s.cloth.term_count = 0;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &models[0]), DRAPE_OK);
    ck_assert_uint_ne(hash_after(ctx, models[0], 0.01), hash_after(ctx, models[0], 0.02));
    drape_model_destroy(&models[0]);
}

TEST(a_model_can_be_read)
{
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    int32_t nodes = drape_model_node_count(model), triangles = drape_model_triangle_count(model);
    double mass = 0;
    ck_assert_int_eq(nodes, 36);
    ck_assert_int_eq(triangles, 50);
    ck_assert_int_eq(drape_model_cloth_count(model), 1);
    drape_cloth_range cloth = drape_model_cloth(model, 0);
    ck_assert_str_eq(cloth.name, "sheet");
    ck_assert(cloth.first_node == 0 && cloth.node_count == nodes);
    ck_assert(cloth.first_triangle == 0 && cloth.triangle_count == triangles);
    ck_assert_str_eq(drape_model_cloth(model, 1).name, "");
    ck_assert_str_eq(drape_model_cloth(model, -1).name, "");
    for (int32_t i = 0; i < 3 * triangles; i++)
        ck_assert(drape_model_triangles(model)[i] >= 0 && drape_model_triangles(model)[i] < nodes);
    for (int32_t i = 0; i < nodes; i++) {
        mass += drape_model_masses(model)[i];
        ck_assert_int_eq(drape_model_pinned(model)[i], i == 0 || i == 5);
    }
    ck_assert_double_eq_tol(mass, 50 * sqrt(3) / 4 * 0.01 * 0.2, 1e-15); /* triangles of 0.1 m, 0.2 kg/m2 */
    scoped_sim *sim = make_sim(ctx, model);
    ck_assert_ptr_eq(drape_sim_model(sim), model);
    ck_assert_mem_eq(drape_sim_positions(sim), drape_model_rest_positions(model), 3 * 36 * sizeof(double));
    for (int32_t i = 0; i < 3 * nodes; i++)
        ck_assert_double_eq(drape_sim_velocities(sim)[i],
                            i % 3 == 2 && !drape_model_pinned(model)[i / 3] ? 0.25 : 0);
}

TEST(an_override_is_a_value_of_the_scene)
{
    scoped_context *ctx = make_context();
    char text[] = SHEET;
    drape_scene *scene = NULL;
    scoped_model *model = make_sheet(ctx), *other = NULL;
    scoped_sim *sim = NULL;
    drape_sim_def def = sim_def();
    quote(text);
    ck_assert_int_eq(drape_scene_parse(ctx, text, "s.json", &scene), DRAPE_OK);
    ck_assert_int_eq(drape_scene_set(scene, "/integrator/dt", "0.02"), DRAPE_OK);
    ck_assert_int_eq(drape_scene_set(scene, "/integrator/linear_solver", "dense"), DRAPE_OK);
    ck_assert_int_eq(drape_scene_compile(scene, &other), DRAPE_OK);
    drape_scene_destroy(&scene);
    const drape_setting dense = {"linear_solver", 0, "dense"};
    def.dt = 0.02;
    def.integrator_settings = &dense;
    def.integrator_setting_count = 1;
    ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 0.2), DRAPE_OK);
    ck_assert_uint_eq(drape_sim_hash(sim), hash_after(ctx, other, 0.2));
}

/* ---- Terms of the host ---- */

/* E = 1/2 k |x - c|^2 of every node. */
static const drape_param attract_params[] = {
    DRAPE_NUMBER("stiffness", "N/m", DRAPE_REQUIRED, 0, 1e6, "k"),
    DRAPE_NUMBER("height", "m", 1, -100, 100, "y of the point"),
    DRAPE_BOOLEAN("refuse", false, "for tests: build says no"),
};

static drape_status attract_build(const drape_cloth_view *cloth, const double *params,
                                  drape_term_builder *builder)
{
    if (params[2] != 0)
        return drape_term_refuse(builder, "height %g m is not\nto its taste", params[1]);
    drape_status status = drape_term_reserve(builder, cloth->node_count, 0);
    for (int32_t i = 0; !status && i < cloth->node_count; i++)
        drape_term_set(builder, i, &i, NULL);
    return status;
}

static void attract_one(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                        double *hess)
{
    const double k = el->params[0], d[3] = {x[0], x[1] - el->params[1], x[2]};
    (void)element;
    if (e)
        *e = 0.5 * k * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int i = 0; g && i < 3; i++)
        g[i] = k * d[i];
    for (int i = 0; hess && i < 9; i++)
        hess[i] = i % 4 == 0 ? k : 0;
}

static void attract_energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                           const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    drape_energy_range(el, first, count, x, e, g, hess, attract_one);
}

static const drape_term_ops attract = {.struct_size = sizeof(drape_term_ops),
                                       .entry = {.name = "host.attract",
                                                 .summary = "draws every node to a point",
                                                 .reference = "Hooke 1678",
                                                 .params = attract_params,
                                                 .param_count = 3},
                                       .element_name = "node",
                                       .nodes = 1,
                                       .build = attract_build,
                                       .energy = attract_energy};

#define ATTRACTED(term)                                                                                      \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 1, 'edge_length': 0.1},"               \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'total_mass': 0.4, 'mass': 'uniform'},"          \
    " 'terms': [" term "]}], 'gravity': [0,0,0], 'integrator': {'dt': 0.001, 'tolerance': 1e-10}, "          \
    "'duration': 1}"

/* Four nodes of 0.1 kg, each on a spring of 10 N/m and not connected: w = 10 rad/s, y = 1 - cos(10 t), except
 * for the decay of backward Euler, exp(-w^2 h t/2), and its phase error of the same order. */
TEST(a_user_defined_term_works)
{
    scoped_context *ctx = make_context();
    scoped_model *model = NULL;
    ck_assert_int_eq(drape_context_add_term(ctx, &attract), DRAPE_OK);
    assert_ok(ctx, compile_text(ctx, ATTRACTED("{'type': 'host.attract', 'stiffness': 10}"), &model));
    scoped_sim *sim = make_sim(ctx, model);
    ck_assert_double_gt(drape_sim_energy(sim).elastic, 4 * 0.5 * 10 * 1);
    ck_assert_int_eq(drape_sim_advance(sim, 0.2), DRAPE_OK);
    for (int i = 0; i < 4; i++)
        ck_assert_double_eq_tol(drape_sim_positions(sim)[3 * i + 1], 1 - cos(2.0), 100 * 0.001 * 0.2);
}

TEST(faults_of_a_user_defined_term_are_reported_at_its_place)
{
    static const struct {
        const char *scene, *says;
    } cases[] = {
        {ATTRACTED("'host.attract'"), "\"stiffness\" is missing"},
        {ATTRACTED("{'type': 'host.attract', 'stiffness': -1}"),
         "/cloth/0/terms/0/stiffness: -1 is not allowed"},
        {ATTRACTED("{'type': 'host.attract', 'stifness': 1}"), "did you mean \"stiffness\"?"},
        {ATTRACTED("{'type': 'host.atract', 'stiffness': 1}"), "did you mean \"host.attract\"?"},
        {ATTRACTED("{'type': 'host.attract', 'stiffness': 1, 'refuse': true}"),
         "/cloth/0/terms/0: height 1 m is not to its taste"},
        {ATTRACTED("{'type': 'host.attract', 'stiffness': 1}, {'type': 'host.attract', 'stiffness': 2}"),
         "/cloth/0/terms/1: the term \"host.attract\" is named twice"},
    };
    scoped_context *ctx = make_context(), *other = make_context();
    drape_model *model;
    ck_assert_int_eq(drape_context_add_term(ctx, &attract), DRAPE_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        ck_assert_int_eq(compile_text(ctx, cases[i].scene, &model), DRAPE_E_ARGUMENT);
        ck_assert_ptr_null(model);
        check_message(ctx, cases[i].says);
        check_message(ctx, "s.json:1:");
    }
    /* another context does not have the term */
    ck_assert_int_eq(compile_text(other, ATTRACTED("{'type': 'host.attract', 'stiffness': 1}"), &model),
                     DRAPE_E_ARGUMENT);
    check_message(other, "there is no term \"host.attract\"");
}

static const int32_t a_node[] = {0};

static drape_status forgets(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder)
{
    (void)cloth, (void)params;
    drape_status status = drape_term_reserve(builder, 2, 0);
    if (!status)
        drape_term_set(builder, 0, a_node, NULL);
    return status;
}

static drape_status strays(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder)
{
    (void)cloth, (void)params;
    drape_status status = drape_term_reserve(builder, 1, 0);
    for (int32_t i = 0; !status && i < 2; i++)
        drape_term_set(builder, i, a_node, NULL);
    return status;
}

static drape_status announces_nothing(const drape_cloth_view *cloth, const double *params,
                                      drape_term_builder *builder)
{
    (void)cloth, (void)params;
    drape_term_set(builder, 0, a_node, NULL);
    return DRAPE_OK;
}

static drape_status announces_twice(const drape_cloth_view *cloth, const double *params,
                                    drape_term_builder *builder)
{
    (void)cloth, (void)params;
    const drape_status status = drape_term_reserve(builder, 0, 0);
    return status ? status : drape_term_reserve(builder, 0, 0);
}

static drape_status announces_less(const drape_cloth_view *cloth, const double *params,
                                   drape_term_builder *builder)
{
    (void)cloth, (void)params;
    return drape_term_reserve(builder, -1, 0);
}

static drape_status says_nothing(const drape_cloth_view *cloth, const double *params,
                                 drape_term_builder *builder)
{
    (void)cloth, (void)params, (void)builder;
    return DRAPE_E_FILE;
}

TEST(elements_of_a_user_defined_term_are_checked)
{
    static const struct {
        drape_status (*build)(const drape_cloth_view *, const double *, drape_term_builder *);
        drape_status status;
        const char *says;
    } cases[] = {
        {forgets, DRAPE_E_ARGUMENT, "host.attract announced 2 elements and did not set element 1"},
        {strays, DRAPE_E_ARGUMENT, "host.attract set an element outside of the 1 that it announced"},
        {announces_twice, DRAPE_E_ARGUMENT, "host.attract announced its elements twice"},
        {announces_less, DRAPE_E_ARGUMENT, "host.attract announced -1 elements of 1 nodes with 0 numbers"},
        {announces_nothing, DRAPE_E_ARGUMENT,
         "host.attract set an element outside of the 0 that it announced"},
        {says_nothing, DRAPE_E_FILE, "/cloth/0/terms/0: build() of \"host.attract\" returned e_file"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_context *ctx = make_context();
        drape_model *model;
        drape_term_ops ops = attract;
        ops.build = cases[i].build;
        ck_assert_int_eq(drape_context_add_term(ctx, &ops), DRAPE_OK);
        ck_assert_int_eq(compile_text(ctx, ATTRACTED("{'type': 'host.attract', 'stiffness': 1}"), &model),
                         cases[i].status);
        check_message(ctx, cases[i].says);
    }
}

/* ---- Colliders, built in and user-defined ---- */

#define WITH_COLLIDERS(text)                                                                                 \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 1, 'edge_length': 0.1},"               \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}], 'colliders': [" text "],"     \
    " 'duration': 1}"

/* A user-defined ball; its parameters, two vectors and a number, have 7 values. */
static const drape_param blob_params[] = {
    DRAPE_TURN("tilt", 0, -360, 360, "what it is turned by"),
    DRAPE_VECTOR("middle", "m", 0.25, -1, 1, "its center"),
    DRAPE_NUMBER("size", "m", DRAPE_REQUIRED, 0, 2, "its radius"),
};

static drape_status blob_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    (void)tolerance;
    if (values[6] == 2)
        return drape_shape_refuse(shape, "size", "%g m is not\nto its taste", values[6]);
    double *kept = drape_shape_take(shape, 1, sizeof *kept);
    if (!kept)
        return DRAPE_E_MEMORY;
    *kept = values[0] == 0 && values[1] == 30 && values[2] == 0 ? values[3] + values[4] + values[5] : NAN;
    shape->kept = kept;
    drape_status status = drape_shape_reserve(shape, 1, 0, 0);
    return status ? status : values[6] == 1 ? drape_shape_reserve(shape, 1, 0, 0) : DRAPE_OK;
}

static double blob_distance(const double *values, const drape_collider_shape *shape, const double *x,
                            double *normal, double *curvature)
{
    (void)values, (void)shape, (void)x, (void)normal, (void)curvature;
    return 1;
}

static const drape_collider_ops blob = {.struct_size = sizeof(drape_collider_ops),
                                        .entry = {.name = "host.blob",
                                                  .summary = "a ball of the host",
                                                  .reference = "none",
                                                  .params = blob_params,
                                                  .param_count = 3},
                                        .shape = blob_shape,
                                        .distance = blob_distance};

TEST(colliders_of_a_scene_can_be_asked)
{
    scoped_context *ctx = make_context();
    scoped_model *model = NULL;
    assert_ok(ctx, compile_text(
                       ctx,
                       WITH_COLLIDERS("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0]},"
                                      "{'type': 'sphere', 'center': [0, 0, 0], 'radius': 1, 'name': 'ball',"
                                      " 'track': [[1, [0, 0, 0]], [2, [0, 0, 4]]]}"),
                       &model));
    ck_assert_int_eq(drape_model_collider_count(model), 2);
    drape_collider_motion plane = drape_model_collider(model, 0, 1.5),
                          ball = drape_model_collider(model, 1, 1.5);
    ck_assert_str_eq(plane.name, "collider0");
    ck_assert_str_eq(plane.type, "plane");
    ck_assert_double_eq(plane.displacement[2], 0);
    ck_assert_double_eq(plane.velocity[2], 0);
    ck_assert_str_eq(ball.name, "ball");
    ck_assert_double_eq(ball.displacement[2], 2);
    ck_assert_double_eq(ball.velocity[2], 4);
    ck_assert_str_eq(drape_model_collider(model, 2, 0).name, "");
    ck_assert_str_eq(drape_model_collider(model, -1, 0).type, "");
    ck_assert_str_eq(drape_model_collider(NULL, 0, 0).name, "");
    ck_assert_int_eq(drape_model_collider_count(NULL), 0);
}

TEST(a_collider_in_memory_is_the_same_as_in_a_file)
{
    host_scene s;
    scoped_context *ctx = make_context();
    drape_model *model = NULL;
    const double center[3] = {0.1, 0.2, 0.3}, turn[4] = {0, 1, 0, 45};
    const drape_setting box[] = {{.name = "center", .vector = center, .vector_count = 3},
                                 {.name = "size", .number = 0.5},
                                 {.name = "rotate", .vector = turn, .vector_count = 4}};
    const drape_track_key keys[] = {{0, {0, 0, 0}}, {1, {1, 0, 0}}};
    const drape_setting thickness = {"thickness", 0.01, NULL}, lagged = {"friction", 0, "lagged"};
    drape_collider_def def = collider_def();
    fill_scene(&s);
    def.entry = (drape_entry_def){"box", box, 3};
    def.track = keys;
    def.key_count = 2;
    s.scene.colliders = &def;
    s.scene.collider_count = 1;
    s.scene.self_contact = &thickness;
    s.scene.self_contact_count = 1;
    s.scene.contact = &lagged;
    s.scene.contact_count = 1;
    assert_ok(ctx, drape_model_create(ctx, &s.scene, &model));
    ck_assert_double_eq(drape_model_collider(model, 0, 0.5).displacement[0], 0.5);
    drape_model_destroy(&model);

    def.friction = -1;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_E_ARGUMENT);
    check_message(ctx, "/colliders/0/friction: -1 is not allowed; friction is a number in [0, 1000]");
    def.friction = NAN;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_E_ARGUMENT);
    def.friction = 0;
    s.scene.collider_count = 4097;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_E_ARGUMENT);
    check_message(
        ctx, "/colliders: an array of 4097 is not allowed; colliders is an array of objects, at most 4096");
}

/* -1 stands for a number that is not given; nothing else below the range does. */
TEST(numbers_below_not_given_are_refused)
{
    scoped_context *ctx = make_context();
    scoped_model *model = NULL;
    host_scene s;
    fill_scene(&s);
    s.pins[0].triangle = -7;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_E_ARGUMENT);
    check_message(ctx, "/cloth/0/pins/0/triangle: -7 is not allowed; triangle is an integer in [0, ");
    s.pins[0].triangle = -1;
    s.pins[1].row = INT32_MIN;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_E_ARGUMENT);
    check_message(ctx, "/cloth/0/pins/1/row: -2147483648 is not allowed; row is an integer in [0, ");
    s.pins[1].row = -1;
    ck_assert_int_eq(drape_model_create(ctx, &s.scene, &model), DRAPE_OK);
}

TEST(a_user_defined_collider_works)
{
    static const struct {
        const char *scene, *says;
    } cases[] = {
        {WITH_COLLIDERS("{'type': 'host.blob'}"),
         "/colliders/0: \"size\" is missing: its radius; a number in [0, 2] m"},
        {WITH_COLLIDERS("{'type': 'host.blob', 'size': 2}"), "/colliders/0/size: 2 m is not to its taste"},
        {WITH_COLLIDERS("{'type': 'host.blob', 'size': 1}"),
         "/colliders/0: the shape announced its parts twice"},
        {WITH_COLLIDERS("{'type': 'host.blob', 'size': 0.5, 'middle': [0, 0, 2]}"),
         "/colliders/0/middle: 2 is not allowed; middle is [x, y, z], each in [-1, 1] m"},
        {WITH_COLLIDERS("{'type': 'host.blb', 'size': 2}"), "did you mean \"host.blob\"?"},
    };
    scoped_context *ctx = make_context();
    scoped_model *model = NULL;
    ck_assert_int_eq(drape_context_add_collider(ctx, &blob), DRAPE_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        ck_assert_int_eq(compile_text(ctx, cases[i].scene, &model), DRAPE_E_ARGUMENT);
        check_message(ctx, cases[i].says);
    }
    assert_ok(ctx,
              compile_text(ctx, WITH_COLLIDERS("{'type': 'host.blob', 'size': 0.5, 'tilt': [0, 3, 0, 30]}"),
                           &model));
    ck_assert_str_eq(drape_model_collider(model, 0, 0).type, "host.blob");
}

/* The shorter ops of an older caller, freed after they were registered: the library has copied them. */
TEST(ops_are_copied_and_may_be_older)
{
    scoped_context *ctx = make_context(), *other = make_context();
    scoped_model *model = NULL, *same = NULL;
    void *term = as_older(&attract, 1, sizeof attract, offsetof(drape_term_ops, in_medium)),
         *shape = as_older(&blob, 1, sizeof blob, offsetof(drape_collider_ops, smooth));
    ck_assert_int_eq(drape_context_add_term(ctx, term), DRAPE_OK);
    ck_assert_int_eq(drape_context_add_collider(ctx, shape), DRAPE_OK);
    free(term);
    free(shape);
    ck_assert_int_eq(drape_context_add_term(other, &attract), DRAPE_OK);
    ck_assert_int_eq(compile_text(ctx, ATTRACTED("{'type': 'host.attract', 'stiffness': 10}"), &model),
                     DRAPE_OK);
    ck_assert_int_eq(compile_text(other, ATTRACTED("{'type': 'host.attract', 'stiffness': 10}"), &same),
                     DRAPE_OK);
    ck_assert_uint_eq(hash_after(ctx, model, 0.2), hash_after(other, same, 0.2));
}

static void some_law(const double *params, int32_t count, const double *k, const double *strain,
                     const double *rate, double *force, double *dforce_dstrain, double *dforce_drate,
                     double *energy)
{
    (void)params, (void)count, (void)k, (void)strain, (void)rate;
    (void)force, (void)dforce_dstrain, (void)dforce_drate, (void)energy;
}

static void no_motion(const drape_elements *el, int32_t first, int32_t count, const double *x,
                      const double *v, const drape_kinetic *out)
{
    (void)el, (void)first, (void)count, (void)x, (void)v, (void)out;
}

/* What is wrong in the ops of a term or of a collider, or in the list of their parameters: assignments, with
 * the reason of the refusal. */
#define MALFORMED_ENTRY(CASE)                                                                                \
    CASE(ops.struct_size = 0, "have 0 bytes")                                                                \
    CASE(ops.struct_size++, "bytes")                                                                         \
    CASE(ops.entry.name = NULL, "not well formed")                                                           \
    CASE(ops.entry.summary = NULL, "not well formed")                                                        \
    CASE(ops.entry.params = NULL, LIST)                                                                      \
    CASE((ops.entry.params = wide, ops.entry.param_count = 9), LIST)                                         \
    CASE((ops.entry.params = &one, ops.entry.param_count = 1, one.name = NULL), LIST)                        \
    CASE((ops.entry.params = &one, ops.entry.param_count = 1, one.unit = NULL), LIST)                        \
    CASE((ops.entry.params = &one, ops.entry.param_count = 1, one.kind = DRAPE_PARAM_CHOICE), LIST)          \
    CASE((ops.entry.params = &one, ops.entry.param_count = 1, one = no_choices), LIST)
#define LIST "at most 24 values of parameters, each with name and unit, a choice with choices"

#define MALFORMED_TERM(CASE)                                                                                 \
    CASE(ops.struct_size = offsetof(drape_term_ops, in_medium) - 1, "an older one's")                        \
    CASE(ops.element_name = NULL, "not well formed")                                                         \
    CASE(ops.energy = NULL, "not well formed")                                                               \
    CASE(ops.law = some_law, "not well formed")                                                              \
    CASE(ops.nodes = 0, "not well formed")                                                                   \
    CASE(ops.nodes = DRAPE_MAX_ELEMENT_NODES + 1, "not well formed")                                         \
    CASE(ops.build = NULL, "not well formed")                                                                \
    CASE(ops.has_internal = true, "not well formed")                                                         \
    CASE(ops.entry.param_count = DRAPE_MAX_PARAMS + 1, "not well formed")                                    \
    CASE(ops.damped = true, "not well formed")       /* dashpots act on a measure, and it has none */        \
    CASE(ops.in_medium = true, "not well formed")    /* an energy does not depend on the velocity */         \
    CASE(ops.kinetic = no_motion, "not well formed") /* it stands beside a dissipation */                    \
    CASE(ops.entry.name = "stretch.edge", "there is a term \"stretch.edge\" already")

#define MALFORMED_COLLIDER(CASE)                                                                             \
    CASE(ops.entry.reference = NULL, "not well formed")                                                      \
    CASE(ops.shape = NULL, "not well formed")                                                                \
    CASE(ops.distance = NULL, "not well formed")                                                             \
    CASE(ops.entry.name = "sphere", "there is a collider \"sphere\" already")

/* Each case on its own: `ops` are those of `good` but for one thing that is wrong. */
#define REFUSE(add, good, edit, says)                                                                        \
    {                                                                                                        \
        ops = good, one = number;                                                                            \
        edit;                                                                                                \
        const drape_status expected = ops.struct_size == sizeof ops ? DRAPE_E_ARGUMENT : DRAPE_E_VERSION;    \
        ck_assert_msg(add(ctx, &ops) == expected, #edit);                                                    \
        check_message(ctx, says);                                                                            \
    }
#define REFUSE_TERM(edit, says)     REFUSE(drape_context_add_term, attract, edit, says)
#define REFUSE_COLLIDER(edit, says) REFUSE(drape_context_add_collider, blob, edit, says)

static const char *const none[] = {NULL};
static const drape_param number = DRAPE_NUMBER("one", "m", 0, 0, 1, "one"),
                         no_choices = {
                             .name = "one", .unit = "1", .kind = DRAPE_PARAM_CHOICE, .choices = none};
static drape_param wide[9]; /* of three values each */

static void fill_wide(void)
{
    for (int i = 0; i < 9; i++)
        wide[i] = (drape_param)DRAPE_VECTOR("wide", "m", 0, 0, 1, "three");
}

TEST(malformed_terms_are_refused)
{
    scoped_context *ctx = make_context();
    drape_term_ops ops;
    drape_param one;
    char names[33][16];
    fill_wide();
    MALFORMED_ENTRY(REFUSE_TERM)
    MALFORMED_TERM(REFUSE_TERM)
    for (int i = 0; i < 33; i++) {
        snprintf(names[i], sizeof names[i], "host.n%d", i);
        ops = attract;
        ops.entry.name = names[i];
        ck_assert_int_eq(drape_context_add_term(ctx, &ops), i < 32 ? DRAPE_OK : DRAPE_E_ARGUMENT);
    }
    check_message(ctx, "at most 32");
}

TEST(malformed_colliders_are_refused)
{
    scoped_context *ctx = make_context();
    drape_collider_ops ops;
    drape_param one;
    char names[33][16];
    fill_wide();
    MALFORMED_ENTRY(REFUSE_COLLIDER)
    MALFORMED_COLLIDER(REFUSE_COLLIDER)
    for (int i = 0; i < 33; i++) {
        snprintf(names[i], sizeof names[i], "host.n%d", i);
        ops = blob;
        ops.entry.name = names[i];
        ck_assert_int_eq(drape_context_add_collider(ctx, &ops), i < 32 ? DRAPE_OK : DRAPE_E_ARGUMENT);
    }
    check_message(ctx, "at most 32");
}

/* ---- Observers, statistics ---- */

typedef struct record {
    int64_t frames, attempts, accepted, iterations;
    double sum, h_min, h_max;
    double time[128], height[128]; /* of frames; height of node 35 */
    double t[128], y[128], v[128]; /* of all states from the start; of node 35 */
} record;

static drape_status observe(void *user, const drape_event *event)
{
    record *r = user;
    const drape_attempt *a = event->attempt;
    if (event->kind == DRAPE_EVENT_FRAME) {
        ck_assert_ptr_null(a);
        ck_assert_int_eq(event->frame, r->frames);
        r->time[r->frames] = event->time;
        r->height[r->frames++] = event->positions[3 * 35 + 1];
        return DRAPE_OK;
    }
    ck_assert_int_eq(a->index, r->attempts++);
    r->iterations += a->iterations;
    if (!a->accepted) {
        ck_assert_int_gt(a->status, 0);
        return DRAPE_OK;
    }
    r->sum += a->h;
    r->h_min = r->accepted == 0 ? a->h : fmin(r->h_min, a->h);
    r->h_max = fmax(r->h_max, a->h);
    r->accepted++;
    r->t[r->accepted] = drape_sim_time(event->sim);
    r->y[r->accepted] = drape_sim_positions(event->sim)[3 * 35 + 1];
    r->v[r->accepted] = drape_sim_velocities(event->sim)[3 * 35 + 1];
    return DRAPE_OK;
}

/* The cubic through both ends of a step with their velocities. */
static double hermite(const record *r, int64_t k, double t)
{
    double h = r->t[k + 1] - r->t[k], s = (t - r->t[k]) / h;
    return (1 + 2 * s) * (1 - s) * (1 - s) * r->y[k] + s * (1 - s) * (1 - s) * h * r->v[k] +
           s * s * (3 - 2 * s) * r->y[k + 1] + s * s * (s - 1) * h * r->v[k + 1];
}

static record run_frames(double rate, double t_end)
{
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    scoped_sim *sim = NULL;
    drape_sim_def def = sim_def();
    record r = {0};
    def.frame_rate = rate;
    ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_observe(sim, observe, &r), DRAPE_OK);
    r.y[0] = drape_sim_positions(sim)[3 * 35 + 1];
    r.v[0] = drape_sim_velocities(sim)[3 * 35 + 1];
    ck_assert_int_eq(drape_sim_advance(sim, t_end), DRAPE_OK);
    return r;
}

TEST(frames_come_in_time)
{
    static const double rates[] = {30, 60, 100, 250, 7};
    for (int i = 0; i < 5; i++) {
        const double end = 0.4;
        record r = run_frames(rates[i], end);
        ck_assert_int_eq(r.frames, (int64_t)floor(end * rates[i] + 1e-9) + 1);
        for (int64_t f = 0; f < r.frames; f++) {
            int64_t k = 0;
            ck_assert_double_eq_tol(r.time[f], (double)f / rates[i], 1e-11);
            while (k + 2 <= r.accepted && r.t[k + 1] < r.time[f])
                k++;
            ck_assert_double_eq_tol(r.height[f], hermite(&r, k, r.time[f]), 1e-12);
        }
    }
}

/* Frames and final state are the same if an advance is split at the ends of steps. */
TEST(advances_may_be_cut_up)
{
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    scoped_sim *sim = make_sim(ctx, model);
    record r = {0}, whole = run_frames(0, 0.4);
    ck_assert_int_eq(drape_sim_observe(sim, observe, &r), DRAPE_OK);
    for (int k = 1; k <= 40; k++) {
        ck_assert_int_eq(drape_sim_advance(sim, 0.01 * k), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(sim, 0), DRAPE_OK); /* an end in the past is reached already */
    }
    ck_assert_int_eq(r.frames, whole.frames);
    ck_assert_mem_eq(r.height, whole.height, (size_t)r.frames * sizeof *r.height);
    ck_assert_uint_eq(drape_sim_hash(sim), hash_after(ctx, model, 0.4));
}

/* ---- States set by the host ---- */

#define MAX_NODES 36

typedef struct state {
    double t, x[3 * MAX_NODES], v[3 * MAX_NODES];
} state;

static state state_of(const drape_sim *sim)
{
    state s = {.t = drape_sim_time(sim)};
    const size_t size = 3 * (size_t)drape_model_node_count(drape_sim_model(sim)) * sizeof(double);
    memcpy(s.x, drape_sim_positions(sim), size);
    memcpy(s.v, drape_sim_velocities(sim), size);
    return s;
}

static drape_status set_state(drape_sim *sim, const state *s)
{
    return drape_sim_set_state(sim, s->t, s->x, s->v);
}

static drape_sim *make_sim_of(drape_context *ctx, const drape_model *model, const char *integrator,
                              const char *controller)
{
    drape_sim *sim = NULL;
    drape_sim_def def = sim_def();
    def.integrator = integrator;
    def.controller = controller;
    def.dt = 1.0 / 64;
    assert_ok(ctx, drape_sim_create(ctx, model, &def, &sim));
    return sim;
}

/* Backward Euler under gravity alone: n steps of h from v0 move by n h v0 + g h^2 n (n + 1)/2. h and the sums
 * are exact in binary, except for the rounding of g. */
typedef struct meddler {
    drape_context *ctx;
    drape_sim *sim;
} meddler;

/* Both advance to the same bits. */
static void end_alike(drape_sim *sim, drape_sim *alone, double t)
{
    ck_assert_int_eq(drape_sim_advance(sim, t), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(alone, t), DRAPE_OK);
    ck_assert_uint_eq(drape_sim_hash(sim), drape_sim_hash(alone));
    drape_sim_destroy(&alone);
    drape_sim_destroy(&sim);
}

/* With all nodes in one point there are no angles; the next state that has angles does not depend on the
 * past. */
TEST(a_collapsed_state_leaves_nothing_behind)
{
    const double zero[3 * MAX_NODES] = {0};
    scoped_context *ctx = make_context();
    host_scene h;
    scoped_model *model = NULL;
    fill_scene(&h);
    h.cloth.pin_count = 0;
    ck_assert_int_eq(drape_model_create(ctx, &h.scene, &model), DRAPE_OK);
    drape_sim *sim = make_sim(ctx, model), *alone = make_sim(ctx, model);
    state s = state_of(alone);
    ck_assert_int_eq(drape_sim_set_state(sim, 0, zero, zero), DRAPE_OK);
    ck_assert_int_eq(set_state(sim, &s), DRAPE_OK);
    ck_assert_int_eq(set_state(alone, &s), DRAPE_OK);
    ck_assert_double_eq(drape_sim_energy(sim).elastic, drape_sim_energy(alone).elastic);
    end_alike(sim, alone, 0.1);
}

TEST(a_state_of_the_host_is_where_a_run_starts)
{
    scoped_context *ctx = make_context();
    host_scene h;
    scoped_model *model = NULL;
    fill_scene(&h);
    h.cloth.pin_count = 0;
    h.cloth.term_count = 0;
    ck_assert_int_eq(drape_model_create(ctx, &h.scene, &model), DRAPE_OK);
    scoped_sim *sim = make_sim_of(ctx, model, "be", "fixed");
    ck_assert_int_eq(drape_sim_advance(sim, 0.25), DRAPE_OK);
    state s = state_of(sim);
    s.t = 2;
    for (int i = 0; i < 3 * MAX_NODES; i++) {
        s.x[i] = 0.1 * i;
        s.v[i] = 1 - 0.01 * i;
    }
    ck_assert_int_eq(set_state(sim, &s), DRAPE_OK);
    ck_assert_double_eq(drape_sim_time(sim), 2);
    ck_assert_mem_eq(drape_sim_positions(sim), s.x, sizeof s.x);
    ck_assert_mem_eq(drape_sim_velocities(sim), s.v, sizeof s.v);
    ck_assert_int_eq(drape_sim_advance(sim, 3), DRAPE_OK);
    ck_assert_int_eq(drape_sim_statistics(sim).steps_accepted, 16 + 64);
    for (int i = 0; i < 3 * MAX_NODES; i++) {
        const double g = h.scene.gravity[i % 3];
        ck_assert_double_eq_tol(drape_sim_velocities(sim)[i], s.v[i] + g, 1e-10);
        ck_assert_double_eq_tol(drape_sim_positions(sim)[i], s.x[i] + s.v[i] + g * 65 / 128, 1e-10);
    }
}

/* The past of a sim leaves no trace: from a state that is set, it advances with the same bits as a new sim,
 * forwards and backwards in time, under every integrator and controller. */
TEST(the_past_does_not_count_after_a_state_was_set)
{
    static const char *const integrators[][2] = {
        {"be", "halving"},     {"bdf2", "halving"}, {"midpoint", "strain"}, {"ida", "halving"},
        {"be", "error"},       {"bdf2", "error"},   {"midpoint", "error"},  {"ida", "fixed"},
        {"trbdf2", "halving"}, {"trbdf2", "error"}};
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    scoped_sim *source = make_sim_of(ctx, model, "be", "halving");
    ck_assert_int_eq(drape_sim_advance(source, 0.125), DRAPE_OK);
    const state s = state_of(source);
    for (size_t i = 0; i < sizeof integrators / sizeof *integrators; i++) {
        scoped_sim *used = make_sim_of(ctx, model, integrators[i][0], integrators[i][1]),
                   *fresh = make_sim_of(ctx, model, integrators[i][0], integrators[i][1]);
        assert_ok(ctx, drape_sim_advance(used, 0.3));
        ck_assert_int_eq(set_state(used, &s), DRAPE_OK);
        ck_assert_int_eq(set_state(fresh, &s), DRAPE_OK);
        for (int k = 1; k <= 4; k++) {
            assert_ok(ctx, drape_sim_advance(used, 0.125 + 0.05 * k));
            assert_ok(ctx, drape_sim_advance(fresh, 0.125 + 0.05 * k));
            ck_assert_msg(drape_sim_hash(used) == drape_sim_hash(fresh), "%s, %s, %g s later",
                          integrators[i][0], integrators[i][1], 0.05 * k);
        }
    }
}

static void refuse_state(drape_context *ctx, drape_sim *sim, const state *s, const char *part)
{
    const uint64_t hash = drape_sim_hash(sim);
    ck_assert_int_eq(set_state(sim, s), DRAPE_E_ARGUMENT);
    check_message(ctx, part);
    ck_assert_uint_eq(drape_sim_hash(sim), hash);
}

TEST(states_of_the_host_are_checked)
{
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    scoped_sim *sim = make_sim(ctx, model);
    ck_assert_int_eq(drape_sim_advance(sim, 0.1), DRAPE_OK);
    const state good = state_of(sim);
    const uint64_t hash = drape_sim_hash(sim);
    static const double times[] = {-1e-9, NAN, INFINITY, 1.1e9};
    ck_assert_int_eq(drape_sim_set_state(NULL, 0, good.x, good.v), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_set_state(sim, 0.1, NULL, good.v), DRAPE_E_ARGUMENT);
    check_message(ctx, "there are no positions");
    ck_assert_int_eq(drape_sim_set_state(sim, 0.1, good.x, NULL), DRAPE_E_ARGUMENT);
    check_message(ctx, "there are no velocities");
    for (int i = 0; i < 4; i++) {
        state bad = good;
        bad.t = times[i];
        refuse_state(ctx, sim, &bad, "it is 0 to 1e+09 s");
    }
    state bad = good;
    bad.x[3 * 7 + 1] = NAN;
    refuse_state(ctx, sim, &bad, "the position of node 7 of sheet is nan");
    bad = good;
    bad.v[3 * 35 + 2] = -INFINITY;
    refuse_state(ctx, sim, &bad, "the velocity of node 35 of sheet is -inf");
    bad = good;
    bad.x[0] += 1e-6; /* node 0 is fixed */
    refuse_state(ctx, sim, &bad, "node 0 of sheet is at (");
    bad = good;
    bad.t = 0.2; /* by then the other pin has moved by 5 cm */
    refuse_state(ctx, sim, &bad, "its pin has it at (");
    bad = good; /* rounding, and the velocity of a fixed node, are accepted and ignored */
    bad.x[0] += 1e-12;
    bad.v[0] = 3;
    ck_assert_int_eq(set_state(sim, &bad), DRAPE_OK);
    ck_assert_uint_eq(drape_sim_hash(sim), hash);
}

typedef struct frame_times {
    int64_t frames, number; /* of the first */
    double first;
} frame_times;

static drape_status note_frame_time(void *user, const drape_event *event)
{
    frame_times *r = user;
    if (event->kind == DRAPE_EVENT_FRAME && r->frames++ == 0) {
        r->first = event->time;
        r->number = event->frame;
    }
    return DRAPE_OK;
}

/* Frames of 1/30 s: the first is at or after the new time; no frame comes twice if the time does not
 * change. */
TEST(frames_follow_the_time_of_a_state)
{
    static const struct {
        double t, end;
        int64_t frames;
        double first;
    } jumps[] = {{0.3, 0.35, 2, 0.3}, /* frames 9, 10 */
                 {0.41, 0.45, 1, 13 / 30.0},
                 {0.1, 0.15, 2, 0.1},       /* back in time: frames 3, 4 */
                 {0.15, 0.19, 1, 5 / 30.0}, /* the present time */
                 {0, 0.01, 1, 0}};
    scoped_context *ctx = make_context();
    host_scene h;
    scoped_model *model = NULL;
    frame_times r = {0};
    fill_scene(&h);
    h.cloth.pin_count = 0;
    ck_assert_int_eq(drape_model_create(ctx, &h.scene, &model), DRAPE_OK);
    scoped_sim *sim = make_sim(ctx, model);
    ck_assert_int_eq(drape_sim_observe(sim, note_frame_time, &r), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 0.1), DRAPE_OK);
    for (size_t i = 0; i < sizeof jumps / sizeof *jumps; i++) {
        state s = state_of(sim);
        s.t = jumps[i].t;
        memset(&r, 0, sizeof r);
        ck_assert_int_eq(set_state(sim, &s), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(sim, jumps[i].end), DRAPE_OK);
        ck_assert_int_eq(r.frames, jumps[i].frames);
        ck_assert_double_eq_tol(r.first, jumps[i].first, 1e-15);
        ck_assert_int_eq(r.number, llround(30 * r.first));
    }
}

/* ---- Reasons and explanations ---- */

/* A term that reports a different fault in every step. */
static int faults_found;

static drape_status fussy_check(const drape_elements *el, const double *x, const double *before,
                                const double *internal, drape_fault *fault)
{
    static char names[50][20];
    (void)el, (void)x, (void)before, (void)internal;
    char *name = names[faults_found < 50 ? faults_found++ : 49];
    snprintf(name, sizeof *names, "fault%d", faults_found);
    *fault = (drape_fault){.reason = name, .what = "fault", .element = 0};
    return DRAPE_RETRY_DEGENERATE;
}

TEST(more_reasons_than_there_is_room_for_are_other)
{
    scoped_context *ctx = make_context();
    scoped_model *model = NULL;
    scoped_sim *sim = NULL;
    drape_sim_def def = sim_def();
    drape_term_ops fussy = attract;
    int64_t count = 0, sum = 0;
    fussy.check = fussy_check;
    faults_found = 0;
    ck_assert_int_eq(drape_context_add_term(ctx, &fussy), DRAPE_OK);
    assert_ok(ctx, compile_text(ctx, ATTRACTED("{'type': 'host.attract', 'stiffness': 10}"), &model));
    def.dt = 0.001;
    def.dt_min = ldexp(0.001, -40) * 0.99; /* 41 attempts */
    ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 1), DRAPE_E_STEP_TOO_SMALL);
    for (int i = 0; i < 32; i++) {
        char expected[16];
        snprintf(expected, sizeof expected, i < 31 ? "fault%d" : "other", i + 1);
        ck_assert_str_eq(drape_sim_reason(sim, i, &count), expected);
        ck_assert_int_eq(count, i < 31 ? 1 : 10);
        sum += count;
    }
    ck_assert_ptr_null(drape_sim_reason(sim, 32, &count));
    ck_assert_int_eq(sum, drape_sim_statistics(sim).steps_rejected);
}

/* One Newton iteration is not enough. The message names the node with the largest residual and, if the sheet
 * is distorted, the most distorted element: an edge of 3 m that was 0.1 m long, a triangle at 2 % of its
 * altitude. */
TEST(a_failure_names_what_is_distorted)
{
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    scoped_sim *sim = NULL;
    drape_sim_def def = sim_def();
    const drape_setting one = {"max_iterations", 1, NULL};
    def.integrator_settings = &one;
    def.integrator_setting_count = 1;
    def.controller = "fixed";
    ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
    const state rest = state_of(sim);
    ck_assert_int_eq(drape_sim_advance(sim, 0.1), DRAPE_E_SOLVER);
    check_message(ctx, "worst at (node ");
    ck_assert_ptr_null(strstr(drape_context_message(ctx), "distorted"));
    state s = rest;
    s.x[3 * 14 + 1] += 3;
    ck_assert_int_eq(set_state(sim, &s), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 0.1), DRAPE_E_SOLVER);
    check_message(ctx, "; most distorted: edge (nodes 13 14 of sheet): length / rest length = 30.");
    const int32_t *corner = drape_model_triangles(model) + 3 * 20;
    s = rest; /* an apex moved 98 % of the distance to the middle of the opposite side */
    for (int k = 0; k < 3; k++) {
        const double middle = 0.5 * (rest.x[3 * corner[1] + k] + rest.x[3 * corner[2] + k]);
        s.x[3 * corner[0] + k] = middle + 0.02 * (rest.x[3 * corner[0] + k] - middle);
    }
    ck_assert_int_eq(set_state(sim, &s), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 0.1), DRAPE_E_SOLVER);
    check_message(ctx, "; most distorted: triangle (nodes ");
    check_message(ctx, " of sheet): altitude / rest altitude = 0.02");
}

TEST(a_sim_has_at_most_8_observers)
{
    scoped_context *ctx = make_context();
    scoped_model *model = make_sheet(ctx);
    scoped_sim *sim = make_sim(ctx, model);
    record r[9] = {{0}};
    for (int i = 0; i < 9; i++)
        ck_assert_int_eq(drape_sim_observe(sim, observe, &r[i]), i < 8 ? DRAPE_OK : DRAPE_E_ARGUMENT);
    check_message(ctx, "at most 8");
    ck_assert_int_eq(drape_sim_observe(sim, NULL, NULL), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_advance(sim, 0.05), DRAPE_OK);
    for (int i = 0; i < 9; i++)
        ck_assert_int_eq(r[i].attempts, i < 8 ? 5 : 0);
}

/* ---- Threads, names ---- */

typedef struct job {
    const drape_model *model;
    uint64_t hash;
} job;

TEST(statuses_have_names)
{
    static const struct {
        drape_status status;
        const char *name;
    } names[] = {{DRAPE_OK, "ok"},
                 {DRAPE_RETRY_NONLINEAR, "retry_nonlinear"},
                 {DRAPE_RETRY_LINEAR, "retry_linear"},
                 {DRAPE_RETRY_NONFINITE, "retry_nonfinite"},
                 {DRAPE_RETRY_DEGENERATE, "retry_degenerate"},
                 {DRAPE_RETRY_REJECTED, "retry_rejected"},
                 {DRAPE_E_ARGUMENT, "e_argument"},
                 {DRAPE_E_MEMORY, "e_memory"},
                 {DRAPE_E_FILE, "e_file"},
                 {DRAPE_E_PARSE, "e_parse"},
                 {DRAPE_E_STEP_TOO_SMALL, "e_step_too_small"},
                 {DRAPE_E_SOLVER, "e_solver"},
                 {DRAPE_E_VERSION, "e_version"},
                 {DRAPE_E_STOPPED, "e_stopped"},
                 {(drape_status)99, "unknown"},
                 {(drape_status)-99, "unknown"}};
    char version[32];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        ck_assert_str_eq(drape_status_name(names[i].status), names[i].name);
    snprintf(version, sizeof version, "%d.%d.%d", DRAPE_VERSION_MAJOR, DRAPE_VERSION_MINOR,
             DRAPE_VERSION_PATCH);
    ck_assert_str_eq(drape_version(), version);
}

TEST(messages_are_one_line)
{
    scoped_context *ctx = make_context();
    drape_model *model = NULL;
    ck_assert_str_eq(drape_context_message(ctx), "");
    drape_context_set_message(ctx, "a\nb\tc\x7f %d", 5);
    ck_assert_str_eq(drape_context_message(ctx), "a b c? 5");
    ck_assert_int_eq(drape_model_load(ctx, "no\nsuch\rfile.json", &model), DRAPE_E_FILE);
    check_message(ctx, "no such file.json: cannot read the scene");
    ck_assert_int_lt(compile_text(ctx, "{'drape': 1, 'clo\\nth': 1}", &model), 0);
    check_message(ctx, "unknown key");
    ck_assert_int_lt(compile_text(ctx, "{'drape': 1,\n 'cloth': [{]}", &model), 0);
    check_message(ctx, "s.json:2:");
}
