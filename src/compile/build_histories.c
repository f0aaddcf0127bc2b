/* build_histories.c: the histories of a scene, and which of them a term has: by its parameter "history", or
 * by "ramp", which stands for a cubic from 0 at t = 0 to 1. */
#include "compile/stages.h"
#include "model/history.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define LEAST_RAMP 1e-9 /* [s] steps that follow shorter ones would be refused as too small */
#define MAX_SLOPE  1e30 /* [1/s] between two keys, so that no number of a cubic overflows */

static drape_status check(drape_model *model, const char *pointer, const drape_scene_def *scene, size_t i)
{
    const drape_history_def *def = &scene->histories[i];
    if (def->time_count == 0 || def->time_count != def->value_count)
        return drape_refuse(model->ctx, pointer,
                            "%zu times and %zu values; there is one value for each time, and at least one",
                            def->time_count, def->value_count);
    for (size_t k = 0; k < def->time_count; k++) {
        const char *list = "times", *fault = NULL;
        char key[40];
        if (!(fabs(def->times[k]) <= DRAPE_MOST))
            fault = "a time is finite and within 1e9 s";
        else if (!(fabs(def->values[k]) <= DRAPE_MOST))
            list = "values", fault = "a factor is finite and within 1e9";
        else if (k > 0 && !(def->times[k] > def->times[k - 1]))
            fault = "times must increase from key to key";
        else if (k > 0 && !(fabs(def->values[k] - def->values[k - 1]) <=
                            MAX_SLOPE * (def->times[k] - def->times[k - 1])))
            fault = "the factor changes by more than 1e30 per second";
        if (!fault)
            continue;
        snprintf(key, sizeof key, "%s/%zu", list, k);
        return drape_fail_below(model->ctx, pointer, key, "%s", fault);
    }
    for (size_t k = 0; k < i; k++)
        if (strcmp(scene->histories[k].name, def->name) == 0)
            return drape_fail_below(model->ctx, pointer, "name", "two histories have the name \"%.60s\"",
                                    def->name);
    return DRAPE_OK;
}

/* Adds a history of so many keys to the model, which has memory for one more. */
static drape_status add(drape_model *model, const char *name, size_t count, const double *times,
                        const double *values, bool cubic)
{
    drape_arena *arena = &model->arena;
    drape_history *to = &model->histories[model->history_count];
    to->name = drape_arena_text(arena, name);
    to->key_count = count;
    to->time = drape_arena_take(arena, count, sizeof *to->time);
    to->value = drape_arena_take(arena, count, sizeof *to->value);
    to->slope = cubic ? drape_arena_take(arena, count, sizeof *to->slope) : NULL;
    DRAPE_TRY(drape_arena_status(arena));
    memcpy(to->time, times, count * sizeof *times);
    memcpy(to->value, values, count * sizeof *values);
    if (cubic)
        drape_history_slopes(count, times, values, to->slope);
    model->history_count++;
    return DRAPE_OK;
}

drape_status drape_compile_histories(drape_model *model, const drape_scene_def *def)
{
    size_t capacity = def->history_count;
    for (size_t c = 0; c < def->cloth_count; c++)
        capacity += def->cloths[c].term_count;
    model->histories = drape_arena_take(&model->arena, capacity, sizeof *model->histories);
    if (!model->histories)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < def->history_count; i++) {
        const drape_history_def *from = &def->histories[i];
        const char *pointer = DRAPE_FORMAT("/histories/%zu", i);
        DRAPE_TRY(check(model, pointer, def, i));
        DRAPE_TRY(add(model, from->name, from->time_count, from->times, from->values,
                      from->interpolation && strcmp(from->interpolation, "cubic") == 0));
    }
    return DRAPE_OK;
}

static drape_status refuse_timed(drape_model *model, const char *pointer, const drape_term *term)
{
    return drape_refuse(model->ctx, pointer, "%s has a course in time of its own, and no history",
                        term->ops->entry.name);
}

drape_status drape_compile_history_named(drape_model *model, const char *pointer, const char *name,
                                         drape_term *term)
{
    const char *names[16];
    size_t known = 0;
    if (drape_term_is_timed(term))
        return refuse_timed(model, pointer, term);
    for (int32_t i = 0; i < model->history_count && !term->history; i++) {
        drape_history *history = &model->histories[i];
        if (*history->name && strcmp(history->name, name) == 0) {
            history->used = true;
            term->history = history;
        } else if (*history->name && known < sizeof names / sizeof *names)
            names[known++] = history->name;
    }
    if (term->history)
        return DRAPE_OK;
    const char *meant = drape_did_you_mean(name, names, known);
    return drape_refuse(model->ctx, pointer, "there is no history \"%.60s\"%s%.60s%s", name,
                        meant ? "; did you mean \"" : "", meant ? meant : "", meant ? "\"?" : "");
}

drape_status drape_compile_history_of(drape_model *model, const char *pointer, const drape_entry_def *def,
                                      drape_term *term)
{
    const drape_entry *entry = &term->ops->entry;
    const int given = drape_param_find(entry->params, entry->param_count, DRAPE_HISTORY_PARAM),
              ramp = drape_param_find(entry->params, entry->param_count, "ramp");
    if (given < 0 || entry->params[given].kind != DRAPE_PARAM_TEXT)
        return DRAPE_OK;
    const char *name = NULL;
    for (size_t i = 0; i < def->setting_count; i++)
        if (strcmp(def->settings[i].name, DRAPE_HISTORY_PARAM) == 0)
            name = def->settings[i].text;
    const double rise = ramp < 0 ? 0 : term->params[drape_param_place(entry->params, ramp)];
    const char *at = DRAPE_FORMAT("%s/%s", pointer, DRAPE_HISTORY_PARAM);
    if (name && rise > 0)
        return drape_refuse(model->ctx, at, "a load has a history or a ramp, not both");
    if (name)
        return drape_compile_history_named(model, at, name, term);
    if (!(rise > 0))
        return DRAPE_OK;
    if (drape_term_is_timed(term))
        return refuse_timed(model, at, term);
    if (rise < LEAST_RAMP)
        return drape_fail_below(model->ctx, pointer, "ramp", "%g s is too short; ramp is 0 or at least %g s",
                                rise, LEAST_RAMP);
    const double times[] = {0, rise}, values[] = {0, 1};
    drape_status status = add(model, "", 2, times, values, true);
    if (!status) {
        term->history = &model->histories[model->history_count - 1];
        model->histories[model->history_count - 1].used = true;
    }
    return status;
}
