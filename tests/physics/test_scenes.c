/*
 * test_scenes.c: every scene of examples/scenes runs. Its beginning, on a coarser mesh if that is a grid,
 * ends "ok"; no part lies in a collider and no edge passes through a triangle, neither at the ends of steps
 * nor at frames. A scene that is not in the table runs unchanged for a tenth of a second, so that none is
 * forgotten.
 */
#include <dirent.h>

#include "model/scene.h"
#include "support/audit.h"
#include "support/sample.h"
#include "support/scene.h"

#define MAX_SETTINGS 8
#define MAX_SCENES   64

#define COLUMNS "/cloth/0/mesh/columns"
#define ROWS    "/cloth/0/mesh/rows"

typedef struct beginning {
    const char *name;
    double time; /* [s] */
    struct {
        const char *pointer, *value;
    } set[MAX_SETTINGS];
    bool explicit; /* explicit rules keep only points out of colliders, and self-contact is approximate */
    bool touches;  /* comes near a collider within this time */
} beginning;

static const beginning beginnings[] = {
    {"airbag", 0.3, {{COLUMNS, "9"}, {ROWS, "9"}}},
    {"ball", 0.25, {{COLUMNS, "13"}, {ROWS, "13"}}, .touches = true},
    {"box_edge", 0.4, {{COLUMNS, "11"}, {ROWS, "11"}}, .touches = true},
    {"capstan", 0.3, {{COLUMNS, "31"}, {ROWS, "3"}}, .touches = true},
    {"crumple", 0.4, {{COLUMNS, "11"}, {ROWS, "11"}}, .touches = true},
    {"cs184_pinned2", 0.2, {{NULL}}, .explicit = true},
    {"dress",
     0.35,
     {{COLUMNS, "10"},
      {ROWS, "10"},
      {"/cloth/1/mesh/columns", "10"},
      {"/cloth/1/mesh/rows", "10"},
      {"/cloth/2/mesh/columns", "11"},
      {"/cloth/2/mesh/rows", "16"},
      {"/cloth/3/mesh/columns", "11"},
      {"/cloth/3/mesh/rows", "16"}},
     .touches = true},
    {"flag", 0.3, {{COLUMNS, "10"}, {ROWS, "7"}}},
    {"floor_drop", 0.4, {{COLUMNS, "5"}, {ROWS, "11"}}, .touches = true},
    {"fold", 1.3, {{COLUMNS, "21"}, {ROWS, "4"}}, .touches = true},
    {"four_pins", 0.2, {{NULL}}},
    {"hung_sheet", 0.5, {{"/cloth/0/mesh/edges", "8"}}},
    {"limb", 1, {{COLUMNS, "8"}, {ROWS, "7"}}, .touches = true},
    {"incline", 0.3, {{COLUMNS, "7"}, {ROWS, "7"}}, .touches = true},
    {"napkin", 0.2, {{COLUMNS, "7"}, {ROWS, "7"}}, .touches = true},
    {"rotating_sphere", 1.2, {{COLUMNS, "9"}, {ROWS, "9"}}, .touches = true},
    {"sphere_drape", 0.4, {{COLUMNS, "11"}, {ROWS, "11"}}, .touches = true},
    {"tangled",
     0.5,
     {{COLUMNS, "10"}, {ROWS, "10"}, {"/cloth/1/mesh/columns", "9"}, {"/cloth/1/mesh/rows", "9"}},
     .touches = true},
    {"tunic",
     0.4,
     {{COLUMNS, "9"}, {ROWS, "10"}, {"/cloth/1/mesh/columns", "9"}, {"/cloth/1/mesh/rows", "10"}},
     .touches = true},
    {"twisted_cylinder", 0.1, {{NULL}}},
    {"verlet_100", 2, {{NULL}}, .explicit = true},
};

static const char *folder(void)
{
    static char path[1024];
    const char *root = getenv("DRAPE_SOURCE");
    snprintf(path, sizeof path, "%s/examples/scenes", root ? root : ".");
    return path;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(a, b);
}

/* Names without ".json", sorted. */
static int find_scenes(char names[MAX_SCENES][64])
{
    int count = 0;
    DIR *all = opendir(folder());
    ck_assert_ptr_nonnull(all);
    for (const struct dirent *entry; (entry = readdir(all));) {
        size_t length = strlen(entry->d_name);
        if (length < 6 || strcmp(entry->d_name + length - 5, ".json") != 0)
            continue;
        ck_assert(count < MAX_SCENES && length < 64);
        memcpy(names[count], entry->d_name, length - 5);
        names[count++][length - 5] = '\0';
    }
    closedir(all);
    qsort(names, (size_t)count, sizeof names[0], by_name);
    return count;
}

static beginning beginning_of(const char *name)
{
    for (size_t i = 0; i < sizeof beginnings / sizeof *beginnings; i++)
        if (strcmp(beginnings[i].name, name) == 0)
            return beginnings[i];
    return (beginning){.name = name, .time = 0.1};
}

static scene load(const beginning *b)
{
    char path[1100];
    drape_scene *parsed = NULL;
    scene s = scene_empty();
    snprintf(path, sizeof path, "%s/%s.json", folder(), b->name);
    drape_status status = drape_scene_load(s.ctx, path, &parsed);
    for (int i = 0; !status && i < MAX_SETTINGS && b->set[i].pointer; i++)
        status = drape_scene_set(parsed, b->set[i].pointer, b->set[i].value);
    if (!status)
        status = drape_scene_compile(parsed, &s.model);
    assert_ok(s.ctx, status);
    drape_scene_destroy(&parsed);
    scene_start(&s, NULL);
    return s;
}

/* The check of a step allows 1e-9 m; the samples of faces are rounded at 1e-16 of coordinates of 1 m. */
static void check_kept(const beginning *b, const audit_worst *worst)
{
    const double allowed = 1e-9 + 1e-15;
    ck_assert_int_gt(worst->states, 0);
    ck_assert_msg(worst->node <= allowed, "%s: a node is %g m deep at %g s", b->name, worst->node,
                  worst->node_at);
    ck_assert_msg(worst->face <= allowed, "%s: a face is %g m deep at %g s", b->name, worst->face,
                  worst->face_at);
    ck_assert_msg(worst->intersections == 0, "%s: %lld edges pass through triangles at %g s", b->name,
                  (long long)worst->intersections, worst->intersections_at);
}

static void run(const beginning *of)
{
    const beginning b = *of;
    const char *name = b.name;
    scoped_scene s = load(&b);
    audit a = audit_of(s.ctx, s.model, s.model->contact.self && !b.explicit, !b.explicit);
    ck_assert_int_eq(drape_sim_observe(s.sim, audit_observe, &a), DRAPE_OK);
    scene_advance(&s, b.time);
    printf("# %s: depth of nodes %g m, of faces %g m at steps\n", name, a.steps.node, a.steps.face);
    if (!b.explicit) {
        check_kept(&b, &a.steps);
        check_kept(&b, &a.frames);
    }
    ck_assert_msg(!b.touches || a.steps.node > -s.model->contact.distance, "%s: no contact: %g m", name,
                  a.steps.node);
}

TEST(every_scene_begins_well)
{
    static char names[MAX_SCENES][64];
    int count = find_scenes(names);
    ck_assert_int_ge(count, (int)(sizeof beginnings / sizeof *beginnings));
    for (int i = 0; i < count; i++) {
        const beginning b = beginning_of(names[i]);
        run(&b);
    }
}

#define SQUARE                                                                                               \
    {COLUMNS, "20"}, {ROWS, "20"},                                                                           \
    {                                                                                                        \
        "/cloth/0/mesh/height", "1"                                                                          \
    }
#define THICKNESS "/self_contact/thickness"
#define SOON                                                                                                 \
    "[[0,[0,0,0]],[0.12,[-0.05,0.25,0]],[0.25,[-0.25,0.42,0]],[0.38,[-0.5,0.42,0]],[0.55,[-0.72,0.15,0]],"   \
    "[0.65,[-0.78,0.022,0]]]"

/* A square sheet that is folded onto itself and one that crumples, 20 points a side, at CS184's thickness
 * and a tenth of it: in the sample, each at one of the two. bench/results/folds.csv has 50 points, and the
 * fold at 80. */
TEST(no_edge_passes_a_triangle)
{
    static const beginning folds[] = {
        {"fold", 0.7, {SQUARE, {THICKNESS, "0.0095"}, {"/cloth/0/pins/0/track", SOON}}, .touches = true},
        {"fold", 0.7, {SQUARE, {THICKNESS, "0.00095"}, {"/cloth/0/pins/0/track", SOON}}, .touches = true},
        {"crumple", 0.35, {SQUARE, {THICKNESS, "0.0095"}}, .touches = true},
        {"crumple", 0.35, {SQUARE, {THICKNESS, "0.00095"}}, .touches = true},
    };
    for (size_t i = 0; i < sizeof folds / sizeof *folds; i++)
        if (in_sample(i / 2, i % 2, 2))
            run(&folds[i]);
}

/* The audit finds faults: the capstan's strip is moved into the bar, and then through itself. */
TEST(an_audit_can_fail)
{
    const beginning b = beginning_of("capstan");
    scoped_scene s = load(&b);
    audit a = audit_of(s.ctx, s.model, true, true);
    drape_state *state = scene_state(&s);
    for (int32_t i = 0; i < s.model->node_count; i++)
        state->x[3 * i + 1] -= 0.05;
    ck_assert_int_eq(audit_state(&a, state->x, 0, &a.steps), DRAPE_OK);
    ck_assert_double_gt(a.steps.node, 0.03);
    ck_assert_double_ge(a.steps.face, a.steps.node);
    for (int k = 0; k < 6; k++) /* an edge passes through the middle of the strip, from below it to above */
        state->x[k] = state->x[3 * (s.model->node_count / 2) + k % 3] + (k % 3 != 1 ? 0.003 * (1 + k % 3)
                                                                         : k < 3    ? -0.01
                                                                                    : 0.01);
    ck_assert_int_eq(audit_state(&a, state->x, 0, &a.steps), DRAPE_OK);
    ck_assert_int_gt(a.steps.intersections, 0);
}
