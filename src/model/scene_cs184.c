/*
 * scene_cs184.c: see scene_json.h. Such a scene is an object with at most "cloth", "sphere" and "plane",
 * whose members are checked here; like CS184 itself, the reader ignores members that CS184 does not know.
 * Settings that the CS184 program keeps in windows and constants have that program's initial values: gravity
 * -9.8, 90 frames per second with 30 substeps each, bend springs of 0.2 ks, strains limited to 10 % in one
 * pass, self-contact.
 *
 * In addition a scene may contain those keys of our format that apply to the whole scene, so that a command
 * line can set the integrator, the duration or the output; they are copied. The default method of an
 * integrator is verlet.
 *
 * CS184 sheets lie at y = 1 with rows along +z, or stand with rows along +y and a random z of at most 1 mm
 * that breaks the symmetry. Rows of our grids go along -z or -y: a rotation by 180 degrees about x maps one
 * to the other. All points have the same mass.
 *
 * Methods that do not enforce limits by moving nodes use limit.strain and contact, which Verlet omits; for
 * them, friction is Coulomb's mu.
 */
#include "model/scene_json.h"

#include <math.h>
#include <string.h>

#include "base/param.h"
#include "model/scene.h"
#include "model/scene_text.h"

#define DURATION   3.0 /* [s]; the CS184 program runs until it is closed */
#define FRAME_RATE 90
#define SUBSTEPS   30
#define NOISE      1e-3 /* [m] */

/* All are required, except for "pinned" of a cloth. */
static const drape_param cloth_params[] = {
    DRAPE_NUMBER("width", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, NULL),
    DRAPE_NUMBER("height", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, NULL),
    DRAPE_INTEGER("num_width_points", "1", DRAPE_REQUIRED, 2, 1 << 27, NULL),
    DRAPE_INTEGER("num_height_points", "1", DRAPE_REQUIRED, 2, 1 << 27, NULL),
    DRAPE_NUMBER("thickness", "m", DRAPE_REQUIRED, 0, 10, NULL),
    DRAPE_INTEGER("orientation", "1", DRAPE_REQUIRED, 0, 1, NULL), /* horizontal, vertical */
    DRAPE_NUMBER("damping", "%", DRAPE_REQUIRED, 0, 100, NULL),
    DRAPE_NUMBER("density", "kg/m2", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, NULL),
    DRAPE_NUMBER("ks", "N/m", DRAPE_REQUIRED, 0, 1e15, NULL),
    DRAPE_BOOLEAN("enable_structural", true, NULL),
    DRAPE_BOOLEAN("enable_shearing", true, NULL),
    DRAPE_BOOLEAN("enable_bending", true, NULL),
};
static const drape_param sphere_params[] = {
    DRAPE_VECTOR("origin", "m", DRAPE_REQUIRED, -1e9, 1e9, NULL),
    DRAPE_NUMBER("radius", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, NULL),
    DRAPE_NUMBER("friction", "1", DRAPE_REQUIRED, 0, 1, NULL),
};
static const drape_param plane_params[] = {
    DRAPE_VECTOR("point", "m", DRAPE_REQUIRED, -1e9, 1e9, NULL),
    DRAPE_VECTOR("normal", "1", DRAPE_REQUIRED, -1e9, 1e9, NULL),
    DRAPE_NUMBER("friction", "1", DRAPE_REQUIRED, 0, 1, NULL),
};

typedef struct object {
    const char *name;
    bool required;
    const drape_param *params;
    size_t param_count;
} object;

#define PARAMS(array) array, sizeof array / sizeof *array
static const object objects[] = {{"cloth", true, PARAMS(cloth_params)},
                                 {"sphere", false, PARAMS(sphere_params)},
                                 {"plane", false, PARAMS(plane_params)}};
#define OBJECTS (sizeof objects / sizeof *objects)

/* Keys of our format that are copied. */
static const char *const ours[] = {"description", "gravity", "integrator", "controller", "duration",
                                   "frame_rate",  "output",  "contact",    NULL};

bool drape_scene_is_cs184(json_t *root)
{
    return !json_object_get(root, "drape") && json_is_object(json_object_get(root, "cloth"));
}

/* ---- Checking ---- */

static drape_status check_object(drape_context *ctx, const object *o, json_t *value)
{
    drape_pointer at = {.length = 0};
    drape_pointer_push(&at, o->name);
    if (!json_is_object(value))
        return drape_json_refuse(ctx, &at, value, o->name, "an object");
    size_t mark = at.length;
    for (size_t i = 0; i < o->param_count; i++) {
        const drape_param *param = &o->params[i];
        json_t *member = json_object_get(value, param->name);
        drape_pointer_push(&at, param->name);
        if (!member)
            return drape_refuse(ctx, at.text, "\"%s\" is missing from a CS184 scene: %s", param->name,
                                DRAPE_PARAM_TAKES(param));
        DRAPE_TRY(drape_json_check(ctx, &at, param, member));
        drape_pointer_cut(&at, mark);
    }
    return DRAPE_OK;
}

static drape_status check_keys(drape_context *ctx, json_t *root)
{
    static const char *const theirs[] = {"cloth", "sphere", "plane"};
    for (void *it = json_object_iter(root); it; it = json_object_iter_next(root, it)) {
        const char *name = json_object_iter_key(it);
        drape_pointer at = {.length = 0};
        bool known = false;
        for (size_t i = 0; i < OBJECTS; i++)
            known = known || strcmp(objects[i].name, name) == 0;
        for (int i = 0; ours[i]; i++)
            known = known || strcmp(ours[i], name) == 0;
        if (known)
            continue;
        const char *meant = drape_did_you_mean(name, theirs, 3);
        drape_pointer_push(&at, name);
        return drape_refuse(ctx, at.text,
                            "unknown key \"%.60s\" of a CS184 scene%s%s%s; one of ours has \"drape\": 1",
                            name, meant ? "; did you mean \"" : ", which has cloth, sphere, plane",
                            meant ? meant : "", meant ? "\"?" : "");
    }
    return DRAPE_OK;
}

static double number_of(json_t *object_value, const char *name)
{
    return json_number_value(json_object_get(object_value, name));
}

static drape_status check_pins(drape_context *ctx, json_t *cloth)
{
    json_t *pins = json_object_get(cloth, "pinned");
    const double points[] = {number_of(cloth, "num_width_points"), number_of(cloth, "num_height_points")};
    drape_pointer at = {.length = 0};
    drape_pointer_push(&at, "cloth");
    drape_pointer_push(&at, "pinned");
    size_t mark = at.length;
    if (pins && !json_is_array(pins))
        return drape_json_refuse(ctx, &at, pins, "pinned",
                                 "an array of [x, y], numbers of points of the grid from 0");
    for (size_t i = 0; i < json_array_size(pins); i++) {
        json_t *pin = json_array_get(pins, i);
        drape_pointer_push_index(&at, i);
        if (json_array_size(pin) != 2)
            return drape_json_refuse(ctx, &at, pin, "a pin", "[x, y]");
        for (size_t k = 0; k < 2; k++) {
            json_t *value = json_array_get(pin, k);
            const double number = json_number_value(value);
            if (json_is_number(value) && number >= 0 && number < points[k] && number == floor(number))
                continue;
            const char *expected = DRAPE_FORMAT("an integer from 0 to %.0f", points[k] - 1);
            drape_pointer_push_index(&at, k);
            return drape_json_refuse(ctx, &at, value, k ? "y of a pin" : "x of a pin", expected);
        }
        drape_pointer_cut(&at, mark);
    }
    return DRAPE_OK;
}

static drape_status check(drape_context *ctx, json_t *root)
{
    DRAPE_TRY(check_keys(ctx, root));
    for (size_t i = 0; i < OBJECTS; i++) {
        json_t *value = json_object_get(root, objects[i].name);
        if (value || objects[i].required)
            DRAPE_TRY(check_object(ctx, &objects[i], value));
    }
    DRAPE_TRY(check_pins(ctx, json_object_get(root, "cloth")));
    json_t *normal = json_object_get(json_object_get(root, "plane"), "normal");
    bool has_direction = !normal;
    for (size_t i = 0; i < json_array_size(normal); i++)
        has_direction = has_direction || json_number_value(json_array_get(normal, i)) != 0;
    return has_direction ? DRAPE_OK : drape_refuse(ctx, "/plane/normal", "0 0 0 has no direction");
}

/* ---- Our format. NULL means out of memory; jansson's functions accept it as an argument. ---- */

static json_t *pins_of(json_t *cloth)
{
    json_t *from = json_object_get(cloth, "pinned"), *nodes = json_array();
    double columns = number_of(cloth, "num_width_points");
    if (json_array_size(from) == 0) {
        json_decref(nodes);
        return json_array();
    }
    for (size_t i = 0; i < json_array_size(from); i++) {
        json_t *pin = json_array_get(from, i);
        double node =
            json_number_value(json_array_get(pin, 1)) * columns + json_number_value(json_array_get(pin, 0));
        if (json_array_append_new(nodes, json_real(node))) {
            json_decref(nodes);
            return NULL;
        }
    }
    return json_pack("[{s:o}]", "nodes", nodes);
}

static double stiffness_of(json_t *cloth, const char *enabled)
{
    const bool on = json_is_true(json_object_get(cloth, enabled)) || number_of(cloth, enabled) != 0;
    return on ? number_of(cloth, "ks") : 0;
}

static json_t *cloth_of(json_t *cloth)
{
    const bool vertical = number_of(cloth, "orientation") == 1;
    json_t *mesh =
        json_pack("{s:s,s:f,s:f,s:f,s:f,s:s,s:f,s:{s:[fff],s:[ffff]}}", "grid", "square", "columns",
                  number_of(cloth, "num_width_points"), "rows", number_of(cloth, "num_height_points"),
                  "width", number_of(cloth, "width"), "height", number_of(cloth, "height"), "orientation",
                  vertical ? "vertical" : "horizontal", "noise", vertical ? NOISE : 0.0, "transform",
                  "translate", 0.0, vertical ? 0.0 : 1.0, 0.0, "rotate", 1.0, 0.0, 0.0, 180.0);
    /* E h = ks, the membrane stiffness of a sheet of these springs; no term used here needs it. */
    const double thickness = fmax(number_of(cloth, "thickness"), 1e-4),
                 mass = number_of(cloth, "width") * number_of(cloth, "height") * number_of(cloth, "density");
    json_t *material =
        json_pack("{s:f,s:f,s:f,s:s}", "young_modulus", fmax(number_of(cloth, "ks"), 1) / thickness,
                  "thickness", thickness, "total_mass", mass, "mass", "uniform");
    /* Springs that are switched off have no stiffness, but the strain limit still applies to them, as in
     * CS184. */
    json_t *terms = json_pack("[{s:s,s:f},{s:s,s:f},{s:s,s:f,s:f},{s:s,s:f,s:s}]", "type",
                              "spring.structural", "stiffness", stiffness_of(cloth, "enable_structural"),
                              "type", "spring.shear", "stiffness", stiffness_of(cloth, "enable_shearing"),
                              "type", "spring.bend", "stiffness", stiffness_of(cloth, "enable_bending"),
                              "factor", 0.2, "type", "limit.strain", "limit", 0.1, "over", "springs");
    return json_pack("[{s:o,s:o,s:o,s:o}]", "mesh", mesh, "material", material, "terms", terms, "pins",
                     pins_of(cloth));
}

static json_t *colliders_of(json_t *root)
{
    static const char *const names[][3] = {{"sphere", "center", "radius"}, {"plane", "point", "normal"}};
    json_t *array = json_array();
    for (size_t i = 0; array && i < sizeof names / sizeof *names; i++) {
        const json_t *from = json_object_get(root, names[i][0]);
        json_t *at = json_object_get(from, i == 0 ? "origin" : "point");
        if (from &&
            json_array_append_new(array, json_pack("{s:s,s:O,s:O,s:O}", "type", names[i][0], names[i][1], at,
                                                   names[i][2], json_object_get(from, names[i][2]),
                                                   "friction", json_object_get(from, "friction")))) {
            json_decref(array);
            array = NULL;
        }
    }
    return array;
}

drape_status drape_scene_from_cs184(drape_context *ctx, json_t *root, json_t **out)
{
    json_t *given = json_object_get(root, "integrator"), *cloth = json_object_get(root, "cloth");
    *out = NULL;
    if (given && !json_is_object(given)) {
        drape_pointer at = {.length = 0};
        drape_pointer_push(&at, "integrator");
        return drape_json_refuse(ctx, &at, given, "integrator", "an object");
    }
    drape_status status = check(ctx, root);
    if (status)
        return status;
    /* The integrator of the CS184 program, with any settings that the scene gives in our format. */
    json_t *integrator =
        json_pack("{s:s,s:f,s:i,s:s,s:O,s:s,s:f,s:b}", "method", "verlet", "dt", 1.0 / FRAME_RATE, "substeps",
                  SUBSTEPS, "form", "position", "damping", json_object_get(cloth, "damping"), "contact",
                  "cs184", "strain_limit", 0.1, "guard", 0);
    bool failed = !integrator || (given && json_object_update(integrator, given));
    /* The CS184 program never retries a step with a smaller one: a step that diverges ends it. Other methods
     * get their default controller. */
    const char *method = json_string_value(json_object_get(given, "method")),
               *controller = method && strcmp(method, "verlet") != 0 ? "halving" : "fixed";
    json_t *scene = json_pack("{s:i,s:o,s:o,s:o,s:{s:s},s:[fff],s:f,s:i}", "drape", DRAPE_SCENE_FORM, "cloth",
                              cloth_of(cloth), "colliders", colliders_of(root), "integrator", integrator,
                              "controller", "type", controller, "gravity", 0.0, -9.8, 0.0, "duration",
                              DURATION, "frame_rate", FRAME_RATE);
    if (number_of(cloth, "thickness") > 0)
        failed = json_object_set_new(scene, "self_contact",
                                     json_pack("{s:O}", "thickness", json_object_get(cloth, "thickness"))) ||
                 failed;
    for (int i = 0; ours[i]; i++) {
        json_t *value = json_object_get(root, ours[i]);
        if (value && strcmp(ours[i], "integrator") != 0)
            failed = json_object_set(scene, ours[i], value) || failed;
    }
    if (failed || !scene) {
        json_decref(scene);
        return drape_fail_memory(ctx, 1);
    }
    *out = scene;
    return DRAPE_OK;
}
