/*
 * fuzz_model.c: a scene made from the bytes, as structs, and some steps of it. Meshes are small and may be
 * nearly degenerate; materials reach the ends of their ranges; terms, colliders, contact, controllers and
 * integrators come from the tables, with settings drawn from the ranges of their parameters. If the scene is
 * refused, with one line, the refused part is removed.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "fuzz/fuzz.h"
#include "integrators/integrator.h"
#include "terms/terms.h"

#define MAX_MEMORY    ((size_t)64 << 20)
#define MAX_SIDE      4 /* cells of a lattice */
#define MAX_NODES     ((MAX_SIDE + 1) * (MAX_SIDE + 1))
#define MAX_TRIANGLES (2 * MAX_SIDE * MAX_SIDE)
#define MAX_CLOTHS    2
#define MAX_PINS      3
#define MAX_TERMS     8
#define MAX_COLLIDERS 3
#define HISTORY       "history" /* the name of the scene's only one */
#define MAX_KEYS      3
#define MAX_ROWS      32 /* parts with settings in a scene */
#define ATTEMPTS      6
#define STEPS         3
#define ALONE         0.4 /* [s] of CPU for a single integrator, and for each when all of them run */
#define EACH          0.1
#define MAX_COUNT     40 /* for integers such as iterations and substeps: bounds the work of a step */

/* ---- Settings, drawn from the parameters of an entry ---- */

typedef struct drawn {
    drape_setting setting[DRAPE_MAX_PARAMS];
    double vector[DRAPE_MAX_PARAMS][4];
    size_t count;
} drawn;

/* A value within the range, logarithmic if it spans several magnitudes; sometimes one of its ends. */
static double draw_number(fuzz_bytes *in, const drape_param *p)
{
    const double max = fmin(p->open_max ? p->max * (1 - 1e-9) : p->max, 1e12),
                 min = fmax(p->open_min ? p->min + 1e-9 : p->min, -1e12);
    const unsigned how = fuzz_below(in, 8);
    if (how == 0)
        return min;
    if (how == 1)
        return max;
    if (how < 4 || max <= 0)
        return fuzz_between(in, fmax(min, -2), fmin(max, 2));
    return fuzz_magnitude(in, fmax(min, max * 1e-12), max);
}

static void draw_value(fuzz_bytes *in, const drape_param *p, int span, drape_setting *s, double *vector)
{
    unsigned choices = 0;
    while (p->choices && p->choices[choices])
        choices++;
    if (p->kind == DRAPE_PARAM_CHOICE)
        s->text = p->choices[fuzz_below(in, choices)];
    else if (p->kind == DRAPE_PARAM_BOOLEAN)
        s->number = fuzz_below(in, 2);
    else if (p->kind == DRAPE_PARAM_INTEGER)
        s->number = floor(fuzz_between(in, p->min, fmin(p->max, p->min + span)));
    else if (p->kind == DRAPE_PARAM_NUMBER)
        s->number = draw_number(in, p);
    else if (p->kind == DRAPE_PARAM_TEXT)
        s->text = strcmp(p->name, "history") == 0 ? HISTORY : "missing.obj";
    else if (p->kind == DRAPE_PARAM_POINTS) { /* one point, or a second one that may lie lower */
        vector[0] = draw_number(in, p), vector[1] = fuzz_magnitude(in, 1e-9, 1e15);
        vector[2] = draw_number(in, p), vector[3] = fuzz_magnitude(in, 1e-9, 1e15);
        s->vector = vector;
        s->number = 2;
        s->vector_count = fuzz_below(in, 2) ? 4 : 2;
    } else {
        for (int k = 0; k < 3; k++)
            vector[k] = fuzz_between(in, fmax(p->min + (p->open_min ? 1e-3 : 0), -1), fmin(p->max, 1));
        s->vector = vector;
        s->vector_count = 3;
    }
}

/* Draws the required settings, and each other one if a bit is set. span: integers lie at most this far above
 * their minimum. */
static void draw(fuzz_bytes *in, const drape_param *params, int count, int span, drawn *d)
{
    unsigned bits = 0;
    d->count = 0;
    for (int i = 0; i < count; i++) {
        const drape_param *p = &params[i];
        if (i % 8 == 0)
            bits = fuzz_byte(in);
        const bool wanted = bits >> i % 8 & 1, required = isnan(p->default_value) && !p->derived;
        if (!wanted && !required)
            continue;
        drape_setting *s = &d->setting[d->count];
        *s = (drape_setting){.name = p->name};
        draw_value(in, p, span, s, d->vector[d->count++]);
    }
}

/* ---- The scene ---- */

typedef struct mesh {
    double x[3 * MAX_NODES];
    int32_t triangle[3 * MAX_TRIANGLES];
    int32_t nodes, triangles;
} mesh;

typedef struct cloth {
    mesh mesh;
    drape_entry_def terms[MAX_TERMS];
    drape_pin_def pins[MAX_PINS];
    int32_t pinned[MAX_PINS];
    drape_track_key keys[MAX_PINS][2];
    drape_setting material[DRAPE_MAX_PARAMS];
} cloth;

typedef struct scene {
    drape_scene_def def;
    drape_cloth_def cloths[MAX_CLOTHS];
    drape_collider_def colliders[MAX_COLLIDERS];
    drape_track_key collider_keys[MAX_COLLIDERS][2];
    cloth parts[MAX_CLOTHS];
    drawn integrators[MAX_ROWS];
    int row_count;
    drape_history_def history;
    double times[MAX_KEYS], factors[MAX_KEYS];
} scene;

static drape_entry_def row(scene *s, fuzz_bytes *in, const char *name, const drape_param *params, int count)
{
    FUZZ_REQUIRE(s->row_count < MAX_ROWS, "row %s", name);
    drawn *d = &s->integrators[s->row_count++];
    draw(in, params, count, MAX_COUNT, d);
    return (drape_entry_def){.type = name, .settings = d->setting, .setting_count = d->count};
}

static void draw_triangles(mesh *m, int columns, int rows, unsigned flips)
{
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            const int32_t a = r * (columns + 1) + c, b = a + 1, d = a + columns + 1, e = d + 1;
            const bool flip = flips >> (r + c) % 8 & 1;
            const int32_t corners[] = {a, d, flip ? e : b, flip ? a : b, flip ? e : d, flip ? b : e};
            memcpy(m->triangle + 3 * m->triangles, corners, sizeof corners);
            m->triangles += 2;
        }
}

/* A lattice whose cells are flattened by `squeeze`, with each node displaced by part of a cell. */
static void draw_mesh(mesh *m, drape_mesh_def *def, fuzz_bytes *in)
{
    const int columns = 1 + (int)fuzz_below(in, MAX_SIDE), rows = 1 + (int)fuzz_below(in, MAX_SIDE);
    const double size = fuzz_magnitude(in, 1e-5, 1e4);
    const double squeeze = fuzz_below(in, 2) ? 1 : fuzz_magnitude(in, 1e-11, 1);
    const double stir = fuzz_below(in, 3) ? 0 : 1.5, height = fuzz_between(in, -1, 1);
    m->nodes = (columns + 1) * (rows + 1);
    m->triangles = 0;
    for (int i = 0; i < m->nodes; i++) {
        const double at[3] = {i % (columns + 1), height, squeeze * (double)(i / (columns + 1))};
        for (int k = 0; k < 3; k++)
            m->x[3 * i + k] = size * (at[k] + (stir > 0 ? fuzz_between(in, -stir, stir) : 0));
    }
    draw_triangles(m, columns, rows, fuzz_byte(in));
    def->positions = m->x;
    def->node_count = (size_t)m->nodes;
    def->triangles = m->triangle;
    def->triangle_count = (size_t)m->triangles;
}

static void draw_grid(scene *s, drape_cloth_def *def, fuzz_bytes *in)
{
    unsigned count = 0;
    while (drape_grids[count])
        count++;
    const drape_grid_ops *ops = drape_grids[fuzz_below(in, count)];
    drawn *d = &s->integrators[s->row_count++];
    draw(in, ops->entry.params, ops->entry.param_count, MAX_SIDE, d);
    def->mesh.grid =
        (drape_entry_def){.type = ops->entry.name, .settings = d->setting, .setting_count = d->count};
}

/* A displacement, in a time that may be shorter than any step. */
static void draw_track(fuzz_bytes *in, drape_track_key keys[2])
{
    const double far = fuzz_magnitude(in, 1e-6, 1e3);
    keys[0] = (drape_track_key){0};
    keys[1].time = fuzz_magnitude(in, 1e-9, 10);
    for (int k = 0; k < 3; k++)
        keys[1].displacement[k] = fuzz_between(in, -far, far);
}

static void draw_pins(cloth *c, drape_cloth_def *def, fuzz_bytes *in)
{
    def->pins = c->pins;
    def->pin_count = fuzz_below(in, MAX_PINS + 1);
    for (size_t i = 0; i < def->pin_count; i++) {
        drape_pin_def *pin = &c->pins[i];
        drape_pin_def_init(pin, sizeof *pin);
        c->pinned[i] = (int32_t)fuzz_below(in, 4);
        pin->nodes = &c->pinned[i];
        pin->node_count = 1;
        pin->clamp = fuzz_below(in, 4) == 3;
        if (fuzz_below(in, 2)) {
            draw_track(in, c->keys[i]);
            pin->track = c->keys[i];
            pin->key_count = 2;
        }
    }
}

static void draw_material(cloth *c, drape_cloth_def *def, fuzz_bytes *in)
{
    const double values[] = {fuzz_magnitude(in, 1e-3, 1e13), fuzz_between(in, 0, 0.5),
                             fuzz_magnitude(in, 1e-7, 1), fuzz_magnitude(in, 1e-3, 1e5)};
    for (int i = 0; i < 4; i++)
        c->material[i] = (drape_setting){.name = drape_material_entry.params[i].name, .number = values[i]};
    def->material = c->material;
    def->material_count = 4;
}

static void draw_terms(scene *s, cloth *c, drape_cloth_def *def, fuzz_bytes *in)
{
    unsigned count = 0;
    while (drape_terms[count])
        count++;
    def->terms = c->terms;
    def->term_count = fuzz_below(in, MAX_TERMS + 1);
    const unsigned first = fuzz_below(in, count);
    for (size_t i = 0; i < def->term_count; i++) {
        const drape_term_ops *ops = drape_terms[(first + i * (i + 1) / 2) % count];
        c->terms[i] = row(s, in, ops->entry.name, ops->entry.params, ops->entry.param_count);
    }
}

static void draw_cloths(scene *s, fuzz_bytes *in)
{
    s->def.cloths = s->cloths;
    s->def.cloth_count = 1 + fuzz_below(in, MAX_CLOTHS);
    for (size_t i = 0; i < s->def.cloth_count; i++) {
        drape_cloth_def *def = &s->cloths[i];
        cloth *c = &s->parts[i];
        drape_cloth_def_init(def, sizeof *def);
        if (fuzz_below(in, 3) == 2)
            draw_grid(s, def, in);
        else
            draw_mesh(&c->mesh, &def->mesh, in);
        draw_material(c, def, in);
        draw_terms(s, c, def, in);
        draw_pins(c, def, in);
        for (int k = 0; k < 3; k++)
            def->velocity[k] = fuzz_between(in, -10, 10);
    }
}

static void draw_colliders(scene *s, fuzz_bytes *in)
{
    unsigned count = 0;
    while (drape_colliders[count])
        count++;
    s->def.colliders = s->colliders;
    s->def.collider_count = fuzz_below(in, MAX_COLLIDERS + 1);
    for (size_t i = 0; i < s->def.collider_count; i++) {
        const drape_collider_ops *ops = drape_colliders[fuzz_below(in, count)];
        drape_collider_def *def = &s->colliders[i];
        drape_collider_def_init(def, sizeof *def);
        def->entry = row(s, in, ops->entry.name, ops->entry.params, ops->entry.param_count);
        def->friction = fuzz_below(in, 2) ? fuzz_magnitude(in, 1e-3, 1e3) : 0;
        if (fuzz_below(in, 2)) {
            draw_track(in, s->collider_keys[i]);
            def->track = s->collider_keys[i];
            def->key_count = 2;
        }
    }
}

static void draw_contact(scene *s, fuzz_bytes *in)
{
    if (fuzz_below(in, 2)) {
        const drape_entry_def contact =
            row(s, in, "contact", drape_contact_params, DRAPE_CONTACT_PARAM_COUNT);
        s->def.contact = contact.settings;
        s->def.contact_count = contact.setting_count;
    }
    if (fuzz_below(in, 2)) {
        const drape_entry_def self =
            row(s, in, "self_contact", drape_self_contact_params, DRAPE_SELF_PARAM_COUNT);
        s->def.self_contact = self.settings;
        s->def.self_contact_count = self.setting_count;
    }
}

static void draw_history(scene *s, fuzz_bytes *in)
{
    const unsigned count = 1 + fuzz_below(in, MAX_KEYS);
    drape_history_def_init(&s->history, sizeof s->history);
    s->history.name = HISTORY;
    s->history.times = s->times;
    s->history.values = s->factors;
    s->history.time_count = s->history.value_count = count;
    s->history.interpolation = fuzz_below(in, 2) ? "cubic" : NULL;
    for (unsigned k = 0; k < count; k++) {
        s->times[k] = (k ? s->times[k - 1] : 0) + fuzz_magnitude(in, 1e-6, 1);
        s->factors[k] = fuzz_between(in, -2, 2);
    }
    s->def.histories = &s->history;
    s->def.history_count = 1;
    s->def.gravity_history = fuzz_below(in, 4) == 3 ? HISTORY : NULL;
}

static void draw_scene(scene *s, fuzz_bytes *in)
{
    memset(s, 0, sizeof *s);
    drape_scene_def_init(&s->def, sizeof s->def);
    draw_cloths(s, in);
    draw_colliders(s, in);
    draw_contact(s, in);
    if (fuzz_below(in, 3) == 2)
        s->def.gravity[1] = fuzz_between(in, -1e4, 1e4);
    draw_history(s, in);
}

/* ---- Removing what was refused ---- */

static void drop(void *items, size_t size, size_t *count, unsigned index, const char *pointer)
{
    char *from = items;
    FUZZ_REQUIRE(index < *count, "%s: there are %zu", pointer, *count);
    memmove(from + index * size, from + (index + 1) * size, (*count - index - 1) * size);
    --*count;
}

/* Removes the part that the message points to; false: the scene cannot do without it. */
static bool leave_out(scene *s, const char *pointer)
{
    unsigned i, j;
    if (sscanf(pointer, "/cloth/%u/terms/%u", &i, &j) == 2 && i < s->def.cloth_count)
        drop(s->parts[i].terms, sizeof *s->parts[i].terms, &s->cloths[i].term_count, j, pointer);
    else if (sscanf(pointer, "/cloth/%u/pins/%u", &i, &j) == 2 && i < s->def.cloth_count)
        drop(s->parts[i].pins, sizeof *s->parts[i].pins, &s->cloths[i].pin_count, j, pointer);
    else if (sscanf(pointer, "/colliders/%u", &j) == 1)
        drop(s->colliders, sizeof *s->colliders, &s->def.collider_count, j, pointer);
    else if (strncmp(pointer, "/contact", 8) == 0 && s->def.contact)
        s->def.contact = NULL, s->def.contact_count = 0;
    else if (strncmp(pointer, "/self_contact", 13) == 0 && s->def.self_contact)
        s->def.self_contact = NULL, s->def.self_contact_count = 0;
    else
        return false;
    return true;
}

static drape_model *make_model(drape_context *ctx, scene *s)
{
    drape_model *model = NULL;
    drape_status status;
    do {
        status = drape_model_create(ctx, &s->def, &model);
        fuzz_check(ctx, status, "drape_model_create");
        FUZZ_REQUIRE(!status == !!model, "%s", drape_status_name(status));
    } while ((status == DRAPE_E_ARGUMENT || status == DRAPE_E_FILE) && leave_out(s, ctx->pointer));
    return model;
}

/* ---- Steps ---- */

static void run(drape_context *ctx, const drape_model *model, const drape_integrator_ops *integrator,
                fuzz_bytes *in, double seconds)
{
    static drawn settings[2]; /* large */
    drape_sim_def def;
    drape_sim *sim = NULL;
    unsigned count = 0;
    while (drape_controllers[count])
        count++;
    const drape_controller_ops *controller = drape_controllers[fuzz_below(in, count)];
    drape_sim_def_init(&def, sizeof def);
    draw(in, integrator->entry.params, integrator->entry.param_count, MAX_COUNT, &settings[0]);
    draw(in, controller->entry.params, controller->entry.param_count, MAX_COUNT, &settings[1]);
    def.integrator = integrator->entry.name;
    def.integrator_settings = settings[0].setting;
    def.integrator_setting_count = settings[0].count;
    def.controller = controller->entry.name;
    def.controller_settings = settings[1].setting;
    def.controller_setting_count = settings[1].count;
    const double dt = fuzz_magnitude(in, 1e-6, 1);
    const drape_status status = drape_sim_create(ctx, model, &def, &sim);
    fuzz_check(ctx, status, "drape_sim_create");
    FUZZ_REQUIRE(!status == !!sim, "%s", drape_status_name(status));
    if (sim)
        fuzz_advance(ctx, sim, STEPS * dt, ATTEMPTS, seconds);
    drape_sim_destroy(&sim);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static scene s; /* large */
    fuzz_bytes in = {.at = data, .end = data + size};
    drape_context *ctx = fuzz_open(MAX_MEMORY);
    const unsigned chosen = fuzz_below(&in, 16); /* index of an integrator; past the last: all of them */
    unsigned count = 0;
    while (drape_integrators[count])
        count++;
    draw_scene(&s, &in);
    drape_model *model = make_model(ctx, &s);
    for (unsigned i = 0; model && i < count; i++) {
        fuzz_bytes own = in; /* each reads the same bytes */
        if (chosen == i || chosen >= count)
            run(ctx, model, drape_integrators[i], &own, chosen == i ? ALONE : EACH);
    }
    drape_model_destroy(&model);
    fuzz_close(&ctx);
    return 0;
}
