/* create.c: creating and destroying a sim. */
#include "base/clock.h"
#include "base/def.h"
#include "compile/compile.h"
#include "sim/rescue.h"
#include "sim/untangle.h"

#include <math.h>
#include <string.h>

#define MAX_THREADS 256
/* The shortest def of an older host. */
#define MIN_SIZE offsetof(drape_sim_def, controller)

/* Reads a def of this version or of an older, shorter one. */
static drape_status read_def(drape_context *ctx, const drape_sim_def *given, drape_sim_def *def)
{
    drape_sim_def_init(def, sizeof *def);
    if (!given)
        return DRAPE_OK;
    if (!drape_def_fits(given->struct_size, MIN_SIZE, sizeof *def))
        return drape_fail(
            ctx, DRAPE_E_VERSION,
            "the sim def was not initialised by drape_sim_def_init of this version: struct_size %zu",
            given->struct_size);
    memcpy(def, given, given->struct_size);
    def->struct_size = sizeof *def;
    if (def->threads < 1 || def->threads > MAX_THREADS)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "threads = %d; it is 1 to %d", def->threads, MAX_THREADS);
    if (!(def->realtime_step >= 0 && def->realtime_step <= 1e6))
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "realtime_step = %g; it is in (0, 1e6] s, or 0 for four times dt",
                          def->realtime_step);
    if (!(def->frame_rate >= 0 && def->frame_rate <= 1e6))
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "frame_rate = %g; it is in (0, 1e6] 1/s, or 0 for the scene's", def->frame_rate);
    if (!(def->teleport_speed >= 0 && def->teleport_speed <= 1e9))
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "teleport_speed = %g; it is in (0, 1e9] m/s, or 0 for no limit",
                          def->teleport_speed);
    return DRAPE_OK;
}

static drape_status create_states(drape_sim *sim)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && i < 2 + sim->chosen.controller->history_depth; i++)
        status = drape_state_create(sim->arena, sim->model, &sim->states[i]);
    size_t n = 3 * (size_t)sim->model->node_count;
    sim->frame = drape_arena_take(sim->arena, n, sizeof *sim->frame);
    sim->frame_velocity = drape_arena_take(sim->arena, n, sizeof *sim->frame_velocity);
    sim->query_scratch = drape_arena_take(sim->arena, n, sizeof *sim->query_scratch);
    sim->untangled_move =
        drape_arena_take(sim->arena, (size_t)sim->model->cloth_count, sizeof *sim->untangled_move);
    sim->state_bytes = sizeof *sim + sim->arena->bytes;
    return drape_arena_status(sim->arena);
}

/* Where ranks share the model, a stage of the creation begins only if all have ended the one before. */
static drape_status agree(const drape_sim *sim, drape_status status)
{
    return drape_ranks_agree(drape_model_ranks(sim->model), sim->ctx, status);
}

static drape_status create_system(drape_sim *sim, int threads)
{
    drape_status status = agree(sim, drape_system_create(sim->arena, sim->model, threads, &sim->system));
    if (status)
        return status;
    drape_system_watch(sim->system, &sim->cancel);
    if (sim->chosen.integrator->leaves_losses)
        drape_system_leave_losses(sim->system);
    if (!sim->chosen.integrator->projects_contact) {
        status = drape_system_add_contact(sim->system);
        if (!status && !sim->chosen.integrator->own_steps)
            drape_system_set_contact_step(
                sim->system, drape_chosen_integrator_value(&sim->chosen, "dt", 1 / sim->frame_rate));
        return status;
    }
    drape_system_leave_constraints(sim->system);
    return DRAPE_OK;
}

/* Creates a sim with nothing but its arena. */
static drape_status open_sim(drape_context *ctx, const drape_model *model, const drape_sim_def *def,
                             drape_sim **out)
{
    drape_sim *sim = *out = drape_alloc(ctx, 1, sizeof *sim);
    if (!sim)
        return DRAPE_E_MEMORY;
    *sim = (drape_sim){.next = 1,
                       .before = -1,
                       .past = {-1, -1},
                       .ctx = ctx,
                       .arena = drape_arena_create(ctx),
                       .model = model,
                       .statistics = {.error_max = NAN, .error_last = NAN},
                       .left = {.largest = NAN, .last = NAN},
                       .realtime_step = def->realtime_step,
                       .frame_rate = def->frame_rate > 0 ? def->frame_rate : model->frame_rate,
                       .teleport_speed = def->teleport_speed};
    return sim->arena ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* Creates everything that a sim with its choices needs, except its energy account. */
static drape_status start_sim(drape_sim *sim, int threads)
{
    drape_status status = drape_chosen_check(sim->ctx, &sim->chosen, sim->model);
    if (!status)
        status = create_states(sim);
    status = status ? status : drape_check_cancel(sim->ctx);
    status = agree(sim, status);
    if (!status)
        status = create_system(sim, threads);
    if (!status)
        status = drape_sim_create_work(sim);
    if (!status) {
        /* Pins that bodies carry have the velocity of the body at the start, which frames of the first
         * step show. Those with a track of their own begin at rest, and jump to its velocity. */
        const drape_motion *motion = drape_system_motion(sim->system);
        drape_state *now = &sim->states[sim->now];
        for (int32_t i = 0; i < motion->moved_count; i++)
            if (drape_motion_carrier(motion, i) >= 0)
                drape_motion_pin_velocity(motion, i, now->t, now->t,
                                          now->v + 3 * (size_t)motion->moved_node[i]);
    }
    status = status ? status : drape_check_cancel(sim->ctx);
    status = agree(sim, status);
    if (!status) {
        const size_t before = sim->arena->bytes;
        status = sim->chosen.integrator->create(sim->arena, sim->system, sim->chosen.integrator_values,
                                                &sim->integrator);
        sim->integrator_bytes = sim->arena->bytes - before;
    }
    status = status ? status : drape_check_cancel(sim->ctx);
    if (!status)
        status = drape_events_create(sim);
    if (!status && sim->model->contact.no_room == DRAPE_NO_ROOM_RELAX)
        status = drape_realtime_rescue.open(sim);
    status = agree(sim, status);
    if (status)
        return status;
    const double given = drape_chosen_integrator_value(&sim->chosen, "tolerance", NAN),
                 used = drape_sim_tolerance(sim);
    if (used < given)
        drape_log(sim->ctx, DRAPE_LOG_INFO,
                  "/integrator/tolerance: %.4g N is more than 1 %% of the load of a node: %.4g N is used",
                  given, used);
    /* Rules of contact that move nodes return no share of an impact. */
    const drape_model *m = sim->model;
    bool asked = m->contact.self && m->contact.self_restitution > 0;
    for (int32_t c = 0; c < m->collider_count && !asked; c++)
        asked = m->colliders[c].restitution > 0;
    if (asked && sim->chosen.integrator->projects_contact)
        drape_log(
            sim->ctx, DRAPE_LOG_WARNING,
            "\"%s\" ignores restitution: it resolves contact by moving nodes, and cloth does not rebound",
            sim->chosen.integrator->entry.name);
    const drape_stepping stepping = sim->chosen.integrator->own_steps   ? DRAPE_STEPS_FREE
                                    : sim->chosen.controller->own_steps ? DRAPE_STEPS_PROPOSED
                                                                        : DRAPE_STEPS_COUNTED;
    drape_schedule_init(&sim->schedule, stepping, drape_chosen_integrator_value(&sim->chosen, "dt", 0), 0);
    sim->max_attempts = sim->chosen.controller->max_attempts;
    return DRAPE_OK;
}

/* A copy in the arena; NULL without one to copy. */
static void *keep(drape_sim *sim, const void *from, size_t count, size_t size)
{
    void *copy = from ? drape_arena_take(sim->arena, count, size) : NULL;
    if (copy)
        memcpy(copy, from, count * size);
    return copy;
}

/* Replaces the model by one with these pins and masses. */
static drape_status change_nodes(drape_sim *sim, const uint8_t *pinned, const double *masses)
{
    const size_t nodes = (size_t)sim->model->node_count;
    const drape_status status = drape_compile_repinned(sim->ctx, sim->model, pinned, masses, &sim->own_model);
    if (status)
        return status;
    sim->model = sim->own_model;
    sim->pinned = keep(sim, pinned, nodes, sizeof *pinned);
    sim->masses = keep(sim, masses, nodes, sizeof *masses);
    return drape_arena_status(sim->arena);
}

drape_status drape_sim_create_like(const drape_sim *like, const drape_chosen *chosen,
                                   const drape_model *model, const uint8_t *pinned, const double *masses,
                                   drape_sim **out)
{
    const drape_sim_def def = {.frame_rate = like->frame_rate,
                               .realtime_step = like->realtime_step,
                               .teleport_speed = like->teleport_speed};
    drape_status status = open_sim(like->ctx, model, &def, out);
    if (!status && (pinned || masses))
        status = change_nodes(*out, pinned, masses);
    status = drape_ranks_agree(drape_model_ranks(model), like->ctx, status);
    if (!status) {
        (*out)->chosen = *chosen;
        status = start_sim(*out, drape_pool_threads(drape_system_pool(like->system)));
        if (!status)
            status = drape_events_copy(*out, like);
        if (!status)
            drape_sim_copy_untangling(*out, like);
    }
    if (status)
        drape_sim_destroy(out);
    return status;
}

/* Not every method can run on several ranks. */
static drape_status check_ranks(const drape_sim *sim)
{
    if (!sim->chosen.integrator->by_ranks)
        return drape_fail_at(sim->ctx, DRAPE_E_ARGUMENT, "/integrator/method",
                             "a run on several ranks cannot use \"%s\"", sim->chosen.integrator->entry.name);
    if (!sim->chosen.controller->by_ranks)
        return drape_fail_at(sim->ctx, DRAPE_E_ARGUMENT, "/controller/type",
                             "a run on several ranks cannot use \"%s\"", sim->chosen.controller->entry.name);
    return DRAPE_OK;
}

drape_status drape_sim_create(drape_context *ctx, const drape_model *model, const drape_sim_def *given,
                              drape_sim **out)
{
    drape_sim_def def;
    double start = drape_clock_seconds();
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!out)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_sim_create: out is NULL");
    *out = NULL;
    if (!model)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_sim_create: the model is NULL");
    drape_status status = read_def(ctx, given, &def);
    if (!status)
        status = open_sim(ctx, model, &def, out);
    if (!status)
        status = drape_choose(ctx, model, &def, &(*out)->chosen);
    if (!status && model->part)
        status = check_ranks(*out);
    status = drape_ranks_agree(drape_model_ranks(model), ctx, status);
    if (!status)
        status = start_sim(*out, def.threads);
    if (status) {
        drape_sim_destroy(out);
        return status;
    }
    (*out)->untangle_due = model->untangle.given;
    drape_sim_reset_energy(*out);
    (*out)->statistics.wall_setup = drape_clock_seconds() - start;
    return DRAPE_OK;
}

void drape_sim_destroy(drape_sim **out)
{
    if (!out || !*out)
        return;
    drape_sim *sim = *out;
    if (sim->integrator && sim->chosen.integrator->destroy)
        sim->chosen.integrator->destroy(&sim->integrator);
    drape_system_destroy(&sim->system);
    drape_model_destroy(&sim->own_model);
    drape_model_destroy(&sim->kept_model);
    drape_arena_free(&sim->rescue_arena);
    drape_arena_destroy(&sim->arena);
    drape_free(sim->ctx, sim);
    *out = NULL;
}
