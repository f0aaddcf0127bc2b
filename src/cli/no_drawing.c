/* no_drawing.c: stands for the verbs that draw in a program that was built without what they need. */
#include "cli/cli.h"
#include "cli/tables.h"

static int refuse(int argc, char **argv)
{
    (void)argc;
    return cli_misuse(argv[0],
                      "this drape was built without drawing: install Debian's libepoxy-dev, libpng-dev and "
                      "libglfw3-dev, and build anew with -Drender=enabled");
}

bool cli_shading_row(int index, cli_row *row)
{
    (void)index, (void)row;
    return false;
}

const drape_verb drape_verb_render = {.name = "render",
                                      .operand = "SCENE|RUN ...",
                                      .summary = "pictures and films: not in this build",
                                      .run = refuse};

const drape_verb drape_verb_view = {
    .name = "view", .operand = "SCENE", .summary = "a window: not in this build", .run = refuse};
