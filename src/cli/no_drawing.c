/* no_drawing.c: stands for the verbs that draw, in a build without the libraries that they need. */
#include "cli/cli.h"

#define MISSING                                                                                              \
    "this drape was built without drawing: install Debian's libepoxy-dev, libpng-dev and libglfw3-dev, and " \
    "rebuild with -Drender=enabled"

int cli_draw_distances(const cli_command *command, const cli_drawing *drawing)
{
    (void)drawing;
    return cli_misuse(command->verb, MISSING);
}

extern const drape_verb drape_verb_render, drape_verb_view;

const drape_verb drape_verb_render = {
    .entry = {.name = "render", .summary = "draw pictures and films: not in this build"},
    .operand = "SCENE|RUN",
    .missing = MISSING,
    .details = "This drape was built without drawing.",
    .request_size = sizeof(cli_command)};

const drape_verb drape_verb_view = {.entry = {.name = "view", .summary = "open a window: not in this build"},
                                    .operand = "SCENE",
                                    .missing = MISSING,
                                    .details = "This drape was built without drawing.",
                                    .request_size = sizeof(cli_command)};
