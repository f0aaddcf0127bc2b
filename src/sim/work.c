/* work.c: what does work on cloth from outside: pins, colliders, the host, each load and medium. */
#include "sim/sim.h"

#include <stdio.h>

/* Of a term that may do work: "drag.wind of flag", of a second one "drag.wind of flag (2)". */
static const char *name_of(drape_sim *sim, const drape_term *t)
{
    const drape_model *m = sim->model;
    const drape_term_ops *ops = t->ops;
    char text[400], number[16] = "";
    int count = 1;
    if (!drape_term_changes(t) && !ops->kinetic && !(ops->external && !ops->from_scene_gravity) &&
        !(ops->dissipation && ops->in_medium))
        return NULL;
    for (const drape_term *other = m->terms; other < t; other++)
        count += other->ops == ops && other->cloth == t->cloth && other->seam == t->seam;
    if (count > 1)
        snprintf(number, sizeof number, " (%d)", count);
    snprintf(text, sizeof text, "%.60s of %.300s%s", ops->entry.name,
             t->seam >= 0 ? m->seams[t->seam].name : m->cloths[t->cloth].name, number);
    return drape_arena_text(sim->arena, text);
}

drape_status drape_sim_create_work(drape_sim *sim)
{
    const size_t count = drape_system_work_count(sim->system);
    sim->work = drape_arena_take(sim->arena, 3 * count, sizeof *sim->work);
    sim->workers = drape_arena_take(sim->arena, count, sizeof *sim->workers);
    if (!sim->work || !sim->workers)
        return DRAPE_E_MEMORY;
    sim->potential = sim->work + count;
    sim->work_scratch = sim->potential + count;
    sim->workers[DRAPE_BY_PINS] = "pins";
    sim->workers[DRAPE_BY_COLLIDERS] = "colliders";
    sim->workers[DRAPE_BY_HOST] = "host";
    for (int32_t i = 0; i < sim->model->term_count; i++)
        sim->workers[DRAPE_BY_TERMS + i] = name_of(sim, &sim->model->terms[i]);
    return drape_arena_status(sim->arena);
}

const char *drape_sim_work(drape_sim *sim, int index, double *work)
{
    if (work)
        *work = 0;
    if (sim && !sim->model->part) /* the ranks need not all ask */
        drape_sim_energy(sim);
    for (size_t i = 0; sim && index >= 0 && i < drape_system_work_count(sim->system); i++)
        if (sim->workers[i] && index-- == 0) {
            if (work)
                *work = sim->work[i] - sim->potential[i];
            return sim->workers[i];
        }
    return NULL;
}
