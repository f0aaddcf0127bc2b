/*
 * wind.h: the velocity field w(t, x) of the medium, set by a host. Terms with `in_medium`, such as drag,
 * are given the relative velocity v - w(t, x) in place of v. With W = dw/dx at each node their derivatives
 * become
 *     dg/dx = g_x - g_v W,   dg/dv = g_v
 */
#ifndef DRAPE_ASSEMBLE_WIND_H
#define DRAPE_ASSEMBLE_WIND_H

#include "assemble/state.h"

typedef struct drape_wind {
    drape_wind_field *field; /* NULL: the medium rests */
    void *user;
    double *against;  /* (node_count x 3) v - w [m/s]; NULL if no term of the model is in the medium */
    double *gradient; /* (node_count x 3 x 3) W [1/s] */
} drape_wind;

/* Allocates the arrays if a term of the model is in the medium, which is at rest until a field is set.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_wind_create(drape_arena *arena, const drape_model *model, drape_wind *wind);

/* Evaluates the field at all nodes and stores v - w in wind->against and, if `gradient`, W in
 * wind->gradient. */
void drape_wind_evaluate(drape_wind *wind, int32_t node_count, double t, const double *x, const double *v,
                         bool gradient);

/* Whether a term of the model is in the medium. */
bool drape_wind_is_felt(const drape_model *model);

#endif
