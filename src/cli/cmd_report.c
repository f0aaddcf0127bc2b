/* cmd_report.c: `drape report`: a finished run as one HTML file that moves. */
#include "cli/cli.h"
#include "cli/signals.h"

#include "report/report.h"

#include <stdio.h>

#define DEFAULT_MEGABYTES 48
#define MOST_MEGABYTES    2000

typedef struct report_request {
    cli_command command;
    const char *out;
    int megabytes; /* 0: not said */
} report_request;

static const cli_option options[] = {
    {"out", CLI_TEXT, "FILE", "the page; default report.html in the folder of the run",
     offsetof(report_request, out), 0, NULL},
    {"megabytes", CLI_NUMBER, "N",
     "room for frames in the page, 48: where they need more, some are left out, evenly",
     offsetof(report_request, megabytes), MOST_MEGABYTES, NULL},
};

static int main_report(int argc, char **argv);

const drape_verb drape_verb_report = {
    .entry = {.name = "report", .summary = "a finished run as one HTML file that moves"},
    .operand = "RUN",
    .details = "Writes one HTML file of a run, the folder that `drape run SCENE --out RUN` wrote: the cloth "
               "in motion, plots of\n"
               "energies and steps under the same time, the summary and the scene. A browser shows it "
               "without a network.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .run = main_report,
};

static int write_report(const report_request *request)
{
    drape_context *ctx = NULL;
    drape_report_result result;
    bool input = false;
    const drape_report_def def = {
        .run = request->command.operand,
        .out = request->out,
        .most_bytes = (size_t)(request->megabytes ? request->megabytes : DEFAULT_MEGABYTES) * 1000000};
    if (cli_context_create(&ctx))
        return cli_misuse(request->command.verb, "out of memory");
    drape_status status = drape_report_write(ctx, &def, &result, &input);
    if (status == DRAPE_E_STOPPED)
        cli_tell_interrupted(request->command.verb);
    else if (status)
        fprintf(stderr, "%s\n", drape_context_message(ctx));
    else
        printf("report    %s, %.3g MB, %lld of %lld frames\n", result.path, (double)result.bytes / 1e6,
               (long long)result.kept, (long long)result.frames);
    drape_context_destroy(&ctx);
    if (status == DRAPE_E_STOPPED)
        return CLI_INTERRUPTED;
    return !status ? CLI_DONE : input ? CLI_BAD_INPUT : CLI_FAILED;
}

static int main_report(int argc, char **argv)
{
    report_request request = {.out = NULL};
    int code = cli_parse(&drape_verb_report, argc, argv, &request.command);
    if (code == CLI_GO_ON)
        code = write_report(&request);
    cli_command_free(&request.command);
    return code;
}
