/* no_drawing.c: stands for the verbs that draw in a program that was built without what they need. */
#include "cli/cli.h"

#include <string.h>

extern const drape_verb drape_verb_render, drape_verb_view;

static int refuse(const drape_verb *verb, int argc, char **argv)
{
    if (argc > 1 && (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0)) {
        cli_print_help(verb);
        return CLI_DONE;
    }
    return cli_misuse(verb->entry.name,
                      "this drape was built without drawing: install Debian's libepoxy-dev, libpng-dev and "
                      "libglfw3-dev, and build anew with -Drender=enabled");
}

static int main_render(int argc, char **argv)
{
    return refuse(&drape_verb_render, argc, argv);
}

static int main_view(int argc, char **argv)
{
    return refuse(&drape_verb_view, argc, argv);
}

const drape_verb drape_verb_render = {
    .entry = {.name = "render", .summary = "pictures and films: not in this build"},
    .operand = "SCENE|RUN",
    .details = "This drape was built without drawing.",
    .run = main_render};

const drape_verb drape_verb_view = {.entry = {.name = "view", .summary = "a window: not in this build"},
                                    .operand = "SCENE",
                                    .details = "This drape was built without drawing.",
                                    .run = main_view};
