/*
 * test_implicit.c: the scenes of CS184 and Boson by implicit steps, at the steps at which their programs
 * blow up and far beyond: springs 200 times as stiff, a hundredth of the mass, both, 1/30 s. The sheets are
 * small, so that this takes seconds; bench/implicit runs them at full size.
 */
#include "support/scene.h"

#include "base/vec3.h"
#include "model/scene.h"

#define MAX_SETTINGS 10

typedef struct setting {
    const char *pointer, *value;
} setting;

#define SMALL                                                                                                \
    {"/cloth/num_width_points", "8"}, {"/cloth/num_height_points", "8"},                                     \
    {                                                                                                        \
        "/cloth/pinned", "[[0, 0], [7, 0]]"                                                                  \
    }
#define STEP(seconds)                                                                                        \
    {                                                                                                        \
        "/integrator/dt", #seconds                                                                           \
    }
#define BE                                                                                                   \
    {"/integrator/method", "\"be\""},                                                                        \
    {                                                                                                        \
        "/controller", "{\"type\": \"halving\"}"                                                             \
    }
#define IDA                                                                                                  \
    {"/integrator/method", "\"ida\""},                                                                       \
    {                                                                                                        \
        "/controller", "{\"type\": \"halving\"}"                                                             \
    }
#define STIFF                                                                                                \
    {                                                                                                        \
        "/cloth/ks", "1e6"                                                                                   \
    }
#define LIGHT                                                                                                \
    {                                                                                                        \
        "/cloth/density", "1.5"                                                                              \
    }

/* A corner of Boson's sheet between two of its pins: 21 x 21 nodes of 1 kg, 200/99 m apart. */
#define CORNER                                                                                               \
    {"/cloth/0/mesh/columns", "21"}, {"/cloth/0/mesh/rows", "21"}, {"/cloth/0/mesh/width", "40.404"},        \
        {"/cloth/0/mesh/height", "40.404"},                                                                  \
    {                                                                                                        \
        "/cloth/0/pins", "[{\"nodes\": [0, 20]}]"                                                            \
    }

typedef struct run {
    const char *scene;
    double time;  /* [s] */
    double limit; /* of the strain of all springs; infinite: no limit */
    setting set[MAX_SETTINGS];
} run;

static const run runs[] = {
    {"cs184_pinned2", 3, 0.1, {SMALL, BE, STEP(0.00555555555555555)}},
    {"cs184_pinned2", 3, 0.1, {SMALL, BE, STEP(0.03333333333333333)}},
    {"cs184_pinned2", 3, 0.1, {SMALL, BE, STEP(0.03333333333333333), STIFF}},
    {"cs184_pinned2", 3, 0.1, {SMALL, BE, STEP(0.03333333333333333), LIGHT}},
    {"cs184_pinned2", 3, 0.1, {SMALL, BE, STEP(0.03333333333333333), STIFF, LIGHT}},
    {"cs184_pinned2", 1, 0.1, {SMALL, IDA}},
    {"cs184_pinned2", 1, 0.1, {SMALL, IDA, STIFF}},
    {"cs184_pinned2", 1, 0.1, {SMALL, IDA, STIFF, LIGHT}},
    {"verlet_100", 12, INFINITY, {CORNER, BE, STEP(0.06), {"/cloth/0/material/total_mass", "441"}}},
    {"verlet_100", 12, INFINITY, {CORNER, BE, STEP(0.12), {"/cloth/0/material/total_mass", "220.5"}}},
    {"verlet_100", 3, INFINITY, {CORNER, IDA, {"/cloth/0/material/total_mass", "441"}}},
};

static scene load(const run *r)
{
    char path[1024];
    drape_scene *parsed = NULL;
    scene s = scene_empty();
    const char *root = getenv("DRAPE_SOURCE");
    snprintf(path, sizeof path, "%s/examples/scenes/%s.json", root ? root : ".", r->scene);
    drape_status status = drape_scene_load(s.ctx, path, &parsed);
    for (int i = 0; !status && i < MAX_SETTINGS && r->set[i].pointer; i++)
        status = drape_scene_set(parsed, r->set[i].pointer, r->set[i].value);
    if (!status)
        status = drape_scene_compile(parsed, &s.model);
    ck_assert_msg(status == DRAPE_OK, "%s", drape_context_message(s.ctx));
    drape_scene_destroy(&parsed);
    scene_start(&s, NULL);
    return s;
}

/* The largest strain of all springs in all accepted states. */
static drape_status watch(void *user, const drape_event *event)
{
    double *max = user;
    const drape_model *m = drape_sim_model(event->sim);
    const double *x = drape_sim_positions(event->sim);
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t e = 0; m->terms[i].ops->distance && e < el->count; e++) {
            double d[3];
            vec3_sub(x + 3 * (size_t)el->node[2 * e + 1], x + 3 * (size_t)el->node[2 * e], d);
            *max = fmax(*max, vec3_norm(d) / el->rest[el->count + e] - 1);
        }
    }
    return DRAPE_OK;
}

/* Implicit steps lose energy: kinetic, elastic and potential energy at the end are no more than the
 * potential energy at the start, at rest. The slack is that of ida's tolerance, 1e-3 of m g L, times the
 * number of crossings of a wave, some tens. */
static void falls_and_no_more(const scene *s, double start)
{
    const drape_model *m = s->model;
    const drape_energy now = drape_sim_energy(s->sim);
    double mass = 0;
    for (int32_t i = 0; i < m->node_count; i++)
        mass += m->mass[i];
    double scale = mass * vec3_norm(m->gravity) * m->length;
    ck_assert_double_le(now.kinetic + now.elastic + now.gravity + now.contact, start + 0.03 * scale);
    ck_assert_double_le(now.kinetic, start - now.gravity + 0.03 * scale);
}

static void stays(const run *r)
{
    scene s = load(r);
    double strain = -1;
    scene_watch(&s);
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, &strain), DRAPE_OK);
    const drape_energy before = drape_sim_energy(s.sim);
    scene_advance(&s, r->time);
    printf("# %s %d: %ld steps, %ld rejected, strain %.4f\n", r->scene, (int)(r - runs), s.accepted,
           s.rejected, strain);
    ck_assert_double_le(strain, r->limit);
    ck_assert_int_eq(s.unconverged, 0);
    falls_and_no_more(&s, before.kinetic + before.elastic + before.gravity + before.contact);
    scene_close(&s);
}

START_TEST(pinned2_keeps_its_limit)
{
    for (size_t i = 0; i < sizeof runs / sizeof *runs; i++)
        if (isfinite(runs[i].limit))
            stays(&runs[i]);
}
END_TEST

START_TEST(boson_does_not_blow_up)
{
    for (size_t i = 0; i < sizeof runs / sizeof *runs; i++)
        if (!isfinite(runs[i].limit))
            stays(&runs[i]);
}
END_TEST

/* A stiff sheet (E h = 2e5 N/m), which two corners swing to and fro by up to a tenth of its size in a step.
 * Where the guess takes the pull of the pins to all nodes, what is left is of second order in the
 * displacement: 3 to 4 iterations a step. 18 were needed where nodes kept their velocity; the bound is
 * between the two. */
START_TEST(a_stiff_sheet_follows_its_pins)
{
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 13, 'rows': 13, 'width': %g, "
        "'height': "
        "0.1, 'orientation': 'horizontal'}, 'material': {'young_modulus': 1e9, 'thickness': 2e-4, "
        "'areal_density': 0.1}, 'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'nodes': [0, 12], "
        "'track': [[0, [0, 0, 0]], [0.075, [0.1, 0.02, 0]], [0.15, [0, 0, 0]]]}]}],"
        "'integrator': {'method': 'be'}, 'duration': 0.15}",
        0.1);
    scene_advance(&s, 0.15);
    const drape_statistics n = drape_sim_statistics(s.sim);
    printf("# %lld iterations in %lld steps\n", (long long)n.newton_iterations, (long long)n.steps_accepted);
    ck_assert_int_le(n.steps_rejected, 1); /* what is left of the stretch is set free where they turn back */
    ck_assert_int_le(n.newton_iterations, 8 * n.steps_accepted);
    scene_close(&s);
}
END_TEST

SUITE("implicit", pinned2_keeps_its_limit, boson_does_not_blow_up, a_stiff_sheet_follows_its_pins)
