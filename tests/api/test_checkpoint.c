/* test_checkpoint.c: a host saves a sim and restores it, through the public header only. */
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drape/drape.h"
#include "support/bytes.h"
#include "support/suite.h"

static const char text[] =
    "{\"drape\": 1, \"cloth\": [{\"name\": \"sheet\","
    " \"mesh\": {\"grid\": \"equilateral\", \"edges\": 5, \"edge_length\": 0.1},"
    " \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200},"
    " \"terms\": [\"stretch.edge\", \"bend.hinge\", {\"type\": \"damp.kelvin_voigt\", \"beta\": 1e-3}],"
    " \"pins\": [{\"nodes\": [0]}, {\"corner\": \"top-right\", \"track\": [[0, [0,0,0]], [1, [0,0.5,0]]]}]}],"
    " \"integrator\": {\"method\": \"%s\", \"dt\": 0.01}, \"duration\": 1, \"frame_rate\": 30}";

static drape_model *make_model(drape_context *ctx, const char *integrator)
{
    char whole[2048];
    scoped_parsed *scene = NULL;
    drape_model *model = NULL;
    snprintf(whole, sizeof whole, text, integrator);
    ck_assert_int_eq(drape_scene_parse(ctx, whole, "s.json", &scene), DRAPE_OK);
    assert_ok(ctx, drape_scene_compile(scene, &model));
    return model;
}

static drape_sim *make_sim(drape_context *ctx, const drape_model *model, int threads)
{
    drape_sim *sim = NULL;
    drape_sim_def def = sim_def();
    def.threads = threads;
    ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
    return sim;
}

static drape_status count_frames(void *user, const drape_event *event)
{
    *(int *)user += event->kind == DRAPE_EVENT_FRAME;
    return DRAPE_OK;
}

/* Saves to a file and restores in another sim, of another model of the same scene, with a different number of
 * threads; observers stay registered. */
TEST(a_file_is_taken_by_another_sim)
{
    static const char *const integrators[] = {"be", "bdf2", "ida", "verlet", "dirk"};
    for (size_t k = 0; k < sizeof integrators / sizeof *integrators; k++) {
        char path[] = "/tmp/drape-api-XXXXXX";
        int fd = mkstemp(path), frames[2] = {0};
        ck_assert_int_ge(fd, 0);
        close(fd);
        drape_context *ctx = make_context(), *second = make_context();
        drape_model *model = make_model(ctx, integrators[k]), *same = make_model(second, integrators[k]);
        drape_sim *sim = make_sim(ctx, model, 1), *other = make_sim(second, same, 2);
        ck_assert_int_eq(drape_sim_observe(sim, count_frames, &frames[0]), DRAPE_OK);
        ck_assert_int_eq(drape_sim_observe(other, count_frames, &frames[1]), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(sim, 0.25), DRAPE_OK);
        assert_ok(ctx, drape_sim_save(sim, path));
        int before = frames[0];
        assert_ok(second, drape_sim_restore(other, path));
        ck_assert(drape_sim_time(other) == drape_sim_time(sim));
        ck_assert_uint_eq(drape_sim_hash(other), drape_sim_hash(sim));
        ck_assert_int_eq(frames[1], 0);
        ck_assert_int_eq(drape_sim_advance(sim, 0.5), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(other, 0.5), DRAPE_OK);
        ck_assert_uint_eq(drape_sim_hash(other), drape_sim_hash(sim));
        ck_assert_int_eq(frames[1], frames[0] - before);
        drape_sim_destroy(&sim);
        drape_sim_destroy(&other);
        drape_model_destroy(&model);
        drape_model_destroy(&same);
        drape_context_destroy(&ctx);
        drape_context_destroy(&second);
        unlink(path);
    }
}

/* One model; in each thread a context and a sim, all restored from the same bytes. */
typedef struct worker {
    const drape_model *model;
    const bytes *from;
    uint64_t hash;
} worker;
