/* engine_json.c: cases and results as JSON; see engine.h. */
#include "lab/engine.h"

#include "base/param.h"

#include <math.h>
#include <string.h>

/* ---- Values ---- */

double lab_number(const json_t *object, const char *key)
{
    const json_t *value = json_object_get(object, key);
    return json_is_number(value) ? json_number_value(value) : NAN;
}

const char *lab_text(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

double lab_tag_number(const json_t *result, const char *key)
{
    return lab_number(json_object_get(result, "tags"), key);
}

const char *lab_tag_text(const json_t *result, const char *key)
{
    return lab_text(json_object_get(result, "tags"), key);
}

bool lab_is_good(const json_t *result)
{
    return strcmp(lab_text(result, "status"), drape_status_name(DRAPE_OK)) == 0;
}

/* ---- Cases ---- */

drape_status lab_add_case(lab *l, json_t *tags, json_t *settings, int64_t same_as)
{
    json_t *one = json_pack("{s:o, s:o}", "tags", tags, "settings", settings);
    const bool failed = !one ||
                        (same_as >= 0 && json_object_set_new(one, "same_as", json_integer(same_as))) ||
                        json_array_append_new(l->cases, one);
    return failed ? drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for the cases") : DRAPE_OK;
}

bool lab_is_ours(const lab *l, size_t i)
{
    return i % (size_t)l->def->shards == (size_t)(l->def->shard - 1) &&
           !json_object_get(json_array_get(l->cases, i), "same_as");
}

const json_t *lab_identified(const lab *l)
{
    return l->experiment->grows ? NULL : json_object_get(json_array_get(l->cases, 0), "settings");
}

lab_request lab_request_of(const lab *l, size_t index)
{
    lab_request request = {.def = l->def,
                           .identity = lab_text(l->about, "scene_hash"),
                           .identified = lab_identified(l),
                           .settings = json_object_get(json_array_get(l->cases, index), "settings"),
                           .reference = &l->reference,
                           .reference_error = l->reference_error,
                           .compared = l->compared,
                           .seconds = l->def->case_seconds,
                           .repeats = l->experiment->compares_costs ? l->def->repeats : 1};
    if (l->experiment->request)
        l->experiment->request(l, index, &request);
    return request;
}

/* ---- Integrators ---- */

const drape_integrator_ops *lab_find_integrator(const char *name)
{
    const int i = drape_registry_find(&drape_integrator_registry, NULL, name);
    return i < 0 ? NULL : drape_integrators[i];
}

bool lab_has_param(const drape_entry *entry, const char *name)
{
    return drape_param_find(entry->params, entry->param_count, name) >= 0;
}

bool lab_ignores(const drape_integrator_ops *integrator, const char *pointer)
{
    const size_t prefix = strlen("/integrator/");
    return strncmp(pointer, "/integrator/", prefix) == 0 && strcmp(pointer + prefix, "method") != 0 &&
           !lab_has_param(&integrator->entry, pointer + prefix);
}

bool lab_wants_integrator(const lab *l, const char *name, bool fallback)
{
    for (size_t i = 0; i < l->def->integrator_count; i++)
        if (strcmp(l->def->integrators[i], name) == 0)
            return true;
    return l->def->integrator_count == 0 && fallback;
}
