/* cli.h: what the verbs of the program share: the table of verbs, command lines, scenes, exit codes, output.
 *
 * A verb is one file, cmd_<verb>.c, and one name in meson.build. Results go to stdout; messages and progress
 * go to stderr. The library never prints. */
#ifndef DRAPE_CLI_CLI_H
#define DRAPE_CLI_CLI_H

#include "base/registry.h"
#include "sim/sim.h"

/* ---- Exit codes
 * -------------------------------------------------------------------------------------------- */

enum {
    CLI_GO_ON = -1, /* no exit code: the verb goes on */
    CLI_DONE = 0,
    CLI_FAILED = 1,       /* the simulation, a check or the output */
    CLI_BAD_INPUT = 2,    /* a scene or a command line; nothing was written */
    CLI_INTERRUPTED = 130 /* by a signal */
};

/* ---- Command lines
 * ----------------------------------------------------------------------------------------- */

typedef enum cli_kind {
    CLI_FLAG,   /* a bool */
    CLI_TEXT,   /* a const char *, not empty */
    CLI_TEXTS,  /* a cli_texts: the option may be repeated */
    CLI_NUMBER, /* an int from 1 to max */
    CLI_REAL,   /* a double above 0 */
    CLI_VALUE,  /* of the scene, at pointer */
    CLI_LIST,   /* of the scene, at pointer: words between commas */
    CLI_SET     /* of the scene, "/pointer=value" */
} cli_kind;

#define CLI_MAX_TEXTS 16

typedef struct cli_texts {
    const char *items[CLI_MAX_TEXTS];
    size_t count;
} cli_texts;

typedef struct cli_option {
    const char *name; /* without the dashes */
    cli_kind kind;
    const char *argument; /* "DIR" in the help; NULL: a flag */
    const char *help;
    size_t offset;       /* FLAG, TEXT, TEXTS, NUMBER, REAL: in the verb's request */
    int max;             /* NUMBER */
    const char *pointer; /* VALUE, LIST */
    bool
        must_act; /* VALUE of the integrator: drape run refuses it where the chosen integrator has no such parameter */
} cli_option;

/* A scene value of the command line. */
typedef struct cli_setting {
    const char *option; /* its name on the command line */
    const char *pointer, *value;
    char *memory;  /* of either; NULL: none was needed */
    bool must_act; /* the option's */
} cli_setting;

/* What every command line has. A verb's request begins with it. */
typedef struct cli_command {
    const char *verb;
    const char *operand; /* NULL: none, where it may be left out */
    char **operands;     /* (operand_count) the first of them is operand */
    int operand_count;
    cli_setting *settings;
    size_t setting_count;
    int threads; /* 0: not said */
} cli_command;

typedef struct drape_verb {
    drape_entry entry;   /* summary: a line in the list of verbs */
    const char *operand; /* "SCENE" in the help */
    bool operand_optional;
    int operands_most;   /* 0: one */
    bool takes_scene;    /* the options that change a scene */
    const char *details; /* lines of its help */
    const cli_option *options;
    size_t option_count;
    int (*run)(int argc, char **argv); /* argv[0] is the verb; returns the exit code */
} drape_verb;

extern const drape_verb *const drape_verbs[]; /* NULL-ended */
extern const drape_registry drape_verb_registry;

void cli_print_help(const drape_verb *verb); /* on stdout */

/* What a verb is given, as help shows it: in brackets where it may be left out. */
void cli_operand_text(const drape_verb *verb, char *text, size_t size);

/* Reads a command line into a request, all zeros before. CLI_GO_ON, or the exit code after help or a fault
 * was printed. cli_command_free in any case. */
int cli_parse(const drape_verb *verb, int argc, char **argv, cli_command *request);
void cli_command_free(cli_command *command);

/* One line "drape run: text" on stderr. Returns CLI_BAD_INPUT. */
int cli_misuse(const char *verb, const char *format, ...) DRAPE_PRINTF(2, 3);

/* ---- Scenes
 * ------------------------------------------------------------------------------------------------ */

/* A context whose scenes, models and sims are given up where the program was interrupted (cli/signals.h). */
drape_status cli_context_create(drape_context **out);

/* A scene that is ready to run. All NULL: nothing. */
typedef struct cli_scene {
    drape_context *ctx;
    drape_scene *scene;
    drape_model *model;
    drape_sim *sim;
} cli_scene;

/* Loads the operand, applies the settings, compiles, checks the formats of the output, makes a sim. Writes no
 * file. CLI_GO_ON, CLI_BAD_INPUT or CLI_INTERRUPTED after a line was printed. cli_scene_free in any case. */
int cli_scene_load(const cli_command *command, cli_scene *out);
void cli_scene_free(cli_scene *scene);

/* The same of a file that is not the operand, or in a folder that drape run wrote. */
int cli_scene_load_from(const cli_command *command, const char *path, cli_scene *out);

#endif
