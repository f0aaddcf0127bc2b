/*
 * rescue.c: what happens after a step that fails (sim/rescue.h). With no_room "relax" or, by default, with a
 * time budget, cloth that bodies leave no room is relaxed (room.h), and the same step is made again. With a
 * time budget, cloth is held in the end (hold.h).
 */
#include "base/clock.h"
#include "base/reason.h"
#include "realtime/hold.h"
#include "realtime/relaxed_report.h"
#include "realtime/room.h"

#include <math.h>
#include <stdio.h>

/* After so many failures in a row, or so many halvings of a step, near pairs are relaxed; an impact on cloth
 * that has room also takes some attempts. With a time budget, in which a frame may have a single attempt, the
 * pair that refuses an attempt is relaxed after so many failures within one nominal step, whatever was
 * accepted between them. With 3 instead of 6, three capes with self-contact were 23 mm inside of bodies,
 * instead of nowhere, and pinches dropped a tenth less time. */
#define PATIENCE 6

static drape_contact *contact_of(const drape_sim *sim)
{
    return drape_system_contact(sim->system);
}

/* Takes memory from an arena of its own: an arena whose allocation has failed once keeps its failure, and a
 * later call may find memory. */
static drape_status open_memory(drape_sim *sim)
{
    if (sim->rescue)
        return DRAPE_OK;
    drape_arena arena = drape_arena_within(sim->arena);
    drape_realtime_memory *m = drape_arena_take(&arena, 1, sizeof *m);
    const drape_status status = m ? drape_room_open(&arena, contact_of(sim)) : DRAPE_E_MEMORY;
    if (status) {
        drape_arena_free(&arena);
        return status;
    }
    sim->rescue_arena = arena;
    sim->realtime = m;
    sim->rescue = &drape_realtime_rescue;
    return DRAPE_OK;
}

/* ---- A step ---- */

/* Whether cloth that bodies leave no room may be relaxed. */
static bool may_relax(const drape_sim *sim)
{
    const drape_no_room policy = sim->model->contact.no_room;
    return policy == DRAPE_NO_ROOM_RELAX || (policy == DRAPE_NO_ROOM_AUTO && sim->realtime->active);
}

static void begin(drape_sim *sim, double t1)
{
    drape_room_expect(contact_of(sim), t1, may_relax(sim));
}

static void solved(drape_sim *sim, const drape_step_info *info)
{
    sim->realtime->solved_at = drape_clock_seconds();
    sim->realtime->further_seconds = info->further_seconds;
}

static bool takes_any(const drape_sim *sim)
{
    return sim->realtime->active;
}

/* Relaxes cloth that bodies leave no room at the end of the step and, if the step has failed several times or
 * is not to be tried again, the pairs that hold it up. Returns how many nodes. */
static int32_t relax(drape_sim *sim, double t1, drape_status failure, bool stopped, drape_status *status)
{
    const drape_realtime_memory *m = sim->realtime;
    const bool all = stopped || m->failed >= PATIENCE || sim->schedule.level >= PATIENCE,
               one = m->active && m->held_up >= PATIENCE,
               may_help =
                   failure > 0 || failure == DRAPE_E_STEP_TOO_SMALL; /* of integrators with own steps */
    int32_t added = 0;
    if (may_help && may_relax(sim))
        *status = drape_room_relax(contact_of(sim), t1,
                                   all   ? DRAPE_RELAX_NEAR
                                   : one ? DRAPE_RELAX_PAIR
                                         : DRAPE_RELAX_NONE,
                                   &added);
    return *status ? 0 : added;
}

static drape_verdict failed(drape_sim *sim, double t1, drape_trial *trial, drape_verdict verdict)
{
    drape_realtime_memory *m = sim->realtime;
    drape_status status = DRAPE_OK;
    m->relaxed_again = relax(sim, t1, trial->status, verdict == DRAPE_STOP, &status) > 0;
    if (!status && !m->relaxed_again && drape_hold(sim, trial, verdict == DRAPE_STOP, &status)) {
        trial->h_next = sim->schedule.dt;
        drape_schedule_cut(&sim->schedule, sim->states[sim->next].t);
        return DRAPE_SUBSTITUTE;
    }
    m->failed++;
    m->held_up++;
    if (status) {
        trial->stop = status;
        return DRAPE_STOP;
    }
    if (!m->relaxed_again)
        return verdict;
    drape_schedule_repeat(&sim->schedule);
    return DRAPE_REPEAT;
}

/* With a time budget, the steps of the schedule may be smaller than nominal ones. */
static void accepted(drape_sim *sim)
{
    drape_realtime_memory *m = sim->realtime;
    const double t = drape_sim_state(sim)->t;
    m->failed = 0;
    if (!(t - m->held_up_from < (m->active ? m->dt : sim->schedule.dt))) {
        m->held_up = 0;
        m->held_up_from = t;
    }
    drape_sim_log_relaxed(sim);
}

/* If contact refused the step, the pairs that hold it up count as having no room. */
static drape_status advise(drape_sim *sim, const drape_attempt *last, char *text, size_t size)
{
    bool lacks = false;
    text[0] = 0;
    if (sim->model->part || sim->chosen.integrator->projects_contact || (sim->rescue && may_relax(sim)))
        return DRAPE_OK;
    const bool refused = sim->reason == DRAPE_REASON_PENETRATION || sim->reason == DRAPE_REASON_COLLISION;
    const double t1 = last->t + fmax(last->h, sim->schedule.dt);
    const drape_status status =
        drape_room_lacks(contact_of(sim), t1, refused ? DRAPE_RELAX_NEAR : DRAPE_RELAX_NONE, &lacks);
    if (lacks)
        snprintf(text, size,
                 "; bodies leave the cloth no room there: with /contact/no_room \"relax\" they are let into "
                 "it, and the run goes on");
    return status;
}

/* ---- Between sims ---- */

static void archive_memory(drape_sim *sim, drape_archive *a)
{
    drape_realtime_memory *m = sim->realtime;
    double *const numbers[] = {&m->dt,         &m->longest,     &m->debt,        &m->dropped,
                               &m->behind,     &m->pins_behind, &m->cap,         &m->apart_at,
                               &m->apart_wait, &m->ending,      &m->held_up_from};
    int64_t *const counts[] = {&m->inaccurate, &m->crossings, &m->most_crossings,
                               &m->crossed,    &m->failed,    &m->held_up};
    drape_archive_bool(a, &m->active);
    drape_archive_bool(a, &m->stretched);
    drape_archive_bool(a, &m->touches);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_archive_double(a, numbers[i]);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        drape_archive_int64(a, counts[i]);
    drape_archive_doubles(a, m->cost, 2);
    drape_archive_int(a, &m->effort);
    if (drape_archive_good(a) && m->effort != 0 && !(m->effort == 1 && sim->chosen.integrator->set_cheap))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an effort %d", m->effort);
    if (drape_archive_good(a) && m->active &&
        !(m->dt > 0 && m->longest >= m->dt && m->longest <= DRAPE_MOST && m->debt >= 0 &&
          m->debt <= m->longest && m->behind >= 0 && m->pins_behind >= 0 && m->cap > 0))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no step for a budget");
    if (drape_archive_has_read(a))
        drape_realtime_set_effort(sim, m->effort);
}

static void archive(drape_sim *sim, drape_archive *a)
{
    bool open = sim->rescue != NULL;
    drape_archive_mark(a, "realtime");
    drape_archive_bool(a, &open);
    if (open && drape_archive_has_read(a))
        drape_archive_note(a, open_memory(sim));
    if (!open || !drape_archive_good(a))
        return;
    archive_memory(sim, a);
    if (drape_realtime_relaxed(sim))
        drape_relaxed_archive(drape_realtime_relaxed(sim), a);
}

/* Continues from another sim, without the count of its attempts that failed. */
static drape_status go_on(drape_sim *to, const drape_sim *from, const int32_t *before)
{
    const drape_status status = from->rescue ? open_memory(to) : DRAPE_OK;
    if (status || !from->rescue)
        return status;
    *to->realtime = *from->realtime;
    to->realtime->failed = to->realtime->held_up = 0;
    to->realtime->held_up_from = 0;
    drape_realtime_set_effort(to, to->realtime->effort);
    const drape_relaxed_set *relaxed = drape_realtime_relaxed(from);
    return relaxed ? drape_relaxed_continue(drape_realtime_relaxed(to), relaxed, before) : DRAPE_OK;
}

const drape_rescue_ops drape_realtime_rescue = {.begin = begin,
                                                .solved = solved,
                                                .takes_any = takes_any,
                                                .failed = failed,
                                                .accepted = accepted,
                                                .leave = drape_realtime_leave,
                                                .open = open_memory,
                                                .advise = advise,
                                                .archive = archive,
                                                .go_on = go_on,
                                                .send_pins = drape_teleport_pins,
                                                .send_collider = drape_teleport_collider,
                                                .warnings = drape_realtime_warnings};
