/*
 * test_identity.c: a checkpoint is refused by a scene in which one value was changed that affects results,
 * and accepted by one in which a value was changed that does not. Every key of a scene, and every parameter
 * of its material and contact, is tried: a new one with a value that is derived from its parameter, unless
 * `cases` has one. A key that no run can notice stands in `cases` with RESUMES.
 */
#include "compile/compile.h"
#include "model/scene.h"
#include "support/bytes.h"
#include "support/scene.h"

static const char base[] =
    "{'drape': 1, 'cloth': [{'name': 'sheet',"
    " 'mesh': {'grid': 'square', 'columns': 4, 'rows': 5, 'width': 0.3, 'height': 0.4},"
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
    " 'terms': ['stretch.cst', 'bend.midedge', 'stretch.curve'],"
    " 'pins': [{'nodes': [5, 6], 'track': [[0, [0,0,0]], [1, [0,0.1,0]]]},"
    "          {'name': 'other', 'nodes': [0]}]},"
    "  {'name': 'sewn', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 2, 'width': 0.3, 'height': 0.1,"
    "    'transform': {'translate': [2, 0, 0]}},"
    "   'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.cst']}],"
    " 'events': [{'type': 'height', 'height': -1}],"
    " 'seams': [{'type': 'stitch', 'a': {'cloth': 'sewn', 'nodes': [0, 1]},"
    "            'b': {'cloth': 'sewn', 'nodes': [2, 3]}}],"
    " 'colliders': [{'name': 'ball', 'type': 'sphere', 'center': [0,0,-1], 'radius': 0.1}],"
    " 'gravity_history': 'up', 'histories': [{'name': 'up', 'times': [0, 1, 2], 'values': [1, 2, 3]},"
    " {'name': 'down', 'times': [0, 1], 'values': [2, 1]}],"
    " 'self_contact': {'thickness': 0.001}, 'untangle': {}, 'duration': 1}";

typedef enum outcome {
    REFUSED, /* the value affects results: the checkpoint must be refused */
    RESUMES, /* it does not: the checkpoint must be accepted */
    SKIPPED  /* it has only one value, or the case of another key covers it */
} outcome;

#define RENDER_MESH(rest) "{'grid': 'square', 'columns': 7, 'rows': 9, 'width': 0.3, 'height': 0.4" rest "}"
#define FOLD(point, axis, angle)                                                                             \
    "[{'point': " point ", 'axis': " axis ", 'side': [1,0,0], 'angle': " angle "}]"

/* Keys whose value is not changed automatically: the value that `at` is set to instead, which is the key
 * itself if NULL. */
static const struct test_case {
    const char *key;
    outcome outcome;
    const char *at, *value;
} cases[] = {
    /* They concern people, or what a run writes and how long it lasts. */
    {"/description", RESUMES, NULL, "'a remark'"},
    {"/duration", RESUMES, NULL, "2"},
    {"/accuracy", RESUMES, NULL, "'1 um'"}, /* for one sim only a distance of contact, not larger here */
    {"/output/formats", RESUMES, NULL, "['obj']"},
    {"/output/up", RESUMES, NULL, "'z'"},
    {"/cloth/0/name", RESUMES, NULL, "'another'"},
    {"/cloth/0/render_mesh/grid", RESUMES, "/cloth/0/render_mesh", RENDER_MESH("")},
    {"/cloth/0/render_mesh/transform/translate", RESUMES, "/cloth/0/render_mesh",
     RENDER_MESH(", 'transform': {'translate': [0, 0.01, 0]}")},
    {"/cloth/0/render_mesh/transform/rotate", RESUMES, "/cloth/0/render_mesh",
     RENDER_MESH(", 'transform': {'rotate': [0, 1, 0, 1]}")},
    {"/cloth/0/render_mesh/transform/scale", RESUMES, "/cloth/0/render_mesh",
     RENDER_MESH(", 'transform': {'scale': 0.9}")},
    {"/cloth/0/render_mesh/max_distance", RESUMES, "/cloth/0/render_mesh",
     RENDER_MESH(", 'max_distance': 0.5")},
    {"/cloth/0/render_mesh/file", SKIPPED, NULL, NULL}, /* needs a file; its mesh is that of a grid */
    {"/colliders/0/name", RESUMES, NULL, "'another'"},
    {"/cloth/0/pins/0/name", RESUMES, NULL, "'another'"},
    {"/events/0/name", RESUMES, NULL, "'another'"},
    {"/seams/0/name", RESUMES, NULL, "'another'"},

    {"/drape", SKIPPED, NULL, NULL},             /* has only one value */
    {"/cloth/0/mesh/file", SKIPPED, NULL, NULL}, /* its mesh counts, as that of a grid does */

    {"/cloth/0/mesh/grid", REFUSED, "/cloth/0/mesh",
     "{'grid': 'equilateral', 'edges': 6, 'edge_length': 0.1}"},
    {"/cloth/0/material/fabric", REFUSED, "/cloth/0/material", "{'fabric': 'wang2011_denim'}"},
    {"/cloth/0/material/damping", RESUMES, NULL, "'none'"}, /* there is no fabric: physics/loss */
    {"/cloth/0/material/areal_density", REFUSED, "/cloth/0/material",
     "{'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.3}"},
    {"/cloth/0/material/total_mass", REFUSED, "/cloth/0/material",
     "{'young_modulus': 1e5, 'thickness': 1e-3, 'total_mass': 0.3}"},
    {"/cloth/0/terms", REFUSED, NULL,
     "['stretch.cst', 'bend.midedge', 'stretch.curve', {'type': 'drag.viscous', 'coefficient': 1}]"},
    {"/cloth/0/terms/0/type", REFUSED, "/cloth/0/terms/0", "'stretch.edge'"},
    {"/cloth/0/pins/0/nodes", REFUSED, NULL, "[5, 7]"},
    {"/cloth/0/pins/0/corner", REFUSED, "/cloth/0/pins/0", "{'corner': 'top-right'}"},
    {"/cloth/0/pins/0/edge", REFUSED, "/cloth/0/pins/0", "{'edge': 'left'}"},
    {"/cloth/0/pins/0/row", REFUSED, "/cloth/0/pins/0", "{'row': 2}"},
    {"/cloth/0/pins/0/box", REFUSED, "/cloth/0/pins/0", "{'box': [[0,0,-1], [0.2,1,1]]}"},
    {"/cloth/0/pins/0/track", REFUSED, NULL, "[[0, [0,0,0]], [1, [0,0.2,0]]]"},
    {"/cloth/0/pins/0/attach", REFUSED, "/cloth/0/pins/1", "{'nodes': [0], 'attach': 'ball'}"},
    {"/cloth/0/pins/0/triangle", SKIPPED, NULL, NULL}, /* needs the files of a body: physics/riding */
    {"/cloth/0/start/file", SKIPPED, NULL, NULL},      /* needs a file: physics/start; its positions count */
    {"/cloth/0/start/velocities", SKIPPED, NULL, NULL},
    {"/cloth/0/start/pivot", SKIPPED, NULL, NULL}, /* without a spin it has no effect */
    {"/cloth/0/start/folds/0/point", REFUSED, "/cloth/0/start/folds",
     FOLD("[0.2,0,0]", "[0,0,1]", "90, 'radius': 0.01")},
    {"/cloth/0/start/folds/0/axis", REFUSED, "/cloth/0/start/folds", FOLD("[0.1,0,0]", "[0,0,-1]", "90")},
    {"/cloth/0/start/folds/0/side", SKIPPED, NULL, NULL}, /* with the others of a fold: the positions count */
    {"/cloth/0/start/folds/0/angle", SKIPPED, NULL, NULL},
    {"/cloth/0/start/folds/0/radius", SKIPPED, NULL, NULL},
    {"/cloth/0/pins/0/turns/0/time", REFUSED, "/cloth/0/pins/1/turns",
     "[{'time': 0, 'rotate': [0,1,0,0]}, {'time': 1, 'rotate': [0,1,0,90]}]"},
    {"/cloth/0/pins/0/turns/0/rotate", REFUSED, "/cloth/0/pins/1/turns",
     "[{'time': 0, 'rotate': [0,1,0,30]}]"},
    {"/cloth/0/pins/0/turns/0/quaternion", REFUSED, "/cloth/0/pins/1/turns",
     "[{'time': 0, 'quaternion': [1,0,1,0]}]"},
    {"/cloth/0/pins/0/pivot", REFUSED, "/cloth/0/pins/1",
     "{'nodes': [0], 'pivot': [1,0,0], 'turns': [{'time': 0, 'rotate': [0,1,0,30]}]}"},
    {"/cloth/0/pins/0/normal", REFUSED, "/cloth/0/pins/1", "{'nodes': [0], 'normal': [0, 1, 0]}"},
    {"/cloth/0/pins/0/axis", REFUSED, "/cloth/0/pins/1", "{'nodes': [0], 'axis': [0, 1, 0]}"},
    {"/cloth/0/masses/0/nodes", SKIPPED, NULL, NULL}, /* as for pins: the masses count */
    {"/cloth/0/masses/0/corner", SKIPPED, NULL, NULL},
    {"/cloth/0/masses/0/edge", SKIPPED, NULL, NULL},
    {"/cloth/0/masses/0/row", SKIPPED, NULL, NULL},
    {"/cloth/0/masses/0/box", SKIPPED, NULL, NULL},
    {"/cloth/0/masses/0/add", REFUSED, "/cloth/0/masses", "[{'nodes': [8], 'add': 0.01}]"},
    {"/cloth/0/masses/0/mass", REFUSED, "/cloth/0/masses", "[{'edge': 'bottom', 'mass': 0.01}]"},
    /* They need a cloth without bending: physics/periodic. */
    {"/cloth/0/periodic/0/from/nodes", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/from/corner", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/from/edge", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/from/row", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/from/box", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/to/nodes", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/to/corner", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/to/edge", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/to/row", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/to/box", SKIPPED, NULL, NULL},
    {"/cloth/0/periodic/0/period", SKIPPED, NULL, NULL},
    {"/colliders/0/type", REFUSED, "/colliders/0", "{'type': 'plane', 'point': [0,0,-1], 'normal': [0,0,1]}"},
    {"/colliders/0/track", REFUSED, NULL, "[[0, [0,0,0]], [1, [0,0.1,0]]]"},
    {"/colliders/0/turns/0/time", REFUSED, "/colliders/0/turns",
     "[{'time': 0, 'rotate': [0,1,0,0]}, {'time': 1, 'rotate': [0,1,0,90]}]"},
    {"/colliders/0/turns/0/rotate", REFUSED, "/colliders/0/turns", "[{'time': 0, 'rotate': [0,1,0,30]}]"},
    {"/colliders/0/turns/0/quaternion", REFUSED, "/colliders/0/turns",
     "[{'time': 0, 'quaternion': [1,0,1,0]}]"},
    {"/events/0/type", REFUSED, "/events/0", "{'type': 'energy', 'bound': 1}"},
    {"/events/0/cloth", REFUSED, NULL, "'sheet'"},
    {"/cloth/0/ignore", REFUSED, NULL, "['ball']"},
    {"/colliders/0/enabled", REFUSED, NULL, "false"},
    {"/events/0/pins", REFUSED, NULL, "'other'"},
    {"/histories/0/name", SKIPPED, NULL, NULL}, /* names what the loads have */
    {"/histories/0/times", REFUSED, NULL, "[0, 1, 3]"},
    {"/histories/0/values", REFUSED, NULL, "[1, 2, 4]"},
    {"/gravity_history", REFUSED, NULL, "'down'"},
    {"/seams/0/type", SKIPPED, NULL, NULL}, /* there is only one */
    {"/seams/0/a/cloth", SKIPPED, NULL, NULL},
    {"/seams/0/b/cloth", SKIPPED, NULL, NULL},
    {"/seams/0/a/nodes", REFUSED, NULL, "[4, 1]"},
    {"/seams/0/b/nodes", REFUSED, NULL, "[7, 3]"},
    {"/seams/0/a/corner", SKIPPED, NULL, NULL}, /* as for pins: the nodes count */
    {"/seams/0/b/corner", SKIPPED, NULL, NULL},
    {"/seams/0/a/edge", SKIPPED, NULL, NULL},
    {"/seams/0/b/edge", SKIPPED, NULL, NULL},
    {"/seams/0/a/row", SKIPPED, NULL, NULL},
    {"/seams/0/b/row", SKIPPED, NULL, NULL},
    {"/seams/0/a/box", SKIPPED, NULL, NULL},
    {"/seams/0/b/box", SKIPPED, NULL, NULL},
    {"/contact/distance", REFUSED, NULL, "0.002"},
    {"/integrator/method", REFUSED, NULL, "'bdf2'"},
    {"/controller/type", REFUSED, NULL, "'fixed'"},
};

static const char *with_quotes(const char *text)
{
    static char quoted[2048];
    ck_assert_uint_lt(strlen(text), sizeof quoted);
    strcpy(quoted, text);
    quote(quoted);
    return quoted;
}

/* A sim of the base scene, after one change unless value is NULL. */
static scene open_changed(const char *at, const char *value)
{
    scene s = scene_empty();
    drape_scene *parsed;
    ck_assert_int_eq(drape_scene_parse(s.ctx, with_quotes(base), "base", &parsed), DRAPE_OK);
    drape_status status = value ? drape_scene_set(parsed, at, with_quotes(value)) : DRAPE_OK;
    if (!status)
        status = drape_scene_compile(parsed, &s.model);
    ck_assert_msg(status == DRAPE_OK, "%s\n%s: give this key a value in `cases`",
                  drape_context_message(s.ctx), at);
    drape_scene_destroy(&parsed);
    scene_start(&s, NULL);
    return s;
}

/* ---- Values ---- */

/* A number in the range of a parameter that is not its default. */
static double another_number(const drape_param *p)
{
    const double none = isnan(p->default_value) ? 0 : p->default_value, low = fmax(p->min, -1e6),
                 high = fmin(p->max, 1e6), guess = none == 0 ? 0.5 : 1.25 * none;
    if (p->kind == DRAPE_PARAM_INTEGER)
        return none + 1 <= p->max ? none + 1 : none - 1;
    return guess > low && guess < high ? guess : low + (high - low) * (none == (low + high) / 2 ? 0.25 : 0.5);
}

/* Another value of a parameter as JSON text, with apostrophes. */
static void another_value(const drape_param *p, char *text, size_t size)
{
    const double number = another_number(p);
    const int choice = isnan(p->default_value) ? 0 : (int)p->default_value;
    switch (p->kind) {
    case DRAPE_PARAM_BOOLEAN:
        snprintf(text, size, "%s", p->default_value != 0 ? "false" : "true");
        return;
    case DRAPE_PARAM_CHOICE:
        snprintf(text, size, "'%s'", p->choices[choice == 0]);
        return;
    case DRAPE_PARAM_VECTOR:
    case DRAPE_PARAM_TURN:
        snprintf(text, size, "[%.17g, %.17g, %.17g]", number, number, number);
        return;
    case DRAPE_PARAM_TEXT:
        ck_abort_msg("%s is a text: give it a value in `cases`", p->name);
    case DRAPE_PARAM_POINTS:
        snprintf(text, size, "[[0.25, 0.5], [0.75, 1]]");
        return;
    case DRAPE_PARAM_NUMBER:
    case DRAPE_PARAM_INTEGER:
        break;
    }
    snprintf(text, size, "%.17g", number);
}

/* ---- Keys ---- */

typedef struct trial {
    bytes saved; /* a checkpoint of the base scene */
    bool used[sizeof cases / sizeof *cases];
    int count;
} trial;

static const struct test_case *case_of(trial *t, const char *key)
{
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        if (strcmp(cases[i].key, key) == 0) {
            t->used[i] = true;
            return &cases[i];
        }
    return NULL;
}

static void try_change(trial *t, const char *key, const char *at, const char *value, outcome expected)
{
    scene s = open_changed(at, value);
    const drape_status status = drape_sim_restore_from(s.sim, t->saved.data, t->saved.size);
    if (expected == REFUSED)
        ck_assert_msg(status == DRAPE_E_ARGUMENT,
                      "%s = %s: a checkpoint from before the change is restored (%s); sim/identity.c must "
                      "hash what the key changes, or `cases` must say that it RESUMES",
                      key, value, drape_status_name(status));
    else
        ck_assert_msg(status == DRAPE_OK, "%s = %s: %s", key, value, drape_context_message(s.ctx));
    scene_close(&s);
    t->count++;
}

/* shape: of the key's value. */
static void try_param(trial *t, const char *key, const drape_param *p, drape_scene_shape shape)
{
    char value[256];
    const struct test_case *c = case_of(t, key);
    if (c && c->outcome == SKIPPED)
        return;
    if (c) {
        try_change(t, key, c->at ? c->at : key, c->value, c->outcome);
        return;
    }
    ck_assert_msg(shape == DRAPE_SCENE_VALUE, "%s: give this key a value in `cases`", key);
    another_value(p, value, sizeof value);
    try_change(t, key, key, value, REFUSED);
}

static void try_object(trial *t, const drape_scene_object *object, const char *pointer)
{
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        char at[256];
        snprintf(at, sizeof at, "%s/%s", pointer, key->param.name);
        if (!key->child || key->shape == DRAPE_SCENE_ENTRIES)
            try_param(t, at, &key->param, key->shape);
        if (key->child) {
            const bool array = key->shape != DRAPE_SCENE_OBJECT;
            snprintf(at, sizeof at, "%s/%s%s", pointer, key->param.name, array ? "/0" : "");
            try_object(t, key->child, at);
        }
    }
}

/* The parameters of an object that has one entry only. */
static void try_settings(trial *t, const drape_registry *registry, const char *pointer)
{
    const drape_entry *entry = registry->entries[0];
    for (int i = 0; i < entry->param_count; i++) {
        char at[256];
        snprintf(at, sizeof at, "%s/%s", pointer, entry->params[i].name);
        try_param(t, at, &entry->params[i], DRAPE_SCENE_VALUE);
    }
}

TEST(every_key_that_affects_results_is_in_the_identity)
{
    trial t = {0};
    scene s = open_changed(NULL, NULL);
    ck_assert_int_eq(drape_sim_save_to(s.sim, bytes_keep, &t.saved), DRAPE_OK);
    scene_close(&s);
    try_object(&t, &drape_form_scene, "");
    try_settings(&t, &drape_material_registry, "/cloth/0/material");
    try_settings(&t, &drape_contact_registry, "/contact");
    try_settings(&t, &drape_self_contact_registry, "/self_contact");
    try_settings(&t, &drape_untangle_registry, "/untangle");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        ck_assert_msg(t.used[i], "%s is in `cases` and not a key", cases[i].key);
    printf("# %d changes\n", t.count);
    ck_assert_int_gt(t.count, (int)(sizeof cases / sizeof *cases) / 2); /* keys without a case */
    free(t.saved.data);
}
