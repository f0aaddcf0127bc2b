/* wind.c: see wind.h. */
#include "assemble/wind.h"

#include <string.h>

bool drape_wind_is_felt(const drape_model *model)
{
    bool felt = false;
    for (int32_t i = 0; i < model->term_count; i++)
        felt = felt || (model->terms[i].ops->in_medium && model->terms[i].elements.count > 0);
    return felt;
}

drape_status drape_wind_create(drape_arena *arena, const drape_model *model, drape_wind *wind)
{
    if (!drape_wind_is_felt(model))
        return DRAPE_OK;
    wind->against = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof *wind->against);
    wind->gradient = drape_arena_take(arena, 9 * (size_t)model->node_count, sizeof *wind->gradient);
    return drape_arena_status(arena);
}

void drape_wind_evaluate(drape_wind *wind, int32_t node_count, double t, const double *x, const double *v,
                         bool gradient)
{
    memset(wind->against, 0, 3 * (size_t)node_count * sizeof *wind->against);
    if (gradient)
        memset(wind->gradient, 0, 9 * (size_t)node_count * sizeof *wind->gradient);
    wind->field(wind->user, t, node_count, x, wind->against, gradient ? wind->gradient : NULL);
    for (size_t i = 0; i < 3 * (size_t)node_count; i++)
        wind->against[i] = v[i] - wind->against[i];
}
