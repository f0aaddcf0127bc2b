/* work.c: what does work on cloth from outside: pins, colliders, the host, each load and medium. */
#include "sim/sim.h"

#include <stdio.h>
#include <string.h>

/* Of a term that may do work: "drag.wind of flag", of a second one "drag.wind of flag (2)". */
static const char *name_of(drape_sim *sim, const drape_term *t)
{
    const drape_model *m = sim->model;
    const drape_term_ops *ops = t->ops;
    const char *of = t->seam >= 0 ? m->seams[t->seam].name : m->cloths[t->cloth].name;
    const size_t size = strlen(ops->entry.name) + strlen(of) + 32;
    int count = 1;
    if (!drape_term_changes(t) && !ops->kinetic && !(ops->external && !ops->from_scene_gravity) &&
        !(ops->dissipation && ops->in_medium))
        return NULL;
    for (const drape_term *other = m->terms; other < t; other++)
        count += other->ops == ops && other->cloth == t->cloth && other->seam == t->seam;
    char *text = drape_arena_take(sim->arena, size, 1);
    for (bool taken = text != NULL; taken; count++) { /* also by a cloth that is called "flag (2)" */
        const int length = snprintf(text, size, "%s of %s", ops->entry.name, of);
        if (count > 1)
            snprintf(text + length, size - (size_t)length, " (%d)", count);
        drape_make_printable(text);
        taken = false;
        for (const char *const *other = sim->workers; other < sim->workers + DRAPE_BY_TERMS + (t - m->terms);
             other++)
            taken = taken || (*other && strcmp(*other, text) == 0);
    }
    return text;
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
