/*
 * summary.c: see summary.h. The keys are a contract with readers of summaries: add keys, do not rename any.
 */
#include "io/summary.h"

#include "io/export.h"
#include "io/json.h"
#include "model/model.h"
#include "realtime/relaxed_report.h"
#include "sim/inside.h"
#include "sim/sim.h"
#include "sim/warnings.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

/* A count of the sim; null if the host cancelled it; NULL, which fails the summary, if memory was out. */
static json_t *found(const drape_sim *sim, int64_t count)
{
    return count >= 0 ? json_integer((json_int_t)count) : drape_check_cancel(sim->ctx) ? json_null() : NULL;
}

/* For each collider, if there are any: the number of triangles of the cloth that reach into it, how deep [m],
 * and the pairs of edge and triangle that pass through each other; and those pairs of the cloth itself. */
static json_t *with_inside(json_t *object, const drape_sim *sim)
{
    const int32_t colliders = drape_sim_model(sim)->collider_count;
    json_t *list = json_array();
    for (int32_t c = 0; c < colliders; c++) {
        drape_inside inside;
        if (drape_sim_find_inside(sim, c, &inside))
            inside = (drape_inside){.triangles = -1, .deepest = NAN, .intersections = -1};
        json_t *one = drape_json_with(json_object(), "triangles", found(sim, inside.triangles));
        one = drape_json_with(one, "deepest", drape_json_number(inside.deepest));
        one = drape_json_with(one, "intersections", found(sim, inside.intersections));
        list = drape_json_append(list, one);
    }
    object = drape_json_with_list(object, "inside", list);
    return drape_json_with(object, "intersections", found(sim, drape_sim_intersections(sim, -1)));
}

/* For each collider, and pinned pieces of cloth, that left cloth no room, if there are any: the number of
 * nodes that are relaxed there, the most at a time, how deep [m], and when [s]. */
static json_t *with_no_room(json_t *object, const drape_sim *sim)
{
    json_t *list = json_array();
    for (int32_t c = -1; c < drape_sim_model(sim)->collider_count; c++) {
        const drape_relaxed_total *total = drape_sim_relaxed_total(sim, c);
        if (total->most == 0)
            continue;
        json_t *one = drape_json_with(json_object(), "at", drape_json_text(drape_sim_relaxed_name(sim, c)));
        list = drape_json_append(
            list, DRAPE_JSON_REALS(
                      DRAPE_JSON_COUNTS(one, {"now", drape_sim_relaxed_at(sim, c)}, {"most", total->most}),
                      {"deepest", total->deepest}, {"first", total->first}, {"last", total->last},
                      {"seconds", total->seconds}));
    }
    return drape_json_with_list(object, "no_room", list);
}

/* What the untangling of the start, or the last one of a host, found and did. */
static json_t *with_untangling(json_t *object, const drape_sim *sim)
{
    const drape_model *model = drape_sim_model(sim);
    const drape_untangling *u = &sim->untangling;
    if (!sim->untangled)
        return object;
    json_t *list = json_array(), *one = drape_json_with(json_object(), "clear", json_boolean(u->clear));
    for (int32_t c = 0; c < model->cloth_count; c++) {
        if (!(sim->untangled_move[c] > 0))
            continue;
        json_t *cloth = drape_json_with(json_object(), "name", drape_json_text(model->cloths[c].name));
        list = drape_json_append(
            list, drape_json_with(cloth, "displacement", drape_json_number(sim->untangled_move[c])));
    }
    one = DRAPE_JSON_REALS(
        DRAPE_JSON_COUNTS(one, {"sweeps", u->sweeps}, {"pairs_before", u->pairs_before}, {"pairs", u->pairs},
                          {"inside_before", u->inside_before}, {"inside", u->inside}, {"node", u->node}),
        {"time", u->time}, {"least_gap_before", u->least_gap_before}, {"least_gap", u->least_gap},
        {"displacement", u->displacement}, {"strain", u->strain}, {"seconds", u->seconds});
    return drape_json_with(object, "untangling", drape_json_with(one, "cloths", list));
}

/* For each event, if there are any: how often it occurred, and the first times. */
static json_t *with_events(json_t *object, const drape_sim *sim)
{
    json_t *list = json_array();
    for (int32_t i = 0; i < sim->events.count; i++) {
        const drape_watch *w = &sim->events.watches[i];
        json_t *times = json_array();
        for (int64_t k = 0; k < w->count && k < DRAPE_EVENT_TIMES; k++) {
            const drape_event_root *r = &w->first[k];
            times = drape_json_append(times, json_pack("{s:o, s:o, s:s}", "time", drape_json_number(r->t),
                                                       "value", drape_json_number(r->value), "direction",
                                                       r->direction > 0 ? "up" : "down"));
        }
        json_t *one = drape_json_with(json_object(), "name", drape_json_text(w->event->name));
        one = drape_json_with(one, "count", json_integer((json_int_t)w->count));
        list = drape_json_append(list, drape_json_with(one, "occurrences", times));
    }
    return drape_json_with_list(object, "events", list);
}

/* What each seam carries at the end. */
static json_t *with_seams(json_t *object, drape_sim *sim)
{
    drape_seam_report s;
    json_t *list = json_array();
    const int32_t count = drape_sim_seam(sim, -1, NULL);
    for (int32_t i = 0; i < count; i++) {
        drape_sim_seam(sim, i, &s);
        json_t *one = drape_json_with(json_object(), "name", drape_json_text(s.name));
        one = drape_json_with(one, "type", drape_json_text(s.type));
        one = drape_json_with(one, "pairs", json_integer((json_int_t)s.pairs));
        one = drape_json_with(DRAPE_JSON_REALS(one, {"gap_mean", s.gap_mean}, {"gap_max", s.gap_max},
                                               {"tension", s.tension}, {"tension_max", s.tension_max}),
                              "force", drape_json_numbers(s.force, 3));
        list = drape_json_append(list, one);
    }
    return drape_json_with_list(object, "seams", list);
}

static json_t *warnings(drape_sim *sim)
{
    json_t *list = json_array();
    drape_warning w;
    for (int i = 0; drape_sim_warning(sim, i, &w); i++) {
        json_t *one = drape_json_with(json_object(), "name", json_string(w.name));
        one = drape_json_with(one, "text", drape_json_text(w.text));
        if (json_array_append_new(list, one)) {
            json_decref(list);
            return NULL;
        }
    }
    if (!drape_sim_take_warning_failure(sim) || drape_check_cancel(sim->ctx))
        return list;
    json_decref(list);
    return NULL;
}

json_t *drape_summary_accuracy(const drape_model *model, const drape_accuracy *accuracy)
{
    json_t *of = DRAPE_JSON_COUNTS(json_object(), {"node", accuracy->node});
    of = drape_json_with(of, "reached", json_boolean(accuracy->reached));
    of = DRAPE_JSON_REALS(of, {"error", accuracy->error}, {"distance", accuracy->distance},
                          {"worst", accuracy->worst}, {"time", accuracy->time}, {"until", accuracy->until});
    of = drape_json_with(of, "cloth", drape_json_text(model->cloths[accuracy->cloth].name));
    return drape_json_with(of, "place", drape_json_numbers(accuracy->place, 3));
}

static json_t *summary(drape_sim *sim, const drape_summary_def *def)
{
    const drape_model *model = drape_sim_model(sim);
    const drape_statistics s = drape_sim_statistics(sim);
    const drape_energy e = drape_sim_energy(sim);
    const char *reason;
    int64_t count = 0;
    char digits[17];
    json_t *object = drape_json_with(json_object(), "status", json_string(drape_status_name(def->status)));
    object = drape_json_with(object, "message", drape_json_text(def->message ? def->message : ""));
    object = drape_json_with(object, "version", json_string(drape_version()));
    object = DRAPE_JSON_COUNTS(object, {"nodes", drape_model_node_count(model)},
                               {"dofs", drape_model_dof_count(model)},
                               {"nnz", drape_model_nonzero_count(model)}, {"frames", def->frames});
    object = drape_json_with(object, "time", drape_json_number(drape_sim_time(sim)));
    json_t *reasons = json_object();
    for (int i = 0; (reason = drape_sim_reason(sim, i, &count)); i++)
        reasons = drape_json_with(reasons, reason, json_integer((json_int_t)count));
    json_t *steps =
        DRAPE_JSON_COUNTS(json_object(), {"accepted", s.steps_accepted}, {"rejected", s.steps_rejected},
                          {"unconverged", s.steps_unconverged}, {"held", s.steps_held});
    steps = DRAPE_JSON_REALS(steps, {"h_min", s.h_min}, {"h_max", s.h_max});
    object = drape_json_with(object, "steps", drape_json_with(steps, "reasons", reasons));
    json_t *newton =
        DRAPE_JSON_COUNTS(json_object(), {"iterations", s.newton_iterations}, {"jacobians", s.jacobians},
                          {"factorizations", s.factorizations}, {"linear_iterations", s.linear_iterations},
                          {"residuals", s.residuals});
    object = drape_json_with(object, "newton", newton);
    object = drape_json_with(object, "tolerance", drape_json_number(s.tolerance));
    if (!isnan(s.error_bound) || !isnan(s.error_max)) {
        /* the estimated distance of steps to the solution of their equation [m], and the energy left [J] */
        json_t *error = DRAPE_JSON_REALS(json_object(), {"bound", s.error_bound}, {"largest", s.error_max},
                                         {"last", s.error_last}, {"largest_left", sim->left.largest},
                                         {"last_left", sim->left.last});
        error = DRAPE_JSON_COUNTS(error, {"steps_above", s.steps_above_error},
                                  {"steps_by_local_error", sim->left.by_error},
                                  {"steps_above_local_error", sim->left.above_own});
        object = drape_json_with(object, "error", error);
    }
    const drape_accuracy *accuracy = def->accuracy;
    json_t *wall = DRAPE_JSON_REALS(json_object(), {"total", def->wall_total}, {"setup", s.wall_setup},
                                    {"steps", s.wall_steps + (accuracy ? accuracy->seconds : 0)},
                                    {"residual", s.wall_residual}, {"jacobian", s.wall_jacobian},
                                    {"factor", s.wall_factor}, {"solve", s.wall_solve},
                                    {"contact", s.wall_contact}, {"output", def->wall_output});
    object = drape_json_with(object, "wall_s", wall);
    if (accuracy) { /* the estimated error, a share of the diagonal, and what else is known of it */
        json_t *of = DRAPE_JSON_COUNTS(drape_summary_accuracy(model, accuracy), {"runs", accuracy->runs});
        of = DRAPE_JSON_REALS(of, {"asked", accuracy->asked}, {"earlier_runs_s", accuracy->seconds});
        of = drape_json_with(of, "method", drape_json_text(accuracy->method));
        object = drape_json_with(object, "accuracy", drape_json_number(accuracy->error));
        object = drape_json_with(object, "accuracy_of", of);
    }
    json_t *energy = DRAPE_JSON_REALS(json_object(), {"kinetic", e.kinetic}, {"elastic", e.elastic},
                                      {"gravity", e.gravity}, {"contact", e.contact},
                                      {"dissipated", e.dissipated}, {"numerical", e.numerical});
    object = drape_json_with(object, "energy", energy);
    json_t *works = json_object();
    const char *name;
    double work;
    for (int i = 0; (name = drape_sim_work(sim, i, &work)); i++)
        works = drape_json_with(works, name, drape_json_number(work));
    object = drape_json_with(object, "work", works);
    object = drape_json_with(object, "strain",
                             DRAPE_JSON_REALS(json_object(), {"min", s.strain_min}, {"max", s.strain_max}));
    if (s.stability_known) /* of an equilibrium; the number is that of negative eigenvalues of its Hessian */
        object = drape_json_with(object, "equilibrium",
                                 json_pack("{s:b, s:I}", "stable", s.unstable_modes == 0, "unstable_modes",
                                           (json_int_t)s.unstable_modes));
    if (model->part) /* what follows needs the whole model */
        return drape_json_with(object, "ranks", json_integer(model->part->ranks->count));
    object = with_inside(object, sim);
    object = with_untangling(object, sim);
    object = with_no_room(object, sim);
    object = with_events(object, sim);
    object = with_seams(object, sim);
    object = drape_json_with(object, "warnings", warnings(sim));
    if (def->realtime) {
        const drape_summary_realtime *r = def->realtime;
        json_t *realtime =
            DRAPE_JSON_COUNTS(json_object(), {"frames", r->frames}, {"missed", r->missed}, {"full", r->full},
                              {"fewer", r->fewer}, {"larger", r->larger}, {"still", r->still},
                              {"inaccurate", r->inaccurate}, {"crossings", r->crossings});
        realtime = DRAPE_JSON_REALS(realtime, {"budget", r->budget}, {"p50", r->p50}, {"p95", r->p95},
                                    {"p99", r->p99}, {"worst", r->worst}, {"debt", r->debt},
                                    {"dropped", r->dropped});
        object = drape_json_with(object, "realtime", realtime);
    }
    snprintf(digits, sizeof digits, "%016" PRIx64, drape_sim_hash(sim));
    return drape_json_with(object, "hash", json_string(digits));
}

drape_status drape_summary_write(drape_context *ctx, drape_sim *sim, const drape_summary_def *def,
                                 drape_folder *folder, const char *path)
{
    if (!sim || !def || !path)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "a summary needs a sim, a def and a path");
    drape_file file = {0};
    locale_t old = drape_locale_enter();
    const drape_ranks *ranks = drape_model_ranks(sim->model);
    errno = 0;
    json_t *json = summary(sim, def);
    drape_status status = DRAPE_OK;
    if (!json || drape_memory_ran_out())
        status = drape_fail(ctx, DRAPE_E_MEMORY, "out of memory for the summary \"%.500s\"", path);
    else if (!ranks || ranks->rank == 0) /* rank 0 writes it */
        status = drape_export_begin(ctx, folder, path, &file);
    if (!status && file.open) {
        drape_json_put(&file, json, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
        drape_file_put_text(&file, "\n");
        status = drape_file_finish(&file);
    }
    json_decref(json);
    drape_file_destroy(&file);
    drape_locale_leave(old);
    return status;
}
