/* choose.h: chooses integrator and controller by name, with their parameters. The parameters of all entries
 * of a table are accepted as keys; those that the chosen entry does not have are ignored. */
#ifndef DRAPE_SIM_CHOOSE_H
#define DRAPE_SIM_CHOOSE_H

#include "control/control.h"

/* The integrator and controller of a sim, with their parameters. */
typedef struct drape_chosen {
    const drape_integrator_ops *integrator;
    const drape_controller_ops *controller;
    double integrator_values[DRAPE_MAX_PARAMS], controller_values[DRAPE_MAX_PARAMS];
    bool usual; /* neither scene nor def says anything of the integrator */
} drape_chosen;

/* The scene's choices, overridden by def. NULL: they are only checked, without the
 * warnings that a sim gives of what is gone. Errors are reported at "/integrator/..." and
 * "/controller/...". */
drape_status drape_choose(drape_context *ctx, const drape_model *model, const drape_sim_def *def,
                          drape_chosen *chosen);

/* Refuses a model that the chosen integrator cannot take, at "/integrator/method". */
drape_status drape_chosen_check(drape_context *ctx, const drape_chosen *chosen, const drape_model *model);

/* The value of the named parameter; fallback if there is no such parameter. */
double drape_chosen_integrator_value(const drape_chosen *chosen, const char *name, double fallback);
double drape_chosen_controller_value(const drape_chosen *chosen, const char *name, double fallback);

/* Whether the scene gave a setting that the chosen integrator or controller ignores. */
bool drape_chosen_ignores_integrator(const drape_chosen *chosen, const char *name);
bool drape_chosen_ignores_controller(const drape_chosen *chosen, const char *name);

#endif
