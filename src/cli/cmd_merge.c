/* cmd_merge.c: `drape merge`: the shards of a sweep as one, with its report. */
#include "cli/lab.h"

#include "drape/lab.h"

#include <stdio.h>

typedef struct merge_request {
    cli_command command;
    const char *out;
} merge_request;

static const cli_option options[] = {
    {"out", CLI_TEXT, "DIR", "folder for all lines and the report", offsetof(merge_request, out), 0, NULL},
};

static int main_merge(int argc, char **argv);

const drape_verb drape_verb_merge = {
    .name = "merge",
    .operand = "DIR...",
    .operands_most = 100000,
    .summary = "the shards of a sweep into one, with its report",
    .details =
        "Takes the results of the folders of an experiment that ran in parts (--shard I/N), and makes the\n"
        "report once all cases are done. Says how many are missing otherwise.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .run = main_merge,
};

static int merge(const merge_request *request)
{
    drape_context *ctx = NULL;
    drape_lab_outcome outcome;
    if (!request->out)
        return cli_misuse("merge", "--out is missing: the folder for the report");
    if (cli_context_create(&ctx))
        return cli_misuse("merge", "out of memory");
    drape_status status = drape_lab_merge(ctx, (const char *const *)request->command.operands,
                                          (size_t)request->command.operand_count, request->out, &outcome);
    bool whole = outcome.done == outcome.cases;
    int code = cli_lab_conclude(ctx, status, &outcome);
    drape_context_destroy(&ctx);
    return code == CLI_DONE && !whole ? CLI_FAILED : code;
}

static int main_merge(int argc, char **argv)
{
    merge_request request = {.out = NULL};
    int code = cli_parse(&drape_verb_merge, argc, argv, &request.command);
    if (code == CLI_GO_ON)
        code = merge(&request);
    cli_command_free(&request.command);
    return code;
}
