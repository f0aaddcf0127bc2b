/* system.c: see system.h. The sums over the elements of terms are in sum.h. */
#include "assemble/system.h"

#include "assemble/agree.h"
#include "assemble/sum.h"
#include "base/clock.h"
#include "base/finite.h"
#include "model/history.h"
#include "model/periodic.h"
#include "model/support.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Of the central difference that is dE/dprogress of a term that depends on time: the cube root of epsilon,
 * at which its truncation error is of the size of its rounding error. */
#define PROGRESS_STEP ldexp(1, -DBL_MANT_DIG / 3)

struct drape_system {
    drape_arena *arena;
    const drape_model *model;
    drape_pool *pool;             /* NULL: one thread */
    drape_summer *summer;         /* over the elements of terms */
    drape_contact *contact;       /* NULL: the model has none, or it was not added */
    const drape_pattern *pattern; /* the model's, or the extended one */
    drape_arena extension;        /* holds the extended pattern and its block slots */
    drape_pattern extended;       /* without some terms, or with the pairs of nodes that contact couples */
    int64_t pattern_version;      /* counts the changes of `pattern` */
    int32_t **blocks;             /* (term_count) slots in the extended pattern; NULL: it is not in use */
    const bool *left_out;         /* (term_count) terms without slots in it; NULL: none */
    drape_status status;          /* of drape_system_status */
    /* The reasons of user-defined terms. Not archived: a checkpoint has the names of those that were counted,
     * which are numbered anew. */
    const char *own_reasons[DRAPE_OWN_REASONS];
    int own_reason_count;
    drape_motion *motion;
    drape_drag_springs drag;
    double *push; /* (node_count x 3) [N], if pushed */
    bool pushed;
    double *work;        /* see drape_system_work */
    bool *drives;        /* (term_count) the terms that did work at the last drape_system_dissipation */
    double *load;        /* (node_count x 3) scratch, if the model has histories */
    double *moving;      /* (node_count x 3) scratch: momenta, if a term has a kinetic energy */
    double *still;       /* (node_count x 3) no velocity */
    double *middle[2];   /* (node_count x 3) scratch: x and v of a step, if directions turn */
    double *held;        /* (node_count x 3) [N] the last forces on supports; NULL: none of them moves */
    bool in_frame;       /* positions are in the frame of the supports, and the next of these are scratch: */
    double frame_t;      /* [s] of the last evaluation, or of the end of the last step */
    drape_state started; /* of a step, in the frame */
    double *space[3];    /* (node_count x 3) what was given, in space: x, v, and further positions */
    drape_wind wind;
    const atomic_bool *cancel; /* NULL: there is no flag to watch */
    const drape_ranks *ranks;  /* the model's */
    drape_agreed agreed;       /* texts of what other ranks found */
};

/* ---- Creation ---- */

static drape_status create(drape_arena *arena, const drape_model *model, int threads, drape_system **out)
{
    drape_system *system = *out = drape_arena_take(arena, 1, sizeof *system);
    if (!system)
        return DRAPE_E_MEMORY;
    *system = (drape_system){.arena = arena,
                             .model = model,
                             .pattern = &model->pattern,
                             .extension = drape_arena_within(arena),
                             .ranks = drape_model_ranks(model)};
    system->push = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof *system->push);
    system->work = drape_arena_take(arena, drape_system_work_count(system), sizeof *system->work);
    system->drives = drape_arena_take(arena, (size_t)model->term_count, sizeof *system->drives);
    if (model->history_count > 0)
        system->load = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof *system->load);
    system->still = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof *system->still);
    if (model->has_kinetic)
        system->moving = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof *system->moving);
    bool turns = false;
    for (int32_t i = 0; i < model->term_count && !turns; i++)
        turns = drape_term_turns(&model->terms[i]);
    for (int k = 0; k < 2 && turns; k++)
        system->middle[k] = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof(double));
    double **const moved[] = {&system->held,     &system->started.x, &system->started.v,
                              &system->space[0], &system->space[1],  &system->space[2]};
    for (size_t i = 0; model->supports_move && i < sizeof moved / sizeof *moved; i++)
        *moved[i] = drape_arena_take(arena, 3 * (size_t)model->node_count, sizeof(double));
    DRAPE_TRY(drape_arena_status(arena));
    DRAPE_TRY(drape_pool_create(arena, threads, &system->pool));
    DRAPE_TRY(drape_summer_create(arena, model, system->pool, &system->summer));
    DRAPE_TRY(drape_motion_create(arena, model, &system->motion));
    return drape_wind_create(arena, model, &system->wind);
}

drape_status drape_system_create(drape_arena *arena, const drape_model *model, int threads,
                                 drape_system **out)
{
    const drape_status status = create(arena, model, threads, out);
    if (status)
        drape_system_destroy(out);
    return status;
}

void drape_system_destroy(drape_system **system)
{
    if (!*system)
        return;
    drape_arena_free(&(*system)->extension);
    drape_pool_destroy(&(*system)->pool);
    *system = NULL;
}

void drape_system_leave_constraints(drape_system *system)
{
    drape_summer_leave_constraints(system->summer);
}

void drape_system_leave_losses(drape_system *system)
{
    drape_summer_leave_losses(system->summer);
}

const drape_model *drape_system_model(const drape_system *system)
{
    return system->model;
}

drape_pool *drape_system_pool(const drape_system *system)
{
    return system->pool;
}

/* ---- Pins, colliders and loads of the host ---- */

const drape_motion *drape_system_motion(const drape_system *system)
{
    return system->motion;
}

drape_motion *drape_system_steer(drape_system *system)
{
    return system->motion;
}

void drape_system_set_drag_springs(drape_system *system, const drape_drag_springs *springs)
{
    system->drag = *springs;
}

const drape_drag_springs *drape_system_drag_springs(const drape_system *system)
{
    return &system->drag;
}

void drape_system_set_push(drape_system *system, const double *force)
{
    size_t size = 3 * (size_t)system->model->node_count * sizeof *system->push;
    system->pushed = force;
    if (force)
        memcpy(system->push, force, size);
}

double drape_system_push_work(const drape_system *system, const double *x, const double *y)
{
    double work = 0;
    for (size_t i = 0; system->pushed && i < 3 * (size_t)system->model->node_count; i++)
        work += system->push[i] * (y[i] - x[i]);
    return work;
}

void drape_system_set_wind(drape_system *system, drape_wind_field *field, void *user)
{
    system->wind.field = field;
    system->wind.user = user;
}

void drape_system_copy_wind(drape_system *system, const drape_system *from)
{
    drape_system_set_wind(system, from->wind.field, from->wind.user);
}

bool drape_system_has_wind(const drape_system *system)
{
    return system->wind.field && system->wind.against;
}

void drape_system_add_loads(const drape_system *system, const double *x, double *g)
{
    drape_drag_springs_add_gradient(&system->drag, x, g);
    for (size_t i = 0; system->pushed && i < 3 * (size_t)system->model->node_count; i++)
        g[i] -= system->push[i];
}

/* ---- The frame of the supports ---- */

const drape_state *drape_system_to_frame(drape_system *system, const drape_state *in)
{
    const size_t bytes = 3 * (size_t)system->model->node_count * sizeof(double);
    if (!system->model->supports_move)
        return in;
    system->in_frame = true;
    system->frame_t = in->t;
    system->started.t = in->t;
    system->started.internal = in->internal;
    memcpy(system->started.x, in->x, bytes);
    memcpy(system->started.v, in->v, bytes);
    drape_supports_displace(system->motion, in->t, -1, system->started.x);
    drape_supports_project(system->motion, system->started.v);
    return &system->started;
}

void drape_system_from_frame(drape_system *system, drape_state *out)
{
    if (system->in_frame && out)
        drape_supports_displace(system->motion, out->t, 1, out->x);
    if (out)
        system->frame_t = out->t;
    system->in_frame = false;
}

/* Positions at time t in space, in one of the scratch arrays. */
static const double *in_space(const drape_system *system, double t, const double *x, int scratch)
{
    if (!system->in_frame || !x)
        return x;
    memcpy(system->space[scratch], x, 3 * (size_t)system->model->node_count * sizeof *x);
    drape_supports_displace(system->motion, t, 1, system->space[scratch]);
    return system->space[scratch];
}

static drape_point point_in_space(const drape_system *system, const drape_point *given)
{
    drape_point point = *given;
    if (!system->in_frame)
        return point;
    point.x = in_space(system, point.t, given->x, 0);
    if (given->v) {
        point.v = system->space[1];
        memcpy(system->space[1], given->v, 3 * (size_t)system->model->node_count * sizeof *given->v);
        drape_supports_add_velocity(system->motion, point.span, point.instant, system->space[1]);
    }
    return point;
}

double drape_system_support_work(const drape_system *system, const double *g, double t0, double t1)
{
    return drape_supports_work(system->motion, g ? g : system->held, t0, t1);
}

double drape_system_support_power(const drape_system *system, const double *g, double t)
{
    return drape_supports_power(system->motion, g ? g : system->held, t);
}

bool drape_system_is_driven(const drape_system *system)
{
    const bool pins = drape_ranks_any(system->ranks, system->motion->moved_count > 0);
    return pins || system->model->collider_count > 0 || system->model->supports_move;
}

double *drape_system_work(const drape_system *system)
{
    return system->work;
}

void drape_system_begin_work(drape_system *system)
{
    memset(system->work, 0, drape_system_work_count(system) * sizeof *system->work);
}

size_t drape_system_work_count(const drape_system *system)
{
    return DRAPE_BY_TERMS + (size_t)system->model->term_count;
}

/* ---- Steps ---- */

void drape_system_watch(drape_system *system, const atomic_bool *cancel)
{
    system->cancel = cancel;
}

const atomic_bool *const *drape_system_cancel_flag(const drape_system *system)
{
    return &system->cancel;
}

bool drape_system_cancelled(drape_system *system)
{
    const bool cancelled = drape_ranks_any(system->ranks, system->cancel && atomic_load(system->cancel));
    if (cancelled && !system->status)
        system->status = DRAPE_E_STOPPED;
    return cancelled;
}

drape_status drape_system_begin(drape_system *system, const drape_state *in)
{
    system->status = DRAPE_OK;
    const double *x = in_space(system, in->t, in->x, 0);
    return system->contact ? drape_contact_begin(system->contact, x, in->v, in->t) : DRAPE_OK;
}

drape_status drape_system_begin_reading(drape_system *system, const drape_state *at)
{
    const bool begun = system->contact && drape_contact_has_begun(system->contact, at->x, at->t);
    const drape_status status = begun ? DRAPE_OK : drape_system_begin(system, at);
    drape_system_end_step(system);
    return status;
}

void drape_system_end_step(drape_system *system)
{
    if (system->contact)
        drape_contact_end(system->contact);
}

drape_status drape_system_status(const drape_system *system)
{
    return system->status;
}

drape_status drape_system_agree(drape_system *system)
{
    system->status = drape_ranks_agree(system->ranks, system->model->ctx, system->status);
    return system->status;
}

bool drape_system_agree_finite(drape_system *system, const double *f, size_t count)
{
    const bool finite = drape_all_finite(f, count);
    if (drape_ranks_all(system->ranks, finite && !system->status))
        return true;
    drape_system_agree(system);
    return drape_ranks_all(system->ranks, finite);
}

/* ---- Contact ---- */

drape_status drape_system_add_contact(drape_system *system)
{
    const drape_status status = drape_contact_create(system->arena, system->motion, &system->contact);
    if (system->contact)
        drape_contact_watch(system->contact, &system->cancel);
    return status;
}

drape_contact *drape_system_contact(const drape_system *system)
{
    return system->contact;
}

bool drape_system_touches(const drape_system *system)
{
    double gap;
    return system->contact && drape_contact_active(system->contact, &gap) > 0;
}

double drape_system_clock(const drape_system *system)
{
    return drape_clock_seconds() - drape_contact_seconds(system->contact);
}

/* Finds the contacts at the point. False if the model has no contact, or if it fails: see
 * drape_system_status. */
static bool evaluate_contact(drape_system *system, const drape_point *point)
{
    if (!system->contact)
        return false;
    drape_status status = drape_contact_evaluate_at(
        system->contact, &(drape_contact_at){.x = point->x,
                                             .v = point->v,
                                             .t = point->t,
                                             .span = {point->span[0], point->span[1]},
                                             .instant = point->instant});
    if (status && !system->status)
        system->status = status;
    return status == DRAPE_OK;
}

const drape_load *drape_system_on_colliders(const drape_system *system)
{
    return system->contact ? drape_contact_on_colliders(system->contact) : NULL;
}

double drape_system_step_fraction(drape_system *system, const double *x, const double *y, double t,
                                  bool again, double *of_node)
{
    for (int32_t i = 0; of_node && !(again && system->contact) && i < system->model->node_count; i++)
        of_node[i] = 1;
    const double fraction = system->contact
                                ? drape_contact_step_fraction(system->contact, in_space(system, t, x, 0),
                                                              in_space(system, t, y, 2), t, again, of_node)
                                : 1;
    if (of_node)
        drape_periodic_least(system->model, of_node);
    return drape_ranks_least(system->ranks, fraction);
}

void drape_system_set_contact_step(drape_system *system, double dt)
{
    if (system->contact)
        drape_contact_set_step(system->contact, dt);
}

void drape_system_sweep(drape_system *system, double t, double *y)
{
    if (system->contact)
        drape_contact_sweep(system->contact, t, y);
}

void drape_system_carry_layers(drape_system *system, double t, double *y)
{
    if (system->contact)
        drape_contact_carry_layers(system->contact, t, y);
}

bool drape_system_crosses(drape_system *system, const double *x, double t, drape_reason *reason,
                          drape_diagnostic *diagnostic)
{
    if (!system->contact)
        return false;
    const bool crosses =
        drape_contact_crosses(system->contact, in_space(system, t, x, 0), t, reason, diagnostic);
    return drape_agree(&system->agreed, system->model, crosses ? DRAPE_RETRY_REJECTED : DRAPE_OK, reason,
                       diagnostic) != DRAPE_OK;
}

bool drape_system_nearest(drape_system *system, drape_diagnostic *diagnostic)
{
    if (!system->contact)
        return false;
    const bool found = drape_contact_nearest(system->contact, diagnostic);
    return drape_agree_largest(&system->agreed, system->model, found ? -diagnostic->value : -INFINITY,
                               diagnostic) > -INFINITY;
}

double drape_system_take_contact_work(drape_system *system)
{
    return system->contact ? drape_contact_take_work(system->contact) : 0;
}

drape_status drape_system_check_contact(drape_system *system, const double *x, double t, drape_reason *reason,
                                        drape_diagnostic *diagnostic)
{
    if (!system->contact)
        return DRAPE_OK;
    const drape_status status =
        drape_contact_check(system->contact, in_space(system, t, x, 0), t, reason, diagnostic);
    return drape_agree(&system->agreed, system->model, status, reason, diagnostic);
}

/* ---- The pattern ---- */

const drape_pattern *drape_system_pattern(const drape_system *system)
{
    return system->pattern;
}

static void forget_extension(drape_system *system)
{
    system->pattern_version++;
    drape_arena_free(&system->extension);
    system->blocks = NULL;
    system->pattern = &system->model->pattern;
}

/* Builds the extended pattern: that of the model, without the terms that are left out, and these pairs of
 * contact (pairs x 4 nodes). */
static drape_status extend(drape_system *system, int32_t pairs, const int32_t *nodes)
{
    const drape_model *model = system->model;
    drape_context *ctx = system->arena->ctx;
    drape_coupling *couplings = drape_alloc(ctx, (size_t)model->term_count + 3, sizeof *couplings);
    if (pairs < 0 || !couplings) {
        drape_free(ctx, couplings);
        return DRAPE_E_MEMORY;
    }
    int count = drape_model_couplings(model, system->left_out, couplings);
    couplings[count++] = (drape_coupling){.count = pairs, .nodes = 4, .node = nodes};
    forget_extension(system);
    drape_status status = drape_pattern_build(&system->extension, model->block_count, model->free_of_node,
                                              couplings, count, &system->extended);
    drape_free(ctx, couplings);
    system->extended.ranks = system->ranks;
    if (!status) {
        /* Finds the slots of the terms' blocks in the extended pattern. */
        drape_arena *arena = &system->extension;
        system->blocks = drape_arena_take(arena, (size_t)model->term_count, sizeof *system->blocks);
        for (int32_t i = 0; system->blocks && i < model->term_count; i++) {
            const drape_term *term = &model->terms[i];
            if (!drape_term_couples(term) || (system->left_out && system->left_out[i]))
                continue;
            system->blocks[i] = drape_arena_take(arena, drape_term_places(term), sizeof **system->blocks);
            if (system->blocks[i])
                drape_term_place(term, &system->extended, model->free_of_node, system->blocks[i]);
        }
        status = drape_arena_status(arena);
    }
    if (status) /* back to the model's pattern, which also differs from the one before this call */
        forget_extension(system);
    else
        system->pattern = &system->extended;
    return status;
}

int64_t drape_system_pattern_version(const drape_system *system)
{
    return system->pattern_version;
}

drape_status drape_system_leave_out(drape_system *system, const bool *terms)
{
    system->left_out = terms;
    if (terms)
        return extend(system, 0, NULL);
    forget_extension(system);
    return DRAPE_OK;
}

drape_status drape_system_extend_pattern(drape_system *system, const drape_point *given, bool *changed)
{
    const drape_point point = point_in_space(system, given);
    *changed = false;
    if (!evaluate_contact(system, &point))
        return system->status;
    if (drape_contact_is_in_pattern(system->contact, system->pattern))
        return DRAPE_OK;
    *changed = true;
    const int32_t *nodes = NULL;
    int32_t pairs = drape_contact_list_couplings(system->contact, &nodes);
    return extend(system, pairs, nodes);
}

/* ---- Forces ---- */

/* For the terms in the medium: the velocity relative to it at each node. */
static void evaluate_wind(drape_system *system, drape_request *want)
{
    const drape_point *point = want->point;
    if (!drape_system_has_wind(system))
        return;
    drape_wind_evaluate(&system->wind, system->model->node_count, point->t, point->x, point->v,
                        want->hessian && !want->velocity);
    want->against = system->wind.against;
    want->wind_gradient = system->wind.gradient;
}

static void add_forces(drape_system *system, drape_request want, double *g)
{
    evaluate_wind(system, &want);
    drape_summer_add(system->summer, &want, &(drape_sums){.g = g});
    if (want.conservative)
        drape_system_add_loads(system, want.point->x, g);
    if (evaluate_contact(system, want.point))
        drape_contact_add_forces(system->contact, want.conservative, true, g);
}

void drape_system_sum_forces(drape_system *system, const drape_point *given, const bool *without, double *g)
{
    const drape_point point = point_in_space(system, given);
    system->frame_t = point.t;
    drape_system_cancelled(system);
    add_forces(
        system,
        (drape_request){.point = &point, .conservative = true, .dissipative = true, .without = without}, g);
}

void drape_system_force(drape_system *system, const drape_point *point, double *g)
{
    drape_system_force_without(system, point, NULL, g);
}

void drape_system_force_without(drape_system *system, const drape_point *point, const bool *without,
                                double *g)
{
    drape_system_sum_forces(system, point, without, g);
    drape_system_project_forces(system, g);
}

void drape_system_momentum(drape_system *system, const drape_point *given, double *p)
{
    const drape_point point = point_in_space(system, given);
    drape_request want = {.point = &point, .momentum = true};
    evaluate_wind(system, &want);
    drape_summer_add(system->summer, &want, &(drape_sums){.g = p});
    drape_supports_project(system->motion, p);
}

void drape_system_reactions(drape_system *system, const drape_point *point, double *g)
{
    drape_system_sum_forces(system, point, NULL, g);
    drape_supports_keep_reactions(system->motion, g);
}

void drape_system_project_forces(drape_system *system, double *g)
{
    if (system->held)
        memcpy(system->held, g, 3 * (size_t)system->model->node_count * sizeof *g);
    drape_supports_project(system->motion, g);
}

void drape_system_project(const drape_system *system, double *nodes)
{
    drape_supports_project(system->motion, nodes);
}

void drape_system_project_free(const drape_system *system, double *free_nodes)
{
    drape_supports_project_free(system->motion, free_nodes);
}

void drape_system_project_matrix(const drape_system *system, double *values)
{
    drape_supports_project_matrix(system->motion, system->pattern, values);
}

/* g = the dissipative forces of one term. */
static void term_forces(drape_system *system, int32_t term, const drape_point *point, double *g)
{
    drape_request want = {.point = point, .dissipative = true};
    evaluate_wind(system, &want);
    memset(g, 0, 3 * (size_t)system->model->node_count * sizeof *g);
    drape_summer_add_term(system->summer, &system->model->terms[term], &want, &(drape_sums){.g = g}, NULL);
}

/* Whether a term does work instead of dissipating: it is a load, or its medium pushes cloth at rest.
 * Overwrites g (nodes). */
static bool drives(drape_system *system, int32_t term, const drape_point *at, double *g)
{
    const drape_term_ops *ops = system->model->terms[term].ops;
    drape_point rest = *at;
    bool found = ops->external;
    if (!ops->dissipation || !ops->in_medium)
        return ops->dissipation && found;
    rest.v = system->still;
    term_forces(system, term, &rest, g);
    for (size_t i = 0; i < 3 * (size_t)system->model->node_count && !found; i++)
        found = g[i] != 0;
    return drape_ranks_any(system->ranks, found);
}

/* The work over a time against forces g (nodes) at a point. */
static double taken(const drape_system *system, const drape_point *point, double time, const double *g)
{
    const double *span = point->span;
    double power = 0;
    for (size_t i = 0; i < 3 * (size_t)system->model->node_count; i++)
        power += drape_model_owns(system->model, (int32_t)(i / 3)) ? g[i] * point->v[i] : 0;
    power = drape_ranks_sum(system->ranks, power);
    if (span[1] > span[0])
        power += drape_system_support_work(system, g, span[0], span[1]) / (span[1] - span[0]);
    return time * power;
}

double drape_system_dissipation(drape_system *system, const drape_point *given, double time, double *g)
{
    const drape_point point = point_in_space(system, given);
    for (int32_t i = 0; i < system->model->term_count; i++) {
        system->drives[i] = drives(system, i, &point, g);
        if (system->drives[i]) {
            term_forces(system, i, &point, g);
            system->work[DRAPE_BY_TERMS + i] -= taken(system, given, time, g);
        }
    }
    add_forces(system, (drape_request){.point = &point, .dissipative = true, .without = system->drives}, g);
    return taken(system, given, time, g);
}

/* ---- Jacobians ---- */

static drape_sums into_values(const drape_system *system, double *values)
{
    return (drape_sums){.values = values, .pattern = system->pattern, .blocks = system->blocks};
}

static void add_jacobian(drape_system *system, drape_request want, drape_contact_derivatives which,
                         double *values)
{
    const drape_sums to = into_values(system, values);
    evaluate_wind(system, &want);
    drape_summer_add(system->summer, &want, &to);
    if (evaluate_contact(system, want.point))
        drape_contact_add_jacobian(system->contact, want.velocity ? 0 : want.point->weight, which,
                                   want.positive_share, system->pattern, values);
}

void drape_system_jacobian(drape_system *system, const drape_point *point, double mass_weight,
                           double positive_share, double *values)
{
    drape_system_jacobian_without(system, point, mass_weight, positive_share, NULL, values);
}

void drape_system_jacobian_without(drape_system *system, const drape_point *given, double mass_weight,
                                   double positive_share, const bool *without, double *values)
{
    const drape_point point = point_in_space(system, given);
    const drape_request want = {.point = &point,
                                .hessian = true,
                                .conservative = true,
                                .dissipative = true,
                                .positive_share = positive_share,
                                .without = without};
    add_jacobian(system, want, point.contact, values);
    drape_drag_springs_add_hessian(&system->drag, system->model, system->pattern, values);
    const drape_model *model = system->model;
    const drape_pattern *pattern = system->pattern;
    for (int32_t j = 0; j < model->free_count; j++) {
        int64_t stride;
        double *diagonal = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
        for (int c = 0; c < 3; c++)
            diagonal[c * stride + c] += mass_weight * model->mass[model->node_of_free[j]];
    }
    drape_system_project_matrix(system, values);
}

void drape_system_predict_contact(drape_system *system, const double *p, double weight, double mass_weight)
{
    if (system->contact)
        drape_contact_predict(system->contact, p, weight, mass_weight);
}

bool drape_system_is_symmetric(const drape_system *system)
{
    return !system->contact || drape_contact_is_symmetric(system->contact);
}

bool drape_system_has_symmetric_terms(const drape_system *system)
{
    bool symmetric = true;
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        symmetric &= !term->ops->kinetic && !(term->ops->dissipation && term->ops->nodes > 1);
    }
    return symmetric;
}

void drape_system_symmetrize(drape_system *system, const drape_point *given, double positive_share,
                             double *values)
{
    const drape_point point = point_in_space(system, given);
    if (evaluate_contact(system, &point))
        drape_contact_fix_friction(system->contact, point.weight, 1 - positive_share, system->pattern,
                                   values);
    drape_pattern_symmetrize(system->pattern, values);
    drape_system_project_matrix(system, values);
}

void drape_system_contact_remainder(drape_system *system, const drape_point *given, double *values)
{
    const drape_point point = point_in_space(system, given);
    memset(values, 0, (size_t)system->pattern->nonzeros * sizeof *values);
    if (evaluate_contact(system, &point))
        drape_contact_add_remainder(system->contact, point.weight, system->pattern, values);
}

bool drape_system_has_friction(const drape_system *system)
{
    return system->contact && drape_contact_has_friction(system->contact);
}

void drape_system_pairs(const drape_system *system, int32_t term, const drape_point *given, double *h)
{
    const drape_point point = point_in_space(system, given);
    const drape_request want = {
        .point = &point, .hessian = true, .conservative = true, .dissipative = true, .positive_share = 1};
    drape_summer_pairs(system->summer, &system->model->terms[term], &want, h);
}

void drape_system_remainder(drape_system *system, const drape_point *given, double *values)
{
    const drape_point point = point_in_space(system, given);
    const drape_request want = {.point = &point,
                                .hessian = true,
                                .conservative = true,
                                .dissipative = true,
                                .positive_share = 1,
                                .remainder = true};
    add_jacobian(system, want, DRAPE_CONTACT_GAUSS_NEWTON, values);
}

bool drape_system_has_remainder(const drape_system *system)
{
    bool found = system->contact != NULL;
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        found = found || (drape_term_couples(term) && !term->ops->measure &&
                          !drape_summer_leaves(system->summer, term));
    }
    return found;
}

void drape_system_damping(drape_system *system, const drape_point *given, double *values)
{
    const drape_point point = point_in_space(system, given);
    const drape_request want = {.point = &point, .hessian = true, .velocity = true, .dissipative = true};
    add_jacobian(system, want, DRAPE_CONTACT_VELOCITY, values);
    drape_system_project_matrix(system, values);
}

/* ---- Energies ---- */

static bool has_energy(const drape_system *system, const drape_term *term)
{
    return !term->ops->law && !term->ops->dissipation && !drape_summer_leaves(system->summer, term);
}

static double energy_at(const drape_system *system, const drape_term *term, const drape_point *point)
{
    const drape_request want = {.point = point, .energy = true, .conservative = true};
    double energy = 0;
    drape_summer_add_term(system->summer, term, &want, &(drape_sums){0}, &energy);
    return energy;
}

void drape_system_energy(drape_system *system, const drape_point *point, double *elastic, double *gravity)
{
    *elastic = *gravity = 0;
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        if (has_energy(system, term))
            *(term->ops->external ? gravity : elastic) += energy_at(system, term, point);
    }
    *elastic = drape_ranks_sum(system->ranks, *elastic);
    *gravity = drape_ranks_sum(system->ranks, *gravity);
    *elastic += drape_drag_springs_energy(&system->drag, point->x);
}

/* The energy of motion of a term, and its momenta in scratch. */
static double measure_motion(drape_system *system, const drape_term *term, const drape_request *want)
{
    double energy = 0;
    memset(system->moving, 0, 3 * (size_t)system->model->node_count * sizeof *system->moving);
    drape_summer_add_term(system->summer, term, want, &(drape_sums){.g = system->moving}, &energy);
    return energy;
}

void drape_system_motion_energy(drape_system *system, const drape_point *point, double *kinetic,
                                double *potential)
{
    drape_point rest = *point;
    rest.v = system->still;
    *kinetic = *potential = 0;
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        drape_request want = {.point = &rest, .momentum = true};
        if (!term->ops->kinetic)
            continue;
        evaluate_wind(system, &want);
        const double still = measure_motion(system, term, &want);
        want.point = point;
        evaluate_wind(system, &want);
        *kinetic += still - measure_motion(system, term, &want);
        for (size_t k = 0; k < 3 * (size_t)system->model->node_count; k++)
            *kinetic += system->moving[k] * point->v[k];
        *potential -= still;
    }
}

bool drape_system_is_timed(const drape_system *system)
{
    for (int32_t i = 0; i < system->model->term_count; i++)
        if (drape_term_changes(&system->model->terms[i]))
            return true;
    return false;
}

/* dE/dprogress of a term at a point. */
static double by_progress(drape_system *system, const drape_term *term, const drape_point *at)
{
    const double progress = drape_term_progress(term, at->t), back = fmin(PROGRESS_STEP, progress),
                 ahead = fmin(PROGRESS_STEP, 1 - progress);
    drape_point less = *at, more = *at;
    less.progressed = -back;
    more.progressed = ahead;
    return (energy_at(system, term, &more) - energy_at(system, term, &less)) / (back + ahead);
}

/* By the trapezoidal rule over the progress, at whose ends the nodes are where the step has them: between
 * them, a straight path is far from theirs in comparison with what a stiff term is strained. What begins
 * and ends within the step is a jump, and is taken where the step begins. */
static double timed_work(drape_system *system, const drape_term *term, const drape_point *from,
                         const drape_point *to)
{
    const double done = drape_term_progress(term, to->t) - drape_term_progress(term, from->t);
    if (done == 0)
        return 0;
    if (done < 1)
        return done * (by_progress(system, term, from) + by_progress(system, term, to)) / 2;
    drape_point after = *from;
    after.done = true;
    return energy_at(system, term, &after) - energy_at(system, term, from);
}

/* E0 of a load without its history, and its rate dE0/dx . v. */
static void measure_load(drape_system *system, const drape_term *term, const drape_point *at, double *energy,
                         double *rate)
{
    const size_t n = 3 * (size_t)system->model->node_count;
    double *g = system->load;
    drape_point point = *at;
    point.full = true;
    const drape_request want = {.point = &point, .energy = true, .conservative = true};
    memset(g, 0, n * sizeof *g);
    drape_summer_add_term(system->summer, term, &want, &(drape_sums){.g = g}, energy);
    *rate = 0;
    for (size_t i = 0; i < n; i++)
        if (drape_model_owns(system->model, (int32_t)(i / 3)))
            *rate += g[i] * at->v[i];
}

/* The work of a load E = f(t) E0(x) whose factor changes, int f' E0 dt = [f E0] - int f E0' dt, with E0 as
 * the cubic through its values and rates at both ends, by Gauss's rule of three points; f counts from its
 * value at the beginning, so that a constant one does no work. */
static double history_work(drape_system *system, const drape_term *term, const drape_point *from,
                           const drape_point *to, double *open)
{
    static const double node[] = {0.11270166537925831, 0.5, 0.88729833462074169},
                        weight[] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    const double h = to->t - from->t, start = drape_history_factor(term->history, from->t),
                 change = drape_history_factor(term->history, to->t) - start;
    double energy[2] = {0, 0}, rate[2];
    measure_load(system, term, from, &energy[0], &rate[0]);
    measure_load(system, term, to, &energy[1], &rate[1]);
    double work = change * energy[1];
    *open += fabs(change) * fmax(fabs(energy[1] - energy[0]), h * fabs(rate[1]));
    for (int k = 0; k < 3; k++) {
        const double s = node[k], along = 6 * s * (1 - s) * (energy[1] - energy[0]) +
                                          (1 - s) * (1 - 3 * s) * h * rate[0] + s * (3 * s - 2) * h * rate[1];
        work -= weight[k] * (drape_history_factor(term->history, from->t + s * h) - start) * along;
    }
    return work;
}

/* The work of directions that turn: what their turn by itself changes the energy by, with the nodes half
 * where the step begins and half where it ends; the nodes change the rest. */
static double turning_work(drape_system *system, const drape_term *term, const drape_point *from,
                           const drape_point *to)
{
    const double h = to->t - from->t, ahead[4] = {0, h, -h, 0};
    double energy[4];
    for (int k = 0; k < 4; k++) {
        drape_point point = k < 2 ? *from : *to;
        point.ahead = ahead[k];
        energy[k] = energy_at(system, term, &point);
    }
    return (energy[1] - energy[0] + energy[3] - energy[2]) / 2;
}

/* The work of such directions against the dissipative forces of the term, by the midpoint rule. */
static double turning_dissipation(drape_system *system, const drape_term *term, const drape_point *from,
                                  const drape_point *to)
{
    const double h = to->t - from->t;
    if (!(h > 0))
        return 0;
    for (size_t i = 0; i < 3 * (size_t)system->model->node_count; i++) {
        system->middle[0][i] = (from->x[i] + to->x[i]) / 2;
        system->middle[1][i] = (to->x[i] - from->x[i]) / h;
    }
    const drape_point point = {.x = system->middle[0],
                               .v = system->middle[1],
                               .internal = from->internal,
                               .t = (from->t + to->t) / 2,
                               .turning = true};
    return h * drape_summer_turning_power(system->summer, term,
                                          &(drape_request){.point = &point, .dissipative = true});
}

/* The work of wind that changes on the energy of motion T of a term, whose v . dT/dv - T grows by -dT/dt: the
 * change of T by that of the wind from where and when the step begins to where and when it ends, with the
 * nodes half at each end. */
static double gust_work(drape_system *system, const drape_term *term, const drape_point *from,
                        const drape_point *to)
{
    const drape_point *const end[2] = {from, to};
    double work = 0;
    for (int k = 0; k < 4; k++) {
        const drape_point *nodes = end[k / 2], *wind = end[k % 2];
        drape_point point = *nodes;
        drape_request want = {.point = &point, .momentum = true};
        point.t = wind->t;
        if (drape_system_has_wind(system)) {
            drape_wind_evaluate(&system->wind, system->model->node_count, wind->t, wind->x, nodes->v, false);
            want.against = system->wind.against;
        }
        work += (k % 2 ? -0.5 : 0.5) * measure_motion(system, term, &want);
    }
    return work;
}

/* That of one term here; adds to *dissipated only what is known here. */
static double timed_work_of(drape_system *system, const drape_term *term, const drape_state *before,
                            const drape_state *after, double *open, double *dissipated)
{
    const drape_point from = {.x = before->x, .v = before->v, .internal = before->internal, .t = before->t},
                      to = {.x = after->x, .v = after->v, .internal = before->internal, .t = after->t};
    double work = 0;
    if (drape_term_is_timed(term) && has_energy(system, term))
        work += timed_work(system, term, &from, &to);
    if (term->history && has_energy(system, term))
        work += history_work(system, term, &from, &to, open);
    if (term->ops->kinetic && (term->history || drape_system_has_wind(system)))
        work += gust_work(system, term, &from, &to);
    if (drape_term_turns(term)) {
        const double loss = dissipated ? turning_dissipation(system, term, &from, &to) : 0;
        work += turning_work(system, term, &from, &to) + loss;
        if (dissipated)
            *dissipated += loss;
    }
    return work;
}

void drape_system_add_timed_work(drape_system *system, const drape_state *before, const drape_state *after,
                                 double *work, double *open, double *dissipated)
{
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        double opened = 0, lost = 0;
        if (!drape_term_changes(term) && !term->ops->kinetic)
            continue;
        work[DRAPE_BY_TERMS + i] += drape_ranks_sum(
            system->ranks, timed_work_of(system, term, before, after, &opened, dissipated ? &lost : NULL));
        *open += drape_ranks_sum(system->ranks, opened);
        if (dissipated)
            *dissipated += drape_ranks_sum(system->ranks, lost);
    }
}

double drape_system_measure_loads(drape_system *system, const drape_point *point, double *potential)
{
    double sum = 0;
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *t = &system->model->terms[i];
        if (!t->ops->external || t->ops->from_scene_gravity || !has_energy(system, t))
            continue;
        const double energy = drape_ranks_sum(system->ranks, energy_at(system, t, point));
        sum += energy;
        if (potential)
            potential[DRAPE_BY_TERMS + i] = energy;
    }
    return sum;
}

void drape_system_node_energy(drape_system *system, const drape_point *point, double *energy)
{
    const drape_request want = {.point = point, .energy = true, .conservative = true};
    const drape_sums to = {.node_energy = energy};
    memset(energy, 0, (size_t)system->model->node_count * sizeof *energy);
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        if (!term->ops->external && has_energy(system, term))
            drape_summer_add_term(system->summer, term, &want, &to, NULL);
    }
}

double drape_system_contact_energy(drape_system *system, const drape_point *point)
{
    if (!system->contact)
        return 0;
    const bool found = evaluate_contact(system, point);
    return drape_ranks_all(system->ranks, found) ? drape_contact_potential(system->contact) : NAN;
}

/* ---- One part alone ---- */

void drape_system_contact_part(drape_system *system, const drape_point *point, bool friction, double *g,
                               double *values)
{
    if (g)
        memset(g, 0, 3 * (size_t)system->model->node_count * sizeof *g);
    if (values)
        memset(values, 0, (size_t)system->pattern->nonzeros * sizeof *values);
    if (!evaluate_contact(system, point))
        return;
    if (g)
        drape_contact_add_forces(system->contact, true, friction, g);
    if (values)
        drape_contact_add_jacobian(system->contact, point->weight, DRAPE_CONTACT_EXACT, 0, system->pattern,
                                   values);
}

void drape_system_term(drape_system *system, int32_t term, const drape_point *point, double *energy,
                       double *g, double *values)
{
    const drape_term *t = &system->model->terms[term];
    drape_request want = {
        .point = point, .energy = energy, .hessian = values, .conservative = true, .dissipative = true};
    drape_sums to = into_values(system, t->block ? values : NULL);
    evaluate_wind(system, &want);
    to.g = g;
    if (energy)
        *energy = 0;
    if (!t->ops->law && !drape_summer_leaves(system->summer, t))
        drape_summer_add_term(system->summer, t, &want, &to, energy);
}

void drape_system_measures(drape_system *system, const drape_point *given, double *q)
{
    const drape_point point = point_in_space(system, given);
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        if (term->ops->measure)
            drape_summer_measure(system->summer, term, &point, q + term->first_measure);
    }
}

void drape_system_stress(drape_system *system, const drape_point *given, const double *along, double *stress)
{
    const drape_point point = point_in_space(system, given);
    const drape_request want = {
        .point = &point, .conservative = true, .dissipative = along, .along = along, .stress = stress};
    drape_summer_stress(system->summer, &want);
}

/* ---- Checks ---- */

drape_reason drape_system_reason(drape_system *s, const char *name)
{
    const drape_reason known = drape_reason_named(name);
    if (known < DRAPE_REASON_COUNT)
        return known;
    int i = 0;
    while (i < s->own_reason_count && strcmp(s->own_reasons[i], name) != 0)
        i++;
    if (i == DRAPE_OWN_REASONS)
        return DRAPE_REASON_OTHER;
    s->own_reason_count = i == s->own_reason_count ? i + 1 : s->own_reason_count;
    s->own_reasons[i] = name; /* the text of a term, which is static, in the place of one that was copied */
    return (drape_reason)(DRAPE_REASON_COUNT + i);
}

const char *drape_system_reason_name(const drape_system *s, drape_reason reason)
{
    return reason < DRAPE_REASON_COUNT ? drape_reason_name(reason)
                                       : s->own_reasons[reason - DRAPE_REASON_COUNT];
}

/* limits: of the terms that limit strain only. */
static drape_status check_terms(const drape_system *system, bool limits, const double *given,
                                const double *given_before, const double *internal, const char **reason,
                                drape_diagnostic *diagnostic)
{
    const double *x = in_space(system, system->frame_t, given, 0),
                 *before = in_space(system, system->frame_t, given_before, 2);
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        drape_fault fault;
        if (!term->ops->check || (limits && !term->ops->constraint) ||
            drape_summer_leaves(system->summer, term))
            continue;
        const double *own = drape_term_own(term, internal);
        const drape_elements el = drape_term_elements(term, system->frame_t);
        drape_status status = term->ops->check(&el, x, before, own, &fault);
        if (status) {
            *reason = fault.reason;
            *diagnostic = (drape_diagnostic){.what = fault.what,
                                             .term = term->ops->entry.name,
                                             .element = fault.element,
                                             .node = {-1, -1, -1, -1},
                                             .cloth = term->cloth,
                                             .value = fault.value,
                                             .limit = fault.limit};
            for (int a = 0; fault.element >= 0 && a < el.nodes && a < 4; a++)
                diagnostic->node[a] = el.node[(size_t)fault.element * (size_t)el.nodes + (size_t)a];
            return status;
        }
    }
    return DRAPE_OK;
}

drape_status drape_system_check(drape_system *system, const double *x, const double *before,
                                const double *internal, drape_reason *reason, drape_diagnostic *diagnostic)
{
    const char *name;
    const drape_status status = check_terms(system, false, x, before, internal, &name, diagnostic);
    if (status)
        *reason = drape_system_reason(system, name);
    return drape_agree(&system->agreed, system->model, status, reason, diagnostic);
}

bool drape_system_breaks_limit(const drape_system *system, const double *x, const double *before,
                               const double *internal)
{
    const char *reason;
    drape_diagnostic diagnostic;
    return drape_ranks_any(system->ranks,
                           check_terms(system, true, x, before, internal, &reason, &diagnostic));
}

void drape_system_agree_largest(drape_system *system, double value, drape_diagnostic *diagnostic)
{
    drape_agree_largest(&system->agreed, system->model, value, diagnostic);
}

drape_diagnostic drape_system_diagnose_dof(drape_system *system, const double *free_vector, const char *what,
                                           double limit)
{
    const drape_model *model = system->model;
    int64_t largest = 0;
    for (int64_t i = 0; i < 3 * (int64_t)model->free_count; i++) {
        if (!isfinite(free_vector[i])) {
            largest = i;
            break;
        }
        if (fabs(free_vector[i]) > fabs(free_vector[largest]))
            largest = i;
    }
    int32_t node = model->free_count > 0 ? model->node_of_free[largest / 3] : -1;
    drape_diagnostic found = {.what = what,
                              .term = "",
                              .element = -1,
                              .node = {node, -1, -1, -1},
                              .cloth = node >= 0 ? drape_model_cloth_of(model, node) : -1,
                              .value = model->free_count > 0 ? fabs(free_vector[largest]) : 0,
                              .limit = limit};
    drape_agree_largest(&system->agreed, system->model, found.value, &found);
    return found;
}

/* ---- Checkpoints ---- */

void drape_system_archive(drape_system *system, drape_archive *a)
{
    drape_archive_mark(a, "system");
    if (a->by_ranks) { /* no host moves anything there */
        if (system->contact)
            drape_contact_archive_stiffness(system->contact, a);
        return;
    }
    drape_motion_archive(system->motion, a);
    drape_archive_int32(a, &system->drag.count);
    if (drape_archive_good(a) && !(system->drag.count >= 0 && system->drag.count <= DRAPE_MAX_DRAG_SPRINGS)) {
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %d drag springs", (int)system->drag.count);
        system->drag.count = 0;
    }
    for (int32_t i = 0; i < system->drag.count && drape_archive_good(a); i++) {
        drape_drag_spring *spring = &system->drag.spring[i];
        drape_archive_int32(a, &spring->node);
        drape_archive_double(a, &spring->stiffness);
        drape_archive_doubles(a, spring->target, 3);
        if (drape_archive_has_read(a) &&
            !(spring->node >= 0 && spring->node < system->model->node_count &&
              !system->model->pinned[spring->node] && spring->stiffness > 0 && isfinite(spring->stiffness) &&
              drape_all_finite(spring->target, 3)))
            drape_archive_fail(a, DRAPE_E_PARSE,
                               "the checkpoint has a drag spring on node %d that cannot be there",
                               (int)spring->node);
    }
    const size_t n = 3 * (size_t)system->model->node_count;
    drape_archive_bool(a, &system->pushed);
    if (system->pushed)
        drape_archive_doubles(a, system->push, n);
    if (drape_archive_has_read(a) && !drape_all_finite(system->push, n))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint pushes with a force that is not finite");
    drape_archive_same(a, "whether there is contact", system->contact != NULL);
    /* Contact, and the pairs that the extended pattern was built from: they belong to an earlier state, so
     * they cannot be found again from the present one. */
    bool extended = system->blocks != NULL;
    const int32_t *nodes = NULL;
    if (system->contact)
        drape_contact_archive(system->contact, a);
    drape_archive_bool(a, &extended);
    if (!drape_archive_has_read(a) || !system->contact || !extended)
        return;
    int32_t pairs = drape_contact_last_couplings(system->contact, &nodes);
    drape_archive_note(a, extend(system, pairs, nodes));
}

/* ---- Another system goes on ---- */

drape_status drape_system_continue(drape_system *system, drape_system *from, const int32_t *before, double t)
{
    drape_motion_copy(system->motion, from->motion, before, t);
    for (int32_t i = 0; i < from->drag.count; i++)
        if (!system->model->pinned[from->drag.spring[i].node])
            system->drag.spring[system->drag.count++] = from->drag.spring[i];
    drape_system_set_push(system, from->pushed ? from->push : NULL);
    return system->contact && from->contact ? drape_contact_continue(system->contact, from->contact, before)
                                            : DRAPE_OK;
}
