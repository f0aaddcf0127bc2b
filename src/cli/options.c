/* options.c: command lines and their help, by the option tables of the verbs. */
#include "cli/cli.h"

#include "base/param.h"
#include "render/shading.h"

#include <errno.h>
#include <getopt.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_OPTIONS 40
#define FIRST_VALUE 256 /* the value that getopt_long returns for option 0: above all characters */
#define HELP_VALUE  'h'

#define DEFAULT_SHADE "linen"

/* The options of every verb that takes a scene. Those with a pointer are short forms of --set. */
static const cli_option scene_options[] = {
    {"set", CLI_SET, "/POINTER=VALUE", "set a value of the scene by its JSON pointer; may be repeated"},
    {"duration", CLI_VALUE, "SECONDS", "simulated time", 0, 0, "/duration"},
    {"frame-rate", CLI_VALUE, "RATE", "frames per simulated second", 0, 0, "/frame_rate"},
    {"format", CLI_LIST, "A,B", "frame formats, instead of the scene's", 0, 0, "/output/formats"},
    {"accuracy", CLI_VALUE, "LENGTH",
     "choose method and step for this distance to the exact motion, as 1mm, or a share of the size, as 1e-2",
     0, 0, "/accuracy"},
    {"integrator", CLI_VALUE, "NAME", "time integrator", 0, 0, "/integrator/method"},
    {"dt", CLI_VALUE, "SECONDS", "nominal step", 0, 0, "/integrator/dt"},
    {"tolerance", CLI_VALUE, "NEWTONS", "bound on the residual of a step", 0, 0, "/integrator/tolerance"},
    {"linear-solver", CLI_VALUE, "NAME", "linear solver", 0, 0, "/integrator/linear_solver", true},
    {"controller", CLI_VALUE, "NAME", "step controller", 0, 0, "/controller/type"},
    {"threads", CLI_NUMBER, "N", "number of threads; the result does not depend on it",
     offsetof(cli_command, threads), 256},
};

/* The options of a verb: its own, then the scene's. */
typedef struct option_list {
    const cli_option *options[MAX_OPTIONS];
    bool given[MAX_OPTIONS];
    size_t count;
} option_list;

static option_list list_options(const drape_verb *verb)
{
    option_list list = {.count = 0};
    for (size_t i = 0; i < verb->option_count; i++)
        list.options[list.count++] = &verb->options[i];
    for (size_t i = 0; verb->takes_scene && i < sizeof scene_options / sizeof *scene_options; i++)
        list.options[list.count++] = &scene_options[i];
    return list;
}

/* ---- Help and errors ---- */

static void print_option(const char *name, const char *argument, const char *text)
{
    char left[64];
    snprintf(left, sizeof left, "--%s%s%s", name, argument ? " " : "", argument ? argument : "");
    printf("  %-24s %s\n", left, text);
}

void cli_operand_text(const drape_verb *verb, char *text, size_t size)
{
    snprintf(text, size, verb->operand_optional ? "[%s]" : "%s", verb->operand);
}

void cli_print_help(const drape_verb *verb)
{
    const option_list list = list_options(verb);
    char operand[64];
    cli_operand_text(verb, operand, sizeof operand);
    printf("usage: drape %s %s [options]\n\n%s\n\n", verb->entry.name, operand, verb->details);
    for (size_t i = 0; i < list.count; i++)
        print_option(list.options[i]->name, list.options[i]->argument, list.options[i]->help);
    print_option("help", NULL, "this text");
}

const char *cli_shown(char *out, size_t size, const char *text)
{
    snprintf(out, size, "%s", text);
    drape_make_printable(out);
    return out;
}

int cli_misuse(const char *verb, const char *format, ...)
{
    char text[DRAPE_MESSAGE_SIZE];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    drape_make_printable(text);
    fprintf(stderr, "drape %s: %s\n", verb, text);
    return CLI_BAD_INPUT;
}

void cli_print_message(const cli_command *command, const char *message)
{
    bool placed = false;
    for (int i = 0; i < command->operand_count; i++) {
        const size_t length = strlen(command->operands[i]);
        placed |= strncmp(message, command->operands[i], length) == 0 &&
                  (message[length] == ':' || message[length] == '/');
    }
    if (placed)
        fprintf(stderr, "%s\n", message);
    else
        cli_misuse(command->verb, "%s", message);
}

/* A failure of a call whose wait a signal ended is reported as an interruption. */
int cli_report(const cli_command *command, int code)
{
    if (cli_interrupted() && code != CLI_INTERRUPTED)
        return cli_report_interrupted(command->verb);
    cli_print_message(command, drape_context_message(command->ctx));
    return command->ctx->status == DRAPE_E_MEMORY ? CLI_FAILED : code;
}

int cli_report_memory(const cli_command *command)
{
    drape_fail(command->ctx, DRAPE_E_MEMORY, "out of memory");
    return cli_report(command, CLI_FAILED);
}

int cli_print_json(const cli_command *command, json_t *value, size_t flags)
{
    char *text = value ? json_dumps(value, flags | JSON_ENCODE_ANY) : NULL;
    const bool whole = text && !drape_memory_ran_out();
    if (whole)
        puts(text);
    free(text);
    json_decref(value);
    return whole ? CLI_DONE : cli_report_memory(command);
}

static int unknown_option(const drape_verb *verb, const option_list *list, const char *given)
{
    const char *names[MAX_OPTIONS + 1];
    char word[64];
    for (size_t i = 0; i < list->count; i++)
        names[i] = list->options[i]->name;
    names[list->count] = "help";
    snprintf(word, sizeof word, "%.*s", (int)strcspn(given + strspn(given, "-"), "="),
             given + strspn(given, "-"));
    const char *meant = drape_did_you_mean(word, names, list->count + 1);
    return cli_misuse(verb->entry.name, "there is no option \"%.60s\"; `drape %s --help` shows all%s%s%s",
                      given, verb->entry.name, meant ? "; did you mean \"--" : "", meant ? meant : "",
                      meant ? "\"?" : "");
}

int cli_find_shading(const cli_command *command, const char *name, int *index)
{
    return drape_registry_choose(command->ctx, &drape_shading_registry, "", name ? name : DEFAULT_SHADE,
                                 index)
               ? cli_misuse(command->verb, "--shade: %s", command->ctx->text)
               : CLI_GO_ON;
}

/* ---- Values ---- */

int cli_read_length(const cli_command *command, const char *option, const char *text, drape_distance *out)
{
    return drape_distance_read(text, out)
               ? CLI_GO_ON
               : cli_misuse(command->verb, "--%s \"%.60s\": must be %s", option, text, DRAPE_DISTANCE_FORM);
}

static int add_setting(cli_command *command, const cli_option *option, const char *pointer, const char *value)
{
    if (!pointer || !value)
        return cli_report_memory(command);
    command->settings[command->setting_count++] = (cli_setting){
        .option = option->name, .pointer = pointer, .value = value, .must_act = option->must_act};
    return CLI_GO_ON;
}

/* "a,b" -> ["a","b"]; "" -> [] */
static int add_list(cli_command *command, const cli_option *option, const char *argument)
{
    errno = 0;
    json_t *array = json_array();
    bool good = array != NULL, more = *argument != 0;
    for (const char *word = argument; good && more;) {
        size_t length = strcspn(word, ",");
        good = json_array_append_new(array, json_stringn_nocheck(word, length)) == 0;
        more = word[length] != 0;
        word += length + 1;
    }
    char *text = good ? json_dumps(array, JSON_COMPACT) : NULL;
    json_decref(array);
    if (!text && drape_memory_ran_out())
        return cli_report_memory(command);
    if (!text)
        return cli_misuse(command->verb, "--%s \"%.60s\": must be names separated by commas, in UTF-8",
                          option->name, argument);
    int code = add_setting(command, option, option->pointer, drape_arena_text(command->arena, text));
    free(text);
    return code;
}

static int set_option(cli_command *command, const cli_option *option, const char *argument)
{
    void *value = (char *)command + option->offset;
    cli_texts *texts = value;
    char *end, *pointer;
    const char *equals;
    errno = 0;
    switch (option->kind) {
    case CLI_FLAG:
        *(bool *)value = true;
        return CLI_GO_ON;
    case CLI_TEXT:
        *(const char **)value = argument;
        return *argument ? CLI_GO_ON
                         : cli_misuse(command->verb, "--%s \"\": a name of at least one letter is needed",
                                      option->name);
    case CLI_TEXTS:
        if (texts->count == CLI_MAX_TEXTS)
            return cli_misuse(command->verb, "--%s is given more than %d times", option->name, CLI_MAX_TEXTS);
        texts->items[texts->count++] = argument;
        return CLI_GO_ON;
    case CLI_NUMBER: {
        const long number = strtol(argument, &end, 10);
        *(int *)value = (int)number;
        return end == argument || *end || errno || number < 1 || number > option->max
                   ? cli_misuse(command->verb, "--%s \"%.60s\": must be an integer, 1 to %d", option->name,
                                argument, option->max)
                   : CLI_GO_ON;
    }
    case CLI_REAL: {
        const char *rest = drape_number_read(argument, value);
        return !rest || *rest || !(*(double *)value > 0 && *(double *)value < 1e300)
                   ? cli_misuse(command->verb, "--%s \"%.60s\": must be a number above 0", option->name,
                                argument)
                   : CLI_GO_ON;
    }
    case CLI_VALUE:
        return add_setting(command, option, option->pointer, argument);
    case CLI_LIST:
        return add_list(command, option, argument);
    case CLI_SET:
        equals = strchr(argument, '=');
        if (*argument != '/' || !equals)
            return cli_misuse(command->verb,
                              "--%s \"%.60s\": must be /pointer=value, such as /integrator/dt=0.001",
                              option->name, argument);
        pointer = drape_arena_text(command->arena, argument);
        if (pointer)
            pointer[equals - argument] = 0;
        return add_setting(command, option, pointer, equals + 1);
    }
    return CLI_BAD_INPUT;
}

/* ---- Command lines ---- */

/* Handles one result of getopt_long. Only a repeatable option may be given twice: otherwise the first value
 * would be lost silently. */
static int handle(const drape_verb *verb, option_list *list, int code, char **argv, cli_command *request)
{
    if (code == HELP_VALUE) {
        cli_print_help(verb);
        return CLI_DONE;
    }
    if (code >= FIRST_VALUE) {
        const size_t index = (size_t)(code - FIRST_VALUE);
        const cli_option *option = list->options[index];
        if (list->given[index] && option->kind != CLI_SET && option->kind != CLI_TEXTS)
            return cli_misuse(verb->entry.name, "--%s is given twice", option->name);
        list->given[index] = true;
        return set_option(request, option, optarg);
    }
    if (code == ':')
        return cli_misuse(verb->entry.name, "%s needs an argument; `drape %s --help` shows all",
                          argv[optind - 1], verb->entry.name);
    if (optopt >= FIRST_VALUE || optopt == HELP_VALUE)
        return cli_misuse(verb->entry.name, "\"%.60s\": this option takes no argument", argv[optind - 1]);
    if (optopt) {
        const char letter[] = {'-', (char)optopt, 0};
        return unknown_option(verb, list, letter);
    }
    return unknown_option(verb, list, argv[optind - 1]);
}

int cli_parse(const drape_verb *verb, int argc, char **argv, cli_command *request)
{
    struct option table[MAX_OPTIONS + 2] = {{0}};
    option_list list = list_options(verb);
    int code, result = CLI_GO_ON;
    request->verb = verb->entry.name;
    if (verb->missing && !(argc > 1 && (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0)))
        return cli_misuse(verb->entry.name, "%s", verb->missing);
    request->settings = drape_arena_take(request->arena, (size_t)argc, sizeof *request->settings);
    if (!request->settings)
        return cli_report_memory(request);
    for (size_t i = 0; i < list.count; i++)
        table[i] = (struct option){.name = list.options[i]->name,
                                   .has_arg = list.options[i]->argument ? required_argument : no_argument,
                                   .val = FIRST_VALUE + (int)i};
    table[list.count] = (struct option){.name = "help", .has_arg = no_argument, .val = HELP_VALUE};
    opterr = 0;
    optind = 1;
    while (result == CLI_GO_ON && (code = getopt_long(argc, argv, ":h", table, NULL)) != -1)
        result = handle(verb, &list, code, argv, request);
    if (result != CLI_GO_ON)
        return result;
    const int count = argc - optind, max = verb->max_operands ? verb->max_operands : 1;
    if (count > max && max > 1)
        return cli_misuse(verb->entry.name, "at most %d arguments are allowed, %d are given", max, count);
    if (count > max)
        return cli_misuse(verb->entry.name, "one %s is allowed, %d are given: \"%.60s\", \"%.60s\"%s",
                          verb->operand, count, argv[optind], argv[optind + 1], count > 2 ? " ..." : "");
    if (count < 1 && !verb->operand_optional)
        return cli_misuse(verb->entry.name, "%s is missing; `drape %s --help` shows all", verb->operand,
                          verb->entry.name);
    request->operand = count ? argv[optind] : NULL;
    request->operands = argv + optind;
    request->operand_count = count;
    return CLI_GO_ON;
}
