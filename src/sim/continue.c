/* continue.c: what goes on from one sim to the next, when pins or the model change. The new one is made
 * beside the present one, as when a checkpoint is restored, and has the same cloth. Terms, colliders and
 * events are the same if their names are. The integrator and the controller start anew, as after a kink. */
#include "base/elementary.h"
#include "model/support.h"
#include "model/track.h"
#include "sim/rescue.h"
#include "sim/rides.h"

#include <string.h>

/* ---- State ---- */

/* The same term on the same cloth: the first one of that name that no earlier term of the new model stands
 * for; NULL: there is none. */
static const drape_term *term_like(const drape_model *from, const drape_model *to, const drape_term *term)
{
    int32_t skip = 0;
    for (const drape_term *t = to->terms; t < term; t++)
        skip += t->ops == term->ops && t->cloth == term->cloth;
    for (int32_t i = 0; i < from->term_count; i++) {
        const drape_term *t = &from->terms[i];
        if (t->ops == term->ops && t->cloth == term->cloth && skip-- == 0)
            return t;
    }
    return NULL;
}

/* Internal variables go on if there are as many, and so do sliders and Maxwell branches; others are as if the
 * cloth had come from its start in one step. */
static void copy_internal(const drape_model *to, const drape_model *from, const double *before, double *after)
{
    for (int32_t i = 0; i < to->term_count; i++) {
        const drape_term *term = &to->terms[i], *same = term_like(from, to, term);
        const int64_t own = drape_term_internals(term), sliders = drape_term_slider_count(term),
                      branches = drape_term_branch_numbers(term);
        if (same && own > 0 && own == drape_term_internals(same))
            memcpy(after + term->first_internal, before + same->first_internal, (size_t)own * sizeof *after);
        if (same && sliders > 0 && sliders == drape_term_slider_count(same))
            memcpy(after + term->first_slider, before + same->first_slider, (size_t)sliders * sizeof *after);
        if (same && branches > 0 && branches == drape_term_branch_numbers(same))
            memcpy(after + term->first_branch, before + same->first_branch, (size_t)branches * sizeof *after);
    }
}

/* ---- Pins ---- */

/* A released node goes on with the velocity that its pin had in the last step. */
static void let_go(drape_sim *to, const drape_sim *from)
{
    drape_state *state = &to->states[to->now];
    const drape_motion *motion = drape_system_motion(from->system);
    const double before = from->before >= 0 ? from->states[from->before].t : state->t;
    for (int32_t i = 0; i < to->model->node_count; i++) {
        double *v = state->v + 3 * (size_t)i;
        if (!from->model->pinned[i] || to->model->pinned[i])
            continue;
        memset(v, 0, 3 * sizeof *v);
        if (motion->place[i] >= 0)
            drape_motion_pin_velocity(motion, motion->place[i], state->t, before + (state->t - before) / 2,
                                      v);
    }
}

static drape_status refuse_pin(const drape_sim *sim, int32_t node, const double *x, const double *pin)
{
    const drape_cloth *cloth = &sim->model->cloths[drape_model_cloth_of(sim->model, node)];
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                      "node %d of %s is at (%g %g %g); its track has it at (%g %g %g) m at t = %g s: a track "
                      "that is new must begin where its nodes are",
                      (int)(node - cloth->first_node), cloth->name, x[0], x[1], x[2], pin[0], pin[1], pin[2],
                      drape_sim_state(sim)->t);
}

/* Pinned nodes are where they were, carried on from there by their collider, or held there unless their
 * motion leads there anyway. A node that was pinned before may not get a track that begins elsewhere. */
static drape_status hold(drape_sim *to, const drape_sim *from)
{
    const drape_model *m = to->model;
    drape_motion *motion = drape_system_steer(to->system);
    drape_state *state = &to->states[to->now];
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; !status && i < m->node_count; i++) {
        const double *x = state->x + 3 * (size_t)i;
        double pin[3];
        if (!m->pinned[i])
            continue;
        drape_motion_place_pin(motion, i, state->t, pin);
        if (!from->model->pinned[i])
            memset(state->v + 3 * (size_t)i, 0, 3 * sizeof *state->v);
        if (drape_hypot(drape_hypot(x[0] - pin[0], x[1] - pin[1]), x[2] - pin[2]) <= DRAPE_SAME * m->length)
            continue;
        const int32_t place = motion->place[i], track = place >= 0 ? motion->moved_track[place] : -1;
        if (drape_sim_carrier(to, i) >= 0)
            drape_sim_ride_on(to, i);
        else if (from->model->pinned[i] && track >= 0 && drape_track_moves(&m->tracks[track]))
            status = refuse_pin(to, i, x, pin);
        else
            drape_motion_hold_pin(motion, i, x);
    }
    drape_supports_stop(motion, drape_system_motion(from->system), drape_sim_state(from)->v, state->v);
    return status;
}

/* ---- The driver ---- */

/* Contact may need memory to measure its energy. */
static drape_status measured(drape_sim *sim)
{
    if (drape_system_status(sim->system) != DRAPE_E_MEMORY)
        return DRAPE_OK;
    sim->energy_known = false;
    return DRAPE_E_MEMORY;
}

/* What has the same name goes on; the work of the rest is forgotten, without a change of the balance. */
static void continue_work(drape_sim *to, drape_sim *from)
{
    const char *name, *other;
    double work;
    drape_sim_energy(to);
    for (size_t i = 0; i < drape_system_work_count(from->system); i++)
        to->audit.start += from->work[i];
    for (size_t i = 0; i < drape_system_work_count(to->system); i++) {
        to->work[i] = to->potential[i];
        for (int k = 0; (name = to->workers[i]) && (other = drape_sim_work(from, k, &work)); k++)
            to->work[i] += strcmp(name, other) == 0 ? work : 0;
        to->audit.start -= to->work[i];
    }
}

/* The energy account goes on; what the change itself adds or takes counts as given by the host. */
static drape_status copy_account(drape_sim *to, drape_sim *from)
{
    const drape_energy before = drape_sim_account(from);
    const drape_status status = measured(from);
    if (status)
        return status;
    to->audit = from->audit;
    continue_work(to, from);
    drape_sim_shift_energy(to, &before, DRAPE_BY_HOST);
    return measured(to);
}

static drape_status copy_driver(drape_sim *to, drape_sim *from, const int32_t *before)
{
    to->schedule = from->schedule;
    to->next_frame = from->next_frame;
    to->attempts = from->attempts;
    to->reason = from->reason;
    to->statistics = from->statistics;
    to->earlier = drape_work_sum(from->chosen.integrator->work(from->integrator), &from->earlier);
    const drape_status status = drape_realtime_rescue.go_on(to, from, before);
    if (status)
        return status;
    drape_events_continue(to, from);
    to->reason_count = from->reason_count;
    for (int i = 0; i < from->reason_count; i++) {
        const char *name = drape_arena_text(to->arena, drape_sim_reason(from, i, &to->reasons[i].count));
        to->reasons[i].reason = name ? drape_system_reason(to->system, name) : DRAPE_REASON_OTHER;
    }
    return drape_arena_status(to->arena);
}

/* ---- All of it ---- */

static drape_status go_on(drape_sim *to, drape_sim *from)
{
    int32_t *before = drape_alloc(to->ctx, (size_t)to->model->collider_count + 1, sizeof *before);
    if (!before)
        return DRAPE_E_MEMORY;
    /* The number that each collider of `to` had; -1: it is new. */
    for (int32_t c = 0; c < to->model->collider_count; c++) {
        before[c] = -1;
        for (int32_t k = 0; before[c] < 0 && k < from->model->collider_count; k++)
            if (strcmp(to->model->colliders[c].name, from->model->colliders[k].name) == 0)
                before[c] = k;
    }
    const size_t n = 3 * (size_t)to->model->node_count;
    const drape_state *now = drape_sim_state(from);
    drape_state *state = &to->states[to->now];
    state->t = now->t;
    memcpy(state->x, now->x, n * sizeof *state->x);
    memcpy(state->v, now->v, n * sizeof *state->v);
    copy_internal(to->model, from->model, now->internal, state->internal);
    let_go(to, from);
    drape_status status = drape_system_continue(to->system, from->system, before, drape_sim_state(from)->t);
    if (!status)
        status = drape_sim_continue_rides(to, from, before);
    if (!status)
        status = hold(to, from);
    if (!status)
        status = copy_driver(to, from, before);
    if (!status)
        status = copy_account(to, from);
    drape_free(to->ctx, before);
    return status;
}

void drape_sim_forget_past(drape_sim *sim)
{
    sim->before = sim->past[0] = sim->past[1] = -1;
    memset(sim->scratch, 0, sizeof sim->scratch);
    sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
    drape_events_reset(sim);
}

/* Puts `other`, a new sim, in the place of the present one, whose state it gets; destroys it in any case. */
static drape_status take_over(drape_sim *sim, drape_status created, drape_sim **other)
{
    const drape_status status = created ? created : go_on(*other, sim);
    if (!status)
        drape_sim_exchange(sim, *other);
    drape_sim_destroy(other);
    return status;
}

drape_status drape_sim_remake(drape_sim *sim, const drape_model *model, const uint8_t *pinned,
                              const double *masses)
{
    drape_sim *other = NULL;
    const drape_status status = drape_sim_create_like(sim, &sim->chosen, model, pinned, masses, &other);
    return take_over(sim, status, &other);
}

drape_status drape_sim_continue_by(drape_sim *sim, const drape_sim_def *def)
{
    drape_chosen chosen;
    drape_schedule fresh = sim->schedule;
    drape_sim *other = NULL;
    drape_status status = drape_choose(sim->ctx, sim->model, def, &chosen);
    if (!status)
        status =
            drape_sim_create_like(sim, &chosen, drape_sim_base_model(sim), sim->pinned, sim->masses, &other);
    if (!status)
        fresh = other->schedule;
    status = take_over(sim, status, &other);
    if (!status) /* that which came with the state is of the method before */
        drape_schedule_init(&sim->schedule, fresh.stepping, fresh.dt, drape_sim_time(sim));
    return status;
}
