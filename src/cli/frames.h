/* frames.h: where the frames that are drawn come from: a scene that is simulated, or the folder of a finished run. */
#ifndef DRAPE_CLI_FRAMES_H
#define DRAPE_CLI_FRAMES_H

#include "cli/cli.h"

#include "io/record.h"
#include "render/reel.h"

/* Which frames are wanted. */
typedef struct cli_frames_def {
    int every;                    /* each so many; with one: not asked */
    int one;                      /* the number of a single frame from 0; -1: all; CLI_LAST_FRAME */
    const drape_field_ops *field; /* NULL: none */
} cli_frames_def;

#define CLI_LAST_FRAME (-2)

bool cli_is_folder(const char *path);

typedef struct cli_source {
    const char *operand;
    char label[80]; /* for the picture */
    cli_scene in;
    drape_record run; /* of a folder; empty: the scene is simulated */
    drape_reel reel;  /* filled by cli_source_fill */
    bool incomplete;  /* the simulation stopped: its frames so far are there */
} cli_source;

/* Opens a scene or a run. CLI_GO_ON, or CLI_BAD_INPUT after the fault was printed. cli_source_free in any case. */
int cli_source_open(const cli_command *command, const char *operand, const cli_frames_def *def,
                    cli_source *out);
void cli_source_free(cli_source *source);

/* Reads or simulates the frames. CLI_GO_ON, also where the simulation stopped after the first frame, which is told on
 * stderr; or an exit code. */
int cli_source_fill(const cli_frames_def *def, cli_source *source);

#endif
