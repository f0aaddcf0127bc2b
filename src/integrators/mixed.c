/* mixed.c: see mixed.h. */
#include "integrators/mixed.h"

drape_status drape_mixed_init(drape_context *ctx, drape_system *system, drape_mixed *mixed)
{
    const drape_model *model = drape_system_model(system);
    *mixed = (drape_mixed){.ctx = ctx, .system = system};
    if (model->measure_count == 0)
        return DRAPE_OK;
    mixed->stress = drape_alloc(ctx, (size_t)model->measure_count, sizeof *mixed->stress);
    mixed->along = drape_alloc(ctx, 3 * (size_t)model->node_count, sizeof *mixed->along);
    return mixed->stress && mixed->along ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_mixed_free(drape_mixed *mixed)
{
    drape_free(mixed->ctx, mixed->stress);
    drape_free(mixed->ctx, mixed->along);
}

void drape_mixed_begin(drape_mixed *mixed, const drape_point *start)
{
    mixed->holds = mixed->wanted = mixed->stress && start;
    if (mixed->holds)
        drape_system_stress(mixed->system, start, NULL, mixed->stress);
}

/* Pinned nodes do not move: theirs stays the 0 that it was allocated with. */
void drape_mixed_correct(drape_mixed *mixed, const drape_point *from, const double *p)
{
    const drape_model *model = drape_system_model(mixed->system);
    mixed->holds = mixed->wanted;
    if (!mixed->holds)
        return;
    for (int64_t i = 0; i < 3 * (int64_t)model->free_count; i++)
        mixed->along[3 * (int64_t)model->node_of_free[i / 3] + i % 3] = p[i];
    drape_system_stress(mixed->system, from, mixed->along, mixed->stress);
}

void drape_mixed_forget(drape_mixed *mixed)
{
    mixed->holds = false;
}

const double *drape_mixed_stress(const drape_mixed *mixed)
{
    return mixed->holds ? mixed->stress : NULL;
}

size_t drape_mixed_bytes(const drape_mixed *mixed)
{
    const drape_model *model = drape_system_model(mixed->system);
    return mixed->stress
               ? ((size_t)model->measure_count + 3 * (size_t)model->node_count) * sizeof *mixed->stress
               : 0;
}
