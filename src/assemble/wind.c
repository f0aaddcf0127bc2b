/* wind.c: see wind.h. */
#include "assemble/wind.h"

#include <string.h>

drape_status drape_wind_set(drape_context *ctx, const drape_model *model, drape_wind_field *field, void *user,
                            drape_wind *wind)
{
    drape_wind next = {.field = field, .user = user, .against = wind->against, .gradient = wind->gradient};
    size_t nodes = (size_t)model->node_count;
    if (field && !wind->against) {
        next.against = drape_alloc(ctx, 3 * nodes, sizeof *next.against);
        next.gradient = drape_alloc(ctx, 9 * nodes, sizeof *next.gradient);
        if (!next.against || !next.gradient) {
            drape_wind_free(ctx, &next);
            return DRAPE_E_MEMORY;
        }
    }
    *wind = next;
    return DRAPE_OK;
}

void drape_wind_free(drape_context *ctx, drape_wind *wind)
{
    drape_free(ctx, wind->against);
    drape_free(ctx, wind->gradient);
    *wind = (drape_wind){.field = NULL};
}

void drape_wind_feel(drape_wind *wind, int32_t node_count, double t, const double *x, const double *v,
                     bool gradient)
{
    memset(wind->against, 0, 3 * (size_t)node_count * sizeof *wind->against);
    if (gradient)
        memset(wind->gradient, 0, 9 * (size_t)node_count * sizeof *wind->gradient);
    wind->field(wind->user, t, node_count, x, wind->against, gradient ? wind->gradient : NULL);
    for (size_t i = 0; i < 3 * (size_t)node_count; i++)
        wind->against[i] = v[i] - wind->against[i];
}

bool drape_wind_is_felt(const drape_model *model)
{
    bool felt = false;
    for (int32_t i = 0; i < model->term_count; i++)
        felt = felt || (model->terms[i].ops->in_medium && model->terms[i].elements.count > 0);
    return felt;
}

size_t drape_wind_bytes(const drape_wind *wind, const drape_model *model)
{
    return wind->against ? 12 * (size_t)model->node_count * sizeof *wind->against : 0;
}
