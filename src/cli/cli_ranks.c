/* cli_ranks.c: see cli_ranks.h. */
#include "cli/cli_ranks.h"

#include "base/hash.h"
#include "model/scene.h"
#include "mpi/mpi.h"
#include "sim/identity.h"

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

static drape_mpi *ranks;  /* NULL: there is one */
static int messages = -1; /* the standard error of a rank that does not print */

/* Results and messages of ranks other than 0 are the same as those of rank 0. */
static void be_silent(void)
{
    const int nowhere = open("/dev/null", O_WRONLY);
    fflush(stdout);
    messages = dup(STDERR_FILENO);
    if (nowhere < 0)
        return;
    dup2(nowhere, STDOUT_FILENO);
    dup2(nowhere, STDERR_FILENO);
    close(nowhere);
}

int cli_ranks_begin(const cli_command *command)
{
    if (!drape_mpi_is_launched())
        return CLI_GO_ON;
    if (drape_mpi_begin(command->ctx, &ranks))
        return cli_report(command, CLI_FAILED);
    if (drape_mpi_rank(ranks) > 0)
        be_silent();
    return CLI_GO_ON;
}

int cli_ranks_end(int code)
{
    drape_mpi_end(&ranks);
    return code;
}

int cli_ranks_count(void)
{
    return drape_mpi_count(ranks);
}

int cli_ranks_agree(const cli_command *command, int code)
{
    int agreed = code;
    const int from = drape_mpi_agree(ranks, code != CLI_GO_ON, &agreed);
    if (from > 0 && from == drape_mpi_rank(ranks)) {
        dup2(messages, STDERR_FILENO); /* a rank above 0 is silent */
        cli_report(command, code);
    }
    return from < 0 ? CLI_GO_ON : agreed;
}

int cli_ranks_compare(const cli_command *command, uint64_t options)
{
    return drape_mpi_is_same(ranks, options)
               ? CLI_GO_ON
               : cli_misuse(command->verb, "the ranks do not have the same options on their command lines");
}

static void add_text(void *user, const char *text, size_t size)
{
    uint64_t *hash = user;
    *hash = drape_hash_bytes(*hash, text, size);
}

drape_status cli_ranks_share(drape_status status, cli_scene *s)
{
    if (!ranks)
        return status;
    int agreed = status;
    const int from = drape_mpi_agree(ranks, status != DRAPE_OK, &agreed);
    if (from > 0 && from == drape_mpi_rank(ranks))
        dup2(messages, STDERR_FILENO); /* the caller prints its message */
    else if (from > 0 && drape_mpi_rank(ranks) == 0)
        be_silent();
    if (from >= 0)
        return (drape_status)agreed;
    /* all that a scene says, with the meshes that it names */
    const uint64_t model = drape_model_identity(s->model);
    uint64_t hash = DRAPE_HASH_START;
    drape_scene_print(s->scene, add_text, &hash);
    if (!drape_mpi_is_same(ranks, drape_hash_bytes(hash, &model, sizeof model)))
        return drape_fail(
            s->ctx, DRAPE_E_ARGUMENT,
            "the ranks do not have the same scene: each reads it, and the meshes that it names, "
            "from its own folder");
    s->whole = s->model;
    s->model = NULL;
    return drape_mpi_share(ranks, s->whole, &s->model);
}
