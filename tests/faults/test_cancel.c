/* test_cancel.c: the cancel function of a context answers true at each of its calls in turn, while a scene is
 * read and compiled and a sim is made and restored. Each time: DRAPE_E_STOPPED, NULL, and no leak. */
#include <stdio.h>
#include <unistd.h>

#include "assemble/check.h"
#include "sim/profile.h"
#include "sim/sim.h"
#include "support/bytes.h"
#include "support/failing_allocator.h"
#include "support/suite.h"

static const char scene_text[] =
    "{\"drape\": 1, \"cloth\": [\n"
    " {\"mesh\": {\"grid\": \"square\", \"columns\": 4, \"rows\": 4, \"width\": 0.3, \"height\": 0.3},\n"
    "  \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200},\n"
    "  \"terms\": [\"stretch.edge\", {\"type\": \"bend.hinge\", \"rest\": \"flat\"}],\n"
    "  \"pins\": [{\"corner\": \"top-left\"}]},\n"
    " {\"mesh\": {\"grid\": \"equilateral\", \"edges\": 2, \"edge_length\": 0.1, \"transform\": "
    "{\"translate\": [0, 1, 0]}},\n"
    "  \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200}, \"terms\": "
    "[\"stretch.edge\"]}],\n"
    " \"colliders\": [{\"type\": \"plane\", \"point\": [0, -9, 0], \"normal\": [0, 1, 0]}],\n"
    " \"integrator\": {\"dt\": 0.01}, \"duration\": 1}\n";

/* Answers true at call number `at` and, if `stays`, at all later ones. */
typedef struct asked {
    failing_allocator memory;
    long calls, at;
    bool stays;
} asked;

static bool cancel(void *user)
{
    asked *a = user;
    a->calls++;
    return a->at > 0 && (a->calls == a->at || (a->stays && a->calls > a->at));
}

static drape_context *context(asked *a)
{
    drape_context_def def = context_def();
    drape_context *ctx = NULL;
    def.allocate = failing_allocate;
    def.release = failing_release;
    def.allocator_user = &a->memory;
    def.cancel = cancel;
    def.cancel_user = a;
    ck_assert_int_eq(drape_context_create(&def, &ctx), DRAPE_OK);
    return ctx;
}

/* Reads and compiles a scene, makes a sim, checks and measures it, saves and restores it. */
static drape_status live(drape_context *ctx, const char *path)
{
    scoped_parsed *scene = NULL;
    scoped_model *model = NULL;
    scoped_sim *sim = NULL;
    int count;
    drape_status status = drape_scene_load(ctx, path, &scene);
    ck_assert_int_eq(status != DRAPE_OK, scene == NULL);
    if (!status) {
        status = drape_scene_compile(scene, &model);
        ck_assert_int_eq(status != DRAPE_OK, model == NULL);
    }
    if (!status) {
        status = drape_sim_create(ctx, model, NULL, &sim);
        ck_assert_int_eq(status != DRAPE_OK, sim == NULL);
    }
    if (!status) {
        static drape_check_result results[DRAPE_MAX_CHECK_RESULTS];
        status = drape_check_derivatives(ctx, sim->system, 1, results, &count);
    }
    if (!status) {
        drape_profile_term terms[16];
        drape_profile profile;
        status = drape_profile_measure(ctx, sim, terms, &profile);
    }
    return status;
}

/* The number of calls of the cancel function in a whole run. */
static long calls_of_a_life(const char *path)
{
    asked a = {.at = 0};
    scoped_context *ctx = context(&a);
    ck_assert_int_eq(live(ctx, path), DRAPE_OK);
    return a.calls;
}

TEST(it_may_be_at_any_stage)
{
    char path[] = "/tmp/drape-cancel-XXXXXX";
    const int fd = mkstemp(path);
    ck_assert_int_eq(write(fd, scene_text, sizeof scene_text - 1), sizeof scene_text - 1);
    close(fd);
    const long calls = calls_of_a_life(path);
    ck_assert_int_ge(calls,
                     30); /* reading, each cloth, mesh, collider and term, the parts of a sim, measurements */
    for (long n = 1; n <= 2 * calls; n++) {
        asked a = {.at = (n + 1) / 2, .stays = n % 2 == 0};
        drape_context *ctx = context(&a);
        ck_assert_msg(live(ctx, path) == DRAPE_E_STOPPED, "call %ld: %s", a.at, drape_context_message(ctx));
        ck_assert_ptr_nonnull(strstr(drape_context_message(ctx), "cancelled"));
        ck_assert_int_eq(a.calls, a.at); /* it is not called again after it answered true */
        drape_context_destroy(&ctx);
        ck_assert_msg(a.memory.live == 0, "call %ld: %ld leaks", a.at, a.memory.live);
    }
    unlink(path);
}
