/* frames.h: the frames to be drawn, from a scene, which is simulated, or from the folder of a finished
 * run. */
#ifndef DRAPE_CLI_FRAMES_H
#define DRAPE_CLI_FRAMES_H

#include "cli/cli.h"

#include "io/record.h"
#include "render/reel.h"

/* Which frames are wanted. */
typedef struct cli_frames_def {
    int every;                    /* every n-th frame; not used with `one` */
    int one;                      /* number of a single frame, from 0; CLI_ALL_FRAMES; CLI_LAST_FRAME */
    const drape_field_ops *field; /* NULL: none */
} cli_frames_def;

enum { CLI_ALL_FRAMES = -1, CLI_LAST_FRAME = -2 };

typedef struct cli_source {
    const cli_command *command;
    const char *operand;
    char label[80]; /* name shown in the picture */
    cli_scene in;
    drape_record run; /* of a folder; without frames: the scene is simulated */
    drape_reel reel;  /* filled by cli_source_fill */
    bool incomplete;  /* the simulation stopped early: the reel has the frames up to then */
} cli_source;

/* Finds a shading by its name; NULL: the default one. Returns CLI_GO_ON, or CLI_BAD_INPUT after the error was
 * printed. */
int cli_find_shading(const cli_command *command, const char *name, int *index);

/* Opens a scene or a run. Returns CLI_GO_ON, or CLI_BAD_INPUT after the error was printed. The caller calls
 * cli_source_free in either case. */
int cli_source_open(const cli_command *command, const char *operand, const cli_frames_def *def,
                    cli_source *out);
void cli_source_free(cli_source *source);

/* Reads or simulates the frames. Returns an exit code, or CLI_GO_ON, also if the simulation stopped after the
 * first frame, which is reported on stderr. */
int cli_source_fill(const cli_frames_def *def, cli_source *source);

#endif
