/* no_drawing.c: stands for the verbs that draw, in a build without the libraries that they need. */
#include "cli/cli.h"
#include "cli/tables.h"

#define MISSING                                                                                              \
    "this drape was built without drawing: install Debian's libepoxy-dev, libpng-dev and libglfw3-dev, and " \
    "build anew with -Drender=enabled"

bool cli_shading_row(int index, cli_row *row)
{
    (void)index, (void)row;
    return false;
}

const drape_verb drape_verb_render = {.name = "render",
                                      .operand = "SCENE|RUN",
                                      .missing = MISSING,
                                      .summary = "pictures and films: not in this build",
                                      .details = "This drape was built without drawing.",
                                      .request_size = sizeof(cli_command)};

const drape_verb drape_verb_view = {.name = "view",
                                    .operand = "SCENE",
                                    .missing = MISSING,
                                    .summary = "a window: not in this build",
                                    .details = "This drape was built without drawing.",
                                    .request_size = sizeof(cli_command)};
