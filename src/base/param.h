/* param.h: parameters, and the values that settings give them: names, kinds, ranges and defaults, as numbers
 * and as text. The keys of a scene are parameters too (model/scene.h). */
#ifndef DRAPE_BASE_PARAM_H
#define DRAPE_BASE_PARAM_H

#include "base/context.h"

/* The number of values that a parameter occupies, at most DRAPE_PARAM_WIDEST; and the index of the first
 * value of a parameter in a list, which is the number of values of the parameters before it. */
#define DRAPE_PARAM_WIDEST 3
int drape_param_width(const drape_param *param);
int drape_param_place(const drape_param *params, int index);

/* Writes the default, once per value. */
void drape_param_default(const drape_param *param, double *values);

/* Whether a setting must be given: there is no default, neither fixed nor derived. */
bool drape_param_is_required(const drape_param *param);

/* Resolves the values of the parameters of an entry, in their order: the default if no setting names the
 * parameter (NaN if the default is derived). Faults are reported at "pointer/name". A setting whose name is
 * not in the list is a fault, unless it is a former one (base/retired.h). */
drape_status drape_params_resolve(drape_context *ctx, const char *pointer, const drape_entry *entry,
                                  const drape_setting *settings, size_t setting_count, double *values);

/* Checks one setting against its parameter and converts it; writes as many values as the parameter
 * occupies. */
drape_status drape_param_value(drape_context *ctx, const char *pointer, const drape_param *param,
                               const drape_setting *setting, double *value);

/* Set the message for a value that is not allowed, or for a required parameter that is missing, with what the
 * parameter accepts, at the pointer. Return DRAPE_E_ARGUMENT. */
drape_status drape_param_refuse(drape_context *ctx, const char *pointer, const drape_param *param,
                                const char *given);
drape_status drape_param_missing(drape_context *ctx, const char *pointer, const drape_param *param);

/* Sets the message for a setting whose name is not among the known parameters. It names the likely one, or
 * all of them. Returns DRAPE_E_ARGUMENT. */
drape_status drape_param_unknown(drape_context *ctx, const char *pointer, const char *name,
                                 const char *const *known, size_t count);

/* Whether a user-defined list is well formed: at most DRAPE_MAX_PARAMS values; each parameter has a name and
 * a unit, and a choice has choices. */
bool drape_params_are_well_formed(const drape_param *params, int param_count);

/* Returns the index of a name; -1 if it is not in the list. */
int drape_param_find(const drape_param *params, int param_count, const char *name);

/* ---- As text ---- */

/* Writes the range of a parameter: "(0, 1e9] N/m", "[x, y, z], each in [0, 1]" or "one of: a, b". */
void drape_param_range_text(const drape_param *param, char *text, size_t size);

/* The same with the kind of number: "a number in (0, 1e9] N/m". The macro makes it in place, valid until the
 * end of the block. */
const char *drape_param_takes_text(const drape_param *param, char *text, size_t size);
#define DRAPE_PARAM_TAKES(param) drape_param_takes_text(param, (char[DRAPE_RANGE_SIZE]){0}, DRAPE_RANGE_SIZE)
#define DRAPE_RANGE_SIZE         1024 /* lists of choices are long */

/* Writes a value of a parameter: "0.001", "true", "report", "[0, 1, 0]". */
void drape_param_value_text(const drape_param *param, const double *value, char *text, size_t size);

#define DRAPE_NUMBER_SIZE 32
/* A number with enough digits to read back as itself, at least 10, without trailing zeros; in place. */
const char *drape_number_text(double number, char text[DRAPE_NUMBER_SIZE]);
#define DRAPE_NUMBER_TEXT(number) drape_number_text(number, (char[DRAPE_NUMBER_SIZE]){0})

/* Reads the number that a text begins with, "0.005" or a fraction "1/240", in any locale. Returns what
 * follows it; NULL: it begins with none, or with one that is not finite, such as "1/0". */
const char *drape_number_read(const char *text, double *number);

/* Returns the candidate nearest to word by edit distance; NULL if none is close enough to be a plausible
 * misspelling. */
const char *drape_did_you_mean(const char *word, const char *const *candidates, size_t count);

/* Arguments for three %s at the end of a message, which say `; did you mean "x"?` for a result of
 * drape_did_you_mean, and nothing if that is NULL. */
#define DRAPE_DID_YOU_MEAN(name) (name) ? "; did you mean \"" : "", (name) ? (name) : "", (name) ? "\"?" : ""

#endif
