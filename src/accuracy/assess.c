/* assess.c: see assess.h. */
#include "accuracy/assess.h"

#include "accuracy/accuracy.h"
#include "base/clock.h"
#include "base/vec3.h"
#include "geometry/deviation.h"
#include "mesh/grid.h"
#include "model/periodic.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define WITHIN   1e-2
#define ROUNDING 1e-9  /* of the duration */
#define FINER    0.5   /* steps, and edges */
#define TIGHTER  0.1   /* tolerances */
#define ESTIMATE 1.414 /* of the error, times the distance */

typedef struct judge {
    drape_context *ctx;
    drape_arena arena;
    drape_model *model;
    const drape_sim_def *given;
    drape_assess_prepare *prepare;
    void *user;
    drape_assessment *out;
    drape_chosen chosen; /* of the run */
    bool controlled;     /* its steps, by a tolerance */
    double *x, *times;   /* (most x nodes x 3), (most) its frames [m], [s] */
    int64_t frames, most;
    double deadline, clock; /* [s] of CPU time; of the last step */
    /* of the present run: its number, -1: the run itself; frames that were compared */
    int number;
    int64_t frame;
    drape_deviation apart;
    bool late, parted;
} judge;

static double value_of(const judge *j, const char *name)
{
    const double value = drape_chosen_integrator_value(&j->chosen, name, NAN);
    return isnan(value) ? drape_chosen_controller_value(&j->chosen, name, NAN) : value;
}

/* With tolerances of the run, and all that bounds its steps, times a factor: of steps a half, if it is not 1.
 * Tolerances that the scene does not give follow rtol. */
static drape_status create(const judge *j, const drape_model *model, double factor, drape_sim **sim)
{
    static const char *const names[] = {"rtol",       "atol_x",   "atol_v",   "dt",
                                        "fixed_step", "max_step", "max_move", "max_stretch"};
    enum { TOLERANCES = 3, COUNT = sizeof names / sizeof *names };
    drape_setting of_integrator[COUNT], of_controller[COUNT];
    drape_sim_def def = *j->given;
    def.integrator_settings = of_integrator;
    def.controller_settings = of_controller;
    def.integrator_setting_count = def.controller_setting_count = 0;
    for (size_t i = 0; i < COUNT; i++) {
        const bool steps = i >= TOLERANCES;
        const double by_integrator = drape_chosen_integrator_value(&j->chosen, names[i], NAN),
                     by_controller = drape_chosen_controller_value(&j->chosen, names[i], NAN),
                     scale = steps && factor < 1 ? FINER : factor;
        if (!isnan(by_integrator))
            of_integrator[def.integrator_setting_count++] =
                (drape_setting){.name = names[i], .number = scale * by_integrator};
        if (!isnan(by_controller))
            of_controller[def.controller_setting_count++] =
                (drape_setting){.name = names[i], .number = scale * by_controller};
    }
    def.integrator = j->chosen.integrator->entry.name;
    def.controller = j->chosen.controller->entry.name;
    return drape_sim_create(j->ctx, model, &def, sim);
}

/* ---- A run ---- */

static drape_status watch(void *user, const drape_event *event)
{
    judge *j = user;
    const size_t n = 3 * (size_t)j->model->node_count;
    if (event->kind == DRAPE_EVENT_ATTEMPT) { /* the next takes as long as the last */
        const double now = drape_clock_cpu_seconds();
        j->late = j->number >= 0 && 2 * now - j->clock > j->deadline;
        j->clock = now;
    }
    if (event->kind == DRAPE_EVENT_FRAME && j->number < 0 && j->frames < j->most) {
        memcpy(j->x + n * (size_t)j->frames, event->positions, n * sizeof *j->x);
        j->times[j->frames++] = event->time;
    } else if (event->kind == DRAPE_EVENT_FRAME && j->number >= 0 && j->frame < j->frames) {
        drape_deviation_add(&j->apart, event->time, j->x + n * (size_t)j->frame, event->positions);
        const drape_deviation_cloth *worst = &j->apart.cloths[drape_deviation_worst(&j->apart)];
        j->parted =
            j->number == DRAPE_ASSESS_BY_START && worst->largest.rms > j->out->within * worst->diagonal;
        j->frame += !j->parted;
    }
    return j->late || j->parted ? 1 : DRAPE_OK;
}

static void fill(const judge *j, drape_accuracy *by)
{
    const int32_t c = drape_deviation_worst(&j->apart);
    const drape_deviation_cloth *cloth = &j->apart.cloths[c];
    const double most = j->number == DRAPE_ASSESS_BY_START ? 1 : ESTIMATE,
                 share = j->apart.frames > 1 ? most : NAN; /* the first frame is the start */
    by->distance = share * cloth->largest.rms;
    by->error = by->distance / cloth->diagonal;
    by->worst = share * cloth->largest.distance;
    by->cloth = c;
    by->node = cloth->largest.node - j->model->cloths[c].first_node;
    by->time = cloth->largest.time;
    memcpy(by->place, cloth->largest.place[0], sizeof by->place);
    by->until = j->frame > 0 ? j->times[j->frame - 1] : 0;
}

/* A run up to the time `until`. The failure of one that is compared is reported with it. */
static drape_status make_run(judge *j, int number, const drape_model *model, double factor, double until)
{
    drape_sim *sim = NULL;
    const double begun = j->clock = drape_clock_cpu_seconds();
    j->number = number;
    j->frame = 0;
    j->late = j->parted = false;
    drape_status status = drape_deviation_create(&j->arena, j->model, model, &j->apart);
    if (!status)
        status = create(j, model, factor, &sim);
    if (!status)
        status = drape_sim_observe(sim, watch, j);
    if (!status)
        status = j->prepare(j->user, sim, number, j->out);
    if (!status)
        status = drape_sim_advance(sim, until);
    if (j->late || j->parted)
        status = DRAPE_OK;
    const double seconds = drape_clock_cpu_seconds() - begun;
    if (number < 0) {
        j->out->seconds += seconds;
        j->out->hash = status ? 0 : drape_sim_hash(sim);
    }
    drape_sim_destroy(&sim);
    if (number < 0 || status == DRAPE_E_STOPPED || status == DRAPE_E_MEMORY)
        return status;
    fill(j, &j->out->by[number]);
    j->out->by[number].seconds = seconds;
    j->out->by[number].reached = !status && !j->late && j->apart.frames > 1;
    if (j->late)
        snprintf(j->out->why[number], DRAPE_MESSAGE_SIZE,
                 "it would take more than %d times the CPU time of the run", DRAPE_ASSESS_COST);
    else
        snprintf(j->out->why[number], DRAPE_MESSAGE_SIZE, "%s",
                 status ? drape_context_message(j->ctx) : "no frame but the start can be compared");
    return DRAPE_OK;
}

/* With a start whose nodes, unless they are held, are displaced along their normals, in which sheets strain
 * least. */
static drape_status run_displaced(judge *j)
{
    drape_model *m = j->model;
    const size_t n = 3 * (size_t)m->node_count;
    const double by = DRAPE_ASSESS_START * drape_model_least_diagonal(m);
    double *const start = m->start, *x = drape_arena_take(&j->arena, n, sizeof *x),
                  *d = drape_arena_take(&j->arena, n, sizeof *d), shift = 0;
    uint64_t seed = 1;
    if (!x || !d)
        return DRAPE_E_MEMORY;
    drape_model_normals(m, start, d);
    for (size_t i = 0; i < n; i++) {
        shift = i % 3 ? shift : by * drape_grid_random(&seed);
        d[i] *= m->pinned[i / 3] ? 0 : shift;
    }
    for (int32_t i = 0; i < m->support_count; i++)
        memset(d + 3 * (size_t)m->supports[i].node, 0, 3 * sizeof *d);
    drape_periodic_project(m, d);
    for (size_t i = 0; i < n; i++)
        x[i] = start[i] + d[i];
    m->start = x;
    const drape_status status = make_run(j, DRAPE_ASSESS_BY_START, m, 1, m->duration);
    m->start = start;
    if (j->parted)
        j->out->until = j->out->by[DRAPE_ASSESS_BY_START].until;
    return status;
}

/* ---- The method of the run: of its scene or, if that asks for an accuracy, of the run that has it ---- */

static drape_status prepare_search(void *user, drape_sim *sim, const drape_accuracy *before)
{
    judge *j = user;
    (void)before;
    return j->prepare(j->user, sim, -1, j->out);
}

static drape_status choose(judge *j)
{
    const double begun = drape_clock_cpu_seconds();
    drape_accuracy reached;
    drape_sim *sim = NULL;
    drape_status status = drape_choose(j->ctx, j->model, j->given, &j->chosen);
    if (!status && j->model->accuracy.value > 0)
        status = drape_run_accurately(j->ctx, j->model, j->given, prepare_search, j, &sim, &reached);
    if (sim)
        j->chosen = sim->chosen;
    drape_sim_destroy(&sim);
    j->out->seconds = drape_clock_cpu_seconds() - begun;
    j->controlled =
        j->chosen.integrator->own_steps || !isnan(drape_chosen_controller_value(&j->chosen, "rtol", NAN));
    const char *key = j->controlled ? "rtol" : "dt";
    snprintf(j->out->method, sizeof j->out->method, "%s, %s %.3g", j->chosen.integrator->entry.name, key,
             value_of(j, key));
    return status;
}

drape_status drape_assess(drape_context *ctx, drape_model *model, const drape_model *fine,
                          const drape_sim_def *def, drape_assess_prepare *prepare, void *user,
                          drape_assessment *out)
{
    const double size = drape_model_least_diagonal(model);
    judge j = {ctx, drape_arena_of(ctx), model, def, prepare, user, out};
    *out = (drape_assessment){
        .until = model->duration,
        .within = model->accuracy.value > 0 ? drape_distance_of(&model->accuracy, size) / size : WITHIN};
    j.most = (int64_t)floor(model->duration * model->frame_rate * (1 + ROUNDING)) + 1;
    j.x = drape_arena_take(&j.arena, 3 * (size_t)model->node_count * (size_t)j.most, sizeof *j.x);
    j.times = drape_arena_take(&j.arena, (size_t)j.most, sizeof *j.times);
    drape_status status = drape_arena_status(&j.arena);
    if (!status)
        status = drape_accuracy_check_runs(ctx, model);
    if (!status)
        status = choose(&j);
    if (!status)
        status = make_run(&j, -1, model, 1, model->duration);
    j.deadline = drape_clock_cpu_seconds() + fmax(DRAPE_ASSESS_LEAST, (DRAPE_ASSESS_COST - 1) * out->seconds);
    if (!status)
        status = run_displaced(&j);
    if (!status)
        status = make_run(&j, DRAPE_ASSESS_BY_TIME, model, j.controlled ? TIGHTER : FINER, out->until);
    if (!status)
        status = make_run(&j, DRAPE_ASSESS_BY_MESH, fine, 1, out->until);
    drape_arena_free(&j.arena);
    return status;
}
