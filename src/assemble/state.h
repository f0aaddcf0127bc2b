/* state.h: what changes in time: t, x, v, and the internal variables of the terms that have any. */
#ifndef DRAPE_ASSEMBLE_STATE_H
#define DRAPE_ASSEMBLE_STATE_H

#include "model/model.h"

typedef struct drape_state {
    double t;         /* [s] */
    double *x, *v;    /* (node_count x 3) [m], [m/s] */
    double *internal; /* (internal_count) */
} drape_state;

/* A state with the rest positions and initial velocities at t = 0, and pins where their tracks begin.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_state_create(drape_arena *arena, const drape_model *model, drape_state *state);

/* Computes after->internal from before->internal and after->x: what the terms remember of an accepted
 * step. */
void drape_state_commit(const drape_model *model, const drape_state *before, drape_state *after);

/* Moves the sliders and the Maxwell branches of the terms from where they are in `before` to where the time
 * and the positions of `after`, whose other internal variables are committed, take them; relaxed: branches go
 * to their limit after an infinite time. Returns what that dissipates [J]. Separate from
 * drape_state_commit, which an iteration for an equilibrium calls for each of its steps: there they
 * stay until the equilibrium is found, so that it does not depend on the path of the iteration. */
double drape_state_relax(const drape_model *model, const drape_state *before, bool relaxed,
                         drape_state *after);

uint64_t drape_state_hash(const drape_model *model, const drape_state *state);

#endif
