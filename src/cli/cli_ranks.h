/* cli_ranks.h: a verb that can run on several ranks of MPI (mpi/mpi.h). In a build without MPI, and in a
 * process that was started alone, all functions do nothing and there is one rank. */
#ifndef DRAPE_CLI_CLI_RANKS_H
#define DRAPE_CLI_CLI_RANKS_H

#include "cli/cli.h"

/* Joins the ranks that a launcher started. From then on, only rank 0 prints. Returns CLI_GO_ON, or the exit
 * code after a line was printed. */
int cli_ranks_begin(const cli_command *command);
/* Leaves them, with the exit code of the verb, which it returns; collective. */
int cli_ranks_end(int code);

int cli_ranks_count(void);

/* CLI_GO_ON if that is the code of all ranks, else the code of the lowest with another one; it prints the
 * message of its context if that is not rank 0, which has printed it. Collective. */
int cli_ranks_agree(const cli_command *command, int code);

/* CLI_GO_ON if all ranks have the same options, by a hash of them; else prints a line. Collective. */
int cli_ranks_compare(const cli_command *command, uint64_t options);

/* Replaces the compiled model of a scene by the part of this rank. status: whether the scene was compiled
 * here. Collective. Returns the status of all ranks. */
drape_status cli_ranks_share(drape_status status, cli_scene *scene);

#endif
