/*
 * wind.h: the moving medium, set by a host. Terms in the medium (drag) see the velocity relative to it, v -
 * w(t, x). With W = dw/dx at each node their derivatives become
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

/* Memory for a field, if some term of the model feels it; the medium is at rest at first. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_wind_create(drape_arena *arena, const drape_model *model, drape_wind *wind);

/* Evaluates the field at all nodes into wind->against and, if `gradient`, wind->gradient. */
void drape_wind_evaluate(drape_wind *wind, int32_t node_count, double t, const double *x, const double *v,
                         bool gradient);

/* Whether a term of the model is in the medium. */
bool drape_wind_is_felt(const drape_model *model);

#endif
