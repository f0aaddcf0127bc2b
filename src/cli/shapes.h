/* shapes.h: folders with frames that are not moments of a motion: modes, and the points of a path. `drape
 * render` draws them as the frames of a run. */
#ifndef DRAPE_CLI_SHAPES_H
#define DRAPE_CLI_SHAPES_H

#include "cli/cli.h"
#include "io/recorder.h"

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
