/* check_def.c: checks a scene def that a host filled, key by key (model/scene_keys.c). Such a def may have
 * NULL where a value is required, or values that the reader of scene files refuses. Later stages rely on
 * these checks and do not repeat them. */
#include "compile/stages.h"

#include <math.h>
#include <string.h>

#include "model/scene.h"
#include "model/scene_text.h"

typedef struct checker {
    drape_context *ctx;
    drape_pointer at; /* pointer to the value that is being checked */
} checker;

static drape_status refuse_null(checker *c, const char *what)
{
    return drape_refuse(c->ctx, c->at.text, "%s is NULL", what);
}

static drape_status check_value(checker *c, const drape_scene_key *key, const char *def)
{
    drape_setting setting;
    double values[DRAPE_PARAM_WIDEST];
    if (drape_scene_value(key, def, &setting))
        return drape_param_value(c->ctx, c->at.text, &key->param, &setting, values);
    return drape_param_is_required(&key->param) ? drape_param_missing(c->ctx, c->at.text, &key->param)
                                                : DRAPE_OK;
}

static drape_status check_object(checker *c, const drape_scene_object *object, const char *def);

/* Checks the length of an array, and its elements if they are objects or texts. Elements of other arrays,
 * node numbers and the keys of tracks, are checked where they are used. */
static drape_status check_array(checker *c, const drape_scene_key *key, const char *def)
{
    const size_t mark = c->at.length;
    const char *array;
    size_t count, size = key->child ? key->child->def_size : sizeof(const char *);
    memcpy(&array, def + key->offset, sizeof array);
    memcpy(&count, def + key->count_offset, sizeof count);
    if (count > 0 && !array)
        return refuse_null(c, "the array");
    if (key->at_most && count > key->at_most)
        return drape_refuse(c->ctx, c->at.text, "an array of %zu is not allowed; %s is %s", count,
                            key->param.name, DRAPE_KEY_TAKES(key));
    const bool has_texts = key->shape == DRAPE_SCENE_LIST && key->param.kind == DRAPE_PARAM_TEXT;
    const drape_scene_key text = {.param = {.name = "an element",
                                            .kind = DRAPE_PARAM_TEXT,
                                            .unit = "1",
                                            .default_value = NAN,
                                            .help = key->param.help}};
    for (size_t i = 0; (key->child || has_texts) && i < count; i++) {
        drape_pointer_push_index(&c->at, i);
        DRAPE_TRY(key->child ? check_object(c, key->child, array + i * size)
                             : check_value(c, &text, array + i * size));
        drape_pointer_cut(&c->at, mark);
    }
    return DRAPE_OK;
}

static drape_status check_object(checker *c, const drape_scene_object *object, const char *def)
{
    const size_t mark = c->at.length;
    const drape_setting *settings = NULL;
    size_t count = 0;
    if (object->open) {
        memcpy(&settings, def + object->settings_offset, sizeof settings);
        memcpy(&count, def + object->settings_count_offset, sizeof count);
    }
    if (count > 0 && !settings)
        return refuse_null(c, "the array of settings");
    for (size_t i = 0; i < count; i++)
        if (!settings[i].name)
            return refuse_null(c, "the name of a setting");
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        drape_pointer_push(&c->at, key->param.name);
        if (key->shape == DRAPE_SCENE_VALUE)
            DRAPE_TRY(check_value(c, key, def));
        else if (key->shape == DRAPE_SCENE_OBJECT)
            DRAPE_TRY(check_object(c, key->child, def + key->offset));
        else if (key->shape == DRAPE_SCENE_LIST || key->shape == DRAPE_SCENE_TRACK ||
                 key->shape == DRAPE_SCENE_OBJECTS || key->shape == DRAPE_SCENE_ENTRIES)
            DRAPE_TRY(check_array(c, key, def));
        drape_pointer_cut(&c->at, mark);
    }
    return DRAPE_OK;
}

drape_status drape_compile_check_def(drape_context *ctx, const drape_scene_def *def)
{
    checker c = {.ctx = ctx};
    return check_object(&c, &drape_form_scene, (const char *)def);
}
