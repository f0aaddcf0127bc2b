/*
 * wind.h: the medium that a host moves. Terms in a medium (drag) are given the velocity against it, v - w(t,
 * x), and their derivatives become, W = dw/dx of each node,
 *     dg/dx = g_x - g_v W,   dg/dv = g_v
 */
#ifndef DRAPE_ASSEMBLE_WIND_H
#define DRAPE_ASSEMBLE_WIND_H

#include "assemble/state.h"

typedef struct drape_wind {
    drape_wind_field *field; /* NULL: the medium rests */
    void *user;
    double *against;  /* (node_count x 3) v - w [m/s]; NULL where no term feels the medium */
    double *gradient; /* (node_count x 3 x 3) W [1/s] */
} drape_wind;

/* Room for a field, where some term of the model feels it; the medium rests. Errors: DRAPE_E_MEMORY. */
drape_status drape_wind_create(drape_arena *arena, const drape_model *model, drape_wind *wind);

/* Evaluates the field at all nodes: wind->against, and wind->gradient if gradient. */
void drape_wind_evaluate(drape_wind *wind, int32_t node_count, double t, const double *x, const double *v,
                         bool gradient);

/* Whether some term of the model is in the medium. */
bool drape_wind_is_felt(const drape_model *model);

#endif
