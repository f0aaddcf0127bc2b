/* stress_predictor.c: see stress_predictor.h. */
#include "nonlinear/stress_predictor.h"

drape_status drape_stress_predictor_init(drape_arena *arena, drape_system *system, drape_stress_predictor *s)
{
    const drape_model *model = drape_system_model(system);
    *s = (drape_stress_predictor){.system = system};
    if (drape_model_whole(model)->measure_count == 0)
        return DRAPE_OK;
    s->stress = drape_arena_take(arena, (size_t)model->measure_count, sizeof *s->stress);
    s->along = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof *s->along);
    return drape_arena_status(arena);
}

void drape_stress_predictor_begin(drape_stress_predictor *s, const drape_point *start)
{
    s->valid = s->active = s->stress && start;
    if (s->valid)
        drape_system_stress(s->system, start, NULL, s->stress);
}

void drape_stress_predictor_correct(drape_stress_predictor *s, const drape_point *from, const double *p)
{
    const drape_model *model = drape_system_model(s->system);
    s->valid = s->active;
    if (!s->valid)
        return;
    for (int64_t i = 0; i < 3 * (int64_t)model->free_count; i++)
        s->along[3 * (int64_t)model->node_of_free[i / 3] + i % 3] = p[i];
    drape_ranks_fetch(drape_model_ranks(model), s->along);
    drape_system_stress(s->system, from, s->along, s->stress);
}

void drape_stress_predictor_forget(drape_stress_predictor *s)
{
    s->valid = false;
}

const double *drape_stress_predictor_stress(const drape_stress_predictor *s)
{
    return s->valid ? s->stress : NULL;
}
