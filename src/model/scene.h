/* scene.h: the text of a scene as defs, and the keys that a scene may have.
 *
 * A key is a parameter and the place in a def where its value goes. The tables of scene_keys.c drive the
 * reader (scene_json.c), the defaults of the defs, the checks of a host's defs, and all that describes a
 * scene: `drape list`, the schema, `drape info`. A new key is one entry there. */
#ifndef DRAPE_MODEL_SCENE_H
#define DRAPE_MODEL_SCENE_H

#include "base/param.h"

/* ---- The scene object -------------------------------------------------------------------------------- */

/* The defs of a scene: valid until the scene changes or is destroyed. Faults are located. Errors:
 * DRAPE_E_ARGUMENT, DRAPE_E_VERSION, DRAPE_E_MEMORY. */
drape_status drape_scene_to_def(drape_scene *scene, drape_scene_def *def);

/* Puts the place of the context's last fault before its message: "scene.json:6:26: /cloth/0/pins/1: text"
 * with line and column of the key (of the value in an array), or of the nearest ancestor if the text does not
 * have it;
 * "--set /integrator/dt=-1: /integrator/dt: text" where drape_scene_set gave the value; "scene.json: text"
 * for a fault without a pointer. Doing it again changes nothing. */
void drape_scene_locate_fault(drape_scene *scene);

drape_context *drape_scene_context(drape_scene *scene);

/* Receives a piece of a text. */
typedef void drape_text_sink(void *user, const char *text, size_t size);

/* Prints the scene with all values that were set, as JSON without comments. A scene of another form is
 * printed in ours, once drape_scene_to_def or a compilation succeeded. */
void drape_scene_print(drape_scene *scene, drape_text_sink *sink, void *user);

/* ---- The form of a scene ----------------------------------------------------------------------------- */

/* How the text of a scene writes what a key has. */
typedef enum drape_scene_shape {
    DRAPE_SCENE_VALUE,   /* a value of the parameter */
    DRAPE_SCENE_LIST,    /* an array of such values, integers or texts */
    DRAPE_SCENE_VERSION, /* the number DRAPE_SCENE_FORM; not in the def */
    DRAPE_SCENE_REMARK,  /* a string for people; not in the def */
    DRAPE_SCENE_BOX,     /* two corners of the box of a pin */
    DRAPE_SCENE_TRACK,   /* an array of [time, [x, y, z]], times increasing */
    DRAPE_SCENE_OBJECT,  /* a child */
    DRAPE_SCENE_OBJECTS, /* an array of children */
    DRAPE_SCENE_ENTRIES  /* an array of children, or of names for children with a "type" alone */
} drape_scene_shape;

#define DRAPE_SCENE_FORM 1 /* of "drape": 1 */

/*
 * In a def a number is a double, an integer an int32_t (-1: not given, where it has no default), a boolean a
 * bool, a choice or a text a const char * (NULL: not given), a vector double[3], a rotation double[4]: axis
 * and angle [degrees].
 */
typedef struct drape_scene_key {
    drape_param param; /* without a kind and a range where the shape has no values */
    drape_scene_shape shape;
    bool literal;                           /* TEXT: what param.derived says is the default itself */
    bool optional;                          /* OBJECT: may be left out although something in it is required */
    const double *vector;                   /* VECTOR: the default where its three numbers differ */
    size_t offset;                          /* in the def of its object */
    size_t count_offset;                    /* arrays: of their size_t count */
    size_t at_least;                        /* elements of an array in a text */
    size_t at_most;                         /* elements of an array; 0: no limit */
    const struct drape_scene_object *child; /* OBJECT, OBJECTS, ENTRIES */
} drape_scene_key;

#define DRAPE_MAX_CLOTHS    (1 << 20)
#define DRAPE_MAX_COLLIDERS 4096

typedef struct drape_scene_object {
    const char *name;
    const drape_scene_key *keys;
    size_t key_count;
    const char *const *one_of; /* NULL-ended: exactly one of these keys is given; NULL: no such rule */
    bool open;                 /* other members are settings, which the compiler checks */
    const char *open_with;     /* only where this key is given; NULL: always */
    size_t settings_offset, settings_count_offset; /* open: in the def */
    size_t def_size;                               /* of a def of its own; 0: it lies in that of its parent */
    bool sized;                                    /* the def begins with its size */
} drape_scene_object;

/* The object at the top, and some of those below it. */
extern const drape_scene_object drape_form_scene, drape_form_output, drape_form_cloth, drape_form_mesh,
    drape_form_transform, drape_form_pin, drape_form_collider;

/* The key of an object by its name; NULL: it has none of that name. */
const drape_scene_key *drape_scene_key_of(const drape_scene_object *object, const char *name);

/* The key that a JSON pointer leads to, or into the value of; NULL: it leads to no key. */
const drape_scene_key *drape_scene_key_at(const char *pointer);

/* The value of a key as a setting, which points into the def. False: none is given. */
bool drape_scene_value(const drape_scene_key *key, const void *def, drape_setting *out);

/* The texts of a LIST of them, and how many there are. */
size_t drape_scene_texts(const drape_scene_key *key, const void *def, const char *const **texts);

/* Puts a value that is good for the parameter into the def: of a setting, and as drape_param_value made
 * numbers of it. */
void drape_scene_store(const drape_scene_key *key, const drape_setting *setting, const double *values,
                       void *def);

/* Gives the def of an object all defaults, those of children inside it included; def begins as zeros. */
void drape_scene_set_defaults(const drape_scene_object *object, void *def);

/* What a key takes, in words: "a number in (0, 1e6] s", "an array of objects, at least one". */
void drape_scene_takes_text(const drape_scene_key *key, char *text, size_t size);

/* Its value in a def in words, of a list of texts too: "[0, 1, 0]", "npy, glb"; "" where none is given. */
void drape_scene_value_text(const drape_scene_key *key, const void *def, char *text, size_t size);

/* Its default in words: "60", "required", "" where there is nothing to say. */
void drape_scene_default_text(const drape_scene_key *key, char *text, size_t size);

#endif
