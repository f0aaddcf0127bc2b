/* param.c: see param.h. */
#include "base/param.h"
#include "base/elementary.h"
#include "base/retired.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_WORD   63
#define MIN_PART   3    /* letters: shorter words are near to a part of too many names */
#define SHOWN_SIZE 24   /* bytes of a number with 10 digits */
#define POINT_MIN  1e-9 /* of the second numbers of points */
#define POINT_MAX  1e15

int drape_param_find(const drape_param *params, int param_count, const char *name)
{
    for (int i = 0; i < param_count; i++)
        if (strcmp(params[i].name, name) == 0)
            return i;
    return -1;
}

int drape_param_width(const drape_param *param)
{
    return param->kind == DRAPE_PARAM_VECTOR || param->kind == DRAPE_PARAM_TURN ? 3 : 1;
}

int drape_param_place(const drape_param *params, int index)
{
    int place = 0;
    for (int i = 0; i < index; i++)
        place += drape_param_width(&params[i]);
    return place;
}

bool drape_params_are_well_formed(const drape_param *params, int param_count)
{
    if (param_count < 0 || param_count > DRAPE_MAX_PARAMS || (param_count > 0 && !params))
        return false;
    for (int i = 0; i < param_count; i++)
        if (!params[i].name || !params[i].unit || params[i].kind < DRAPE_PARAM_NUMBER ||
            params[i].kind > DRAPE_PARAM_POINTS ||
            (params[i].kind == DRAPE_PARAM_CHOICE && (!params[i].choices || !params[i].choices[0])))
            return false;
    return drape_param_place(params, param_count) <= DRAPE_MAX_PARAMS;
}

void drape_param_default(const drape_param *param, double *values)
{
    for (int k = 0; k < drape_param_width(param); k++)
        values[k] = param->default_value;
}

bool drape_param_is_required(const drape_param *param)
{
    return isnan(param->default_value) && !param->derived;
}

/* Levenshtein distance, keeping one row of the table. Words longer than MAX_WORD match nothing. */
static size_t edit_distance(const char *a, const char *b)
{
    size_t na = strlen(a), nb = strlen(b), row[MAX_WORD + 1];
    if (na > MAX_WORD || nb > MAX_WORD)
        return SIZE_MAX;
    for (size_t j = 0; j <= nb; j++)
        row[j] = j;
    for (size_t i = 1; i <= na; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            if (row[j - 1] + 1 < best)
                best = row[j - 1] + 1;
            if (row[j] + 1 < best)
                best = row[j] + 1;
            row[j] = best;
        }
    }
    return row[nb];
}

/* The smallest distance of a word from a part of a name: "stretch" and "edge" of "stretch.edge". */
static size_t distance_from_part(const char *word, const char *name)
{
    size_t best = SIZE_MAX;
    for (const char *part = name;; part++) {
        const size_t length = strcspn(part, "._");
        const char *one = DRAPE_FORMAT("%.*s", (int)length, part);
        const size_t distance = edit_distance(word, one);
        best = distance < best ? distance : best;
        part += length;
        if (!*part)
            return best;
    }
}

const char *drape_did_you_mean(const char *word, const char *const *candidates, size_t count)
{
    const char *best = NULL, *by_part = NULL;
    /* Up to a third of the letters of a name may be wrong, or a quarter of those of a part of one. */
    size_t best_distance = 1 + strlen(word) / 3, part_distance = strlen(word) / 4;
    for (size_t i = 0; i < count; i++) {
        size_t distance = edit_distance(word, candidates[i]);
        if (distance <= best_distance && (!best || distance < best_distance)) {
            best = candidates[i];
            best_distance = distance;
        }
        distance = distance_from_part(word, candidates[i]);
        if (strlen(word) >= MIN_PART && distance <= part_distance && (!by_part || distance < part_distance)) {
            by_part = candidates[i];
            part_distance = distance;
        }
    }
    return by_part && (!best || part_distance < best_distance) ? by_part : best;
}

/* Writes an exponent as people do: "1e+09" -> "1e9", "1e-06" -> "1e-6". */
static void trim_exponent(char *text)
{
    char *exponent = strchr(text, 'e');
    if (!exponent || !strchr("+-", exponent[1]))
        return;
    const char *digits = exponent + 2 + strspn(exponent + 2, "0");
    memmove(exponent + (exponent[1] == '-' ? 2 : 1), digits, strlen(digits) + 1);
}

/* The shorter of 1250000 and 1.25e6; numbers below 1e6 have no exponent. */
static const char *shown(double number, char text[SHOWN_SIZE])
{
    char power[SHOWN_SIZE] = "";
    snprintf(text, SHOWN_SIZE, "%.10g", number);
    for (int digits = 0; fabs(number) >= 1e6 && digits < 10 && !strchr(text, 'e'); digits++) {
        snprintf(power, sizeof power, "%.*e", digits, number);
        if (strtod(power, NULL) == strtod(text, NULL)) {
            trim_exponent(power);
            break;
        }
    }
    trim_exponent(text);
    if (*power && strlen(power) < strlen(text))
        memcpy(text, power, strlen(power) + 1);
    return text;
}
#define SHOWN(number) shown(number, (char[SHOWN_SIZE]){0})

void drape_param_range_text(const drape_param *param, char *text, size_t size)
{
    const char *unit = strcmp(param->unit, "1") == 0 ? "" : param->unit;
    const bool points = param->kind == DRAPE_PARAM_POINTS;
    const char *numbers = param->numbers ? param->numbers : points ? "[x, y]" : "[x, y, z]";
    char several[128] = "";
    switch (param->kind) {
    case DRAPE_PARAM_BOOLEAN:
        snprintf(text, size, "true or false");
        return;
    case DRAPE_PARAM_CHOICE:
        snprintf(text, size, "one of: %s", param->choices[0]);
        for (int i = 1; param->choices[i]; i++)
            drape_list_add(text, size, param->choices[i]);
        return;
    case DRAPE_PARAM_TEXT:
        snprintf(text, size, "a non-empty string");
        return;
    case DRAPE_PARAM_VECTOR:
        snprintf(several, sizeof several, "%s%s, each in ", param->uniform ? "a number or " : "", numbers);
        break;
    case DRAPE_PARAM_TURN:
        snprintf(several, sizeof several, "[x, y, z, angle], or %s whose length is the angle, which is in ",
                 numbers);
        break;
    case DRAPE_PARAM_POINTS:
        snprintf(several, sizeof several, "an array of %s, both increasing from 0, the first in ", numbers);
        break;
    case DRAPE_PARAM_NUMBER:
    case DRAPE_PARAM_INTEGER:
        break;
    }
    snprintf(text, size, "%s%c%s, %s%c%s%s", several, param->open_min ? '(' : '[', SHOWN(param->min),
             SHOWN(param->max), param->open_max ? ')' : ']', *unit && !points ? " " : "", points ? "" : unit);
}

const char *drape_param_takes_text(const drape_param *param, char *text, size_t size)
{
    const char *kind = param->kind == DRAPE_PARAM_INTEGER  ? "an integer in "
                       : param->kind == DRAPE_PARAM_NUMBER ? "a number in "
                                                           : "";
    const size_t used = strlen(kind);
    snprintf(text, size, "%s", kind);
    if (used < size)
        drape_param_range_text(param, text + used, size - used);
    return text;
}

const char *drape_number_text(double number, char text[DRAPE_NUMBER_SIZE])
{
    for (int digits = 10; digits <= 17; digits++) {
        snprintf(text, DRAPE_NUMBER_SIZE, "%.*g", digits, number);
        if (strtod(text, NULL) == number)
            break;
    }
    return text;
}

const char *drape_number_read(const char *text, double *number)
{
    char *end;
    const locale_t old = drape_locale_enter();
    *number = strtod(text, &end);
    if (end > text && *end == '/') {
        text = end + 1;
        *number /= strtod(text, &end);
    }
    drape_locale_leave(old);
    return end > text && isfinite(*number) ? end : NULL;
}

/* The same with the exponent as people write it. */
static const char *given_text(double number, char text[DRAPE_NUMBER_SIZE])
{
    drape_number_text(number, text);
    trim_exponent(text);
    return text;
}
#define GIVEN(number) given_text(number, (char[DRAPE_NUMBER_SIZE]){0})

void drape_param_value_text(const drape_param *param, const double *value, char *text, size_t size)
{
    if (isnan(*value)) {
        snprintf(text, size, "%s", param->derived ? param->derived : "required");
        return;
    }
    switch (param->kind) {
    case DRAPE_PARAM_BOOLEAN:
        snprintf(text, size, "%s", *value != 0 ? "true" : "false");
        return;
    case DRAPE_PARAM_CHOICE:
        snprintf(text, size, "%s", param->choices[(int)*value]);
        return;
    case DRAPE_PARAM_NUMBER:
    case DRAPE_PARAM_INTEGER:
        snprintf(text, size, "%s", SHOWN(*value));
        return;
    case DRAPE_PARAM_VECTOR:
    case DRAPE_PARAM_TURN:
        snprintf(text, size, "[%s, %s, %s]", SHOWN(value[0]), SHOWN(value[1]), SHOWN(value[2]));
        return;
    case DRAPE_PARAM_TEXT:
        snprintf(text, size, "a text");
        return;
    case DRAPE_PARAM_POINTS:
        snprintf(text, size, "%d point%s", (int)*value, *value == 1 ? "" : "s");
    }
}

drape_status drape_param_refuse(drape_context *ctx, const char *pointer, const drape_param *param,
                                const char *given)
{
    return drape_refuse(ctx, pointer, "%.100s is not allowed; %s is %s", given, param->name,
                        DRAPE_PARAM_TAKES(param));
}

static drape_status refuse_number(drape_context *ctx, const char *pointer, const drape_param *param,
                                  double number)
{
    return drape_param_refuse(ctx, pointer, param, GIVEN(number));
}

static bool in_range(const drape_param *param, double number)
{
    return isfinite(number) && (param->open_min ? number > param->min : number >= param->min) &&
           (param->open_max ? number < param->max : number <= param->max);
}

static drape_status number_value(drape_context *ctx, const char *pointer, const drape_param *param,
                                 double number, double *value)
{
    const bool fits = in_range(param, number);
    const bool good = param->kind == DRAPE_PARAM_BOOLEAN   ? number == 0 || number == 1
                      : param->kind == DRAPE_PARAM_INTEGER ? fits && number == floor(number)
                      : param->kind == DRAPE_PARAM_VECTOR  ? fits && param->uniform
                                                           : fits && param->kind == DRAPE_PARAM_NUMBER;
    if (!good)
        return refuse_number(ctx, pointer, param, number);
    for (int k = 0; k < drape_param_width(param); k++)
        value[k] = number;
    return DRAPE_OK;
}

/* Converts axis and angle to a vector along the axis whose length is the angle. */
static drape_status turn_value(drape_context *ctx, const char *pointer, const drape_param *param,
                               const drape_setting *setting, double *value)
{
    const double *v = setting->vector;
    double axis = drape_hypot(drape_hypot(v[0], v[1]), v[2]),
           angle = setting->vector_count == 4 ? v[3] : axis;
    if (setting->vector_count == 3 && !isfinite(axis * axis)) /* later code takes the square */
        return drape_refuse(ctx, pointer, "the rotation vector is too long");
    if (!in_range(param, angle) || !isfinite(axis))
        return refuse_number(ctx, pointer, param, isfinite(axis) ? angle : axis);
    if (axis == 0 && angle != 0)
        return drape_refuse(ctx, pointer,
                            "the axis of a rotation by %.10g degrees is 0 0 0; it must not be zero", angle);
    for (int k = 0; k < 3; k++)
        value[k] = axis > 0 ? v[k] / axis * angle : 0;
    return DRAPE_OK;
}

/* pointer: to the number k (0, 1) of point i. */
static drape_status refuse_point(drape_context *ctx, const char *pointer, const drape_param *param, size_t i,
                                 int k, double number, double before)
{
    const char *at = DRAPE_FORMAT("%.250s/%zu/%d", pointer, i, k);
    return drape_refuse(
        ctx, at,
        "%s is not allowed; the %s number of a point of %s is above that of the point before, "
        "%s, and in [%s, %s]",
        GIVEN(number), k == 0 ? "first" : "second", param->name, GIVEN(before),
        SHOWN(k == 0 ? param->min : POINT_MIN), SHOWN(k == 0 ? param->max : POINT_MAX));
}

/* The bounds keep slopes, and products of two of them, far from overflow and underflow. */
static drape_status points_value(drape_context *ctx, const char *pointer, const drape_param *param,
                                 const drape_setting *setting, double *value)
{
    const size_t count = setting->vector_count;
    const double *v = setting->vector;
    const char *given = DRAPE_FORMAT(count ? "an array of %zu numbers" : "an empty array", count);
    if (count == 0 || count % 2 || setting->number != 2)
        return drape_param_refuse(ctx, pointer, param, given);
    for (size_t i = 0; i < count / 2; i++) {
        const double x = v[2 * i], y = v[2 * i + 1], x0 = i ? v[2 * i - 2] : 0, y0 = i ? v[2 * i - 1] : 0;
        if (!in_range(param, x) || !(x > x0))
            return refuse_point(ctx, pointer, param, i, 0, x, x0);
        if (!(y >= POINT_MIN) || !(y <= POINT_MAX) || !(y > y0))
            return refuse_point(ctx, pointer, param, i, 1, y, y0);
    }
    *value = (double)(count / 2);
    return DRAPE_OK;
}

static drape_status vector_value(drape_context *ctx, const char *pointer, const drape_param *param,
                                 const drape_setting *setting, double *value)
{
    const size_t count = setting->vector_count;
    const bool pairs = setting->number == 2;
    if (param->kind == DRAPE_PARAM_POINTS)
        return points_value(ctx, pointer, param, setting, value);
    if (param->kind == DRAPE_PARAM_TURN && !pairs && (count == 3 || count == 4))
        return turn_value(ctx, pointer, param, setting, value);
    const char *given = DRAPE_FORMAT(count ? "an array of %zu" : "an empty array", pairs ? count / 2 : count);
    if (param->kind != DRAPE_PARAM_VECTOR || pairs || count != 3)
        return drape_param_refuse(ctx, pointer, param, given);
    for (int k = 0; k < 3; k++) {
        if (!in_range(param, setting->vector[k]))
            return refuse_number(ctx, pointer, param, setting->vector[k]);
        value[k] = setting->vector[k];
    }
    return DRAPE_OK;
}

static drape_status text_value(drape_context *ctx, const char *pointer, const drape_param *param,
                               const char *text, double *value)
{
    for (const char *const *alias = param->aliases; alias && alias[0]; alias += 2)
        if (strcmp(alias[0], text) == 0) {
            drape_log(ctx, DRAPE_LOG_WARNING, "%s: \"%s\" is a former name; \"%s\" is used", pointer, text,
                      alias[1]);
            text = alias[1];
            break;
        }
    const bool yes = strcmp(text, "true") == 0, boolean = yes || strcmp(text, "false") == 0;
    size_t count = 0;
    for (; param->kind == DRAPE_PARAM_CHOICE && param->choices[count]; count++)
        if (strcmp(param->choices[count], text) == 0) {
            *value = (double)count;
            return DRAPE_OK;
        }
    if ((param->kind == DRAPE_PARAM_BOOLEAN && boolean) || (param->kind == DRAPE_PARAM_TEXT && *text)) {
        *value = param->kind == DRAPE_PARAM_BOOLEAN && yes;
        return DRAPE_OK;
    }
    const char *given = DRAPE_FORMAT(boolean ? "%.60s" : "\"%.60s\"", text);
    if (count == 0)
        return drape_param_refuse(ctx, pointer, param, given);
    const char *meant = drape_did_you_mean(text, param->choices, count);
    return drape_refuse(ctx, pointer, "%s is not allowed; %s is %s%s%s%s", given, param->name,
                        DRAPE_PARAM_TAKES(param), DRAPE_DID_YOU_MEAN(meant));
}

drape_status drape_param_value(drape_context *ctx, const char *pointer, const drape_param *param,
                               const drape_setting *setting, double *value)
{
    if (setting->text)
        return text_value(ctx, pointer, param, setting->text, value);
    if (setting->vector)
        return vector_value(ctx, pointer, param, setting, value);
    return number_value(ctx, pointer, param, setting->number, value);
}

drape_status drape_param_unknown(drape_context *ctx, const char *pointer, const char *name,
                                 const char *const *known, size_t count)
{
    char list[DRAPE_RANGE_SIZE] = "";
    for (size_t i = 0; i < count; i++)
        drape_list_add(list, sizeof list, known[i]);
    const char *meant = drape_did_you_mean(name, known, count);
    return drape_refuse(ctx, pointer, "unknown key \"%.60s\"; %s%s%s%s%s", name,
                        meant ? "did you mean \"" : "", meant ? meant : "", meant ? "\"? " : "",
                        !count  ? "there are no parameters"
                        : meant ? "Known: "
                                : "known: ",
                        list);
}

drape_status drape_param_missing(drape_context *ctx, const char *pointer, const drape_param *param)
{
    return drape_refuse(ctx, pointer, "\"%s\" is missing: %s; %s", param->name, param->help,
                        DRAPE_PARAM_TAKES(param));
}

drape_status drape_params_resolve(drape_context *ctx, const char *pointer, const drape_entry *entry,
                                  const drape_setting *settings, size_t setting_count, double *values)
{
    const drape_param *params = entry->params;
    bool given[DRAPE_MAX_PARAMS] = {false};
    for (int i = 0; i < entry->param_count; i++)
        drape_param_default(&params[i], values + drape_param_place(params, i));
    for (size_t s = 0; s < setting_count; s++) {
        const char *at = DRAPE_FORMAT("%s/%.80s", pointer, settings[s].name);
        int i = drape_param_find(params, entry->param_count, settings[s].name);
        if (i < 0 && drape_retired(ctx, at, entry->name, settings[s].name))
            continue;
        if (i < 0) {
            const char *names[DRAPE_MAX_PARAMS];
            for (int k = 0; k < entry->param_count; k++)
                names[k] = params[k].name;
            return drape_param_unknown(ctx, at, settings[s].name, names, (size_t)entry->param_count);
        }
        DRAPE_TRY(
            drape_param_value(ctx, at, &params[i], &settings[s], values + drape_param_place(params, i)));
        given[i] = true;
    }
    for (int i = 0; i < entry->param_count; i++)
        if (!given[i] && drape_param_is_required(&params[i]))
            return drape_param_missing(ctx, pointer, &params[i]);
    return DRAPE_OK;
}
