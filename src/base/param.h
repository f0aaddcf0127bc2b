/* param.h: parameters and the values that settings give them: names, kinds, ranges, defaults, in numbers and
 * in words. The keys of a scene are parameters too (model/scene.h). */
#ifndef DRAPE_BASE_PARAM_H
#define DRAPE_BASE_PARAM_H

#include "base/context.h"

/* How many values a parameter takes, at most DRAPE_PARAM_WIDEST, and a list of them up to the given one: the
 * place of its first value. */
#define DRAPE_PARAM_WIDEST 3
int drape_param_width(const drape_param *param);
int drape_param_place(const drape_param *params, int index);

/* The default, once for each value. */
void drape_param_default(const drape_param *param, double *values);

/* Whether there is neither a default nor anything else in its place. */
bool drape_param_is_required(const drape_param *param);

/* Values of params in their order: the default where no setting names it (NaN where the default is derived).
 * Faults are reported at "pointer/name". A setting of a name that the list does not have is a fault, with a
 * "did you mean". */
drape_status drape_params_resolve(drape_context *ctx, const char *pointer, const drape_param *params,
                                  int param_count, const drape_setting *settings, size_t setting_count,
                                  double *values);

/* Checks one setting against its parameter and converts it; writes as many values as the parameter takes. */
drape_status drape_param_value(drape_context *ctx, const char *pointer, const drape_param *param,
                               const drape_setting *setting, double *value);

/* Sets the message of a value that is not allowed, or of a parameter that nothing gives, with what the
 * parameter takes, at the pointer. Returns DRAPE_E_ARGUMENT. */
drape_status drape_param_refuse(drape_context *ctx, const char *pointer, const drape_param *param,
                                const char *given);
drape_status drape_param_missing(drape_context *ctx, const char *pointer, const drape_param *param);

/* Whether a host's list can be read: no more than DRAPE_MAX_PARAMS values, each parameter with a name and a
 * unit, a choice with choices. */
bool drape_params_are_well_formed(const drape_param *params, int param_count);

/* The index of a name; -1 if it is not in the list. */
int drape_param_find(const drape_param *params, int param_count, const char *name);

/* ---- In words ---- */

/* "(0, 1e+9] N/m", "[x, y, z], each in [0, 1]" or "one of: a, b": the range of a parameter. */
void drape_param_range_text(const drape_param *param, char *text, size_t size);

/* The same with the kind of a number: "a number in (0, 1e+9] N/m". */
void drape_param_takes_text(const drape_param *param, char *text, size_t size);

/* A value of a parameter: "0.001", "true", "report", "[0, 1, 0]". */
void drape_param_value_text(const drape_param *param, const double *value, char *text, size_t size);

/* A number with the digits that it needs to read back as itself, 10 at least where they are not zeros. */
void drape_number_text(double number, char *text, size_t size);

/* The candidate nearest to word by edit distance, NULL if none is near enough to be meant. */
const char *drape_did_you_mean(const char *word, const char *const *candidates, size_t count);

/* For three %s behind a fault: `; did you mean "x"?`, or nothing where meant is NULL. */
#define DRAPE_MEANT(meant) (meant) ? "; did you mean \"" : "", (meant) ? (meant) : "", (meant) ? "\"?" : ""

#endif
