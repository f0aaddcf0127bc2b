/* event_actions.c: what follows from the roots of an accepted step: observers are notified, pins are
 * released, the advance stops. */
#include "sim/dense.h"
#include "sim/sim.h"

#include <string.h>

static drape_status report(drape_sim *sim, const drape_pending_root *p)
{
    const drape_state *now = drape_sim_state(sim),
                      *before = sim->before >= 0 ? &sim->states[sim->before] : NULL;
    const drape_watch *w = &sim->events.watches[p->event];
    const bool inside = before && p->root.t > before->t && p->root.t < now->t;
    drape_event event = {.kind = DRAPE_EVENT_ROOT,
                         .sim = sim,
                         .time = p->root.t,
                         .positions = inside ? sim->frame : now->x,
                         .velocities = inside ? sim->frame_velocity : now->v,
                         .event = p->event,
                         .name = w->event->name,
                         .value = p->root.value,
                         .direction = p->root.direction};
    if (inside) {
        drape_sim_dense_positions(sim, before, now, p->root.t, sim->frame);
        drape_sim_dense_velocities(sim, before, now, p->root.t, sim->frame_velocity);
    }
    return drape_sim_notify(sim, &event);
}

drape_status drape_events_report(drape_sim *sim)
{
    drape_event_set *e = &sim->events;
    drape_status status = DRAPE_OK;
    while (!status && e->reported < e->pending_count)
        status = report(sim, &e->pending[e->reported++]);
    return status;
}

static drape_status release(drape_sim *sim)
{
    const drape_event_set *e = &sim->events;
    const int32_t before = sim->model->free_count;
    const size_t nodes = (size_t)sim->model->node_count;
    uint8_t *pinned = drape_alloc(sim->ctx, nodes, sizeof *pinned);
    bool any = false;
    if (!pinned)
        return DRAPE_E_MEMORY;
    memcpy(pinned, sim->model->pinned, nodes * sizeof *pinned);
    for (int32_t i = 0; i < e->pending_count; i++) {
        const drape_model_event *event = e->watches[e->pending[i].event].event;
        for (int32_t k = 0; event->action == DRAPE_ACTION_RELEASE && k < event->pinned_count; k++)
            pinned[event->pinned[k]] = 0;
        any = any || event->action == DRAPE_ACTION_RELEASE;
    }
    const drape_status status = any ? drape_sim_repin(sim, pinned) : DRAPE_OK;
    if (any && !status)
        drape_log(sim->ctx, DRAPE_LOG_INFO, "t=%.9g: %d nodes are released", drape_sim_state(sim)->t,
                  (int)(sim->model->free_count - before));
    drape_free(sim->ctx, pinned);
    return status;
}

drape_status drape_events_act(drape_sim *sim)
{
    drape_event_set *e = &sim->events; /* stays in place when the sim is built anew */
    drape_status status = e->pending_count > 0 ? release(sim) : DRAPE_OK;
    if (status)
        return status;
    for (int32_t i = 0; !status && i < e->pending_count; i++) {
        const drape_watch *w = &e->watches[e->pending[i].event];
        if (w->event->action != DRAPE_ACTION_STOP)
            continue;
        e->stopped_by = e->pending[i].event;
        status = drape_fail(sim->ctx, DRAPE_E_STOPPED, "t=%.9g: stopped by event \"%.60s\"",
                            e->pending[i].root.t, w->event->name);
    }
    e->pending_count = e->reported = 0;
    return status;
}

drape_status drape_events_resume(drape_sim *sim)
{
    sim->events.stopped_by = -1;
    const drape_status status = drape_events_report(sim);
    return status ? status : drape_events_act(sim);
}
