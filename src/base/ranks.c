/* ranks.c: see ranks.h. */
#include "base/ranks.h"

#include "base/context.h"

#include <stdio.h>

drape_status drape_ranks_agree(const drape_ranks *ranks, drape_context *ctx, drape_status status)
{
    struct {
        drape_status status;
        char message[DRAPE_MESSAGE_SIZE];
    } there = {.status = status};
    if (!ranks || !drape_ranks_any(ranks, status != DRAPE_OK))
        return status;
    const int from = drape_ranks_find(ranks, status != DRAPE_OK);
    snprintf(there.message, sizeof there.message, "%s", drape_context_message(ctx));
    ranks->broadcast(ranks, from, &there, sizeof there);
    return from == ranks->rank ? status : drape_fail(ctx, there.status, "%s", there.message);
}
