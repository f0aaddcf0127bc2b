/* shapes.h: what `drape modes` and `drape path` share: the state of a scene that they look at, --state, and
 * folders with frames that are not moments of a motion: modes, and the points of a path. `drape render` draws
 * them as the frames of a run. */
#ifndef DRAPE_CLI_SHAPES_H
#define DRAPE_CLI_SHAPES_H

#include "cli/cli.h"
#include "io/recorder.h"

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

typedef struct cli_shapes {
    const char *folder;
    const char *table; /* that the caller writes into it */
    int64_t frames;    /* at most */
} cli_shapes;

/* Refuses a folder whose scene.json is the scene itself if options change it. NULL: there is no folder.
 * Returns CLI_GO_ON, or the exit code after a line was printed. */
int cli_shapes_check(const cli_command *command, const char *folder);

/* Opens the folder for frames in the scene's formats and in npy, and copies the scene. Destroy the recorder
 * in any case. Errors: those of drape_recorder_create and drape_scene_copy. */
drape_status cli_shapes_open(const cli_command *command, const cli_scene *in, const cli_shapes *shapes,
                             drape_recorder **out);

/* Writes the present state as the frame of that number. */
drape_status cli_shapes_emit(drape_sim *sim, int64_t frame);

#endif
