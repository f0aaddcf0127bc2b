/* scene_keys.c: the keys of a scene, one entry each. */
#include "model/scene.h"

#include <math.h>

#define KEYS(array) .keys = array, .key_count = sizeof array / sizeof *array

/* The place of a value: a member of the def, or an array and its count. */
#define IN(def, member)           .offset = offsetof(def, member)
#define ARRAY(def, member, count) .offset = offsetof(def, member), .count_offset = offsetof(def, count)
#define BOX(def)                  .offset = offsetof(def, box_min), .count_offset = offsetof(def, has_box)
#define SETTINGS(def, member, count)                                                                         \
    .open = true, .settings_offset = offsetof(def, member), .settings_count_offset = offsetof(def, count)

/* In place of a default: there is none unless it is given. */
#define NONE DRAPE_DERIVED("none")
/* The same without a description: one of several keys is given, or an object has defaults inside. */
#define UNSAID DRAPE_DERIVED("")

/* A key without a value of its own; a key whose value is a text with a default. */
#define SHAPED(shape_, name_, default_, help_)                                                               \
    .param = {.name = name_, .unit = "1", .default_value = default_, .help = help_}, .shape = shape_
#define TEXT_OR(name, text, help) DRAPE_TEXT(name, help, .derived = text), .literal = true

/* In place of bounds: no bound. */
#define LOWEST  DRAPE_ABOVE(-INFINITY)
#define HIGHEST DRAPE_BELOW(INFINITY)

static const char *const corners[] = {"top-left", "top-right", "bottom-left", "bottom-right", NULL};
static const char *const edges[] = {"top", "bottom", "left", "right", NULL};
static const char *const up_axes[] = {"y", "z", NULL};

/* ---- Nodes ---- */

/* The nodes that pins, masses, edges and seams have. */
#define SELECTION_KEYS(def)                                                                                  \
    {DRAPE_INTEGER("nodes", "1", UNSAID, 0, INT32_MAX,                                                       \
                   "node numbers of the cloth; of a seam, in its order"),                                    \
     .shape = DRAPE_SCENE_LIST, ARRAY(def, nodes, node_count), .at_least = 1},                               \
        {DRAPE_CHOICE("corner", UNSAID, corners, "a corner of a grid; top is row 0, left is column 0"),      \
         IN(def, corner)},                                                                                   \
        {DRAPE_CHOICE("edge", UNSAID, edges,                                                                 \
                      "a side of a grid, by ascending column or row; top is row 0, left is column 0"),       \
         IN(def, edge)},                                                                                     \
        {DRAPE_INTEGER("row", "1", UNSAID, 0, INT32_MAX, "a row of a grid, from 0, by ascending column"),    \
         IN(def, row)},                                                                                      \
    {                                                                                                        \
        DRAPE_VECTOR("box", "m", UNSAID, LOWEST, HIGHEST,                                                    \
                     "nodes inside a box of rest coordinates after the transform, boundary included; of a "  \
                     "seam, sorted along the longest side of their bounding box"),                           \
            .shape = DRAPE_SCENE_BOX, BOX(def)                                                               \
    }
static const char *const selectors[] = {"nodes", "corner", "edge", "row", "box", NULL};

/* The keys of motions, which pins and colliders have, and the key of names. */
#define MOTION_KEYS(def)                                                                                     \
    {DRAPE_VECTOR("track", "s and m", NONE, LOWEST, HIGHEST,                                                 \
                  "displacement from the position at the start, or that its parameters define, linear "      \
                  "between the times"),                                                                      \
     .shape = DRAPE_SCENE_TRACK, ARRAY(def, track, key_count), .at_least = 1},                               \
    {                                                                                                        \
        SHAPED(                                                                                              \
            DRAPE_SCENE_OBJECTS, "turns", NONE,                                                              \
            "rotation about the pivot, steady between the times; of pins, as one body, together with the "   \
            "direction that they clamp"),                                                                    \
            ARRAY(def, turns, turn_count), .at_least = 1, .child = &drape_form_turn                          \
    }
#define PIVOT_KEY(def)                                                                                       \
    {                                                                                                        \
        DRAPE_VECTOR("pivot", "m",                                                                           \
                     DRAPE_DERIVED(                                                                          \
                         "the mean of the nodes, the centre of mass of a cloth that spins, the middle of a " \
                         "collider, or the origin"),                                                         \
                     -1e9, 1e9, "the point about which it turns, at the start; the track displaces it"),     \
            IN(def, pivot)                                                                                   \
    }
#define NAME_KEY(def)                                                                                        \
    {                                                                                                        \
        DRAPE_TEXT("name", "unique name, of pins among those of their cloth; of an event without ; and @",   \
                   .derived = "what it is and its number, such as \"cloth0\""),                              \
            IN(def, name)                                                                                    \
    }

/* ---- Pins ---- */

static const drape_scene_key pin_keys[] = {
    NAME_KEY(drape_pin_def),
    SELECTION_KEYS(drape_pin_def),
    MOTION_KEYS(drape_pin_def),
    {DRAPE_TEXT("attach", "name of the collider that carries the nodes, which ride on it from where they are",
                .derived = "none"),
     IN(drape_pin_def, attach)},
    {DRAPE_INTEGER("triangle", "1", DRAPE_DERIVED("the nearest one of each node"), 0, INT32_MAX,
                   "the triangle that carries the nodes, of a collider that deforms, from 0"),
     IN(drape_pin_def, triangle)},
    {DRAPE_BOOLEAN("clamp", false,
                   "edges between these nodes keep the direction of the sheet across them, or turn it with "
                   "`turns`; for bend.midedge"),
     IN(drape_pin_def, clamp)},
    {DRAPE_VECTOR("normal", "1", DRAPE_DERIVED("none: held in all directions"), LOWEST, HIGHEST,
                  "the only direction in which the nodes are held: each stays in the plane across it, as on "
                  "rollers or in a symmetry plane"),
     IN(drape_pin_def, normal)},
    {DRAPE_VECTOR("axis", "1", DRAPE_DERIVED("none: held in all directions"), LOWEST, HIGHEST,
                  "the only direction in which the nodes are free: each stays on a line, as on a rail"),
     IN(drape_pin_def, axis)},
    PIVOT_KEY(drape_pin_def),
};

const drape_scene_object drape_form_pin = {.name = "pin",
                                           KEYS(pin_keys),
                                           .one_of = selectors,
                                           .def_size = sizeof(drape_pin_def),
                                           .least_size = offsetof(drape_pin_def, clamp)};

/* ---- Masses ---- */

static const drape_scene_key mass_keys[] = {
    SELECTION_KEYS(drape_mass_def),
    {DRAPE_NUMBER("add", "kg", DRAPE_DERIVED("none; exactly one of add and mass is given"), DRAPE_ABOVE(0),
                  1e12, "added to the mass of each of these nodes"),
     IN(drape_mass_def, add)},
    {DRAPE_NUMBER("mass", "kg", DRAPE_DERIVED("none; exactly one of add and mass is given"), DRAPE_ABOVE(0),
                  1e12, "of each of these nodes, in place of its mass so far"),
     IN(drape_mass_def, mass)},
};

const drape_scene_object drape_form_mass = {.name = "mass",
                                            KEYS(mass_keys),
                                            .one_of = selectors,
                                            .def_size = sizeof(drape_mass_def),
                                            .least_size = sizeof(drape_mass_def)};

static const drape_scene_key selection_keys[] = {
    SELECTION_KEYS(drape_selection_def),
};

const drape_scene_object drape_form_selection = {
    .name = "selection", KEYS(selection_keys), .one_of = selectors, .def_size = sizeof(drape_selection_def)};

static const drape_scene_key periodic_keys[] = {
    {SHAPED(DRAPE_SCENE_OBJECT, "from", DRAPE_REQUIRED, "the nodes of one edge"),
     IN(drape_periodic_def, from), .child = &drape_form_selection},
    {SHAPED(DRAPE_SCENE_OBJECT, "to", DRAPE_REQUIRED, "those of the other, displaced at rest by one vector"),
     IN(drape_periodic_def, to), .child = &drape_form_selection},
    {DRAPE_VECTOR("period", "m", DRAPE_DERIVED("the displacement at the start"), -1e9, 1e9,
                  "from each node of `from` to that of `to`; the cloth starts stretched evenly to it"),
     IN(drape_periodic_def, period)},
};

const drape_scene_object drape_form_periodic = {.name = "periodic",
                                                KEYS(periodic_keys),
                                                .def_size = sizeof(drape_periodic_def),
                                                .least_size = sizeof(drape_periodic_def)};

/* ---- Objects with settings ---- */

static const drape_scene_key term_keys[] = {
    {DRAPE_TEXT("type", "name of a term"), IN(drape_entry_def, type)},
};
static const drape_scene_object term = {.name = "term",
                                        KEYS(term_keys),
                                        SETTINGS(drape_entry_def, settings, setting_count),
                                        .def_size = sizeof(drape_entry_def)};

static const drape_scene_key integrator_keys[] = {
    {DRAPE_TEXT("method", "name of a time integrator",
                .derived = "\"be\"; in a scene without \"integrator\" bdf2 or, with contact, newton_k"),
     IN(drape_entry_def, type)},
};
static const drape_scene_object integrator = {
    .name = "integrator", KEYS(integrator_keys), SETTINGS(drape_entry_def, settings, setting_count)};

static const drape_scene_key controller_keys[] = {
    {TEXT_OR("type", "halving", "name of a step controller"), IN(drape_entry_def, type)},
};
static const drape_scene_object controller = {
    .name = "controller", KEYS(controller_keys), SETTINGS(drape_entry_def, settings, setting_count)};

/* All members of a material are settings. */
static const drape_scene_object material = {.name = "material",
                                            SETTINGS(drape_cloth_def, material, material_count)};

/* ---- Mesh ---- */

/* Of a mesh and of a start. */
#define TRANSFORM_KEYS(def)                                                                                  \
    {DRAPE_VECTOR("translate", "m", 0, LOWEST, HIGHEST, "applied last"), IN(def, translate)},                \
        {DRAPE_TURN("rotate", 0, LOWEST, HIGHEST,                                                            \
                    "axis and angle, or a vector along the axis whose length is the angle"),                 \
         IN(def, rotate)},                                                                                   \
    {                                                                                                        \
        DRAPE_VECTOR("scale", "1", 1, DRAPE_ABOVE(0), HIGHEST, "applied first", .uniform = true),            \
            IN(def, scale)                                                                                   \
    }

static const drape_scene_key transform_keys[] = {TRANSFORM_KEYS(drape_mesh_def)};
const drape_scene_object drape_form_transform = {.name = "transform", KEYS(transform_keys)};

/* Of a mesh at some offset in a def. */
#define MESH_KEYS(at)                                                                                        \
    {DRAPE_TEXT("grid", "name of a grid; its parameters are keys beside it", .derived = ""),                 \
     .offset = (at) + offsetof(drape_mesh_def, grid.type)},                                                  \
        {DRAPE_TEXT("file", "an OBJ or PLY file, relative to the scene", .derived = ""),                     \
         .offset = (at) + offsetof(drape_mesh_def, file)},                                                   \
    {                                                                                                        \
        SHAPED(DRAPE_SCENE_OBJECT, "transform", NONE,                                                        \
               "scale, rotation, translation; of a start, after its folds"),                                 \
            .offset = (at), .child = &drape_form_transform                                                   \
    }

static const drape_scene_key mesh_keys[] = {
    MESH_KEYS(0),
    {DRAPE_INTEGER("subdivide", "1", 0, 0, 12,
                   "each triangle in four, so many times; nodes keep their numbers, and nodes between "
                   "those of one pin are pinned"),
     IN(drape_mesh_def, subdivide)}};
static const char *const mesh_sources[] = {"grid", "file", NULL};
const drape_scene_object drape_form_mesh = {.name = "mesh",
                                            KEYS(mesh_keys),
                                            .one_of = mesh_sources,
                                            SETTINGS(drape_mesh_def, grid.settings, grid.setting_count),
                                            .open_with = "grid",
                                            .def_size = sizeof(drape_mesh_def)};

static const drape_scene_key render_mesh_keys[] = {
    MESH_KEYS(offsetof(drape_render_mesh_def, mesh)),
    {DRAPE_NUMBER("max_distance", "m", DRAPE_DERIVED("the mean edge length of the simulated mesh"),
                  DRAPE_ABOVE(0), 1e9, "of a vertex from the simulated mesh at rest"),
     IN(drape_render_mesh_def, max_distance)},
};
static const drape_scene_object render_mesh = {
    .name = "render_mesh",
    KEYS(render_mesh_keys),
    .one_of = mesh_sources,
    SETTINGS(drape_render_mesh_def, mesh.grid.settings, mesh.grid.setting_count),
    .open_with = "grid",
    .def_size = sizeof(drape_render_mesh_def)};

/* ---- Start ---- */

static const drape_scene_key fold_keys[] = {
    {DRAPE_VECTOR("point", "m", DRAPE_REQUIRED, LOWEST, HIGHEST,
                  "a point on the line about which it is folded"),
     IN(drape_fold_def, point)},
    {DRAPE_VECTOR("axis", "1", DRAPE_REQUIRED, LOWEST, HIGHEST, "direction of the line"),
     IN(drape_fold_def, axis)},
    {DRAPE_VECTOR("side", "1", DRAPE_REQUIRED, LOWEST, HIGHEST,
                  "from the line to the part that is folded over"),
     IN(drape_fold_def, side)},
    {DRAPE_NUMBER("angle", "degrees", 180, -360, 360, "by which that part turns about the axis"),
     IN(drape_fold_def, angle)},
    {DRAPE_NUMBER("radius", "m", 0, 0, 1e6, "of the cylinder that the sheet is bent around; 0: a sharp fold"),
     IN(drape_fold_def, radius)},
};
static const drape_scene_object fold = {.name = "fold", KEYS(fold_keys), .def_size = sizeof(drape_fold_def)};

static const drape_scene_key start_transform_keys[] = {TRANSFORM_KEYS(drape_start_def)};
static const drape_scene_object start_transform = {.name = "transform", KEYS(start_transform_keys)};

static const drape_scene_key start_keys[] = {
    {DRAPE_TEXT("file", "an OBJ or PLY file with the nodes and triangles of the mesh, relative to the scene",
                .derived = "none: the mesh at rest"),
     IN(drape_start_def, file)},
    {SHAPED(DRAPE_SCENE_OBJECTS, "folds", NONE, "lines about which it is folded, in this order"),
     ARRAY(drape_start_def, folds, fold_count), .child = &fold},
    {SHAPED(DRAPE_SCENE_OBJECT, "transform", NONE,
            "scale, rotation, translation; of a start, after its folds"),
     .child = &start_transform},
    {DRAPE_VECTOR("spin", "rad/s", 0, -1e9, 1e9, "angular velocity"), IN(drape_start_def, spin)},
    PIVOT_KEY(drape_start_def),
    {DRAPE_TEXT("velocities", "an NPY file, nodes x 3, of velocities in m/s; relative to the scene",
                .derived = "none"),
     IN(drape_start_def, velocity_file)},
};
static const drape_scene_object start = {
    .name = "start", KEYS(start_keys), .def_size = sizeof(drape_start_def)};

/* ---- Cloth ---- */

static const drape_scene_key cloth_keys[] = {
    NAME_KEY(drape_cloth_def),
    {SHAPED(DRAPE_SCENE_OBJECT, "mesh", DRAPE_REQUIRED, "a grid or a file"), IN(drape_cloth_def, mesh),
     .child = &drape_form_mesh},
    {SHAPED(DRAPE_SCENE_OBJECT, "material", UNSAID, "parameters of the material"), .child = &material},
    {SHAPED(DRAPE_SCENE_ENTRIES, "terms", NONE, "energies, dampings and loads; only those listed act"),
     ARRAY(drape_cloth_def, terms, term_count), .child = &term},
    {SHAPED(DRAPE_SCENE_OBJECTS, "pins", NONE, "nodes held fixed or moved"),
     ARRAY(drape_cloth_def, pins, pin_count), .child = &drape_form_pin},
    {DRAPE_VECTOR("velocity", "m/s", 0, -1e9, 1e9, "initial velocity of every node"),
     IN(drape_cloth_def, velocity)},
    {SHAPED(DRAPE_SCENE_OBJECT, "start", DRAPE_DERIVED("the mesh at rest"),
            "another shape than at rest in which it starts, and initial velocities"),
     IN(drape_cloth_def, start), .child = &start},
    {DRAPE_TEXT("ignore", "names of colliders and cloths that it passes through; its own name: itself",
                .derived = "none"),
     .shape = DRAPE_SCENE_LIST, ARRAY(drape_cloth_def, ignore, ignore_count)},
    {SHAPED(DRAPE_SCENE_OBJECTS, "masses", DRAPE_DERIVED("none: those of the material"),
            "nodes with masses of their own, applied in this order"),
     ARRAY(drape_cloth_def, masses, mass_count), .child = &drape_form_mass},
    {SHAPED(DRAPE_SCENE_OBJECT, "render_mesh", DRAPE_DERIVED("none: frames show the simulated mesh"),
            "another mesh that frames show in its place, whose vertices follow it"),
     .optional = true, IN(drape_cloth_def, render_mesh), .child = &render_mesh},
    {SHAPED(DRAPE_SCENE_OBJECTS, "periodic", DRAPE_DERIVED("none"),
            "pairs of edges that are the same edge but for a translation"),
     ARRAY(drape_cloth_def, periodic, periodic_count), .child = &drape_form_periodic},
};

const drape_scene_object drape_form_cloth = {.name = "cloth",
                                             KEYS(cloth_keys),
                                             .def_size = sizeof(drape_cloth_def),
                                             .least_size = offsetof(drape_cloth_def, velocity)};

/* ---- Colliders and contact ---- */

static const drape_scene_key turn_keys[] = {
    {DRAPE_NUMBER("time", "s", DRAPE_REQUIRED, LOWEST, HIGHEST, "greater than that of the key before"),
     IN(drape_turn_key, time)},
    {DRAPE_TURN("rotate", 0, LOWEST, HIGHEST,
                "axis and angle of any size, or a vector along the axis whose length is the angle"),
     IN(drape_turn_key, rotate)},
    {SHAPED(DRAPE_SCENE_QUATERNION, "quaternion", UNSAID, "the rotation as a quaternion"),
     IN(drape_turn_key, quaternion)},
};
static const char *const turn_forms[] = {"rotate", "quaternion", NULL};
const drape_scene_object drape_form_turn = {
    .name = "turn", KEYS(turn_keys), .one_of = turn_forms, .def_size = sizeof(drape_turn_key)};

static const drape_scene_key collider_keys[] = {
    {DRAPE_TEXT("type", "name of a collider; its parameters are keys beside it"),
     IN(drape_collider_def, entry.type)},
    NAME_KEY(drape_collider_def),
    {DRAPE_NUMBER("friction", "1", 0, 0, 1e3, "Coulomb's mu between collider and cloth"),
     IN(drape_collider_def, friction)},
    {DRAPE_NUMBER("restitution", "1", 0, 0, 1,
                  "speed of rebound / speed of impact, of cloth on the collider"),
     IN(drape_collider_def, restitution)},
    MOTION_KEYS(drape_collider_def),
    PIVOT_KEY(drape_collider_def),
    {DRAPE_BOOLEAN("enabled", true, "cloth touches it"), IN(drape_collider_def, enabled)},
};

const drape_scene_object drape_form_collider = {
    .name = "collider",
    KEYS(collider_keys),
    SETTINGS(drape_collider_def, entry.settings, entry.setting_count),
    .def_size = sizeof(drape_collider_def),
    .least_size = offsetof(drape_collider_def, track),
};

/* All members of these are settings. */
static const drape_scene_object self_contact = {.name = "self_contact",
                                                SETTINGS(drape_scene_def, self_contact, self_contact_count)};
static const drape_scene_object contact = {.name = "contact",
                                           SETTINGS(drape_scene_def, contact, contact_count)};
static const drape_scene_object untangle = {.name = "untangle",
                                            SETTINGS(drape_scene_def, untangle, untangle_count)};

/* ---- Events ---- */

static const char *const directions[] = {"both", "up", "down", NULL};
static const char *const actions[] = {"record", "stop", "release", NULL};

static const drape_scene_key event_keys[] = {
    {DRAPE_TEXT("type", "name of an event; its parameters are keys beside it"),
     IN(drape_event_def, entry.type)},
    NAME_KEY(drape_event_def),
    {DRAPE_TEXT("cloth", "name of the cloth that it is about", .derived = "all of them"),
     IN(drape_event_def, cloth)},
    {DRAPE_TEXT("pins", "name of the pins that it measures or releases", .derived = "all pins of the cloth"),
     IN(drape_event_def, pins)},
    {DRAPE_CHOICE("direction", 0, directions,
                  "whether the quantity passes its bound upwards, downwards, or either"),
     IN(drape_event_def, direction)},
    {DRAPE_CHOICE("action", 0, actions,
                  "record: the run goes on; stop: it ends there; release: the pins let their nodes go"),
     IN(drape_event_def, action)},
    {DRAPE_BOOLEAN("once", false, "only the first time counts"), IN(drape_event_def, once)},
};

const drape_scene_object drape_form_event = {
    .name = "event",
    KEYS(event_keys),
    SETTINGS(drape_event_def, entry.settings, entry.setting_count),
    .def_size = sizeof(drape_event_def),
    .least_size = sizeof(drape_event_def),
};

/* ---- Seams ---- */

static const drape_scene_key seam_side_keys[] = {
    {DRAPE_TEXT("cloth", "name of its cloth"), IN(drape_seam_side_def, cloth)},
    SELECTION_KEYS(drape_seam_side_def),
    {DRAPE_BOOLEAN("reverse", false, "in the reverse order"), IN(drape_seam_side_def, reverse)},
};
const drape_scene_object drape_form_seam_side = {
    .name = "seam_side", KEYS(seam_side_keys), .one_of = selectors, .def_size = sizeof(drape_seam_side_def)};

static const drape_scene_key seam_keys[] = {
    {DRAPE_TEXT("type", "name of a seam; its parameters are keys beside it"), IN(drape_seam_def, entry.type)},
    NAME_KEY(drape_seam_def),
    {SHAPED(DRAPE_SCENE_OBJECT, "a", DRAPE_REQUIRED, "the nodes of one side"), IN(drape_seam_def, a),
     .child = &drape_form_seam_side},
    {SHAPED(DRAPE_SCENE_OBJECT, "b", DRAPE_REQUIRED, "as many nodes of the other, in the same order"),
     IN(drape_seam_def, b), .child = &drape_form_seam_side},
};

const drape_scene_object drape_form_seam = {
    .name = "seam",
    KEYS(seam_keys),
    SETTINGS(drape_seam_def, entry.settings, entry.setting_count),
    .def_size = sizeof(drape_seam_def),
    .least_size = sizeof(drape_seam_def),
};

/* ---- Histories ---- */

static const char *const interpolations[] = {"linear", "cubic", NULL};

static const drape_scene_key history_keys[] = {
    {DRAPE_TEXT("name", "unique name, which loads give as their history"), IN(drape_history_def, name)},
    {DRAPE_NUMBER("times", "s", DRAPE_REQUIRED, -1e9, 1e9, "increasing"), .shape = DRAPE_SCENE_LIST,
     ARRAY(drape_history_def, times, time_count), .at_least = 1},
    {DRAPE_NUMBER("values", "1", DRAPE_REQUIRED, -1e9, 1e9,
                  "the factors of a load at these times; before the first and after the last it is constant"),
     .shape = DRAPE_SCENE_LIST, ARRAY(drape_history_def, values, value_count), .at_least = 1},
    {DRAPE_CHOICE("interpolation", 0, interpolations,
                  "between them; cubic: with a continuous slope, 0 at the ends, and beyond no value"),
     IN(drape_history_def, interpolation)},
};

const drape_scene_object drape_form_history = {.name = "history",
                                               KEYS(history_keys),
                                               .def_size = sizeof(drape_history_def),
                                               .least_size = sizeof(drape_history_def)};

/* ---- Scene ---- */

static const drape_scene_key output_keys[] = {
    {TEXT_OR("formats", "npy", "names of frame formats"), .shape = DRAPE_SCENE_LIST,
     ARRAY(drape_scene_def, formats, format_count)},
    {DRAPE_CHOICE(
         "up", 0, up_axes,
         "axis that points up in frames: \"z\" maps (x, y, z) to (x, -z, y); npy and glb always have y up"),
     IN(drape_scene_def, up)},
};
const drape_scene_object drape_form_output = {.name = "output", KEYS(output_keys)};

static const double earth[3] = {0, -9.81, 0};

static const drape_scene_key scene_keys[] = {
    {SHAPED(DRAPE_SCENE_VERSION, "drape", DRAPE_REQUIRED, "version of the scene format")},
    {SHAPED(DRAPE_SCENE_REMARK, "description", UNSAID, "a remark")},
    {SHAPED(DRAPE_SCENE_OBJECTS, "cloth", DRAPE_REQUIRED, "the pieces of cloth"),
     ARRAY(drape_scene_def, cloths, cloth_count), .at_least = 1, .at_most = DRAPE_MAX_CLOTHS,
     .child = &drape_form_cloth},
    {DRAPE_VECTOR("gravity", "m/s2", 0, -1e9, 1e9, "acceleration of free fall"), .vector = earth,
     IN(drape_scene_def, gravity)},
    {SHAPED(DRAPE_SCENE_OBJECTS, "colliders", NONE, "rigid obstacles"),
     ARRAY(drape_scene_def, colliders, collider_count), .at_most = DRAPE_MAX_COLLIDERS,
     .child = &drape_form_collider},
    {SHAPED(DRAPE_SCENE_OBJECT, "self_contact", DRAPE_DERIVED("none: cloth passes through itself"),
            "cloth against cloth"),
     .optional = true, .child = &self_contact},
    {SHAPED(DRAPE_SCENE_OBJECT, "contact", UNSAID, "settings of contact with colliders and between layers"),
     .child = &contact},
    {SHAPED(DRAPE_SCENE_OBJECT, "untangle", DRAPE_DERIVED("none: what begins through each other stays so"),
            "cloth that begins through cloth or colliders is taken apart before the first step"),
     .optional = true, .child = &untangle},
    {DRAPE_TEXT("accuracy",
                "largest distance to the motion of the model, RMS over the nodes of a cloth: a length, "
                "\"1mm\", or a "
                "share of its diagonal, \"1e-2\"; the method is chosen, and the run repeated until it holds",
                .derived = "none: one run, by the integrator"),
     IN(drape_scene_def, accuracy), .or_number = true},
    {SHAPED(DRAPE_SCENE_OBJECT, "integrator", UNSAID, "method and its settings"),
     IN(drape_scene_def, integrator), .child = &integrator},
    {SHAPED(DRAPE_SCENE_OBJECT, "controller", UNSAID, "step controller and its settings"),
     IN(drape_scene_def, controller), .child = &controller},
    {DRAPE_NUMBER("duration", "s", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, "simulated time"),
     IN(drape_scene_def, duration)},
    {DRAPE_NUMBER("frame_rate", "1/s", 60, DRAPE_ABOVE(0), 1e6, "frames per second of simulated time"),
     IN(drape_scene_def, frame_rate)},
    {SHAPED(DRAPE_SCENE_OBJECT, "output", UNSAID, "what a run writes"), .child = &drape_form_output},
    {SHAPED(DRAPE_SCENE_OBJECTS, "events", NONE, "what is looked out for during the run"),
     ARRAY(drape_scene_def, events, event_count), .at_most = DRAPE_MAX_EVENTS, .child = &drape_form_event},
    {SHAPED(DRAPE_SCENE_OBJECTS, "seams", NONE, "nodes that are sewn together, of two cloths or one"),
     ARRAY(drape_scene_def, seams, seam_count), .at_most = DRAPE_MAX_SEAMS, .child = &drape_form_seam},
    {SHAPED(DRAPE_SCENE_OBJECTS, "histories", NONE, "factors over time, by which loads are multiplied"),
     ARRAY(drape_scene_def, histories, history_count), .at_most = DRAPE_MAX_HISTORIES,
     .child = &drape_form_history},
    {DRAPE_TEXT("gravity_history", "name of the history by which gravity is multiplied",
                .derived = "none: gravity is constant"),
     IN(drape_scene_def, gravity_history)},
};

const drape_scene_object drape_form_scene = {.name = "scene",
                                             KEYS(scene_keys),
                                             .def_size = sizeof(drape_scene_def),
                                             .least_size = offsetof(drape_scene_def, formats)};
