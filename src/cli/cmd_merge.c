/* cmd_merge.c: `drape merge`: the shards of a sweep as one, with its report. */
#include "cli/lab.h"

#include "drape/lab.h"

#include <stdio.h>

typedef struct merge_request {
    cli_command command;
    const char *out;
} merge_request;

static const cli_option options[] = {
    {"out", CLI_TEXT, "DIR", "folder for the merged results and the report", offsetof(merge_request, out)},
};

static int merge(const void *command)
{
    const merge_request *request = command;
    drape_lab_outcome outcome;
    if (!request->out)
        return cli_misuse("merge", "--out is missing: the folder for the report");
    drape_status status =
        drape_lab_merge(request->command.ctx, (const char *const *)request->command.operands,
                        (size_t)request->command.operand_count, request->out, &outcome);
    bool whole = outcome.done == outcome.cases;
    int code = cli_lab_conclude(&request->command, status, &outcome);
    return code == CLI_DONE && !whole ? CLI_FAILED : code;
}

const drape_verb drape_verb_merge = {
    .entry = {.name = "merge", .summary = "merge the shards of a sweep, and make its report"},
    .operand = "DIR...",
    .max_operands = 100000,
    .details = "Merges the results of an experiment that ran in parts (--shard I/N), and makes the report "
               "once all\ncases are done. If some are missing, it says how many.",
    CLI_OPTIONS(options, merge_request),
    .run = merge,
};
