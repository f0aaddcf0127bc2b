/*
 * test_untangle.c: cloth that begins through cloth, through itself or through bodies comes apart, and nothing
 * passes through anything in the run that follows. Crossings are counted by support/crossings.h, which shares
 * nothing with the library.
 */
#include <stdlib.h>

#include "model/model.h"
#include "support/crossings.h"
#include "support/scene.h"

#define MATERIAL                                                                                             \
    "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', "      \
    "'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.05}]"
/* A sheet of 10 x 10 nodes and 1 m, with its middle in the origin, turned and then shifted. */
#define SHEET(name, turn, shift)                                                                             \
    "{'name': '" name "', 'mesh': {'grid': 'square', 'columns': 10, 'rows': 10, 'width': 1, 'height': 1, "   \
    "'transform': {'rotate': [" turn "], 'translate': [" shift "]}}, 'velocity': [0.1, 0, 0.2], " MATERIAL
#define REST                                                                                                 \
    " 'self_contact': {'thickness': 0.004}, 'contact': {'distance': 0.008}, 'untangle': {}, 'integrator': "  \
    "{'method': 'be', 'dt': 0.01}, 'duration': 1}"

/* Moves the nodes of a state before the first step. */
typedef void shape(double x[3]);

typedef struct tangle {
    const char *what, *scene;
    shape *bend;   /* NULL: the scene has it all */
    double reach;  /* [m] no node may go farther */
    double strain; /* nor an edge be strained more */
} tangle;

/* ---- Shapes ---- */

/* The upper sheet, y > 0, hangs down in the middle, through the lower one. */
static void hang_through(double x[3])
{
    if (x[1] > 0.01)
        x[1] -= 0.12 * exp(-12 * (x[0] * x[0] + x[2] * x[2]));
}

/* A sheet that is rolled up, so that its end, which lies over its beginning, dips through it. */
static void roll_up(double x[3])
{
    const double angle = 7.5 * (x[0] + 0.5), radius = 0.14 + (angle < 5     ? 0
                                                              : angle < 6.3 ? 0.01 * (angle - 5)
                                                                            : 0.02 * (6.95 - angle));
    x[1] = -radius * cos(angle);
    x[0] = radius * sin(angle);
    x[2] += 0.01 * angle; /* so that no edge passes through another one */
}

/* ---- What is checked ---- */

static crossings count(const scene *s, const double *x)
{
    return crossings_count(s->model, x, drape_sim_time(s->sim));
}

static drape_status watch(void *user, const drape_event *event)
{
    const scene *s = user;
    const double *x = event->kind == DRAPE_EVENT_FRAME ? event->positions : drape_sim_positions(event->sim);
    const crossings found = crossings_count(s->model, x, 0); /* bodies rest */
    ck_assert_msg(crossings_total(&found) == 0, "t=%g: %s", drape_sim_time(event->sim), found.first);
    return DRAPE_OK;
}

/* Of a scene whose meshes are in the source tree. */
static scene open_model(const char *text)
{
    const char *place = strstr(text, "SOURCE");
    return place ? scene_model("%.*s%s%s", (int)(place - text), text, getenv("DRAPE_SOURCE"), place + 6)
                 : scene_model("%s", text);
}

/* The state, bent. */
static void start(scene *s, shape *bend, double *x)
{
    const size_t size = 3 * (size_t)s->model->node_count * sizeof *x;
    memcpy(x, drape_sim_positions(s->sim), size);
    if (!bend)
        return;
    for (int32_t i = 0; i < s->model->node_count; i++)
        bend(x + 3 * (size_t)i);
    ck_assert_int_eq(drape_sim_set_state(s->sim, 0, x, s->model->velocity), DRAPE_OK);
}

static void comes_apart(const tangle *t)
{
    scoped_scene s = open_model(t->scene);
    scene_start(&s, NULL);
    const size_t n = 3 * (size_t)s.model->node_count;
    scoped_memory double *x = malloc(n * sizeof *x);
    drape_untangling u;
    start(&s, t->bend, x);
    const crossings before = count(&s, x);
    ck_assert_msg(crossings_total(&before) > 5, "%s: %lld", t->what, (long long)crossings_total(&before));
    scene_watch(&s);
    const drape_status status = drape_sim_untangle(s.sim, NULL, &u);
    ck_assert_msg(!status, "%s: %s", t->what, drape_context_message(s.ctx));
    const crossings after = count(&s, drape_sim_positions(s.sim));
    printf("# %s: %lld pairs, %d inside; %d sweeps, %.3g m, strain %.3g\n", t->what,
           (long long)u.pairs_before, (int)u.inside_before, u.sweeps, u.displacement, u.strain);
    ck_assert_msg(crossings_total(&after) == 0, "%s: %s", t->what, after.first);
    ck_assert(u.clear && u.pairs == 0 && u.inside == 0 && u.least_gap >= 1);
    ck_assert_msg(u.pairs_before == before.cloth + before.colliders, "%s: %lld, not %lld + %lld", t->what,
                  (long long)u.pairs_before, (long long)before.cloth, (long long)before.colliders);
    ck_assert_double_le(u.displacement, t->reach);
    ck_assert_double_le(u.strain, t->strain);
    ck_assert_mem_eq(drape_sim_velocities(s.sim), s.model->velocity, n * sizeof *x);
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, &s), DRAPE_OK);
    scene_advance(&s, 0.1);
    ck_assert_int_ge(s.accepted, 10);
}

/* The displacements and the strains are a few times what these tangles took when this was written: they are
 * bounds of what is no distortion, a fifth of a sheet of 1 m and a few per cent, not results. Half of a
 * sheet that passes through another one at 60 degrees has its edge 0.43 m from that. */
static const tangle tangles[] = {
    {"two at 30 degrees",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, " //
     SHEET("b", "0, 0, 1, 30", "-0.41, -0.23, 0.51") "}], " REST,
     NULL, 0.25, 0.05},
    {"two at 60 degrees",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, " //
     SHEET("b", "0, 0, 1, 60", "-0.22, -0.43, 0.45") "}], " REST,
     NULL, 0.45, 0.08},
    {"three layers",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, " //
     SHEET("b", "0, 0, 1, 12", "-0.47, -0.1, 0.52") "}, " SHEET("c", "1, 0, 0, 9",
                                                                "-0.52, 0.09, 0.48") "}], " //
     REST,
     NULL, 0.25, 0.05},
    {"a sheet that hangs through another",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, " //
     SHEET("b", "0, 1, 0, 7", "-0.54, 0.06, 0.45") "}], " REST,
     hang_through, 0.15, 0.08},
    {"a corner that goes through the middle",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, " //
     SHEET("b", "1, 0, 1, 40", "-0.1, -0.2, 0.3") "}], " REST,
     NULL, 0.3, 0.08},
    {"a sheet that is rolled into itself",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}], " REST, roll_up, 0.15, 0.1},
    {"a sleeve in a panel",
     "{'drape': 1, 'cloth': [" SHEET(
         "a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, {'name': 'sleeve', 'mesh': {"
                                            "'file': 'SOURCE/examples/scenes/tube.obj', 'transform': "
                                            "{'rotate': [0, 1, 0.1, 20], 'translate': [0.03, "
                                            "0.08, -0.02]}}, " MATERIAL "}], " REST,
     NULL, 0.15, 0.05},
    {"a sheet in a ball",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0",
                                     "-0.5, 0.08, 0.5") "}], 'colliders': [{'type': 'sphere', "
                                                        "'center': [0.04, 0, 0.02], 'radius': 0.2}], " REST,
     NULL, 0.2, 0.05},
    {"a sheet in a box",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0",
                                     "-0.5, 0.08, 0.5") "}], 'colliders': [{'type': 'box', "
                                                        "'center': [0.04, 0, 0.02], 'size': [0.3, 0.22, "
                                                        "0.25], 'rotate': [0, 1, 0.2, 15]}], " REST,
     NULL, 0.2, 0.05},
    {"a sheet in a mesh",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0",
                                     "-0.2, 0.02, 0.47") "}], 'colliders': [{'type': 'mesh', "
                                                         "'file': 'SOURCE/examples/scenes/limb.obj'}], " REST,
     NULL, 0.3, 0.1},
    /* wholly inside, where nodes have different nearest faces: one side of the sheet is near for all */
    {"a sheet on the middle plane of a box",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0",
                                     "-0.5, 0, 0.5") "}], 'colliders': [{'type': 'box', "
                                                     "'center': [0, 0, 0], 'size': 2}], " REST,
     NULL, 1.02, 0.05},
    {"a sheet through the middle of a ball",
     "{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0",
                                     "-0.5, 0, 0.5") "}], 'colliders': [{'type': 'sphere', "
                                                     "'center': [0, 0, 0], 'radius': 0.9}], " REST,
     NULL, 0.92, 0.05},
    {"a sheet on the axis of a capsule, which ends in a box",
     "{'drape': 1, 'cloth': [" SHEET(
         "a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}], 'colliders': [{'type': 'capsule', 'a': [-1, 0, 0], 'b': [1, "
                                            "0, 0], 'radius': 0.6}, "
                                            "{'type': 'box', 'center': [0.6, 0, 0], 'size': 0.8}], " REST,
     NULL, 0.7, 0.05},
};

TEST(tangles_come_apart)
{
    for (size_t i = 0; i < sizeof tangles / sizeof *tangles; i++)
        comes_apart(&tangles[i]);
}

/* Pinned nodes stay where they are, to the bit, and so does cloth that no tangle is near. */
TEST(pins_and_what_is_far_stay)
{
    scoped_scene s = scene_open("{'drape': 1, 'cloth': [" SHEET(
        "a", "0, 1, 0, 0",
        "-0.5, 0, 0.5") ", 'pins': [{'corner': 'top-left'}, "
                        "{'corner': 'bottom-right'}]}, " SHEET(
                            "b", "0, 0, 1, 25",
                            "-0.43, -0.2, 0.51") ", 'pins': [{'corner': "
                                                 "'top-left'}]}, " SHEET("c", "0, 1, 0, 0",
                                                                         "-0.5, 2, 0.5") "}], " REST);
    drape_untangling u;
    double moved[3];
    ck_assert_msg(!drape_sim_untangle(s.sim, NULL, &u), "%s", drape_context_message(s.ctx));
    ck_assert_int_eq(u.cloths, 2);
    ck_assert(drape_sim_untangling(s.sim, NULL, moved));
    ck_assert(moved[0] > 0 && moved[1] > 0 && moved[2] == 0);
    ck_assert_double_eq(fmax(moved[0], moved[1]), u.displacement);
    const double *x = drape_sim_positions(s.sim);
    for (int32_t i = 0; i < s.model->node_count; i++)
        if (s.model->pinned[i] || i >= 200)
            ck_assert_mem_eq(x + 3 * (size_t)i, s.model->rest + 3 * (size_t)i, 3 * sizeof *x);
}

/* Sheets in one plane do not intersect, but have no gap, and neither side is that of one of them. */
TEST(sheets_in_one_place_get_their_gap)
{
    scoped_scene s = scene_open("{'drape': 1, 'cloth': [" SHEET("a", "0, 1, 0, 0", "-0.5, 0, 0.5") "}, " //
                                SHEET("b", "0, 1, 0, 0", "-0.5, 0, 0.5") "}], " REST);
    drape_untangling u;
    ck_assert_msg(!drape_sim_untangle(s.sim, NULL, &u), "%s", drape_context_message(s.ctx));
    ck_assert_int_eq(u.pairs_before, 0);
    ck_assert_double_eq(u.least_gap_before, 0);
    ck_assert_double_ge(u.least_gap, 1);
    /* half of the activation distance of 8 mm, and of the thickness; twice that where both push a node */
    ck_assert_double_le(u.displacement, 0.01);
    for (int32_t i = 0; i < 100; i++)
        ck_assert_double_gt(drape_sim_positions(s.sim)[3 * (i + 100) + 1],
                            drape_sim_positions(s.sim)[3 * i + 1]);
    /* gaps are the activation distance but for rounding, and the energy is its square: 1e-32 of some J */
    ck_assert_double_le(drape_sim_energy(s.sim).contact, 1e-20);
}

/* The same bits with any number of threads. */
TEST(threads_do_not_matter)
{
    uint64_t hash[2];
    for (int k = 0; k < 2; k++) {
        scoped_scene s = open_model(tangles[2].scene);
        drape_sim_def def = sim_def();
        def.threads = k ? 3 : 1;
        scene_start(&s, &def);
        ck_assert_int_eq(drape_sim_untangle(s.sim, NULL, NULL), DRAPE_OK);
        hash[k] = drape_sim_hash(s.sim);
    }
    ck_assert_uint_eq(hash[0], hash[1]);
}
