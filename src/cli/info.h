/* info.h: what `drape info` gathers about a scene (cmd_info.c), makes a JSON object of (info_json.c, with
 * info_form.c) and prints, as JSON or for reading (info_text.c). */
#ifndef DRAPE_CLI_INFO_H
#define DRAPE_CLI_INFO_H

#include "base/param.h"
#include "cli/cli.h"
#include "compile/compile.h"
#include "mesh/mesh.h"
#include "model/scene.h"
#include "sim/profile.h"

#include <jansson.h>

typedef struct cli_cloth_info {
    double mass, area;                /* [kg], [m2] */
    int32_t pinned, moved, supported; /* nodes; moved ones are pinned, too; supported ones are held in some
                                         directions only */
} cli_cloth_info;

typedef struct cli_info {
    const char *path;
    const drape_model *model;
    const drape_sim *sim;
    drape_scene_def def; /* what the model was compiled from */
    drape_profile profile;
    bool has_limit;            /* the integrator has a stability limit: */
    drape_stability stability; /* at the start, of a step of profile.dt */
    int64_t frames;            /* of a whole run */
    cli_cloth_info *cloths;    /* one for each of the model */
    int32_t *inside;           /* nodes at t = 0, for each collider of the model */
    bool described;            /* for reading: every value of a scene and every quantity is an object with
                                  "value" and "unit", as parameters are, and "default" where it has one */
} cli_info;

json_t *cli_info_json(const cli_info *info); /* a new reference; NULL: out of memory */

/* Prints that object, described, on stdout. Removes from its terms what it prints as a table. */
void cli_info_text(json_t *described);

/* ---- Parts of the object: new references ---- */

/* Takes the reference to a value. */
json_t *cli_described(const cli_info *info, json_t *value, const char *unit);

/* Each parameter with "value", "unit" and "default". choice: what the scene said; NULL: not known, a value
 * that equals the default counts as one, and texts are empty. */
json_t *cli_params_json(const drape_param *params, int param_count, const double *values,
                        const drape_choice *choice);

/* The same without a choice; if not described, the values alone that are not derived. */
json_t *cli_values_json(const cli_info *info, const drape_param *params, int param_count,
                        const double *values);

/* Adds the keys that have a value, except names, which are shown where they are used. */
json_t *cli_with_keys(const cli_info *info, json_t *object, const drape_scene_object *form, const void *def);

/* An object of a scene with the values of its def, those by default included; an array of such. */
json_t *cli_form_json(const cli_info *info, const drape_scene_object *form, const void *def);
json_t *cli_forms_json(const cli_info *info, const drape_scene_object *form, const void *defs, size_t count);

#endif
