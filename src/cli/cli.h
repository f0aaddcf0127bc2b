/* cli.h: what the verbs of the program share: the table of verbs, command lines, scenes, exit codes, output.
 *
 * A verb is one file, cmd_<verb>.c, and one name in meson.build. Results go to stdout, messages and progress
 * to stderr. The library never prints. */
#ifndef DRAPE_CLI_CLI_H
#define DRAPE_CLI_CLI_H

#include "base/arena.h"
#include "base/distance.h"
#include "base/registry.h"
#include "io/record.h"
#include "sim/sim.h"

#include <jansson.h>

/* ---- Exit codes ---- */

enum {
    CLI_GO_ON = -1, /* not an exit code: the verb continues */
    CLI_DONE = 0,
    CLI_FAILED = 1,       /* the simulation, a check or the output failed, or memory ran out */
    CLI_BAD_INPUT = 2,    /* the scene or the command line is wrong; nothing was written */
    CLI_INTERRUPTED = 130 /* interrupted by a signal */
};

/* ---- Command lines ---- */

typedef enum cli_kind {
    CLI_FLAG,   /* a bool */
    CLI_TEXT,   /* a const char *, not empty */
    CLI_TEXTS,  /* a cli_texts: the option may be repeated */
    CLI_NUMBER, /* an int from 1 to max */
    CLI_REAL,   /* a double above 0 */
    CLI_VALUE,  /* a value of the scene, at pointer */
    CLI_LIST,   /* a list of the scene, at pointer: names separated by commas */
    CLI_SET     /* any value of the scene: "/pointer=value" */
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
    bool must_act;       /* VALUE: drape run refuses it if the integrator has no such parameter */
} cli_option;

/* A scene value of the command line. */
typedef struct cli_setting {
    const char *option; /* its name on the command line */
    const char *pointer, *value;
    bool must_act; /* the option's */
} cli_setting;

/* The part of a command line that all verbs have. The request of a verb begins with it. */
typedef struct cli_command {
    drape_arena *arena; /* memory until the verb returns; its context stops if the program is
                           interrupted */
    drape_context *ctx; /* of the arena */
    const char *verb;
    const char *operand; /* the first; NULL: none was given */
    char **operands;     /* (operand_count) */
    int operand_count;
    cli_setting *settings;
    size_t setting_count;
    int threads; /* 0: not given */
} cli_command;

typedef struct drape_verb {
    drape_entry entry;   /* summary: a line in the list of verbs */
    const char *operand; /* "SCENE" in the help */
    bool operand_optional;
    int max_operands;    /* 0: one */
    bool takes_scene;    /* has the options that change a scene */
    const char *missing; /* what the build lacks to run the verb; NULL: nothing */
    const char *details; /* lines of its help */
    const cli_option *options;
    size_t option_count;
    size_t request_size;             /* of the struct that the options are read into */
    int (*run)(const void *request); /* returns the exit code */
} drape_verb;

/* The members of a verb for an array of options that are read into a struct of this type. */
#define CLI_OPTIONS(array, type)                                                                             \
    .options = (array), .option_count = sizeof(array) / sizeof *(array), .request_size = sizeof(type)

extern const drape_verb *const drape_verbs[]; /* NULL-ended */
extern const drape_registry drape_verb_registry;

void cli_print_help(const drape_verb *verb); /* on stdout */

/* The operand as help shows it: in brackets if it is optional. */
void cli_operand_text(const drape_verb *verb, char *text, size_t size);

/* Reads a command line into a request, in which all but arena and ctx is zero. Returns CLI_GO_ON, or the exit
 * code after help or an error was printed. */
int cli_parse(const drape_verb *verb, int argc, char **argv, cli_command *request);

/* Prints one line "drape run: text" on stderr. Returns CLI_BAD_INPUT. */
int cli_misuse(const char *verb, const char *format, ...) DRAPE_PRINTF(2, 3);

/* Reads the value of an option, a length [m] or a share [1] of the diagonal of a cloth's box at rest. Returns
 * CLI_GO_ON, or CLI_BAD_INPUT after the error was printed. */
int cli_read_length(const cli_command *command, const char *option, const char *text, drape_distance *out);

/* A text of the user, such as a name, as it may be printed: shortened to 255 bytes, or to the given size. To
 * be used as in printf("%s", CLI_SHOWN(name)). */
#define CLI_SHOWN(text) cli_shown((char[256]){0}, 256, text)
const char *cli_shown(char *out, size_t size, const char *text);

/* Prints a message of the library on stderr: as it is if it begins with an operand, as
 * "scene.json:6:26: /cloth/0: text" does, else behind "drape VERB: ". */
void cli_print_message(const cli_command *command, const char *message);

/* Prints the message of the command's context by cli_print_message. Returns the given exit code, but
 * CLI_FAILED if memory ran out: the input may be good. */
int cli_report(const cli_command *command, int code);

/* Reports that memory ran out where no message says so. Returns CLI_FAILED. */
int cli_report_memory(const cli_command *command);

/* Prints a value, whose reference it takes over: all of it or a message. The caller has set errno to 0 before
 * it made the value. Returns the exit code. */
int cli_print_json(const cli_command *command, json_t *value, size_t flags);

/* Finds a shading by its name; NULL: the default one. Returns CLI_GO_ON, or CLI_BAD_INPUT after the error was
 * printed. */
int cli_find_shading(const cli_command *command, const char *name, int *index);

/* An estimate of the error of a run, as text. */
void cli_accuracy_text(const drape_model *model, const drape_accuracy *accuracy, char *text, size_t size);

/* ---- Pictures ---- */

/* A frame of a run, its nodes coloured by distances. */
typedef struct cli_drawing {
    const char *out; /* the PNG */
    char *folder;    /* of the run */
    int64_t frame;
    const double *distances; /* (nodes) [m] */
} cli_drawing;

/* Draws it as `drape render` does, where that verb lacks nothing. Returns CLI_DONE, or the exit code after a
 * line was printed. */
int cli_draw_distances(const cli_command *command, const cli_drawing *drawing);

/* ---- Ctrl-C, SIGTERM and SIGHUP: they request a stop, which all stages of a verb check for ---- */

/* After this call the first signal is recorded, and from then on no call of the system waits for longer
 * than a hundredth of a second, such as a read of a scene from a pipe or a write to one; a second signal
 * ends the program at once. */
void cli_catch_signals(void);

bool cli_interrupted(void);
bool cli_interrupted_by(void *unused); /* the same as a callback of the library */

/* Sets the sim whose step in progress is cancelled half a second after a signal, unless it completes before.
 * NULL: none. */
void cli_signals_cancel(drape_sim *sim);

/* Prints the line "drape run: interrupted" on stderr. Returns CLI_INTERRUPTED. */
int cli_report_interrupted(const char *verb);

/* ---- Progress: a line on the terminal. If stderr is not a terminal, an experiment adds a line every five
 * minutes to it, and others nothing ---- */

typedef struct cli_progress {
    bool on;             /* stderr is a terminal */
    bool logs;           /* it is not, and lines are added to it; set by the caller */
    double from, end;    /* simulated time at the beginning and the end [s] */
    double start, shown; /* clock at the beginning and at the last update [s] */
    int width;           /* columns of the line */
} cli_progress;

/* Of a run of the sim up to the simulated time `end`; NULL: of a sweep, whose progress is a number of
 * cases. */
void cli_progress_begin(cli_progress *progress, const drape_sim *sim, double end);
/* Shows the simulated time; updates at most ten times a second, as cli_progress_count does. */
void cli_progress_show(cli_progress *progress, const drape_sim *sim);
/* Shows the number of cases; total 0: their reference is being computed. */
void cli_progress_count(cli_progress *progress, int64_t done, int64_t total, double seconds_left);
/* Erases the line until it is shown again, for other output on the terminal; or for good. */
void cli_progress_hide(cli_progress *progress);
void cli_progress_clear(cli_progress *progress);

/* ---- Scenes ---- */

/* A scene that is ready to run, in the context of its command. All members NULL: no scene. */
typedef struct cli_scene {
    drape_context *ctx;
    drape_scene *scene;
    drape_model *model;
    drape_model *whole; /* of which the model is the part of one rank (cli/cli_ranks.h); NULL: it is whole */
    drape_sim *sim;
} cli_scene;

/* Loads a scene, applies the settings, compiles it, checks the formats of the output and makes a sim. Writes
 * no file. Returns CLI_GO_ON, or CLI_BAD_INPUT or CLI_INTERRUPTED after a line was printed. Call
 * cli_scene_free in any case. */
int cli_scene_load(const cli_command *command, const char *path, cli_scene *out);

/* The same; once the scene is compiled, `choose` may change it, and how the sim will run. */
typedef drape_status cli_choose(void *user, const cli_scene *scene, drape_sim_def *def);
int cli_scene_load_with(const cli_command *command, const char *path, cli_choose *choose, void *user,
                        cli_scene *out);
void cli_scene_free(cli_scene *scene);

bool cli_is_folder(const char *path);

/* Loads the scene of a finished run from its folder and opens its frames; settings are refused. Returns as
 * cli_scene_load does. Call cli_scene_free and drape_record_close in any case. */
int cli_run_load(const cli_command *command, const char *folder, cli_scene *out, drape_record *run);

#endif
