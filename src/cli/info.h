/* info.h: what `drape info` gathers about a scene, for both of its outputs. */
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
    double mass, area;     /* [kg], [m2] */
    int32_t pinned, moved; /* nodes; moved ones are pinned, too */
} cli_cloth_info;

typedef struct cli_collider_info {
    int32_t inside; /* nodes at t = 0 */
} cli_collider_info;

typedef struct cli_info {
    const char *path;
    const drape_model *model;
    const drape_sim *sim;
    drape_scene_def def; /* what the model was compiled from */
    drape_profile profile;
    bool has_limit;               /* the integrator has a stability limit: */
    drape_stability stability;    /* at the start, of a step of profile.dt */
    int64_t frames;               /* of a whole run */
    cli_cloth_info *cloths;       /* one for each of the model */
    cli_collider_info *colliders; /* likewise */
} cli_info;

/* A choice of the scene: an integrator, a controller, or contact. */
typedef struct cli_chosen {
    const char *title, *name, *summary; /* "integrator", "be" */
    const drape_param *params;
    int param_count;
    const double *values;
    const drape_choice *choice; /* what the scene said */
    bool (*ignores)(const drape_chosen *chosen, const char *name);
} cli_chosen;

#define CLI_CHOSEN 2
void cli_chosen_entries(const drape_sim *sim, cli_chosen entries[CLI_CHOSEN]);

/* Contact, self-contact and the untangling of the start, if the scene has them, in the same form. */
typedef struct cli_contact_entries {
    int count;
    cli_chosen entries[3];
    double values[3][DRAPE_MAX_PARAMS];
} cli_contact_entries;
void cli_contact(const drape_sim *sim, cli_contact_entries *out);

/* Whether the scene gave the parameter. */
bool cli_is_given(const drape_choice *choice, const char *name);

/* The text that the scene gave for a parameter; "" if none. */
const char *cli_text_of(const drape_choice *choice, const char *name);

/* A share of the residual, Jacobian, factor and solve of one Newton iteration [1]. */
double cli_share(const cli_info *info, double seconds);

/* The name of the cloth or the seam whose term it is. */
const char *cli_owner(const drape_model *model, const drape_term *term);

/* The time of assembling besides the terms: clearing, masses. */
double cli_other_residual_seconds(const cli_info *info);
double cli_other_jacobian_seconds(const cli_info *info);

void cli_info_text(const cli_info *info);    /* on stdout */
json_t *cli_info_json(const cli_info *info); /* a new reference; NULL: out of memory */

/* The value of a key in a def, a new reference; NULL: none is given, or out of memory. */
json_t *cli_key_json(const drape_scene_key *key, const void *def);

/* An object of a scene with the values of its def, those by default included; a new reference. */
json_t *cli_form_json(const drape_scene_object *form, const void *def);

/* Of a cloth, as in a scene, new references: its pins with the nodes that they select, the triangles that
 * carry them and the pivot about which they turn; its masses; its periodic edges; how it starts, NULL: at
 * rest. */
json_t *cli_pins_json(const cli_info *info, int32_t c);
json_t *cli_masses_json(const cli_info *info, int32_t c);
json_t *cli_periodic_json(const cli_info *info, int32_t c);
json_t *cli_start_json(const cli_info *info, int32_t c);
json_t *cli_render_mesh_json(const cli_info *info, int32_t c); /* NULL: none */

/* The histories of the scene. */
json_t *cli_histories_json(const cli_info *info);

/* The grid of a cloth, with its values; NULL if its mesh is not a grid. */
const drape_grid_ops *cli_grid_of(const drape_entry_def *def, double *values);

#endif
