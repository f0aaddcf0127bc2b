/* cmd_info.c: `drape info`: show what a scene models and what it costs, as JSON or for reading: a line for
 * each value, in the order of the object. Lists are in one line, but those of objects with names. Empty lists
 * are left out. */
#include "cli/form.h"
#include "cli/info.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define COLUMN      28  /* of the values */
#define MAX_WRITTEN 200 /* bytes of a value; --json has all of it */

typedef struct info_request {
    cli_command command;
    bool json;
} info_request;

typedef struct line {
    char text[MAX_WRITTEN + 1];
    size_t length; /* above MAX_WRITTEN: the text is cut */
} line;

DRAPE_PRINTF(2, 3) static void add(line *to, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    if (to->length < sizeof to->text)
        to->length += (size_t)vsnprintf(to->text + to->length, sizeof to->text - to->length, format, args);
    va_end(args);
}

static void add_value(line *to, json_t *value)
{
    const char *key, *unit = json_string_value(json_object_get(value, "unit")), *separator = "";
    json_t *part = json_object_get(value, "value");
    size_t i;
    if (cli_is_described(value)) {
        add_value(to, part);
        if (strcmp(unit, "1") != 0 && (json_is_number(part) || json_is_array(part)))
            add(to, " %s", unit);
        add(to, "%s", json_is_true(json_object_get(value, "default")) ? " (default)" : "");
    } else if (json_is_object(value)) {
        json_object_foreach(value, key, part)
        {
            add(to, "%s%s ", *separator ? separator : "{", key);
            add_value(to, part);
            separator = ", ";
        }
        add(to, "}");
    } else if (json_is_array(value) && json_array_size(value) > 0) {
        json_array_foreach(value, i, part)
        {
            add(to, "%s", i ? ", " : "[");
            add_value(to, part);
        }
        add(to, "]");
    } else if (json_is_number(value)) {
        add(to, json_is_real(value) ? "%.9g" : "%.0f", json_number_value(value));
    } else if (json_is_boolean(value)) {
        add(to, json_is_true(value) ? "true" : "false");
    } else {
        add(to, "%s", json_string_length(value) > 0 ? json_string_value(value) : "none");
    }
}

/* The costs of the terms as a table, as a reader compares them. They leave the terms. */
static void print_costs(json_t *terms)
{
    static const char *const columns[] = {"elements",   "nonzeros",   "bytes",
                                          "residual_s", "jacobian_s", "share"};
    const size_t count = sizeof columns / sizeof *columns;
    json_t *term;
    size_t i;
    printf("%-36s", "");
    for (size_t k = 0; k < count; k++)
        printf(" %10s", columns[k]);
    puts("");
    json_array_foreach(terms, i, term)
    {
        const char *cloth = json_string_value(json_object_get(term, "cloth")),
                   *owner = cloth ? cloth : json_string_value(json_object_get(term, "seam"));
        printf("  %-20s %-13s", json_string_value(json_object_get(term, "name")),
               cli_shown((char[14]){0}, 14, owner));
        for (size_t k = 0; k < count; k++) {
            const json_t *cost = json_object_get(term, columns[k]);
            printf(json_is_integer(cost) ? " %10.0f" : " %10.3g", json_number_value(cost));
            json_object_del(term, columns[k]);
        }
        puts("");
    }
}

static void print_object(int indent, json_t *object);

/* A heading, and the blocks of a list below their names. */
static void print_block(int indent, const char *heading, json_t *block)
{
    json_t *item;
    size_t i;
    printf("%*s%s\n", indent, "", CLI_SHOWN(heading));
    if (indent == 0 && strcmp(heading, "terms") == 0)
        print_costs(block);
    if (json_is_object(block))
        print_object(indent + 2, block);
    json_array_foreach(block, i, item)
        print_block(indent + 2, json_string_value(json_object_get(item, "name")), item);
}

static void print_object(int indent, json_t *object)
{
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value)
    {
        line to = {.length = 0};
        if (strcmp(key, "parameters") == 0) {
            print_object(indent, value);
        } else if ((json_is_object(value) && !cli_is_described(value)) ||
                   json_is_string(json_object_get(json_array_get(value, 0), "name"))) {
            fputs(indent ? "" : "\n", stdout);
            print_block(indent, key, value);
        } else if ((strcmp(key, "name") != 0 || cli_is_described(value)) &&
                   (!json_is_array(value) || json_array_size(value) > 0)) {
            add_value(&to, value);
            printf("%*s%-*s %s%s\n", indent, "", COLUMN - indent, key, CLI_SHOWN(to.text),
                   to.length > MAX_WRITTEN ? " ..." : "");
        }
    }
}

static int print(const cli_command *command, bool json, json_t *object)
{
    if (json) {
        cli_make_plain(object);
        return cli_print_json(command, object, JSON_INDENT(2) | JSON_REAL_PRECISION(15) | JSON_ENSURE_ASCII);
    }
    const bool whole = object && !drape_memory_ran_out();
    if (whole)
        print_object(0, object);
    json_decref(object);
    return whole ? CLI_DONE : cli_report_memory(command);
}

static int run(const void *command)
{
    const info_request *request = command;
    cli_scene in;
    json_t *object;
    int code = cli_scene_load(&request->command, request->command.operand, &in);
    if (code == CLI_GO_ON)
        code = cli_info_json(&request->command, &in, !request->json, &object)
                   ? cli_report(&request->command, CLI_FAILED)
                   : print(&request->command, request->json, object);
    cli_scene_free(&in);
    return code;
}

static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "print the same as JSON", offsetof(info_request, json)},
};

const drape_verb drape_verb_info = {
    .entry = {.name = "info", .summary = "show what a scene models and what it costs"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Shows what a scene models, every parameter with its value, and what each part costs: elements,\n"
        "nonzeros, bytes, and its share of one Newton iteration, measured at a slightly deformed state.",
    CLI_OPTIONS(options, info_request),
    .run = run,
};
