/* agree.h: what ranks (base/ranks.h) find in their parts of a model becomes known to all of them. One process
 * keeps what it found. All functions are collective. */
#ifndef DRAPE_ASSEMBLE_AGREE_H
#define DRAPE_ASSEMBLE_AGREE_H

#include "base/reason.h"
#include "model/model.h"

/* The texts of a diagnostic that another rank found: valid until the next one. */
typedef struct drape_agreed {
    char what[64], term[64];
} drape_agreed;

/* The status of the lowest rank that has one other than DRAPE_OK, with its reason and its diagnostic, whose
 * nodes and element become those of the whole model. */
drape_status drape_agree(drape_agreed *agreed, const drape_model *model, drape_status status,
                         drape_reason *reason, drape_diagnostic *diagnostic);

/* The diagnostic of the rank with the largest value, likewise; -INFINITY: it has none. Returns that value. */
double drape_agree_largest(drape_agreed *agreed, const drape_model *model, double value,
                           drape_diagnostic *diagnostic);

#endif
