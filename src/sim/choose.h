/* choose.h: integrator and controller by name, with their parameters. Keys of any entry of the table are
 * accepted; those that the chosen one does not have are ignored. */
#ifndef DRAPE_SIM_CHOOSE_H
#define DRAPE_SIM_CHOOSE_H

#include "control/control.h"

/* What a sim runs with. */
typedef struct drape_chosen {
    const drape_integrator_ops *integrator;
    const drape_controller_ops *controller;
    double integrator_values[DRAPE_MAX_PARAMS], controller_values[DRAPE_MAX_PARAMS];
} drape_chosen;

/* The scene's choices, overridden by def if there is one. Faults are reported at "/integrator/..." and
 * "/controller/...". */
drape_status drape_choose(drape_context *ctx, const drape_model *model, const drape_sim_def *def,
                          drape_chosen *chosen);

/* The value of the parameter of that name; fallback if there is none. */
double drape_chosen_integrator_value(const drape_chosen *chosen, const char *name, double fallback);
double drape_chosen_controller_value(const drape_chosen *chosen, const char *name, double fallback);

/* Whether the chosen integrator or controller ignores a setting that the scene gave. */
bool drape_chosen_ignores_integrator(const drape_chosen *chosen, const char *name);
bool drape_chosen_ignores_controller(const drape_chosen *chosen, const char *name);

#endif
