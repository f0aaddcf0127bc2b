/* test_untangle.c: an untangling whose memory ends, or that is cancelled, leaves the sim as it was. */
#include "support/host.h"
#include "support/suite.h"

/* A sheet through another one and into a ball. */
static const char scene[] =
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.4, 'height': "
    "0.4}, "
    "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}, "
    "{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.4, 'height': 0.4, 'transform': "
    "{'rotate': "
    "[0, 0, 1, 40], 'translate': [0.05, -0.12, 0.01]}}, 'material': {'young_modulus': 1e5, 'thickness': "
    "1e-3, "
    "'density': 200}, 'terms': ['stretch.edge']}], 'colliders': [{'type': 'box', 'center': [0.1, -0.05, "
    "-0.1], "
    "'size': [0.1, 0.14, 0.1]}], 'self_contact': {'thickness': 0.002}, 'duration': 1}";

/* Every allocation fails once; every seventh one also with all that follow. Then it succeeds. */
TEST(memory_ends_anywhere)
{
    for (int stay = 0; stay < 2; stay++) {
        scoped_host h = open_scene(scene);
        const uint64_t hash = drape_sim_hash(h.sim);
        const long live = h.memory->live;
        drape_status status = DRAPE_E_MEMORY;
        drape_untangling u;
        long n = 0;
        for (; status && n < 100000; n += stay ? 7 : 1) {
            h.memory->fail_at = h.memory->calls + n + 1;
            h.memory->stay_broken = stay;
            status = drape_sim_untangle(h.sim, NULL, &u);
            h.memory->fail_at = 0;
            ck_assert_int_eq(h.memory->live, live);
            if (!status)
                break;
            ck_assert_msg(status == DRAPE_E_MEMORY, "%ld: %s", n, drape_context_message(h.ctx));
            ck_assert(strstr(drape_context_message(h.ctx), "out of memory"));
            ck_assert_uint_eq(drape_sim_hash(h.sim), hash);
            ck_assert(!drape_sim_untangling(h.sim, &u, NULL));
        }
        printf("# %ld allocations\n", n);
        ck_assert(n > 50 && u.clear && u.pairs_before > 0 && u.inside_before > 0);
    }
}

static bool cancel_at(void *user)
{
    int *left = user;
    return (*left)-- <= 0;
}

/* The context's cancel function ends it between any two sweeps. */
TEST(cancelled_anywhere)
{
    drape_context_def def = context_def();
    scoped_context *ctx = NULL;
    scoped_parsed *parsed = NULL;
    scoped_model *model = NULL;
    scoped_sim *sim = NULL;
    char text[2048];
    int left = 1 << 30, ended = 0;
    strcpy(text, scene);
    quote(text);
    def.cancel = cancel_at;
    def.cancel_user = &left;
    ck_assert_int_eq(drape_context_create(&def, &ctx), DRAPE_OK);
    ck_assert_int_eq(drape_scene_parse(ctx, text, "s", &parsed), DRAPE_OK);
    ck_assert_int_eq(drape_scene_compile(parsed, &model), DRAPE_OK);
    ck_assert_int_eq(drape_sim_create(ctx, model, NULL, &sim), DRAPE_OK);
    const uint64_t hash = drape_sim_hash(sim);
    for (drape_status status = DRAPE_E_STOPPED; status; ended++) {
        left = ended;
        status = drape_sim_untangle(sim, NULL, NULL);
        ck_assert(status == DRAPE_OK || (status == DRAPE_E_STOPPED && drape_sim_hash(sim) == hash));
    }
    ck_assert_int_gt(ended, 3);
}
