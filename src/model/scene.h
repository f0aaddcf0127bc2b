/* scene.h: the text of a scene as defs, and the keys that a scene may have.
 *
 * The keys are tables. They drive the reader (scene_json.c), its "did you mean", and whatever describes the
 * form of a scene. A new key is a line in scene_keys.c. */
#ifndef DRAPE_MODEL_SCENE_H
#define DRAPE_MODEL_SCENE_H

#include "base/context.h"

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

/* The scene as it is by now, what was set in it included, as JSON without comments: the text of a scene of our
 * form also where the scene is of another one, after a drape_scene_to_def or a compilation that was good. */
void drape_scene_print(drape_scene *scene, drape_text_sink *sink, void *user);

/* ---- The form of a scene ----------------------------------------------------------------------------- */

typedef enum drape_scene_kind {
    DRAPE_SCENE_VERSION,  /* the number DRAPE_SCENE_FORM */
    DRAPE_SCENE_TEXT,     /* a string for people */
    DRAPE_SCENE_WORD,     /* a string that is not empty */
    DRAPE_SCENE_WORDS,    /* an array of them */
    DRAPE_SCENE_BOOLEAN,  /* true or false */
    DRAPE_SCENE_NUMBER,   /* from min to max, min excluded unless closed */
    DRAPE_SCENE_INTEGER,  /* from min to max */
    DRAPE_SCENE_INTEGERS, /* an array of them */
    DRAPE_SCENE_VECTOR,   /* [x, y, z] */
    DRAPE_SCENE_SCALE,    /* a number or [x, y, z] */
    DRAPE_SCENE_ROTATION, /* [x, y, z, angle] or [x, y, z], in degrees */
    DRAPE_SCENE_BOX,      /* [[x, y, z], [x, y, z]] */
    DRAPE_SCENE_TRACK,    /* an array of [time, [x, y, z]], times increasing */
    DRAPE_SCENE_OBJECT,   /* a child */
    DRAPE_SCENE_OBJECTS,  /* an array of children */
    DRAPE_SCENE_ROWS      /* an array of children, or strings for children with a "type" alone */
} drape_scene_kind;

#define DRAPE_SCENE_FORM 1 /* of "drape": 1 */

typedef struct drape_scene_key {
    const char *name;
    drape_scene_kind kind;
    bool required;
    size_t offset;       /* in the def of its object */
    size_t count_offset; /* arrays: of their size_t count */
    double min, max;     /* NUMBER, INTEGER, INTEGERS */
    bool closed;         /* NUMBER: min is allowed */
    bool optional;       /* OBJECT: may be left out although something in it is required */
    size_t at_least;     /* elements of an array */
    const char *unit;    /* NULL for none */
    const char *const
        *words; /* WORD: the NULL-ended list of words that are right; the compiler checks them */
    const struct drape_scene_object *child; /* OBJECT, OBJECTS, ROWS */
    const char *help;                       /* what it is, its default: one line */
} drape_scene_key;

typedef struct drape_scene_object {
    const char *name;
    const drape_scene_key *keys;
    size_t key_count;
    const char *const *one_of; /* NULL-ended: exactly one of these keys is given; NULL: no such rule */
    bool open;                 /* other members are settings of a row, which the compiler checks */
    const char *open_with;     /* only where this key is given; NULL: always */
    size_t settings_offset, settings_count_offset; /* open: in the def */
    size_t def_size;                               /* OBJECTS, ROWS: of one element */
    void (*init)(void *def);                       /* OBJECTS: its defaults; NULL: zero */
} drape_scene_object;

/* The object at the top; the others hang below it. */
extern const drape_scene_object drape_scene_form;

/* The words of a pin's corner and edge, NULL-ended. */
extern const char *const drape_pin_corners[], *const drape_pin_edges[];

/* Those of the axis of frames that points up. */
extern const char *const drape_up_axes[];

#endif
