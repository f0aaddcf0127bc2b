/* cmd_report.c: `drape report`: make one animated HTML page of a finished run. */
#include "cli/cli.h"

#include "report/report.h"

#include <stdio.h>

#define DEFAULT_MEGABYTES 48
#define MAX_MEGABYTES     2000

typedef struct report_request {
    cli_command command;
    const char *out;
    int megabytes; /* 0: not given */
} report_request;

#define AT(member) offsetof(report_request, member)
static const cli_option options[] = {
    {"out", CLI_TEXT, "FILE", "the page; default report.html in the folder of the run", AT(out)},
    {"megabytes", CLI_NUMBER, "N",
     "room for frames in the page (default 48); if they need more, some are left out at equal intervals",
     AT(megabytes), MAX_MEGABYTES},
};

static int run(const void *command)
{
    const report_request *request = command;
    drape_report_result result;
    bool input = false;
    const drape_report_def def = {
        .run = request->command.operand,
        .out = request->out,
        .max_bytes = (size_t)(request->megabytes ? request->megabytes : DEFAULT_MEGABYTES) * 1000000};
    drape_status status = drape_report_write(request->command.ctx, &def, &result, &input);
    if (status)
        return cli_report(&request->command, input ? CLI_BAD_INPUT : CLI_FAILED);
    printf("report    %s, %.3g MB, %lld of %lld frames\n", CLI_SHOWN(result.path), (double)result.bytes / 1e6,
           (long long)result.kept, (long long)result.frames);
    return CLI_DONE;
}

const drape_verb drape_verb_report = {
    .entry = {.name = "report", .summary = "make one animated HTML page of a finished run"},
    .operand = "RUN",
    .details = "Writes one HTML file from RUN, the folder that `drape run SCENE --out RUN` wrote: the cloth "
               "in motion, plots of\nenergies and steps, the summary and the scene. A browser shows it "
               "without a network.",
    CLI_OPTIONS(options, report_request),
    .run = run,
};
