/*
 * checkpoint.c: a sim as bytes, from which another sim of the same model continues with the same bits. Only
 * what the next steps depend on is archived; everything else follows from it, or from the model.
 *
 * A restored sim is created anew beside the present one and takes its place only if everything succeeded:
 * nothing that the present one keeps can influence it, and a failure at any moment leaves the present one
 * unchanged.
 */
#include "base/finite.h"
#include "model/archive_part.h"
#include "sim/rescue.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#define MEMORY_NAME "checkpoint in memory"

/* ---- States ---- */

static bool is_place(int index, int least, int count)
{
    return index >= least && index < count;
}

/* The present state, and the earlier ones that are still needed; the one that the next attempt overwrites
 * is left out. */
static void archive_states(drape_sim *sim, drape_archive *a)
{
    const int count = 2 + sim->chosen.controller->history_depth;
    const size_t n = 3 * (size_t)sim->model->node_count;
    int *const places[] = {&sim->now, &sim->next, &sim->before, &sim->past[0], &sim->past[1]};
    drape_archive_mark(a, "states");
    for (int i = 0; i < 5; i++) {
        const bool kept = i < 3 || i - 3 < sim->chosen.controller->history_depth;
        drape_archive_int(a, places[i]);
        if (drape_archive_good(a) && !is_place(*places[i], i < 2 ? 0 : -1, kept ? count : 0))
            drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a state %d of %d", *places[i], count);
    }
    if (drape_archive_good(a) &&
        (sim->next == sim->now || sim->next == sim->past[0] || sim->next == sim->past[1]))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no state to step to");
    for (int i = 0; i < count && drape_archive_good(a); i++)
        if (i == sim->now || i == sim->before || i == sim->past[0] || i == sim->past[1]) {
            drape_state *state = &sim->states[i];
            drape_archive_double(a, &state->t);
            drape_archive_nodes(a, sim->model, state->x);
            drape_archive_nodes(a, sim->model, state->v);
            drape_archive_internal(a, sim->model, state->internal);
            if (drape_archive_has_read(a) &&
                !(isfinite(state->t) && drape_all_finite(state->x, n) && drape_all_finite(state->v, n)))
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a state that is not finite");
        }
}

/* ---- State of the driver ---- */

static void archive_schedule(drape_schedule *s, drape_archive *a)
{
    double *const times[] = {
        &s->end,          &s->now,           &s->dt,     &s->limit, &s->tried, &s->start, &s->interval_start,
        &s->interval_end, &s->interval_size, &s->cut_end};
    drape_archive_mark(a, "schedule");
    for (size_t i = 0; i < sizeof times / sizeof *times; i++)
        drape_archive_double(a, times[i]);
    drape_archive_int64(a, &s->count);
    drape_archive_int(a, &s->level);
    drape_archive_int64(a, &s->part);
    drape_archive_bool(a, &s->stepped);
    drape_archive_bool(a, &s->anew);
    drape_archive_bool(a, &s->cut);
    /* What the loops over steps and frames depend on to end. */
    if (drape_archive_good(a) &&
        !(s->level >= 0 && s->level <= DRAPE_SCHEDULE_LEVELS && s->part >= 0 &&
          s->part < (int64_t)1 << s->level && s->count >= 0 && !(s->dt < 0) && !isnan(s->dt) &&
          (!s->cut || (isfinite(s->cut_end) && s->cut_end > s->now))))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no step that could come next");
}

static void archive_audit(drape_sim *sim, drape_archive *a)
{
    drape_audit *audit = &sim->audit;
    double *const sums[] = {&audit->start,        &audit->start_gravity, &audit->dissipated,
                            &audit->start_weight, &audit->offered,       &audit->lowest,
                            &audit->best,         &audit->residual_work, &audit->best_unexplained,
                            &audit->most_lost};
    drape_archive_mark(a, "audit");
    for (size_t i = 0; i < sizeof sums / sizeof *sums; i++)
        drape_archive_double(a, sums[i]);
    drape_archive_doubles(a, sim->work, drape_system_work_count(sim->system));
    drape_archive_bool(a, &sim->energy_known);
    double *const parts[] = {&sim->energy.kinetic, &sim->energy.elastic,    &sim->energy.gravity,
                             &sim->energy.contact, &sim->energy.dissipated, &sim->energy.numerical};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        drape_archive_double(a, parts[i]);
}

/* Whether the next frame lies within the last step. A steady-state integrator has only the first frame. */
static bool is_next_frame(const drape_sim *sim)
{
    const drape_state *before = &sim->states[sim->before >= 0 ? sim->before : sim->now];
    double least = before->t * sim->frame_rate - 2, most = drape_sim_state(sim)->t * sim->frame_rate + 2,
           next = (double)sim->next_frame;
    return next >= 0 && next <= most && (next >= least || sim->chosen.integrator->steady_state);
}

static void archive_statistics(drape_sim *sim, drape_archive *a)
{
    drape_statistics *s = &sim->statistics;
    int64_t *const counts[] = {&s->steps_accepted,    &s->steps_rejected,  &s->steps_unconverged,
                               &s->steps_above_error, &s->steps_held,      &sim->attempts,
                               &sim->next_frame,      &sim->left.by_error, &sim->left.above_own};
    double *const numbers[] = {&s->h_min,        &s->h_max,          &s->wall_setup, &s->wall_steps,
                               &s->wall_contact, &s->strain_min,     &s->strain_max, &s->error_max,
                               &s->error_last,   &sim->left.largest, &sim->left.last};
    drape_archive_mark(a, "statistics");
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        drape_archive_int64(a, counts[i]);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_archive_double(a, numbers[i]);
    int count = sim->reason_count;
    drape_archive_int(a, &count);
    if (drape_archive_good(a) && !is_place(count, 0, (int)(sizeof sim->reasons / sizeof *sim->reasons) + 1))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %d reasons for rejections", count);
    for (int i = 0; i < count && drape_archive_good(a); i++) {
        drape_reason_total *reason = &sim->reasons[i];
        char text[DRAPE_ARCHIVE_TEXT];
        snprintf(text, sizeof text, "%s",
                 a->reading ? "" : drape_system_reason_name(sim->system, reason->reason));
        drape_archive_text(a, text, sizeof text);
        drape_archive_int64(a, &reason->count);
        if (drape_archive_has_read(a)) {
            const char *name = drape_arena_text(sim->arena, text);
            reason->reason = name ? drape_system_reason(sim->system, name) : DRAPE_REASON_OTHER;
            if (!name)
                drape_archive_note(a, DRAPE_E_MEMORY);
        }
        sim->reason_count = drape_archive_good(a) ? i + 1 : i;
    }
    if (drape_archive_has_read(a) && !is_next_frame(sim))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no frame that could come next");
}

static void archive_untangling(drape_sim *sim, drape_archive *a)
{
    drape_untangling *u = &sim->untangling;
    double *const numbers[] = {&u->time,         &u->least_gap_before, &u->least_gap,
                               &u->displacement, &u->strain,           &u->seconds};
    int32_t *const counts[] = {&u->inside_before, &u->inside, &u->node, &u->cloths};
    drape_archive_mark(a, "untangling");
    drape_archive_bool(a, &sim->untangle_due);
    drape_archive_bool(a, &sim->untangled);
    drape_archive_bool(a, &u->clear);
    drape_archive_int(a, &u->sweeps);
    drape_archive_int64(a, &u->pairs_before);
    drape_archive_int64(a, &u->pairs);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_archive_double(a, numbers[i]);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        drape_archive_int32(a, counts[i]);
    drape_archive_doubles(a, sim->untangled_move, (size_t)sim->model->cloth_count);
    if (drape_archive_good(a) && !is_place(u->node, -1, sim->model->node_count))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an untangled node %d of %d", (int)u->node,
                           (int)sim->model->node_count);
}

void drape_sim_archive(drape_sim *sim, drape_archive *a)
{
    if (!a->reading) { /* read by create_restored */
        const size_t nodes = (size_t)sim->model->node_count;
        bool pins = sim->pinned != NULL, masses = sim->masses != NULL;
        drape_archive_bool(a, &pins);
        drape_archive_bool(a, &masses);
        if (pins)
            drape_archive_bytes(a, sim->pinned, nodes);
        if (masses)
            drape_archive_doubles(a, sim->masses, nodes);
    }
    /* of a run on several ranks, integrators are restarted: what they have done is that of earlier ones */
    drape_work work = sim->earlier;
    if (a->by_ranks && !a->reading)
        work = drape_work_sum(sim->chosen.integrator->work(sim->integrator), &work);
    drape_work_archive(&work, a);
    if (drape_archive_has_read(a))
        sim->earlier = work;
    archive_states(sim, a);
    drape_archive_doubles(a, sim->scratch, sizeof sim->scratch / sizeof *sim->scratch);
    archive_schedule(&sim->schedule, a);
    archive_audit(sim, a);
    archive_statistics(sim, a);
    drape_realtime_rescue.archive(sim, a);
    archive_untangling(sim, a);
    drape_events_archive(sim, a);
    drape_system_archive(sim->system, a);
    drape_archive_mark(a, "integrator");
    if (a->by_ranks)
        return;
    if (drape_archive_good(a))
        sim->chosen.integrator->archive(sim->integrator, a);
}

/* ---- For hosts ---- */

void drape_sim_exchange(drape_sim *sim, drape_sim *other)
{
    drape_sim former;
    const size_t size = offsetof(drape_sim, cancel);
    memcpy(&former, sim, size);
    memcpy(sim, other, size);
    memcpy(other, &former, size);
    drape_system_watch(sim->system, &sim->cancel);
    drape_system_watch(other->system, &other->cancel);
    drape_system_copy_wind(sim->system, other->system);
}

/* Reads an array of one number per node, if there is one; NULL otherwise. */
static void *read_own(drape_sim *sim, drape_archive *a, bool any, size_t size)
{
    const size_t nodes = (size_t)sim->model->node_count;
    void *own = any && drape_archive_good(a) ? drape_alloc(sim->ctx, nodes, size) : NULL;
    if (any && !own)
        drape_archive_note(a, DRAPE_E_MEMORY);
    if (own)
        drape_archive_bytes(a, own, nodes * size);
    return own;
}

static void check_own(drape_archive *a, size_t nodes, const uint8_t *pinned, const double *masses)
{
    bool flags = true, positive = true;
    for (size_t i = 0; i < nodes && drape_archive_good(a); i++) {
        flags = flags && (!pinned || pinned[i] <= 1);
        positive = positive && (!masses || (masses[i] > 0 && isfinite(masses[i])));
    }
    if (!flags)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a pin that is neither there nor not");
    if (!positive)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a node without mass");
}

/* A new sim with the pins and masses that there were when the archive was written. */
static drape_status create_restored(drape_sim *sim, drape_archive *a, drape_sim **out)
{
    bool pins = false, weighed = false;
    drape_archive_bool(a, &pins);
    drape_archive_bool(a, &weighed);
    uint8_t *pinned = read_own(sim, a, pins, sizeof *pinned);
    double *masses = read_own(sim, a, weighed, sizeof *masses);
    check_own(a, (size_t)sim->model->node_count, pinned, masses);
    const drape_status status =
        drape_archive_good(a)
            ? drape_sim_create_like(sim, &sim->chosen, drape_sim_base_model(sim), pinned, masses, out)
            : a->status;
    drape_free(sim->ctx, masses);
    drape_free(sim->ctx, pinned);
    return status;
}

drape_status drape_sim_read(drape_sim *sim, drape_archive *a)
{
    drape_sim *restored = NULL;
    drape_sim_archive_identity(sim, a);
    if (drape_archive_good(a))
        drape_archive_note(a, create_restored(sim, a, &restored));
    if (drape_archive_good(a))
        drape_sim_archive(restored, a);
    if (drape_archive_good(a))
        drape_sim_exchange(sim, restored);
    drape_sim_destroy(&restored);
    return a->status;
}

drape_status drape_sim_save_to(drape_sim *sim, drape_write *write, void *user)
{
    drape_archive a;
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (!write)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_save_to: the function is NULL");
    sim->ctx->message[0] = 0;
    drape_archive_write_to(&a, sim->ctx, MEMORY_NAME, write, NULL, user);
    drape_sim_archive_identity(sim, &a);
    drape_sim_archive(sim, &a);
    const drape_status status = drape_archive_end(&a);
    return drape_fail_unsaid(sim->ctx, status, "", "drape_sim_save_to: the function returned %s",
                             drape_status_name(status));
}

/* Reads the sim only: a run archives more for its files after it. */
drape_status drape_sim_restore_from(drape_sim *sim, const void *bytes, size_t size)
{
    drape_archive a;
    drape_status guarded = drape_sim_guard(sim, "drape_sim_restore_from");
    if (guarded)
        return guarded;
    if (!bytes)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_restore_from: the bytes are NULL");
    if (!drape_archive_read_from(&a, sim->ctx, MEMORY_NAME, bytes, size))
        drape_sim_read(sim, &a);
    return a.status;
}
