/* test_memory.c: every allocation of a whole run fails once: parsing, compiling, the sim, frames, summary.
 * Each failure is reported as such, leaves NULL, and leaks nothing. */
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/recorder.h"
#include "io/summary.h"
#include "solvers/linear.h"
#include "support/bytes.h"
#include "support/failing_allocator.h"
#include "support/sample.h"
#include "support/suite.h"

static char folder[32];
static char scene_path[64], mesh_path[64], solid_path[64], out_path[64], summary_path[64];

static const char mesh_text[] = "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0.2 1\nf 1 2 3\nf 3 2 4\n";
static const char solid_text[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 4 3\nf 1 2 4\nf 2 3 4\n";
static const char scene_text[] =
    "{ \"drape\": 1, // a grid and a file, every kind of term, of pin\n"
    "  \"cloth\": [\n"
    "    {\"name\": \"sheet\", \"mesh\": {\"grid\": \"equilateral\", \"edges\": 3, \"edge_length\": 0.1},\n"
    "     \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200},\n"
    "     \"terms\": [\"stretch.edge\", {\"type\": \"bend.hinge\", \"rest\": \"flat\"},\n"
    "               {\"type\": \"damp.kelvin_voigt\", \"beta\": 1e-3}, {\"type\": \"drag.viscous\", "
    "\"coefficient\": 0.1}],\n"
    "     \"pins\": [{\"corner\": \"top-left\"}, {\"nodes\": [5], \"attach\": \"post\"}, {\"nodes\": [3], "
    "\"track\": [[0, [0,0,0]], [1, "
    "[0,0.1,0]]]}]},\n"
    "    {\"mesh\": {\"file\": \"mesh.obj\", \"transform\": {\"scale\": 0.2, \"rotate\": [0, 1, 0, 30]}},\n"
    "     \"render_mesh\": {\"file\": \"mesh.obj\", \"transform\": {\"scale\": 0.2, "
    "\"rotate\": [0, 1, 0, 30]}},\n"
    "     \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"total_mass\": 0.1},\n"
    "     \"terms\": [\"stretch.edge\"], \"pins\": [{\"box\": [[-1,-1,-1],[0.1,1,0.1]]}]}],\n"
    "  \"colliders\": [{\"type\": \"plane\", \"point\": [0, -9, 0], \"normal\": [0, 1, 0]},\n"
    "    {\"type\": \"cylinder\", \"a\": [0, -9, 0], \"b\": [0, -8, 0], \"radius\": 0.1, \"name\": "
    "\"post\",\n"
    "     \"track\": [[0, [0,0,0]], [1, [0,0.1,0]]]},\n"
    "    {\"type\": \"mesh\", \"file\": \"solid.obj\", \"translate\": [0, -9, 0], \"scale\": 0.5}],\n"
    "  \"contact\": {\"friction\": \"lagged\"},\n"
    "  \"integrator\": {\"dt\": 0.01, \"linear_solver\": \"klu\"}, \"controller\": {\"type\": \"halving\"},\n"
    "  \"events\": [{\"type\": \"height\", \"height\": -5, \"action\": \"stop\"},\n"
    "    {\"type\": \"pin_force\", \"cloth\": \"sheet\", \"limit\": 1e6}],\n"
    "  \"seams\": [{\"type\": \"stitch\", \"a\": {\"cloth\": \"sheet\", \"nodes\": [1, 2]},\n"
    "    \"b\": {\"cloth\": \"cloth1\", \"box\": [[0.15, -1, -1], [1, 1, 1]]}}],\n"
    "  \"duration\": 1, \"frame_rate\": 150, \"output\": {\"formats\": [\"npy\", \"obj\", \"ply\"]} }\n";

static void write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    ck_assert_int_ge(fputs(text, file), 0);
    ck_assert_int_eq(fclose(file), 0);
}

static void make_files(void)
{
    snprintf(folder, sizeof folder, "/tmp/drape-memory-XXXXXX");
    ck_assert_ptr_nonnull(mkdtemp(folder));
    snprintf(scene_path, sizeof scene_path, "%s/scene.json", folder);
    snprintf(mesh_path, sizeof mesh_path, "%s/mesh.obj", folder);
    snprintf(solid_path, sizeof solid_path, "%s/solid.obj", folder);
    snprintf(out_path, sizeof out_path, "%s/out", folder);
    snprintf(summary_path, sizeof summary_path, "%s/summary.json", folder);
    write_text(scene_path, scene_text);
    write_text(mesh_path, mesh_text);
    write_text(solid_path, solid_text);
}

static void remove_files(void)
{
    char command[128];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    ck_assert_int_eq(system(command), 0);
}

static void breeze(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    (void)user, (void)t, (void)x, (void)gradient;
    for (int32_t i = 0; i < count; i++)
        wind[3 * i] = 1;
}

/* What a host does between two frames, up to the first failure. */
static drape_status steer(drape_sim *sim, const drape_model *model)
{
    static double forces[3 * 64];
    static const double still[3 * 64];
    const int32_t node = 3; /* on a track */
    const double *x = drape_model_rest_positions(model), up[3] = {0, 0.01, 0};
    ck_assert_int_le(drape_model_node_count(model), 64);
    drape_status status = drape_sim_move_pins(sim, 1, &node, 0.01, x + 3 * node, NULL);
    if (!status)
        status = drape_sim_move_collider(sim, 1, 0.01, up, NULL);
    if (!status)
        status = drape_sim_push(sim, still);
    if (!status)
        status = drape_sim_set_wind(sim, breeze, NULL);
    if (!status)
        status = drape_sim_set_drag_spring(sim, 1, 1, up);
    if (!status)
        status = drape_sim_reactions(sim, forces);
    if (!status)
        status = drape_sim_contact_forces(sim, forces);
    if (!status)
        status = drape_sim_collider_force(sim, 1, forces);
    if (!status)
        status = drape_sim_set_state(sim, 0, x, still);
    if (status)
        return status;
    const uint64_t hash = drape_sim_hash(sim);
    bytes saved = bytes_save(sim);
    status = drape_sim_restore_from(sim, saved.data, saved.size);
    free(saved.data);
    ck_assert(drape_sim_hash(sim) == hash);
    return status;
}

static drape_status record(drape_context *ctx, drape_sim *sim)
{
    static const char *const formats[] = {"npy", "obj", "ply", "vtp", "pc2", "glb"};
    drape_recorder *recorder = (drape_recorder *)(uintptr_t)1;
    drape_status status = drape_recorder_create(
        ctx, sim, &(drape_recorder_def){.folder = out_path, .formats = formats, .format_count = 6},
        &recorder);
    ck_assert_int_eq(status != DRAPE_OK, recorder == NULL);
    if (!status)
        status = drape_sim_advance(sim, 0.03);
    if (!status)
        status = drape_recorder_finish(recorder);
    if (!status) {
        ck_assert_int_ge(drape_recorder_done(recorder).frames, 5);
        status = drape_summary_write(ctx, sim, &(drape_summary_def){.frames = 5}, NULL, summary_path);
    }
    drape_recorder_destroy(&recorder);
    ck_assert_ptr_null(recorder);
    return status;
}

/* recorded: with frames and a summary. */
static drape_status run(drape_context *ctx, const drape_model *model, const char *linear_solver,
                        bool recorded)
{
    const drape_setting setting = {"linear_solver", 0, linear_solver};
    drape_sim *sim = (drape_sim *)(uintptr_t)1;
    drape_sim_def def = sim_def();
    def.integrator_settings = &setting;
    def.integrator_setting_count = 1;
    drape_status status = drape_sim_create(ctx, model, &def, &sim);
    ck_assert_int_eq(status != DRAPE_OK, sim == NULL);
    if (!status)
        status = steer(sim, model);
    if (!status)
        status = recorded ? record(ctx, sim) : drape_sim_advance(sim, 0.03);
    if (!status)
        ck_assert_int_eq(drape_sim_statistics(sim).steps_accepted, 3);
    drape_sim_destroy(&sim);
    ck_assert_ptr_null(sim);
    return status;
}

/* The model of a scene from text, with a setting. */
static drape_status compile(drape_context *ctx, drape_model **made)
{
    drape_scene *scene = (drape_scene *)(uintptr_t)1;
    drape_model *model = (drape_model *)(uintptr_t)1;
    drape_status status = drape_scene_load(ctx, scene_path, &scene);
    ck_assert_int_eq(status != DRAPE_OK, scene == NULL);
    if (!status)
        status = drape_scene_set(scene, "/controller/dt_min", "1e-6");
    if (!status) {
        status = drape_scene_compile(scene, &model);
        ck_assert_int_eq(status != DRAPE_OK, model == NULL);
    } else
        model = NULL;
    drape_scene_destroy(&scene);
    ck_assert_ptr_null(scene);
    *made = model;
    return status;
}

/* A whole run of a program. */
static drape_status live(drape_context *ctx, const char *linear_solver)
{
    drape_model *model = NULL;
    drape_status status = compile(ctx, &model);
    if (!status)
        status = run(ctx, model, linear_solver, true);
    drape_model_destroy(&model);
    ck_assert_ptr_null(model);
    return status;
}

static void check_failure(drape_status status, const drape_context *ctx, const failing_allocator *memory,
                          long n)
{
    const char *message = drape_context_message(ctx);
    ck_assert_msg(status == DRAPE_OK || status == DRAPE_E_MEMORY, "allocation %ld: %s: %s", n,
                  drape_status_name(status), message);
    ck_assert_msg(status == DRAPE_OK || strstr(message, "out of memory"), "allocation %ld: %s", n, message);
    ck_assert_msg(status == DRAPE_E_MEMORY || memory->calls < memory->fail_at,
                  "failure %ld of %ld was not reported", n, memory->calls);
    ck_assert_int_lt(n, 10000);
}

/* Where memory stays away, the suite `long` takes each allocation, the others one of three. */
static long next_failure(long n, bool stay_broken)
{
    return n + (stay_broken && !complete_sweep() ? 3 : 1);
}

/* Fails each allocation of a whole run. Returns the number of allocations of a run in which none fails. */
static long sweep(const char *linear_solver, bool stay_broken)
{
    long n = 0;
    for (drape_status status = DRAPE_E_MEMORY; status;) {
        n = next_failure(n, stay_broken);
        failing_allocator memory = {.fail_at = n, .stay_broken = stay_broken};
        drape_context *ctx = failing_context(&memory);
        status = live(ctx, linear_solver);
        check_failure(status, ctx, &memory, n);
        drape_context_destroy(&ctx);
        ck_assert_msg(memory.live == 0, "allocation %ld: %ld leaks", n, memory.live);
    }
    return n - 1;
}

/* Fails each allocation of a sim of a model, which stays. Returns their number. */
static long sweep_sim(const char *linear_solver, bool stay_broken)
{
    failing_allocator memory = {0};
    drape_context *ctx = failing_context(&memory);
    drape_model *model = NULL;
    long n = 0;
    ck_assert_int_eq(compile(ctx, &model), DRAPE_OK);
    const long live_before = memory.live;
    for (drape_status status = DRAPE_E_MEMORY; status;) {
        n = next_failure(n, stay_broken);
        memory = (failing_allocator){.fail_at = n, .stay_broken = stay_broken, .live = live_before};
        status = run(ctx, model, linear_solver, false);
        check_failure(status, ctx, &memory, n);
        ck_assert_msg(memory.live == live_before, "allocation %ld: %ld leaks", n, memory.live - live_before);
    }
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    ck_assert_int_eq(memory.live, 0);
    return n - 1;
}

/* With the first linear solver a whole run; with the others a sim, as neither the model nor files depend on
 * the solver. */
static void sweep_all(bool stay_broken)
{
    make_files();
    for (int i = 0; drape_linears[i]; i++) {
        const char *name = drape_linears[i]->entry.name;
        const long calls = i == 0 ? sweep(name, stay_broken) : sweep_sim(name, stay_broken);
        printf("# %s: %ld allocations\n", name, calls);
        ck_assert_int_gt(calls, 100);
    }
    remove_files();
}

TEST(every_allocation_fails_once)
{
    sweep_all(false);
}

TEST(memory_ends_and_stays_away)
{
    sweep_all(true);
}

/* ---- Lists of contacts that grow, and the pattern that is extended ---- */

static drape_model *model_of(drape_context *ctx, const char *text)
{
    scoped_parsed *parsed = NULL;
    drape_model *model = NULL;
    ck_assert_int_eq(drape_scene_parse(ctx, text, "test", &parsed), DRAPE_OK);
    ck_assert_int_eq(drape_scene_compile(parsed, &model), DRAPE_OK);
    return model;
}

static drape_model *folding_model(drape_context *ctx)
{
    static const char text[] =
        "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"square\", \"columns\": 3, \"rows\": 9, "
        "\"width\": 0.05,"
        " \"height\": 0.2, \"orientation\": \"vertical\", \"transform\": {\"rotate\": [1, 0.2, 0, 20],"
        " \"translate\": [0, 0.19, 0]}}, \"velocity\": [0, -1, 0], \"terms\": [\"stretch.edge\", "
        "\"bend.hinge\"],"
        " \"material\": {\"young_modulus\": 1e4, \"thickness\": 1e-3, \"density\": 200}}],"
        " \"colliders\": [{\"type\": \"plane\", \"point\": [0,0,0], \"normal\": [0,1,0], \"friction\": 0.5}],"
        " \"self_contact\": {\"thickness\": 3e-3, \"friction\": 0.3}, \"contact\": {\"friction\": "
        "\"lagged\"},"
        " \"integrator\": {\"dt\": 0.01}, \"duration\": 1}";
    return model_of(ctx, text);
}

/* Two balls close upon a sheet and leave it no room. */
static drape_model *pinched_model(drape_context *ctx)
{
    static const char text[] =
        "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"square\", \"columns\": 7, \"rows\": 7, "
        "\"width\": 0.1,"
        " \"height\": 0.1, \"orientation\": \"vertical\", \"transform\": {\"translate\": [-0.05, 0.1, 0]}},"
        " \"terms\": [\"stretch.edge\", \"bend.hinge\"], \"pins\": [{\"edge\": \"top\"}],"
        " \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200}}],"
        " \"colliders\": [{\"type\": \"sphere\", \"center\": [0, 0.05, -0.035], \"radius\": 0.03,"
        " \"track\": [[0, [0,0,0]], [0.06, [0,0,0.015]]]}, {\"type\": \"sphere\", \"center\": [0, 0.05, "
        "0.035],"
        " \"radius\": 0.03, \"track\": [[0, [0,0,0]], [0.06, [0,0,-0.015]]]}],"
        " \"contact\": {\"no_room\": \"relax\"}, \"integrator\": {\"dt\": 0.01}, \"duration\": 1}";
    return model_of(ctx, text);
}

static drape_status note_accepted(void *user, const drape_event *event)
{
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted)
        *(uint64_t *)user = drape_sim_hash(event->sim);
    return DRAPE_OK;
}

/* After the sim is made, every allocation of its run fails once. The failure is reported, the state is the
 * last accepted one, and the run continues from there. */
static long grow_lists(const drape_model *model, const char *integrator, int32_t *relaxed)
{
    const double t = 0.08;
    drape_sim_def def = sim_def();
    def.integrator = integrator;
    long n = 0;
    for (drape_status status = DRAPE_E_MEMORY; status; n++) {
        failing_allocator memory = {0};
        drape_context *ctx = failing_context(&memory);
        drape_sim *sim = NULL;
        ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
        uint64_t accepted = drape_sim_hash(sim);
        ck_assert_int_eq(drape_sim_observe(sim, note_accepted, &accepted), DRAPE_OK);
        memory.fail_at = memory.calls + n + 1;
        status = drape_sim_advance(sim, t);
        ck_assert_msg(status == DRAPE_E_MEMORY || (status == DRAPE_OK && memory.calls < memory.fail_at),
                      "%s %ld of %ld: %s: %s", integrator, n, memory.calls, drape_status_name(status),
                      drape_context_message(ctx));
        ck_assert_uint_eq(drape_sim_hash(sim), accepted);
        if (status) {
            ck_assert_msg(strstr(drape_context_message(ctx), "out of memory") && drape_sim_time(sim) < t,
                          "%ld: %s", n, drape_context_message(ctx));
            ck_assert_msg(drape_sim_advance(sim, t) == DRAPE_OK, "%s %ld: %s", integrator, n,
                          drape_context_message(ctx));
        }
        *relaxed = drape_sim_relaxed(sim, -1, NULL);
        drape_sim_destroy(&sim);
        drape_context_destroy(&ctx);
        ck_assert_int_eq(memory.live, 0);
    }
    return n - 1;
}

TEST(contacts_without_memory)
{
    static const char *const integrators[] = {"be", "ida", "dirk"};
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    scoped_model *model = folding_model(ctx);
    for (size_t k = 0; k < sizeof integrators / sizeof *integrators; k++) {
        int32_t relaxed;
        const long failures = grow_lists(model, integrators[k], &relaxed);
        printf("# %s: %ld allocations in the run\n", integrators[k], failures);
        ck_assert_int_gt(failures, 5);
    }
}

TEST(no_room_without_memory)
{
    scoped_context *ctx = NULL;
    int32_t relaxed = 0;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    scoped_model *model = pinched_model(ctx);
    ck_assert_int_gt(grow_lists(model, "be", &relaxed), 3);
    ck_assert_int_gt(relaxed, 0);
}

/* A sheet on a floor whose pin lets it go: the sim is then built anew within the advance. */
TEST(releases_without_memory)
{
    static const char *const integrators[] = {"be", "ida"};
    static const char text[] =
        "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"square\", \"columns\": 3, \"rows\": 3, "
        "\"width\": 0.1, \"height\": 0.1, \"transform\": {\"translate\": [0, 5e-3, 0]}},"
        " \"terms\": [\"stretch.edge\", \"bend.hinge\"], \"pins\": [{\"nodes\": [0]}],"
        " \"material\": {\"young_modulus\": 1e4, \"thickness\": 1e-3, \"density\": 200}}],"
        " \"colliders\": [{\"type\": \"plane\", \"point\": [0,0,0], \"normal\": [0,1,0], \"friction\": 0.5}],"
        " \"self_contact\": {\"thickness\": 1e-3}, \"integrator\": {\"dt\": 0.01},"
        " \"events\": [{\"type\": \"height\", \"height\": 3e-3, \"action\": \"release\"}], \"duration\": 1}";
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    scoped_model *model = model_of(ctx, text);
    for (size_t k = 0; k < sizeof integrators / sizeof *integrators; k++) {
        int32_t relaxed;
        const long failures = grow_lists(model, integrators[k], &relaxed);
        printf("# %s: %ld allocations in the run\n", integrators[k], failures);
        ck_assert_int_gt(failures, 20);
    }
}

static void *no_memory(void *user, size_t size)
{
    (void)user, (void)size;
    return NULL;
}

static void release(void *user, void *memory)
{
    (void)user, (void)memory;
}

TEST(a_context_without_memory)
{
    drape_context *ctx = (drape_context *)(uintptr_t)1;
    drape_context_def def = context_def();
    def.allocate = no_memory;
    def.release = release;
    ck_assert_int_eq(drape_context_create(&def, &ctx), DRAPE_E_MEMORY);
    ck_assert_ptr_null(ctx);
}
