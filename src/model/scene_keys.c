/* scene_keys.c: the keys of a scene, one entry each. */
#include "model/scene.h"

#define KEYS(array) .keys = array, .key_count = sizeof array / sizeof *array

/* Where a value goes: a member of the def, or an array and its count. */
#define IN(def, member)           .offset = offsetof(def, member)
#define ARRAY(def, member, count) .offset = offsetof(def, member), .count_offset = offsetof(def, count)
#define SETTINGS(def, member, count)                                                                         \
    .open = true, .settings_offset = offsetof(def, member), .settings_count_offset = offsetof(def, count)

const char *const drape_pin_corners[] = {"top-left", "top-right", "bottom-left", "bottom-right", NULL};
const char *const drape_pin_edges[] = {"top", "bottom", "left", "right", NULL};

const char *const drape_up_axes[] = {"y", "z", NULL};

/* ---- Pins ---- */

static const drape_scene_key pin_keys[] = {
    {"nodes", DRAPE_SCENE_INTEGERS, ARRAY(drape_pin_def, nodes, node_count), .max = INT32_MAX, .at_least = 1,
     .help = "node numbers of this cloth"},
    {"corner", DRAPE_SCENE_WORD, IN(drape_pin_def, corner), .words = drape_pin_corners,
     .help = "a corner of a grid; top is row 0, left is column 0"},
    {"edge", DRAPE_SCENE_WORD, IN(drape_pin_def, edge), .words = drape_pin_edges,
     .help = "a side of a grid; top is row 0, left is column 0"},
    {"row", DRAPE_SCENE_INTEGER, IN(drape_pin_def, row), .max = INT32_MAX, .help = "a row of a grid, from 0"},
    {"box", DRAPE_SCENE_BOX, .unit = "m",
     .help = "nodes inside, rest coordinates after the transform, boundary included"},
    {"track", DRAPE_SCENE_TRACK, ARRAY(drape_pin_def, track, key_count), .at_least = 1, .unit = "s and m",
     .help = "displacement from rest, linear between the times; default none: fixed"},
    {"clamp", DRAPE_SCENE_BOOLEAN, IN(drape_pin_def, clamp),
     .help = "edges between these nodes keep the direction of the sheet across them, in bend.midedge; "
             "default false"},
};
static const char *const pin_selectors[] = {"nodes", "corner", "edge", "row", "box", NULL};

static void init_pin(void *def)
{
    drape_pin_def_init(def, sizeof(drape_pin_def));
}

static const drape_scene_object pin = {.name = "pin",
                                       KEYS(pin_keys),
                                       .one_of = pin_selectors,
                                       .def_size = sizeof(drape_pin_def),
                                       .init = init_pin};

/* ---- Rows with settings ---- */

static const drape_scene_key term_keys[] = {
    {"type", DRAPE_SCENE_WORD, .required = true, IN(drape_row_def, type), .help = "a row of the terms"},
};
static const drape_scene_object term = {.name = "term",
                                        KEYS(term_keys),
                                        SETTINGS(drape_row_def, settings, setting_count),
                                        .def_size = sizeof(drape_row_def)};

static const drape_scene_key integrator_keys[] = {
    {"method", DRAPE_SCENE_WORD, IN(drape_row_def, type), .help = "a row of the integrators; default \"be\""},
};
static const drape_scene_object integrator = {
    .name = "integrator", KEYS(integrator_keys), SETTINGS(drape_row_def, settings, setting_count)};

static const drape_scene_key controller_keys[] = {
    {"type", DRAPE_SCENE_WORD, IN(drape_row_def, type),
     .help = "a row of the controllers; default \"halving\""},
};
static const drape_scene_object controller = {
    .name = "controller", KEYS(controller_keys), SETTINGS(drape_row_def, settings, setting_count)};

/* Its members are the parameters of a material, settings all of them. */
static const drape_scene_object material = {.name = "material",
                                            SETTINGS(drape_cloth_def, material, material_count)};

/* ---- Mesh ---- */

static const drape_scene_key transform_keys[] = {
    {"translate", DRAPE_SCENE_VECTOR, IN(drape_mesh_def, translate), .unit = "m",
     .help = "applied last; default 0"},
    {"rotate", DRAPE_SCENE_ROTATION, IN(drape_mesh_def, rotate), .unit = "degrees",
     .help = "axis and angle, or a vector along the axis as long as the angle; default none"},
    {"scale", DRAPE_SCENE_SCALE, IN(drape_mesh_def, scale), .help = "applied first; default 1"},
};
static const drape_scene_object transform = {.name = "transform", KEYS(transform_keys)};

static const drape_scene_key mesh_keys[] = {
    {"grid", DRAPE_SCENE_WORD, IN(drape_mesh_def, grid.type),
     .help = "a row of the grids; its parameters stand beside it"},
    {"file", DRAPE_SCENE_WORD, IN(drape_mesh_def, file), .help = "an OBJ or PLY file, relative to the scene"},
    {"transform", DRAPE_SCENE_OBJECT, .child = &transform,
     .help = "scale, rotation, translation; default none"},
};
static const char *const mesh_sources[] = {"grid", "file", NULL};
static const drape_scene_object mesh = {.name = "mesh",
                                        KEYS(mesh_keys),
                                        .one_of = mesh_sources,
                                        SETTINGS(drape_mesh_def, grid.settings, grid.setting_count),
                                        .open_with = "grid"};

/* ---- Cloth ---- */

static const drape_scene_key cloth_keys[] = {
    {"name", DRAPE_SCENE_WORD, IN(drape_cloth_def, name),
     .help = "its own; default \"cloth0\", \"cloth1\" ..."},
    {"mesh", DRAPE_SCENE_OBJECT, .required = true, IN(drape_cloth_def, mesh), .child = &mesh,
     .help = "a grid or a file"},
    {"material", DRAPE_SCENE_OBJECT, .child = &material, .help = "parameters of the material"},
    {"terms", DRAPE_SCENE_ROWS, ARRAY(drape_cloth_def, terms, term_count), .child = &term,
     .help = "the energies and dampings that are modelled; default none"},
    {"pins", DRAPE_SCENE_OBJECTS, ARRAY(drape_cloth_def, pins, pin_count), .child = &pin,
     .help = "nodes held fixed or moved; default none"},
    {"velocity", DRAPE_SCENE_VECTOR, IN(drape_cloth_def, velocity), .unit = "m/s",
     .help = "of every node at t = 0; default 0"},
};

static void init_cloth(void *def)
{
    drape_cloth_def_init(def, sizeof(drape_cloth_def));
}

static const drape_scene_object cloth = {
    .name = "cloth", KEYS(cloth_keys), .def_size = sizeof(drape_cloth_def), .init = init_cloth};

/* ---- Colliders and contact ---- */

static const drape_scene_key collider_keys[] = {
    {"type", DRAPE_SCENE_WORD, .required = true, IN(drape_collider_def, row.type),
     .help = "a row of the colliders; its parameters stand beside it"},
    {"name", DRAPE_SCENE_WORD, IN(drape_collider_def, name),
     .help = "its own; default \"collider0\", \"collider1\" ..."},
    {"friction", DRAPE_SCENE_NUMBER, IN(drape_collider_def, friction), .max = 1e3, .closed = true,
     .help = "Coulomb's mu between it and cloth; default 0"},
    {"track", DRAPE_SCENE_TRACK, ARRAY(drape_collider_def, track, key_count), .at_least = 1,
     .unit = "s and m",
     .help =
         "displacement from where its parameters put it, linear between the times; default none: it rests"},
};

static void init_collider(void *def)
{
    drape_collider_def_init(def, sizeof(drape_collider_def));
}

static const drape_scene_object collider = {
    .name = "collider",
    KEYS(collider_keys),
    SETTINGS(drape_collider_def, row.settings, row.setting_count),
    .def_size = sizeof(drape_collider_def),
    .init = init_collider,
};

/* Their members are settings all of them, as those of a material. */
static const drape_scene_object self_contact = {.name = "self_contact",
                                                SETTINGS(drape_scene_def, self_contact, self_contact_count)};
static const drape_scene_object contact = {.name = "contact",
                                           SETTINGS(drape_scene_def, contact, contact_count)};

/* ---- Scene ---- */

static const drape_scene_key output_keys[] = {
    {"formats", DRAPE_SCENE_WORDS, ARRAY(drape_scene_def, formats, format_count),
     .help = "rows of the exporters; default npy"},
    {"up", DRAPE_SCENE_WORD, IN(drape_scene_def, up), .words = drape_up_axes,
     .help = "the axis that points up in frames: \"z\" turns them, (x, y, z) to (x, -z, y); default \"y\"; "
             "npy and "
             "glb have y up always"},
};
static const drape_scene_object output = {.name = "output", KEYS(output_keys)};

static const drape_scene_key scene_keys[] = {
    {"drape", DRAPE_SCENE_VERSION, .required = true, .help = "the version of this form of scenes"},
    {"description", DRAPE_SCENE_TEXT, .help = "a remark"},
    {"cloth", DRAPE_SCENE_OBJECTS, .required = true, ARRAY(drape_scene_def, cloths, cloth_count),
     .at_least = 1, .child = &cloth, .help = "the pieces of cloth"},
    {"gravity", DRAPE_SCENE_VECTOR, IN(drape_scene_def, gravity), .unit = "m/s2",
     .help = "default [0, -9.81, 0]"},
    {"colliders", DRAPE_SCENE_OBJECTS, ARRAY(drape_scene_def, colliders, collider_count), .child = &collider,
     .help = "rigid obstacles; default none"},
    {"self_contact", DRAPE_SCENE_OBJECT, .optional = true, .child = &self_contact,
     .help = "cloth against cloth; default none: it goes through itself"},
    {"contact", DRAPE_SCENE_OBJECT, .child = &contact,
     .help = "how contact with colliders and between layers acts"},
    {"integrator", DRAPE_SCENE_OBJECT, IN(drape_scene_def, integrator), .child = &integrator,
     .help = "method and its settings"},
    {"controller", DRAPE_SCENE_OBJECT, IN(drape_scene_def, controller), .child = &controller,
     .help = "step controller and its settings"},
    {"duration", DRAPE_SCENE_NUMBER, .required = true, IN(drape_scene_def, duration), .max = 1e9, .unit = "s",
     .help = "the simulated time"},
    {"frame_rate", DRAPE_SCENE_NUMBER, IN(drape_scene_def, frame_rate), .max = 1e6, .unit = "1/s",
     .help = "frames a second; default 60"},
    {"output", DRAPE_SCENE_OBJECT, .child = &output, .help = "what a run writes"},
};

const drape_scene_object drape_scene_form = {.name = "scene", KEYS(scene_keys)};
