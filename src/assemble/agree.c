/* agree.c: see agree.h. */
#include "assemble/agree.h"

#include <stdio.h>
#include <string.h>

/* What one rank says. */
typedef struct finding {
    int32_t status, reason; /* a drape_reason */
    int32_t element, node[4], cloth;
    double value, limit;
    drape_agreed texts;
} finding;

static finding finding_of(const drape_model *model, const drape_diagnostic *d)
{
    finding f = {.element = d->element, .cloth = d->cloth, .value = d->value, .limit = d->limit};
    for (int a = 0; a < 4; a++)
        f.node[a] = d->node[a] >= 0 && d->node[a] < model->node_count ? model->part->node[d->node[a]] : -1;
    for (int32_t i = 0; i < model->term_count; i++) {
        const drape_term *term = &model->terms[i];
        if (term->element && term->cloth == d->cloth && strcmp(term->ops->entry.name, d->term) == 0 &&
            d->element >= 0 && d->element < term->elements.count)
            f.element = term->element[d->element];
    }
    snprintf(f.texts.what, sizeof f.texts.what, "%s", d->what);
    snprintf(f.texts.term, sizeof f.texts.term, "%s", d->term);
    return f;
}

static void tell(const drape_ranks *ranks, int from, drape_agreed *agreed, finding *f,
                 drape_diagnostic *diagnostic)
{
    ranks->broadcast(ranks, from, f, sizeof *f);
    *agreed = f->texts;
    *diagnostic = (drape_diagnostic){.what = agreed->what,
                                     .term = agreed->term,
                                     .element = f->element,
                                     .node = {f->node[0], f->node[1], f->node[2], f->node[3]},
                                     .cloth = f->cloth,
                                     .value = f->value,
                                     .limit = f->limit};
}

drape_status drape_agree(drape_agreed *agreed, const drape_model *model, drape_status status,
                         drape_reason *reason, drape_diagnostic *diagnostic)
{
    const drape_ranks *ranks = drape_model_ranks(model);
    if (!ranks || !drape_ranks_any(ranks, status != DRAPE_OK))
        return status;
    const int from = drape_ranks_find(ranks, status != DRAPE_OK);
    finding f = {.node = {-1, -1, -1, -1}};
    if (from == ranks->rank) {
        f = finding_of(model, diagnostic);
        f.status = status;
        /* other ranks do not know the reasons of user-defined terms here */
        f.reason = *reason < DRAPE_REASON_COUNT ? *reason : DRAPE_REASON_OTHER;
    }
    tell(ranks, from, agreed, &f, diagnostic);
    *reason = (drape_reason)f.reason;
    return (drape_status)f.status;
}

double drape_agree_largest(drape_agreed *agreed, const drape_model *model, double value,
                           drape_diagnostic *diagnostic)
{
    const drape_ranks *ranks = drape_model_ranks(model);
    if (!ranks)
        return value;
    const int from = drape_ranks_find(ranks, value);
    finding f = {.node = {-1, -1, -1, -1}};
    if (from == ranks->rank && value > -INFINITY)
        f = finding_of(model, diagnostic);
    tell(ranks, from, agreed, &f, diagnostic);
    ranks->broadcast(ranks, from, &value, sizeof value);
    return value;
}
