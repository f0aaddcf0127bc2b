/* models.h: what the tests of entries share: random numbers, models of four meshes made in memory, checks of
 * parameter lists. */
#ifndef DRAPE_TESTS_ENTRIES_MODELS_H
#define DRAPE_TESTS_ENTRIES_MODELS_H

#include <check.h>
#include <ctype.h>
#include <math.h>
#include <string.h>

#include "assemble/system.h"
#include "base/param.h"
#include "drape/extend.h"
#include "support/context.h"

/* ---- Random numbers
 * --------------------------------------------------------------------------------------------- */

/* In [-1, 1): xorshift64*, a generator other than the library's. */
static inline double random_number(uint64_t *seed)
{
    *seed ^= *seed >> 12;
    *seed ^= *seed << 25;
    *seed ^= *seed >> 27;
    return (double)((*seed * UINT64_C(2685821657736338717)) >> 11) / 4503599627370496.0 - 1;
}

/* A rotation matrix (row-major) about a random axis, Rodrigues' formula. */
static inline void random_rotation(uint64_t *seed, double r[9])
{
    double k[3], angle = 3 * random_number(seed), norm = 0;
    for (int i = 0; i < 3; i++)
        k[i] = random_number(seed);
    norm = sqrt(k[0] * k[0] + k[1] * k[1] + k[2] * k[2]);
    for (int i = 0; i < 3; i++)
        k[i] /= norm;
    double s = sin(angle), c = cos(angle);
    const double cross[9] = {0, -k[2], k[1], k[2], 0, -k[0], -k[1], k[0], 0};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[3 * i + j] = c * (i == j) + s * cross[3 * i + j] + (1 - c) * k[i] * k[j];
}

/* ---- Meshes
 * ------------------------------------------------------------------------------------------------------ */

enum model_mesh { MESH_EQUILATERAL, MESH_SQUARE, MESH_IRREGULAR, MESH_CURVED, MESH_COUNT };
static const char *const mesh_names[MESH_COUNT] = {"equilateral", "square", "irregular", "curved"};

#define IRREGULAR_COLUMNS   5
#define IRREGULAR_ROWS      4
#define IRREGULAR_NODES     (IRREGULAR_COLUMNS * IRREGULAR_ROWS)
#define IRREGULAR_TRIANGLES (2 * (IRREGULAR_COLUMNS - 1) * (IRREGULAR_ROWS - 1))

/* A sheet with edges of about 0.1 m, nodes displaced at random, and diagonals and windings chosen at random;
 * curved in both directions if height is not 0. */
static inline void irregular_mesh(double height, double *x, int32_t *triangle)
{
    uint64_t seed = 12345;
    for (int i = 0; i < IRREGULAR_NODES; i++) {
        double u = i % IRREGULAR_COLUMNS, v = i / IRREGULAR_COLUMNS;
        x[3 * i] = 0.1 * u + 0.025 * random_number(&seed);
        x[3 * i + 1] = height * (sin(1.3 * u) + 0.7 * cos(1.9 * v + 0.4));
        x[3 * i + 2] = -0.11 * v + 0.025 * random_number(&seed);
    }
    for (int t = 0; t < IRREGULAR_TRIANGLES; t += 2) {
        int c = t / 2 % (IRREGULAR_COLUMNS - 1), r = t / 2 / (IRREGULAR_COLUMNS - 1);
        int32_t a = r * IRREGULAR_COLUMNS + c, b = a + 1, d = a + IRREGULAR_COLUMNS, e = d + 1;
        const int32_t one[] = {a, b, e, a, e, d}, other[] = {a, b, d, b, e, d};
        memcpy(triangle + 3 * t, random_number(&seed) > 0 ? one : other, 6 * sizeof *triangle);
        if (random_number(&seed) > 0) {
            int32_t kept = triangle[3 * t];
            triangle[3 * t] = triangle[3 * t + 1];
            triangle[3 * t + 1] = kept;
        }
    }
}

/* ---- Models
 * ------------------------------------------------------------------------------------------------------ */

typedef struct model_def {
    enum model_mesh mesh;
    const drape_entry_def *terms;
    size_t term_count;
    bool gravity, pinned; /* pinned: nodes 0 and 3 */
    double thickness;     /* [m]; 0: 1e-3 */
} model_def;

/* All else is fixed: E = 1e5 Pa, nu = 0.3, 0.2 kg/m2, and curves that stiffen, soften and do both. */
static inline drape_status try_model(drape_context *ctx, const model_def *def, drape_model **out)
{
    static const int32_t pinned_nodes[] = {0, 3};
    static const double warp[] = {0.03, 2, 0.08, 11, 0.15, 70}, weft[] = {0.03, 9, 0.08, 11, 0.15, 12},
                        shear[] = {2, 1, 5, 1.6, 12, 6};
    double x[3 * IRREGULAR_NODES];
    int32_t triangle[3 * IRREGULAR_TRIANGLES];
    const drape_setting material[] = {{"young_modulus", 1e5, NULL},
                                      {"poisson_ratio", 0.3, NULL},
                                      {"thickness", def->thickness > 0 ? def->thickness : 1e-3, NULL},
                                      {"areal_density", 0.2, NULL},
                                      {"warp_curve", 2, NULL, warp, 6},
                                      {"weft_curve", 2, NULL, weft, 6},
                                      {"shear_curve", 2, NULL, shear, 6}};
    const drape_setting equilateral[] = {{"edges", 3, NULL}, {"edge_length", 0.1, NULL}};
    const drape_setting square[] = {
        {"columns", 4, NULL}, {"rows", 5, NULL}, {"width", 0.3, NULL}, {"height", 0.5, NULL}};
    drape_scene_def scene = scene_def();
    drape_cloth_def cloth = cloth_def();
    drape_pin_def pin = pin_def();
    if (def->mesh == MESH_EQUILATERAL)
        cloth.mesh.grid = (drape_entry_def){"equilateral", equilateral, 2};
    else if (def->mesh == MESH_SQUARE)
        cloth.mesh.grid = (drape_entry_def){"square", square, 4};
    else {
        irregular_mesh(def->mesh == MESH_CURVED ? 0.04 : 0, x, triangle);
        cloth.mesh.positions = x;
        cloth.mesh.triangles = triangle;
        cloth.mesh.node_count = IRREGULAR_NODES;
        cloth.mesh.triangle_count = IRREGULAR_TRIANGLES;
    }
    cloth.material = material;
    cloth.material_count = sizeof material / sizeof *material;
    cloth.terms = def->terms;
    cloth.term_count = def->term_count;
    pin.nodes = pinned_nodes;
    pin.node_count = 2;
    cloth.pins = &pin;
    cloth.pin_count = def->pinned;
    scene.cloths = &cloth;
    scene.cloth_count = 1;
    if (!def->gravity)
        memset(scene.gravity, 0, sizeof scene.gravity);
    return drape_model_create(ctx, &scene, out);
}

static inline drape_model *make_model(drape_context *ctx, const model_def *def)
{
    drape_model *model = NULL;
    assert_ok(ctx, try_model(ctx, def, &model));
    return model;
}

static inline drape_system *make_system(drape_arena *arena, const drape_model *model, int threads)
{
    drape_system *system = NULL;
    ck_assert_int_eq(drape_system_create(arena, model, threads, &system), DRAPE_OK);
    return system;
}

/* ---- Parameter lists
 * -------------------------------------------------------------------------------------------- */

static inline void check_line(const char *text, const char *what)
{
    ck_assert_msg(text && *text, "%s is empty", what);
    for (; *text; text++)
        ck_assert_msg(!iscntrl((unsigned char)*text), "%s is not one line", what);
}

/* Lower-case letters, digits, '_', and '.' where dots are allowed: the characters of names in scenes and on
 * command lines. */
static inline void check_name(const char *name, bool dots)
{
    check_line(name, "a name");
    ck_assert_msg(islower((unsigned char)*name), "%s", name);
    for (const char *p = name; *p; p++)
        ck_assert_msg(islower((unsigned char)*p) || isdigit((unsigned char)*p) || *p == '_' ||
                          (dots && *p == '.'),
                      "the name \"%s\"", name);
}

static inline void check_choices(const drape_param *p)
{
    ck_assert_msg(p->choices && p->choices[0], "%s has no choices", p->name);
    int count = 0;
    for (; p->choices[count]; count++) {
        check_name(p->choices[count], false);
        for (int other = 0; other < count; other++)
            ck_assert_str_ne(p->choices[count], p->choices[other]);
    }
    ck_assert_msg(p->default_value >= 0 && p->default_value < count &&
                      p->default_value == floor(p->default_value),
                  "the default of %s is no choice", p->name);
}

static inline void check_range(const drape_param *p)
{
    double d = p->default_value;
    ck_assert_msg(isfinite(p->min) && isfinite(p->max) && p->min < p->max, "the range of %s", p->name);
    if (isnan(d)) {
        if (p->derived)
            check_line(p->derived, "what is derived");
        return;
    }
    ck_assert_msg(p->open_min ? d > p->min : d >= p->min, "the default of %s is below its range", p->name);
    ck_assert_msg(p->open_max ? d < p->max : d <= p->max, "the default of %s is above its range", p->name);
    ck_assert_msg(p->kind != DRAPE_PARAM_INTEGER || d == floor(d), "the default of %s is no integer",
                  p->name);
}

static inline void check_params(const drape_param *params, int count)
{
    ck_assert(count >= 0 && (params || count == 0) && drape_param_place(params, count) <= DRAPE_MAX_PARAMS);
    for (int i = 0; i < count; i++) {
        const drape_param *p = &params[i];
        check_name(p->name, false);
        check_line(p->unit, "a unit");
        check_line(p->help, "a help text");
        for (int other = 0; other < i; other++)
            ck_assert_str_ne(p->name, params[other].name);
        if (p->kind == DRAPE_PARAM_CHOICE)
            check_choices(p);
        else if (p->kind == DRAPE_PARAM_BOOLEAN)
            ck_assert(p->default_value == 0 || p->default_value == 1);
        else if (p->kind == DRAPE_PARAM_TEXT)
            ck_assert(isnan(p->default_value));
        else
            check_range(p);
    }
}

/* A typical value of a parameter: its default, or a value inside its range if it has no default. */
static inline double generic_value(const drape_param *p)
{
    if (!isnan(p->default_value))
        return p->default_value;
    return p->min < 0.37 && 0.37 < p->max ? 0.37 : p->min + 0.37 * (p->max - p->min);
}

/* Settings (DRAPE_MAX_PARAMS) that give every required parameter a value; returns their number. */
static inline size_t required_settings(const drape_param *params, int count, drape_setting *settings)
{
    size_t used = 0;
    for (int i = 0; i < count; i++)
        if (isnan(params[i].default_value) && !params[i].derived)
            settings[used++] = (drape_setting){params[i].name, generic_value(&params[i]), NULL};
    return used;
}

#endif
