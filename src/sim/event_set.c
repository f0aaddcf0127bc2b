/* event_set.c: see event_set.h. */
#include "sim/dense.h"

#include "compile/compile.h"
#include "sim/root.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* [s] To this a step ends at its root; a tenth of what is promised. Large times are rounded by more. */
#define EVENT_TOLERANCE 1e-11
#define ROUNDING        (8 * DBL_EPSILON)
/* Roots of a continuous event function in a step, at most: one between samples, and at extrema of the
 * cubic. */
#define ROOM      (2 * (DRAPE_EVENT_SAMPLES - 1))
#define MAX_TRIES 64  /* of a step that is to end at a root; bisection of 1e8 s to the tolerance */
#define NEAR      0.5 /* of the values around it: an extremum of the cubic below this is evaluated */

static double tolerance_at(double t)
{
    return fmax(EVENT_TOLERANCE, ROUNDING * fabs(t));
}

static int sign_of(double f)
{
    return (f > 0) - (f < 0);
}

/* ---- Evaluation ---- */

/* A moment within the attempted step, with what the event functions need, once any of them needs it. */
typedef struct moment {
    drape_sim *sim;
    const drape_state *next; /* at which the attempt ends */
    double t;
    const double *x, *v;
    bool has_energy, has_reactions;
    drape_energy energy;
    drape_status status;
} moment;

static moment between(drape_sim *sim, const drape_state *next, double t)
{
    const drape_state *now = drape_sim_state(sim), *end = t <= now->t ? now : next;
    if (t <= now->t || t >= next->t)
        return (moment){.sim = sim, .next = next, .t = end->t, .x = end->x, .v = end->v};
    drape_sim_dense_positions(sim, now, next, t, sim->frame);
    drape_sim_dense_velocities(sim, now, next, t, sim->frame_velocity);
    return (moment){.sim = sim, .next = next, .t = t, .x = sim->frame, .v = sim->frame_velocity};
}

static const drape_energy *energy_of(moment *m)
{
    if (!m->has_energy) {
        m->energy = drape_sim_energy_of(m->sim, m->t, m->x, m->v);
        m->energy.gravity -= drape_system_measure_loads(
            m->sim->system,
            &(drape_point){.x = m->x, .internal = drape_sim_state(m->sim)->internal, .t = m->t}, NULL);
    }
    m->has_energy = true;
    return &m->energy;
}

/* Colliders move as in the attempted step. */
static const double *reactions_of(moment *m)
{
    const drape_state *now = drape_sim_state(m->sim);
    if (!m->has_reactions)
        m->status =
            drape_sim_reactions_at(m->sim,
                                   &(drape_point){.x = m->x,
                                                  .v = m->v,
                                                  .internal = now->internal,
                                                  .t = m->t,
                                                  .span = {now->t, m->next->t},
                                                  .instant = !m->sim->chosen.integrator->mean_velocities},
                                   m->sim->events.reactions);
    m->has_reactions = true;
    return m->sim->events.reactions;
}

static drape_status ask_host(moment *m, const drape_watch *w, double *value)
{
    *value = NAN;
    const drape_status status = w->function(w->user, m->t, m->x, m->v, value);
    return status ? drape_fail_unsaid(m->sim->ctx, status < 0 ? status : DRAPE_E_STOPPED, "",
                                      "t=%.9g: the function of event \"%.60s\" returned %s", m->t,
                                      w->event->name, drape_status_name(status))
                  : DRAPE_OK;
}

/* The bound of the quantity: 0 for functions of hosts. */
static double bound_of(const drape_watch *w)
{
    return w->event->ops ? w->event->values[w->event->ops->bound] : 0;
}

static drape_status measure(moment *m, const drape_watch *w, double *value)
{
    const drape_event_ops *ops = w->event->ops;
    drape_status status = DRAPE_OK;
    if (ops) {
        const drape_event_point point = {.model = m->sim->model,
                                         .event = w->event,
                                         .x = m->x,
                                         .v = m->v,
                                         .energy = ops->needs_energy ? energy_of(m) : NULL,
                                         .reactions = ops->needs_reactions ? reactions_of(m) : NULL};
        status = m->status;
        *value = status ? 0 : ops->measure(&point);
    } else
        status = ask_host(m, w, value);
    if (!status && !isfinite(*value))
        status = drape_fail(m->sim->ctx, DRAPE_E_ARGUMENT, "t=%.9g: the function of event \"%.60s\" is %g",
                            m->t, w->event->name, *value);
    return status;
}

static drape_status evaluate(moment *m, const drape_watch *w, double *f)
{
    const drape_status status = measure(m, w, f);
    *f -= bound_of(w);
    return status;
}

static bool is_over(const drape_watch *w)
{
    return (w->event->once || w->event->action == DRAPE_ACTION_RELEASE) && w->count > 0;
}

static bool acts(const drape_watch *w)
{
    return w->event->action != DRAPE_ACTION_RECORD;
}

/* ---- Samples ---- */

static drape_status sample(drape_sim *sim, const drape_state *next)
{
    drape_event_set *e = &sim->events;
    const double start = drape_sim_state(sim)->t, h = next->t - start;
    drape_status status = DRAPE_OK;
    for (int k = 0; !status && k < DRAPE_EVENT_SAMPLES; k++) {
        moment m = between(sim, next, k == DRAPE_EVENT_SAMPLES - 1 ? next->t : start + h * k / 3);
        for (int32_t i = 0; !status && i < e->count; i++) {
            drape_watch *w = &e->watches[i];
            if (is_over(w))
                continue;
            if (k == 0 && w->known)
                w->sample[0] = w->before;
            else
                status = evaluate(&m, w, &w->sample[k]);
        }
    }
    return status;
}

typedef struct point {
    double t, f;
} point;

/* What one event function does in the step: its values at increasing times. */
typedef struct course {
    drape_sim *sim;
    const drape_state *next;
    drape_watch *watch;
    point points[DRAPE_EVENT_SAMPLES + 2];
    int count;
} course;

static drape_status evaluate_at(void *user, double t, double *f)
{
    const course *c = user;
    moment m = between(c->sim, c->next, t);
    return evaluate(&m, c->watch, f);
}

/* If the cubic through the samples comes near 0 at s (of the step), between two of them of one sign,
 * evaluates the function there. */
static drape_status look_at(course *c, const double a[4], double s)
{
    const double *f = c->watch->sample, value = a[0] + s * (a[1] + s * (a[2] + s * a[3]));
    const int k = s < 1 / 3.0 ? 0 : s < 2 / 3.0 ? 1 : 2, sign = sign_of(f[k]);
    if (!(s > 0 && s < 1) || sign == 0 || sign_of(f[k + 1]) != sign ||
        sign * value > NEAR * fmin(fabs(f[k]), fabs(f[k + 1])))
        return DRAPE_OK;
    point p = {.t = c->points[0].t + s * (c->next->t - c->points[0].t)};
    const drape_status status = evaluate_at(c, p.t, &p.f);
    if (!status && p.t > c->points[0].t && p.t < c->next->t) {
        int i = c->count++;
        for (; c->points[i - 1].t > p.t; i--)
            c->points[i] = c->points[i - 1];
        c->points[i] = p;
    }
    return status;
}

/* The samples, and the extrema of the cubic through them at which it turns towards 0 between two samples.
 * Heights and distances on the cubic Hermite polynomial are this cubic, so that none of their roots is
 * missed. */
static drape_status follow(course *c)
{
    const double *f = c->watch->sample, start = drape_sim_state(c->sim)->t, h = c->next->t - start;
    c->count = 0;
    for (int k = 0; k < DRAPE_EVENT_SAMPLES; k++)
        c->points[c->count++] = (point){k == DRAPE_EVENT_SAMPLES - 1 ? c->next->t : start + h * k / 3, f[k]};
    /* a0 + a1 s + a2 s^2 + a3 s^3 through f at s = 0, 1/3, 2/3, 1 */
    const double d1 = f[1] - f[0], d2 = f[2] - 2 * f[1] + f[0], d3 = f[3] - 3 * f[2] + 3 * f[1] - f[0];
    const double a[4] = {f[0], 3 * d1 - 1.5 * d2 + d3, 4.5 * (d2 - d3), 4.5 * d3};
    const double square = a[2] * a[2] - 3 * a[1] * a[3];
    if (!(square > 0))
        return DRAPE_OK;
    /* the roots of a1 + 2 a2 s + 3 a3 s^2, without cancellation */
    const double q = -(a[2] + (a[2] > 0 ? sqrt(square) : -sqrt(square)));
    drape_status status = a[3] != 0 ? look_at(c, a, q / (3 * a[3])) : DRAPE_OK;
    return status || q == 0 ? status : look_at(c, a, a[1] / q);
}

/* ---- Roots ---- */

static void add(drape_sim *sim, const course *c, double t, double f, int direction)
{
    drape_event_set *e = &sim->events;
    drape_watch *w = c->watch;
    const drape_pending_root found = {.event = (int32_t)(w - e->watches),
                                      .root = {.t = t, .value = f + bound_of(w), .direction = direction}};
    const bool counts = w->event->direction == DRAPE_DIRECTION_BOTH ||
                        (direction > 0) == (w->event->direction == DRAPE_DIRECTION_UP);
    if (!counts || ((w->event->once || w->event->action == DRAPE_ACTION_RELEASE) && w->found > 0) ||
        e->pending_count == e->pending_room)
        return;
    w->found++;
    int32_t k = e->pending_count++;
    for (; k > 0 && e->pending[k - 1].root.t > t; k--)
        e->pending[k] = e->pending[k - 1];
    e->pending[k] = found;
}

/* A root between two neighbouring points, on whose later one f has another sign than before, or is 0. */
static drape_status locate(course *c, const point *a, const point *b, int direction)
{
    double root = a->t, f = a->f;
    drape_status status = DRAPE_OK;
    if (sign_of(a->f) != sign_of(b->f)) { /* otherwise the root was taken for one of the step before */
        status = drape_root_find(evaluate_at, c, a->t, a->f, b->t, b->f,
                                 fmax(1e-3 * tolerance_at(b->t), 2 * DBL_EPSILON * fabs(b->t)), &root);
        if (!status)
            status = evaluate_at(c, root, &f);
    }
    if (!status)
        add(c->sim, c, root, f, direction);
    return status;
}

/* Adds the roots of one event function in the step, in order. A value of 0 belongs to the side to which the
 * function comes there: a root at the end of a step is not found again at the beginning of the next one. */
static drape_status search_course(course *c)
{
    drape_watch *w = c->watch;
    int side = w->known ? w->side : sign_of(w->sample[0]);
    drape_status status = follow(c);
    w->found = 0;
    for (int k = 1; !status && k < c->count; k++) {
        const int sign = sign_of(c->points[k].f);
        if (side != 0 && sign != side) {
            side = -side;
            status = locate(c, &c->points[k - 1], &c->points[k], side);
        } else if (side == 0)
            side = sign;
    }
    w->side_after = side;
    return status;
}

static drape_status search_all(drape_sim *sim, const drape_state *next)
{
    drape_event_set *e = &sim->events;
    drape_status status = sample(sim, next);
    e->pending_count = e->reported = 0;
    for (int32_t i = 0; !status && i < e->count; i++)
        if (!is_over(&e->watches[i]))
            status = search_course(&(course){.sim = sim, .next = next, .watch = &e->watches[i]});
    return status;
}

/* ---- The step that ends at a root ---- */

/* f changes by this much in the tolerance at the end of the step. */
static double change_in_tolerance(const drape_watch *w, double h, double t)
{
    return fabs(w->sample[3] - w->sample[2]) / (h / 3) * tolerance_at(t);
}

/* The step ends here: roots of events that act and lie less than the tolerance before its end are there. */
static drape_event_verdict end_here(drape_sim *sim, const drape_state *next, int32_t also)
{
    drape_event_set *e = &sim->events;
    /* Events that would have their root less than the tolerance after the end have it at the end: so one
     * that is recorded is, also where another one stops the run. */
    const double h = next->t - drape_sim_state(sim)->t;
    for (int32_t i = 0; i < e->count; i++) {
        drape_watch *w = &e->watches[i];
        const double f = w->sample[3];
        const bool comes = (f - w->sample[2]) * f <= 0 && fabs(f) <= change_in_tolerance(w, h, next->t);
        if (is_over(w) || w->found > 0 || sign_of(f) != w->side_after || w->side_after == 0 ||
            !(comes || i == also))
            continue;
        w->side_after = -w->side_after;
        add(sim, &(course){.watch = w}, next->t, f, w->side_after);
    }
    for (int32_t i = 0; i < e->pending_count; i++)
        if (acts(&e->watches[e->pending[i].event])) {
            e->pending[i].root.t = next->t;
            e->pending[i].root.value =
                e->watches[e->pending[i].event].sample[3] + bound_of(&e->watches[e->pending[i].event]);
        }
    e->search.event = -1;
    return DRAPE_EVENTS_PASS;
}

/* The present state is at the root already, to the tolerance: only those roots stay. */
static drape_event_verdict end_before(drape_sim *sim)
{
    drape_event_set *e = &sim->events;
    const double t = drape_sim_state(sim)->t;
    int32_t kept = 0;
    for (int32_t i = 0; i < e->pending_count; i++) {
        drape_watch *w = &e->watches[e->pending[i].event];
        if (e->pending[i].root.t - t > tolerance_at(t))
            continue;
        e->pending[kept] = e->pending[i];
        e->pending[kept].root.t = t;
        e->pending[kept++].root.value = w->sample[0] + bound_of(w);
        w->known = true;
        w->before = w->sample[0];
        w->side = e->pending[i].root.direction;
        w->count++;
        w->last = e->pending[kept - 1].root;
        if (w->count <= DRAPE_EVENT_TIMES)
            w->first[w->count - 1] = w->last;
    }
    e->pending_count = kept;
    e->search.event = -1;
    return DRAPE_EVENTS_NOW;
}

/* The next end to try: where the chord meets 0, but well within the interval. */
static double next_target(const drape_event_search *s)
{
    const double length = s->high - s->low,
                 chord = s->low - s->low_value * length / (s->high_value - s->low_value),
                 margin = 1e-3 * length;
    return s->tries % 8 == 7 || !isfinite(chord) ? s->low + length / 2
                                                 : fmin(fmax(chord, s->low + margin), s->high - margin);
}

static drape_event_verdict repeat_to(drape_sim *sim, double target)
{
    drape_event_set *e = &sim->events;
    e->search.target = target;
    e->search.tries++;
    e->pending_count = 0;
    drape_schedule_cut(&sim->schedule, target);
    return DRAPE_EVENTS_REPEAT;
}

/* Brings the interval of the search up to date with an attempt, after whose end the root lies unless it was
 * crossed. f at an end that is kept twice in a row is halved (the Illinois rule), so that neither end is kept
 * for ever. Returns false if no interval is left. */
static bool narrow(drape_sim *sim, const drape_state *next, bool crossed)
{
    drape_event_search *s = &sim->events.search;
    const drape_watch *w = &sim->events.watches[s->event];
    if (s->from != drape_sim_state(sim)->t) { /* a part of the step was accepted */
        s->from = s->low = drape_sim_state(sim)->t;
        s->low_value = w->sample[0];
    }
    if (crossed) {
        s->low_value /= s->moved > 0 ? 2 : 1;
        s->high = next->t;
        s->high_value = w->sample[3];
    } else {
        s->high_value /= s->moved < 0 ? 2 : 1;
        s->low = next->t;
        s->low_value = w->sample[3];
    }
    s->moved = crossed ? 1 : -1;
    return s->low < s->high;
}

static drape_event_verdict aim_at(drape_sim *sim, const drape_state *next, const drape_pending_root *root)
{
    drape_event_set *e = &sim->events;
    drape_event_search *s = &e->search;
    const drape_watch *w = &e->watches[root->event];
    const double start = drape_sim_state(sim)->t, target = root->root.t;
    if (next->t - target <= tolerance_at(target))
        return end_here(sim, next, -1);
    if (target - start <= tolerance_at(target))
        return end_before(sim);
    if (s->event != root->event || s->from != start) {
        *s = (drape_event_search){.event = root->event,
                                  .from = start,
                                  .low = start,
                                  .low_value = w->sample[0],
                                  .high = next->t,
                                  .high_value = w->sample[3]};
        return repeat_to(sim, target);
    }
    narrow(sim, next, true);
    if (s->high - s->low <= tolerance_at(target) || s->tries >= MAX_TRIES)
        return end_here(sim, next, root->event);
    return repeat_to(sim, next_target(s));
}

/* The step was repeated to end at a root, and ends before it. */
static drape_event_verdict extend(drape_sim *sim, const drape_state *next)
{
    drape_event_search *s = &sim->events.search;
    const drape_watch *w = &sim->events.watches[s->event];
    const double h = next->t - drape_sim_state(sim)->t;
    const bool inside = narrow(sim, next, false);
    if (fabs(w->sample[3]) <= change_in_tolerance(w, h, next->t) || s->tries >= MAX_TRIES ||
        (inside && s->high - s->low <= tolerance_at(next->t)))
        return end_here(sim, next, s->event);
    if (inside)
        return repeat_to(sim, next_target(s));
    s->event = -1; /* from the new start the root is later: it will be found again */
    return DRAPE_EVENTS_PASS;
}

drape_event_verdict drape_events_examine(drape_sim *sim, const drape_state *next, drape_status *status)
{
    drape_event_set *e = &sim->events;
    bool active = false;
    for (int32_t i = 0; i < e->count && !active; i++)
        active = !is_over(&e->watches[i]);
    if (!active || sim->chosen.integrator->steady_state)
        return DRAPE_EVENTS_PASS;
    *status = search_all(sim, next);
    if (*status) {
        e->pending_count = 0;
        return DRAPE_EVENTS_FAIL;
    }
    for (int32_t i = 0; i < e->pending_count; i++)
        if (acts(&e->watches[e->pending[i].event]))
            return aim_at(sim, next, &e->pending[i]);
    return e->search.event >= 0 && next->t == e->search.target ? extend(sim, next) : DRAPE_EVENTS_PASS;
}

void drape_events_commit(drape_sim *sim)
{
    drape_event_set *e = &sim->events;
    if (sim->chosen.integrator->steady_state)
        return;
    for (int32_t i = 0; i < e->count; i++) {
        drape_watch *w = &e->watches[i];
        if (is_over(w))
            continue;
        w->known = true;
        w->before = w->sample[DRAPE_EVENT_SAMPLES - 1];
        w->side = w->side_after;
    }
    for (int32_t i = 0; i < e->pending_count; i++) {
        drape_watch *w = &e->watches[e->pending[i].event];
        if (w->count < DRAPE_EVENT_TIMES)
            w->first[w->count] = e->pending[i].root;
        w->last = e->pending[i].root;
        w->count++;
    }
}

/* ---- Creation ---- */

static bool needs_reactions(const drape_event_set *e)
{
    bool needs = false;
    for (int32_t i = 0; i < e->count; i++)
        needs = needs || (e->watches[i].event->ops && e->watches[i].event->ops->needs_reactions);
    return needs;
}

drape_status drape_events_create(drape_sim *sim)
{
    drape_event_set *e = &sim->events;
    *e = (drape_event_set){.count = sim->model->event_count, .search = {.event = -1}, .stopped_by = -1};
    if (e->count == 0)
        return DRAPE_OK;
    e->pending_room = ROOM * e->count;
    e->watches = drape_arena_take(sim->arena, (size_t)e->count, sizeof *e->watches);
    e->pending = drape_arena_take(sim->arena, (size_t)e->pending_room, sizeof *e->pending);
    if (drape_arena_status(sim->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < e->count; i++)
        e->watches[i] = (drape_watch){.event = &sim->model->events[i]};
    if (needs_reactions(e))
        e->reactions = drape_arena_take(sim->arena, 3 * (size_t)sim->model->node_count, sizeof *e->reactions);
    return drape_arena_status(sim->arena);
}

static drape_status add_watch(drape_sim *sim, const drape_watch *watch)
{
    drape_event_set *e = &sim->events;
    const int32_t count = e->count + 1, room = ROOM * count;
    drape_watch *watches = drape_arena_take(sim->arena, (size_t)count, sizeof *watches);
    drape_pending_root *pending = drape_arena_take(sim->arena, (size_t)room, sizeof *pending);
    if (!watches || !pending)
        return DRAPE_E_MEMORY;
    if (e->count > 0)
        memcpy(watches, e->watches, (size_t)e->count * sizeof *watches);
    if (e->pending_count > 0)
        memcpy(pending, e->pending, (size_t)e->pending_count * sizeof *pending);
    watches[e->count] = *watch;
    e->watches = watches;
    e->pending = pending;
    e->count = count;
    e->pending_room = room;
    return DRAPE_OK;
}

static drape_status add_function(drape_sim *sim, const drape_event_def *def, drape_event_function *function,
                                 void *user)
{
    drape_watch watch = {.function = function, .user = user};
    drape_model_event *event = drape_arena_take(sim->arena, 1, sizeof *event);
    if (!event)
        return DRAPE_E_MEMORY;
    drape_status status = drape_compile_host_event(sim->ctx, sim->arena, sim->model, def, event);
    watch.event = event;
    if (!status) {
        /* The texts of the def are copied. */
        const char **const texts[] = {&watch.def.name, &watch.def.cloth, &watch.def.pins,
                                      &watch.def.direction, &watch.def.action};
        watch.def = *def;
        for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
            if (*texts[i])
                *texts[i] = drape_arena_text(sim->arena, *texts[i]);
        status = drape_arena_status(sim->arena);
    }
    return status ? status : add_watch(sim, &watch);
}

drape_status drape_events_copy(drape_sim *sim, const drape_sim *from)
{
    drape_status status = DRAPE_OK;
    for (int32_t i = from->model->event_count; !status && i < from->events.count; i++) {
        const drape_watch *w = &from->events.watches[i];
        status = add_function(sim, &w->def, w->function, w->user);
    }
    return status;
}

/* The number of the event of another sim with the same name and kind; -1: there is none. */
static int32_t event_like(const drape_event_set *set, const drape_watch *watch)
{
    for (int32_t i = 0; i < set->count; i++) {
        const drape_watch *w = &set->watches[i];
        if (strcmp(w->event->name, watch->event->name) == 0 && w->event->ops == watch->event->ops &&
            w->function == watch->function)
            return i;
    }
    return -1;
}

void drape_events_continue(drape_sim *sim, const drape_sim *from)
{
    drape_event_set *to = &sim->events;
    for (int32_t i = 0; i < to->count; i++) {
        drape_watch *same = &to->watches[i];
        const int32_t before = event_like(&from->events, same);
        if (before < 0)
            continue;
        const drape_watch *w = &from->events.watches[before];
        same->known = w->known;
        same->before = w->before;
        same->side = w->side;
        same->count = w->count;
        memcpy(same->first, w->first, sizeof same->first);
        same->last = w->last;
    }
    for (int32_t i = 0; i < from->events.pending_count; i++) {
        drape_pending_root root = from->events.pending[i];
        root.event = event_like(to, &from->events.watches[root.event]);
        if (root.event < 0 || to->pending_count == to->pending_room)
            continue;
        to->pending[to->pending_count++] = root;
        to->reported += i < from->events.reported;
    }
}

void drape_events_forget(drape_sim *sim)
{
    for (int32_t i = 0; i < sim->events.count; i++)
        sim->events.watches[i].known = false;
}

void drape_events_reset(drape_sim *sim)
{
    drape_event_set *e = &sim->events;
    drape_events_forget(sim);
    e->search.event = -1;
    e->pending_count = e->reported = 0;
}

/* ---- For hosts ---- */

static drape_status refuse(const drape_sim *sim, const char *what, const char *value)
{
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_add_event: %s \"%.60s\"", what, value);
}

drape_status drape_sim_add_event(drape_sim *sim, const drape_event_def *def, drape_event_function *function,
                                 void *user)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_add_event");
    if (status)
        return status;
    sim->ctx->message[0] = 0;
    if (!def || !function || !def->name)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_add_event: there is no %s",
                          !def        ? "def"
                          : !function ? "function"
                                      : "name in the def");
    if (def->struct_size != sizeof *def)
        return drape_fail(sim->ctx, DRAPE_E_VERSION,
                          "the event def was not initialised by drape_event_def_init of this version");
    if (def->entry.type)
        return refuse(sim, "the function of a host has no type; the def has", def->entry.type);
    for (int32_t i = 0; i < sim->events.count; i++)
        if (strcmp(sim->events.watches[i].event->name, def->name) == 0)
            return refuse(sim, "there is an event of the name", def->name);
    if (sim->events.count - sim->model->event_count == DRAPE_MAX_HOST_EVENTS)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_add_event: a host adds at most %d events",
                          DRAPE_MAX_HOST_EVENTS);
    return add_function(sim, def, function, user);
}

int32_t drape_sim_event(const drape_sim *sim, int32_t index, drape_event_record *out)
{
    if (!sim)
        return 0;
    if (out && index >= 0 && index < sim->events.count) {
        const drape_watch *w = &sim->events.watches[index];
        *out = (drape_event_record){.name = w->event->name,
                                    .count = w->count,
                                    .first = w->count > 0 ? w->first[0].t : NAN,
                                    .last = w->count > 0 ? w->last.t : NAN,
                                    .value = w->count > 0 ? w->last.value : NAN,
                                    .direction = w->last.direction};
    }
    return sim->events.count;
}

int32_t drape_sim_stopped_by(const drape_sim *sim)
{
    return sim ? sim->events.stopped_by : -1;
}

/* ---- Checkpoints ---- */

static void archive_root(drape_event_root *root, drape_archive *a)
{
    drape_archive_double(a, &root->t);
    drape_archive_double(a, &root->value);
    drape_archive_int(a, &root->direction);
}

static void archive_watch(drape_watch *w, drape_archive *a)
{
    drape_archive_bool(a, &w->known);
    drape_archive_double(a, &w->before);
    drape_archive_int(a, &w->side);
    drape_archive_int64(a, &w->count);
    if (drape_archive_good(a) && !(w->side >= -1 && w->side <= 1 && w->count >= 0))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an event that occurred %lld times",
                           (long long)w->count);
    for (int64_t i = 0; i < w->count && i < DRAPE_EVENT_TIMES && drape_archive_good(a); i++)
        archive_root(&w->first[i], a);
    archive_root(&w->last, a);
}

/* The number of an event; -1: none. */
static void archive_index(int32_t *index, int32_t count, drape_archive *a)
{
    drape_archive_int32(a, index);
    if (drape_archive_good(a) && !(*index >= -1 && *index < count))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an event %d of %d", (int)*index, (int)count);
}

static void archive_search(drape_event_search *s, int32_t count, drape_archive *a)
{
    double *const numbers[] = {&s->from, &s->target, &s->low, &s->high, &s->low_value, &s->high_value};
    archive_index(&s->event, count, a);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_archive_double(a, numbers[i]);
    drape_archive_int(a, &s->moved);
    drape_archive_int64(a, &s->tries);
    if (drape_archive_good(a) && s->event >= 0 &&
        !(s->from <= s->low && s->low < s->high && isfinite(s->high)))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no interval with an event");
}

static void archive_pending(drape_event_set *e, drape_archive *a)
{
    int count = e->pending_count, reported = e->reported;
    drape_archive_int(a, &count);
    drape_archive_int(a, &reported);
    if (drape_archive_good(a) &&
        !(count >= 0 && count <= e->pending_room && reported >= 0 && reported <= count))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %d events to report", count);
    for (int i = 0; i < count && drape_archive_good(a); i++) {
        archive_index(&e->pending[i].event, e->count, a);
        if (drape_archive_good(a) && e->pending[i].event < 0)
            drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no event to report");
        archive_root(&e->pending[i].root, a);
    }
    e->pending_count = drape_archive_good(a) ? count : 0;
    e->reported = drape_archive_good(a) ? reported : 0;
}

void drape_events_archive(drape_sim *sim, drape_archive *a)
{
    drape_event_set *e = &sim->events;
    drape_archive_mark(a, "events");
    drape_archive_same(a, "the number of events", e->count);
    for (int32_t i = 0; i < e->count && drape_archive_good(a); i++)
        archive_watch(&e->watches[i], a);
    if (e->count == 0 || !drape_archive_good(a))
        return;
    archive_search(&e->search, e->count, a);
    archive_index(&e->stopped_by, e->count, a);
    archive_pending(e, a);
}
