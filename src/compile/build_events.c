/* build_events.c: events by name, with their parameters, cloths and pins. */
#include "compile/compile.h"
#include "compile/stages.h"
#include "events/events.h"
#include "model/scene.h"

#include <string.h>

/* An event under construction: of a scene, or of a host whose sim has a model already. */
typedef struct place {
    drape_context *ctx;
    drape_arena *arena;
    const drape_model *model;
    const char *pointer; /* of the event: "/events/0" */
} place;

static bool concerns(const drape_pin *pin, const drape_model_event *event, const char *name)
{
    return (event->cloth < 0 || pin->cloth == event->cloth) && (!name || strcmp(pin->name, name) == 0);
}

/* A node that several of the pins hold is listed once. */
static drape_status list_nodes(const place *p, drape_model_event *to)
{
    const drape_model *m = p->model;
    int32_t count = 0;
    drape_arena scratch = drape_arena_of(p->ctx);
    uint8_t *held = drape_arena_take(&scratch, (size_t)m->node_count, sizeof *held);
    for (int32_t k = 0; held && k < to->pin_count; k++) {
        const drape_pin *pin = &m->pins[to->pin[k]];
        for (int32_t i = 0; i < pin->node_count; i++) {
            count += !held[pin->node[i]];
            held[pin->node[i]] = 1;
        }
    }
    to->pinned = drape_arena_take(p->arena, (size_t)count, sizeof *to->pinned);
    for (int32_t i = 0; held && to->pinned && i < m->node_count; i++)
        if (held[i])
            to->pinned[to->pinned_count++] = i;
    const drape_status status = drape_arena_status(&scratch);
    drape_arena_free(&scratch);
    return status ? status : drape_arena_status(p->arena);
}

static drape_status find_pins(const place *p, const char *name, drape_model_event *to)
{
    const drape_model *m = p->model;
    for (int32_t k = 0; k < m->pin_count; k++)
        to->pin_count += concerns(&m->pins[k], to, name);
    to->pin = drape_arena_take(p->arena, (size_t)to->pin_count, sizeof *to->pin);
    if (!to->pin)
        return DRAPE_E_MEMORY;
    int32_t count = 0;
    for (int32_t k = 0; k < m->pin_count; k++)
        if (concerns(&m->pins[k], to, name))
            to->pin[count++] = k;
    if (name && count == 0)
        return drape_fail_below(p->ctx, p->pointer, "pins", "there are no pins \"%.60s\" in %s%.60s", name,
                                to->cloth < 0 ? "any cloth" : "cloth ",
                                to->cloth < 0 ? "" : m->cloths[to->cloth].name);
    return list_nodes(p, to);
}

/* The place of a text among the choices of a key; NULL is the first. */
static drape_status choose(const place *p, const char *key, const char *text, int *out)
{
    const drape_setting setting = {.name = key, .text = text};
    double value = 0;
    const char *at = DRAPE_FORMAT("%s/%s", p->pointer, key);
    if (text)
        DRAPE_TRY(drape_param_value(p->ctx, at, &drape_scene_key_of(&drape_form_event, key)->param, &setting,
                                    &value));
    *out = (int)value;
    return DRAPE_OK;
}

/* The rest shapes of clamped edges contain the directions in which they are held. */
static drape_status check_release(const place *p, const drape_model_event *to)
{
    for (int32_t k = 0; k < to->pin_count; k++) {
        const drape_pin *pin = &p->model->pins[to->pin[k]];
        if (pin->clamps || pin->slides)
            return drape_fail_below(p->ctx, p->pointer, "action",
                                    "the pins \"%.60s\" %s; such pins cannot be released", pin->name,
                                    pin->clamps ? "clamp edges" : "hold their nodes in some directions only");
    }
    return to->pinned_count > 0
               ? DRAPE_OK
               : drape_fail_below(p->ctx, p->pointer, "action", "there are no pins to release");
}

/* All but the event function. */
static drape_status resolve(const place *p, const drape_event_def *def, drape_model_event *to)
{
    int direction = 0, action = 0;
    DRAPE_TRY(choose(p, "direction", def->direction, &direction));
    DRAPE_TRY(choose(p, "action", def->action, &action));
    to->direction = (drape_event_direction)direction;
    to->action = (drape_event_action)action;
    to->once = def->once;
    to->cloth = -1;
    for (int32_t c = 0; def->cloth && c < p->model->cloth_count; c++)
        if (strcmp(p->model->cloths[c].name, def->cloth) == 0)
            to->cloth = c;
    if (def->cloth && to->cloth < 0)
        return drape_fail_below(p->ctx, p->pointer, "cloth", "there is no cloth \"%.60s\"", def->cloth);
    DRAPE_TRY(find_pins(p, def->pins, to));
    return to->action != DRAPE_ACTION_RELEASE ? DRAPE_OK : check_release(p, to);
}

/* In the column of events of steps.csv, "a@0.1;b@0.2", a name ends at "@" and an event at ";". */
static drape_status check_name(const place *p, const char *name)
{
    bool good = true;
    for (const char *c = name; c && *c; c++)
        good = good && *c != ';' && *c != '@' && (unsigned char)*c >= ' ' && *c != 0x7f;
    return good ? DRAPE_OK
                : drape_fail_below(p->ctx, p->pointer, "name",
                                   "the name of an event has no \";\", \"@\" or control character");
}

/* ---- Of a scene ---- */

static drape_status compile_event(drape_model *model, size_t i, const drape_event_def *def)
{
    drape_model_event *to = &model->events[i];
    int function = 0;
    const char *pointer = DRAPE_FORMAT("/events/%zu", i), *type = DRAPE_FORMAT("%s/type", pointer);
    const place p = {.ctx = model->ctx, .arena = &model->arena, .model = model, .pointer = pointer};
    DRAPE_TRY(
        drape_compile_name(model, pointer, "event", "events", def->name, (int32_t)i, &to->name, sizeof *to));
    DRAPE_TRY(check_name(&p, to->name));
    DRAPE_TRY(resolve(&p, def, to));
    DRAPE_TRY(drape_registry_choose(p.ctx, &drape_event_registry, type, def->entry.type, &function));
    to->ops = drape_events[function];
    DRAPE_TRY(drape_compile_choice(model, &def->entry, "", &to->choice));
    DRAPE_TRY(drape_params_resolve(p.ctx, pointer, &to->ops->entry, def->entry.settings,
                                   def->entry.setting_count, to->values));
    if (to->ops->needs_pins && to->pinned_count == 0)
        return drape_fail_below(p.ctx, pointer, "type", "the event is about pins, and there are none");
    return !to->ops->check ? DRAPE_OK : to->ops->check(p.ctx, pointer, model, to);
}

drape_status drape_compile_events(drape_model *model, const drape_scene_def *def)
{
    drape_status status = DRAPE_OK;
    if (def->event_count == 0)
        return DRAPE_OK;
    model->events = drape_arena_take(&model->arena, def->event_count, sizeof *model->events);
    if (!model->events)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; !status && i < def->event_count; i++)
        status = compile_event(model, i, &def->events[i]);
    model->event_count = status ? 0 : (int32_t)def->event_count;
    return status;
}

/* ---- Of a host ---- */

drape_status drape_compile_host_event(drape_context *ctx, drape_arena *arena, const drape_model *model,
                                      const drape_event_def *def, drape_model_event *to)
{
    const place p = {.ctx = ctx, .arena = arena, .model = model, .pointer = "/event"};
    *to = (drape_model_event){.ops = NULL};
    to->name = drape_arena_text(arena, def->name);
    DRAPE_TRY(drape_arena_status(arena));
    DRAPE_TRY(check_name(&p, def->name));
    return resolve(&p, def, to);
}
