/*
 * fields.h: quantities that are known at each node at a moment, for pictures and for files with fields. A
 * field is the constant drape_field_<name> of field_<name>.c.
 */
#ifndef DRAPE_FIELDS_FIELDS_H
#define DRAPE_FIELDS_FIELDS_H

#include "sim/sim.h"

typedef struct drape_field_ops {
    drape_entry entry;
    const char *unit;
    double shown; /* factor for display in shown_unit: 100 for "%" */
    const char *shown_unit;
    bool of_steps; /* it belongs to the last step of the sim: a state set by the host has no values */
    /* Writes a value for each node (node_count). x (node_count x 3 [m]): the positions shown, which may lie
     * between two steps; anything else that the field needs is taken from the sim's present state. Errors:
     * DRAPE_E_ARGUMENT (the sim's integrator does not have this quantity), DRAPE_E_MEMORY. */
    drape_status (*measure)(drape_sim *sim, const double *x, double *values);
} drape_field_ops;

extern const drape_field_ops *const drape_fields[]; /* NULL-ended */
extern const drape_registry drape_field_registry;

/* The field `strain` at positions x; strain (triangle_count x 2): workspace. */
void drape_field_node_strain(const drape_model *model, const double *x, double *strain, double *values);

#endif
