/* engine_schema.c: see engine.h, which has the form of both files. */
#include "lab/engine.h"

#include <stdarg.h>
#include <string.h>

#define LONGEST    DRAPE_MESSAGE_SIZE /* of texts that are shown */
#define MAX_SERIES 4096
#define MAX_SCENES 256

/* Where the check is: the file, and the place in it. */
typedef struct place {
    drape_context *ctx;
    const char *file;
    char pointer[64];
} place;

static drape_status refuse(const place *at, const char *name, const char *why)
{
    return drape_fail(at->ctx, DRAPE_E_PARSE, "%.500s: %s%s%.100s: %s", at->file, at->pointer,
                      !*name                                 ? ""
                      : *at->pointer == '/' || !*at->pointer ? "/"
                                                             : ": ",
                      name, why);
}

/* The format, as of json_unpack, says which members an object has, and of which types. */
static drape_status check_form(const place *at, json_t *object, const char *format, ...)
{
    json_error_t fault;
    va_list keys;
    va_start(keys, format);
    const int code = json_vunpack_ex(object, &fault, JSON_VALIDATE_ONLY, format, keys);
    va_end(keys);
    return code ? refuse(at, "", fault.text) : DRAPE_OK;
}

/* The members of an object, scalars but for some. Texts are shown, or become part of the name of a file. */
static drape_status check_members(const place *at, const json_t *object, const char *const *nested)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)(uintptr_t)object, key, value)
    {
        size_t i = 0;
        while (nested[i] && strcmp(nested[i], key) != 0)
            i++;
        if ((json_is_object(value) || json_is_array(value) || json_is_boolean(value)) && !nested[i])
            return refuse(at, key, "must be a text, a number or null");
        char copy[LONGEST] = "";
        const char *text = json_is_string(value) ? json_string_value(value) : "";
        snprintf(copy, sizeof copy, "%s", text);
        drape_make_printable(copy);
        if (strcmp(copy, text) != 0)
            return refuse(at, key, "a text has control characters, or is longer than 1023 bytes");
    }
    return DRAPE_OK;
}

static drape_status check_items(const place *at, const json_t *object, const char *key, bool texts)
{
    const json_t *list = json_object_get(object, key);
    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *item = json_array_get(list, i);
        if (texts ? !json_is_string(item) : !json_is_number(item) && !json_is_null(item))
            return refuse(at, key, texts ? "must be texts" : "must be numbers or null");
    }
    return DRAPE_OK;
}

/* Checks the members of each case; that the cases of a series stand side by side; and that a case that has
 * the result of another one has that of an earlier case with a result of its own. */
static drape_status check_cases(place *at, const json_t *cases)
{
    json_t *series = json_object(), *one;
    drape_status status = json_array_size(cases) ? DRAPE_OK : refuse(at, "cases", "there is none");
    for (size_t i = 0; !status && (one = json_array_get(cases, i)); i++) {
        char name[2 * LONGEST];
        snprintf(at->pointer, sizeof at->pointer, "/cases/%zu", i);
        status = check_form(at, one, "{s:{s:s, s?:s, s?:s, s?:s}, s?:{}, s?:I, s?:I}", "tags", "integrator",
                            "scene", "series", "knob", "settings", "same_as", "rank");
        if (!status)
            status = check_members(at, json_object_get(one, "tags"), (const char *const[]){NULL});
        if (status)
            break;
        const json_t *same = json_object_get(one, "same_as");
        const json_int_t k = same ? json_integer_value(same) : 0, last = (json_int_t)i - 1;
        snprintf(name, sizeof name, "%s\n%s", lab_tag_text(one, "scene"), lab_tag_text(one, "series"));
        const json_t *before = json_object_get(series, name);
        if (same && (k < 0 || k > last || json_object_get(json_array_get(cases, (size_t)k), "same_as")))
            status =
                refuse(at, "same_as", "must be the number of an earlier case that has a result of its own");
        else if (json_object_size(series) > MAX_SERIES)
            status = refuse(at, "tags", "there are more than 4096 series");
        else if (before && json_integer_value(before) != last)
            status = refuse(at, "tags", "the cases of a series must stand side by side");
        else if (json_object_set_new(series, name, json_integer((json_int_t)i)))
            status = drape_fail(at->ctx, DRAPE_E_MEMORY, "no memory for the cases");
    }
    json_decref(series);
    return status;
}

static drape_status check_scenes(place *at, const json_t *scenes)
{
    json_t *one;
    if (json_array_size(scenes) > MAX_SCENES)
        return refuse(at, "arguments/scenes", "more than 256");
    for (size_t i = 0; (one = json_array_get(scenes, i)); i++) {
        snprintf(at->pointer, sizeof at->pointer, "/arguments/scenes/%zu", i);
        DRAPE_TRY(check_form(at, one, "{s:s, s:F, s:F, s?:[], s?:[]}", "name", "duration_s",
                             "reference_error", "t_s", "growth"));
        DRAPE_TRY(check_members(at, one, (const char *const[]){"t_s", "growth", NULL}));
        DRAPE_TRY(check_items(at, one, "t_s", false));
        DRAPE_TRY(check_items(at, one, "growth", false));
    }
    return DRAPE_OK;
}

drape_status lab_check_about(drape_context *ctx, const char *file, json_t *about)
{
    place at = {ctx, file, ""};
    const json_t *arguments = json_object_get(about, "arguments");
    DRAPE_TRY(check_form(&at, about, "{s:s, s:{s?:[], s?:[]}, s:[], s?:[], s?:[]}", "experiment", "arguments",
                         "axes", "scenes", "cases", "results", "settings"));
    DRAPE_TRY(check_items(&at, arguments, "axes", true));
    DRAPE_TRY(check_items(&at, about, "results", true));
    DRAPE_TRY(check_scenes(&at, json_object_get(arguments, "scenes")));
    return check_cases(&at, json_object_get(about, "cases"));
}

drape_status lab_check_line(const lab *l, const char *file, int64_t number, json_t *line,
                            const json_error_t *fault)
{
    json_error_t inside = *fault;
    char path[520];
    snprintf(path, sizeof path, "%.480s:%lld", file, (long long)number);
    const place at = {l->ctx, path, "not a result of a case of this experiment"};
    if (!line ||
        json_unpack_ex(line, &inside, JSON_VALIDATE_ONLY, "{s:I, s:{}, s:s, s:I, s?:I, s?:{}, s?:[]}", "case",
                       "tags", "status", "rejected", "accepted", "reasons", "positions"))
        return refuse(&at, "", inside.text);
    const json_int_t i = json_integer_value(json_object_get(line, "case"));
    const json_t *one = i < 0 ? NULL : json_array_get(l->cases, (size_t)i);
    if (!json_equal(json_object_get(line, "tags"), json_object_get(one, "tags")))
        return refuse(&at, "", "it has another number, or other tags");
    DRAPE_TRY(check_members(&at, line, (const char *const[]){"tags", "reasons", "positions", NULL}));
    return check_items(&at, line, "positions", false);
}
