/* state.c: see state.h. */
#include "cli/state.h"
#include "cli/signals.h"

#include <string.h>

static const cli_state states[] = {
    {"static", "static", true, 1},
    {"start", NULL, false, 0},
    {"end", NULL, true, 1},
};
#define STATES (sizeof states / sizeof *states)

int cli_state_find(const cli_command *command, const char *name, const cli_state **out)
{
    for (size_t i = 0; i < STATES; i++)
        if (strcmp(states[i].name, name) == 0) {
            *out = &states[i];
            return CLI_GO_ON;
        }
    return cli_misuse(command->verb, "--state \"%.60s\": it is static, start or end", name);
}

static drape_status choose(void *user, const cli_scene *scene, drape_sim_def *def)
{
    const cli_state *const *state = user;
    (void)scene;
    def->integrator = (*state)->integrator;
    return DRAPE_OK;
}

int cli_state_load(const cli_command *command, const cli_state *state, cli_scene *out)
{
    return cli_scene_load_with(command, command->operand, choose, &state, out);
}

drape_status cli_state_reach(const cli_state *state, const cli_scene *in)
{
    if (!state->advances)
        return DRAPE_OK;
    cli_signals_cancel(in->sim);
    drape_status status = drape_sim_advance(in->sim, drape_model_duration(in->model));
    cli_signals_cancel(NULL);
    return status == DRAPE_E_STOPPED && drape_sim_stopped_by(in->sim) >= 0 ? DRAPE_OK : status;
}
