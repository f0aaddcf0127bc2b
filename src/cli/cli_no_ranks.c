/* cli_no_ranks.c: stands for cli_ranks.c in a build without MPI: there is one rank. */
#include "cli/cli_ranks.h"

int cli_ranks_begin(const cli_command *command)
{
    (void)command;
    return CLI_GO_ON;
}

int cli_ranks_end(int code)
{
    return code;
}

int cli_ranks_count(void)
{
    return 1;
}

int cli_ranks_agree(const cli_command *command, int code)
{
    (void)command;
    return code;
}

int cli_ranks_compare(const cli_command *command, uint64_t options)
{
    (void)command;
    (void)options;
    return CLI_GO_ON;
}

drape_status cli_ranks_share(drape_status status, cli_scene *scene)
{
    (void)scene;
    return status;
}
