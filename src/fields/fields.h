/*
 * fields.h: what can be told of a moment at each node, for pictures and for files that have fields. A field
 * is the constant drape_field_<name> of field_<name>.c.
 */
#ifndef DRAPE_FIELDS_FIELDS_H
#define DRAPE_FIELDS_FIELDS_H

#include "sim/sim.h"

typedef struct drape_field_ops {
    drape_entry entry;
    const char *unit;
    double shown; /* a factor for people, with shown_unit: 100 and "%" */
    const char *shown_unit;
    bool of_steps; /* it is of the last step that the sim made: a state that was put there has none */
    /* Writes a value for each node (node_count). x (node_count x 3 [m]): the positions that are shown, which
     * may lie between two steps; what needs more than positions is of the sim's present state. Errors:
     * DRAPE_E_ARGUMENT (the sim's integrator has no such thing), DRAPE_E_MEMORY. */
    drape_status (*measure)(drape_sim *sim, const double *x, double *values);
} drape_field_ops;

extern const drape_field_ops *const drape_fields[]; /* NULL-ended */
extern const drape_registry drape_field_registry;

#endif
