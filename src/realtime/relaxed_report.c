/* relaxed_report.c: see relaxed_report.h. */
#include "realtime/relaxed_report.h"

#include <math.h>

drape_relaxed_set *drape_realtime_relaxed(const drape_sim *sim)
{
    const drape_contact *contact = drape_system_contact(sim->system);
    return contact ? drape_relaxed_of(contact) : NULL;
}

const char *drape_sim_relaxed_name(const drape_sim *sim, int32_t collider)
{
    return collider >= 0 ? sim->model->colliders[collider].name : "self_contact";
}

int32_t drape_sim_relaxed(const drape_sim *sim, int32_t index, drape_relaxed *out)
{
    const drape_relaxed_set *set = sim ? drape_realtime_relaxed(sim) : NULL;
    const int32_t count = set ? set->exempt.count : 0;
    if (!out || index < 0 || index >= count)
        return count;
    const drape_relaxed_node *node = &set->nodes[index];
    *out = (drape_relaxed){.collider = node->collider,
                           .name = drape_sim_relaxed_name(sim, node->collider),
                           .node = node->node,
                           .depth = node->depth,
                           .deepest = node->deepest,
                           .since = node->since};
    return count;
}

const drape_relaxed_total *drape_sim_relaxed_total(const drape_sim *sim, int32_t collider)
{
    static const drape_relaxed_total none = {0};
    const drape_relaxed_set *set = drape_realtime_relaxed(sim);
    return set ? &set->total[collider >= 0 ? collider : sim->model->collider_count] : &none;
}

int32_t drape_sim_relaxed_at(const drape_sim *sim, int32_t collider)
{
    const drape_relaxed_set *set = drape_realtime_relaxed(sim);
    return set ? drape_relaxed_count(set, collider) : 0;
}

int32_t drape_sim_relaxed_now(const drape_sim *sim, double *deepest)
{
    const drape_relaxed_set *set = drape_realtime_relaxed(sim);
    *deepest = 0;
    for (int32_t i = 0; set && i < set->exempt.count; i++)
        *deepest = fmax(*deepest, set->nodes[i].depth);
    return set ? set->exempt.count : 0;
}

void drape_sim_log_relaxed(drape_sim *sim)
{
    drape_relaxed_set *set = drape_realtime_relaxed(sim);
    for (int32_t c = -1; set && sim->ctx->def.log && c < sim->model->collider_count; c++) {
        bool *logged = &set->logged[c >= 0 ? c : sim->model->collider_count];
        const bool relaxed = drape_relaxed_count(set, c) > 0;
        if (relaxed != *logged) {
            /* With the times of the summary: nodes are relaxed, and held again, at the beginning of a
             * step. */
            const drape_relaxed_total *total = drape_sim_relaxed_total(sim, c);
            const char *name = drape_sim_relaxed_name(sim, c);
            if (relaxed)
                drape_log(sim->ctx, DRAPE_LOG_WARNING,
                          "t=%.9g: no room for the cloth at %s: it is relaxed there",
                          drape_relaxed_since(set, c), name);
            else
                drape_log(sim->ctx, DRAPE_LOG_INFO,
                          "t=%.9g: the cloth at %s has room again; it was relaxed for %.4g s so far, up to "
                          "%.4g m deep",
                          total->last, name, total->seconds, total->deepest);
        }
        *logged = relaxed;
    }
}
