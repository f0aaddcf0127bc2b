/* state.h: the state of a scene that a verb looks at: --state. */
#ifndef DRAPE_CLI_STATE_H
#define DRAPE_CLI_STATE_H

#include "cli/cli.h"

typedef struct cli_state {
    const char *name;
    const char *integrator; /* NULL: the scene's */
    bool advances;
    double load_factor; /* of the scene's loads, under which it is an equilibrium */
} cli_state;

/* The choices of --state as its help shows them. */
#define CLI_STATES                                                                                           \
    "static: the equilibrium that this integrator finds; start: as the scene begins; end: as it ends"

/* Looks a name up. Returns CLI_GO_ON, or the exit code after a line was printed. */
int cli_state_find(const cli_command *command, const char *name, const cli_state **out);

/* Loads the command's scene, as cli_scene_load does, for that state. */
int cli_state_load(const cli_command *command, const cli_state *state, cli_scene *out);

/* Advances the sim to the state. Errors: those of drape_sim_advance. */
drape_status cli_state_reach(const cli_state *state, const cli_scene *in);

#endif
