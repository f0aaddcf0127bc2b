/* scene.h: the text of a scene as defs, and the keys that a scene may have.
 *
 * A key is a parameter together with the place in a def where its value is stored. The tables in scene_keys.c
 * drive the reader (scene_json.c), the defaults of defs, the checks of defs from hosts, and every description
 * of scenes: `drape list`, the schema, `drape info`. A new key is one entry there. */
#ifndef DRAPE_MODEL_SCENE_H
#define DRAPE_MODEL_SCENE_H

#include "base/param.h"

/* ---- The scene object -------------------------------------------------------------------------------- */

/* Returns the defs of a scene, which are valid until the scene changes or is destroyed. Messages of faults
 * name the place. Errors: DRAPE_E_ARGUMENT, DRAPE_E_VERSION, DRAPE_E_MEMORY. */
drape_status drape_scene_to_def(drape_scene *scene, drape_scene_def *def);

/* Puts the place of the context's last fault before its message: "scene.json:6:26: /cloth/0/pins/1: text"
 * with line and column of the key (for an array element, of the value), or of the nearest ancestor that is in
 * the text; "scene.json: set /integrator/dt=-1: /integrator/dt: text" if drape_scene_set gave the value;
 * "scene.json: text" for a fault without a pointer. Repeating it changes nothing. */
void drape_scene_locate_fault(drape_scene *scene);

/* Whether a value is given at a JSON pointer, by the text or by drape_scene_set. A scene in another format
 * must have been compiled. */
bool drape_scene_gives(const drape_scene *scene, const char *pointer);

drape_context *drape_scene_context(drape_scene *scene);

/* Receives a piece of a text. */
typedef void drape_text_sink(void *user, const char *text, size_t size);

/* Prints the scene with all values that were set, as JSON without comments. A scene in another format is
 * printed in ours once drape_scene_to_def or a compilation has succeeded. */
void drape_scene_print(drape_scene *scene, drape_text_sink *sink, void *user);

/* ---- The format of a scene ---------------------------------------------------------------------------- */

/* The JSON form of a key's value. */
typedef enum drape_scene_shape {
    DRAPE_SCENE_VALUE,      /* a value of the parameter */
    DRAPE_SCENE_LIST,       /* an array of such values, numbers, integers or texts */
    DRAPE_SCENE_VERSION,    /* the number DRAPE_SCENE_FORM; not stored in the def */
    DRAPE_SCENE_REMARK,     /* a string for people; not stored in the def */
    DRAPE_SCENE_BOX,        /* two corners of a box, and at count_offset whether it is given */
    DRAPE_SCENE_TRACK,      /* an array of [time, [x, y, z]], times increasing */
    DRAPE_SCENE_QUATERNION, /* four numbers, [w, x, y, z] */
    DRAPE_SCENE_OBJECT,     /* a child object */
    DRAPE_SCENE_OBJECTS,    /* an array of child objects */
    DRAPE_SCENE_ENTRIES     /* an array of child objects, or of names as a short form for objects with only a
                            "type" */
} drape_scene_shape;

#define DRAPE_SCENE_FORM 1 /* of "drape": 1 */

/*
 * In a def, a number is a double; an integer is an int32_t (-1: not given, if there is no default); a boolean
 * is a bool; a choice or a text is a const char * (NULL: not given); a vector is a double[3]; a rotation is a
 * double[4], axis and angle [degrees].
 */
typedef struct drape_scene_key {
    drape_param param; /* without kind and range if the shape has no values */
    drape_scene_shape shape;
    bool literal;                           /* TEXT: param.derived is itself the default */
    bool or_number;                         /* TEXT: a number is taken for its text */
    bool optional;                          /* OBJECT: may be omitted although it contains a required key */
    const double *vector;                   /* VECTOR: the default, if its three numbers differ */
    size_t offset;                          /* offset in the def of its object */
    size_t count_offset;                    /* arrays: offset of their size_t count */
    size_t at_least;                        /* minimum number of array elements in a text */
    size_t at_most;                         /* maximum number of array elements; 0: no limit */
    const struct drape_scene_object *child; /* OBJECT, OBJECTS, ENTRIES */
} drape_scene_key;

#define DRAPE_MAX_CLOTHS    (1 << 20)
#define DRAPE_MAX_COLLIDERS 4096
#define DRAPE_MAX_EVENTS    256
#define DRAPE_MAX_SEAMS     4096
#define DRAPE_MAX_HISTORIES 4096

typedef struct drape_scene_object {
    const char *name;
    const drape_scene_key *keys;
    size_t key_count;
    const char *const *one_of; /* NULL-terminated: exactly one of these keys must be given; NULL: no such
                                  rule */
    bool open;                 /* other members are settings, which the compiler checks */
    const char *open_with;     /* open only if this key is given; NULL: always */
    size_t settings_offset, settings_count_offset; /* open: offsets in the def */
    size_t def_size;                               /* size of the def; 0: the values are stored in the
                                                      parent's def */
    size_t least_size; /* the shortest def of an older host; 0: the def does not begin with its size */
} drape_scene_object;

/* The top-level object and some of its descendants. */
extern const drape_scene_object drape_form_scene, drape_form_output, drape_form_cloth, drape_form_mesh,
    drape_form_transform, drape_form_pin, drape_form_mass, drape_form_periodic, drape_form_selection,
    drape_form_turn, drape_form_collider, drape_form_event, drape_form_seam, drape_form_seam_side,
    drape_form_history;

/* Returns the key of an object by its name; NULL if there is none. */
const drape_scene_key *drape_scene_key_of(const drape_scene_object *object, const char *name);

/* Returns the key whose value a JSON pointer leads to or into; NULL if there is none. */
const drape_scene_key *drape_scene_key_at(const char *pointer);

/* Reads the value of a key as a setting, which points into the def. Returns false if none is given. */
bool drape_scene_value(const drape_scene_key *key, const void *def, drape_setting *out);

/* Reads the texts of a LIST. Returns their number; 0 if it has numbers. */
size_t drape_scene_texts(const drape_scene_key *key, const void *def, const char *const **texts);

/* Stores a value that has been checked against the parameter in the def: given as a setting, and as the
 * numbers that drape_param_value made of it. */
void drape_scene_store(const drape_scene_key *key, const drape_setting *setting, const double *values,
                       void *def);

/* Sets all defaults in the def of an object, including children embedded in it; def must start as zeros. */
void drape_scene_set_defaults(const drape_scene_object *object, void *def);

/* Describes what a key accepts: "a number in (0, 1e6] s", "an array of objects, at least one". The macro
 * makes the text in place, valid until the end of the block. */
const char *drape_scene_takes_text(const drape_scene_key *key, char *text, size_t size);
#define DRAPE_KEY_TAKES(key) drape_scene_takes_text(key, (char[DRAPE_RANGE_SIZE]){0}, DRAPE_RANGE_SIZE)

/* Names the keys of which one must be given: "exactly one of grid, file"; "" without such a rule. */
const char *drape_scene_one_of_text(const drape_scene_object *object, char *text, size_t size);

/* Writes the default as text: "60", "required"; "" if there is nothing to say. */
void drape_scene_default_text(const drape_scene_key *key, char *text, size_t size);

#endif
