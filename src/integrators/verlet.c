/*
 * verlet.c: explicit steps, each split into substeps of h. With a = -M^-1 g(x, v) and c = 1 - damping/100:
 *
 * velocity   v <- c v, x' = x + h v + h^2/2 a(x, v), v' = v + h/2 (a(x, v) + a(x', v + h a(x, v)))
 *     velocity Verlet: second order, also with forces that depend on v.
 * position   v' = c v + h a(x, v), x' = x + h v'
 *     x' = x + c (x - x_before) + h^2 a of CS184 and Boson, with v = (x - x_before)/h: the same numbers up
 *     to rounding, but with the state (x, v). v is the velocity half a substep ago: first order.
 *
 * Then nodes are moved: apart where cloth is too near to cloth, out of colliders, and to where springs are
 * not too long (verlet.h). Moving a node by d changes its velocity by d/h, as Verlet's velocity is a
 * difference of positions.
 *
 * Stable for
 *     h < (sqrt(mu^2 + 2 (1 + c) omega^2) - mu)/omega^2
 * with omega^2 the largest eigenvalue of M^-1 K and mu that of M^-1 D: from z^2 - (1 + c - h^2 omega^2 - h
 * mu) z + c - h mu, whose roots are the growth factors of one wave in a substep of the position form if
 * omega and mu belong to the same wave. For mu = 0, c = 1 it is 2/omega. Damping lowers it because its
 * forces lag. The limit of the velocity form is slightly higher. The moves of nodes are not considered.
 *
 * Energy: `dissipated` contains the work of the dissipative terms and the energy removed by c. Moves of
 * nodes have neither a force nor a law, so their energy is part of `numerical`, with the error of the
 * substeps.
 */
#include "integrators/verlet.h"

#include "base/clock.h"
#include "base/finite.h"
#include "base/lanes.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "integrators/spectrum.h"
#include "model/support.h"

#include <string.h>

enum {
    PARAM_DT,
    PARAM_SUBSTEPS,
    PARAM_FORM,
    PARAM_DAMPING,
    PARAM_CONTACT,
    PARAM_SURFACE_OFFSET,
    PARAM_FRICTION_RANGE,
    PARAM_FRICTION_DRAG,
    PARAM_SELF_BOXES,
    PARAM_STRAIN_LIMIT,
    PARAM_STRAIN_LIMIT_ITERATIONS,
    PARAM_GUARD,
    PARAM_COUNT
};
enum { FORM_VELOCITY, FORM_POSITION };
enum { BOXES_ALL, BOXES_OWN };

static const char *const form_choices[] = {"velocity", "position", NULL};
static const char *const contact_choices[] = {
    [DRAPE_VERLET_CS184] = "cs184", [DRAPE_VERLET_BOSON] = "boson", NULL};
static const char *const boxes_choices[] = {[BOXES_ALL] = "all", [BOXES_OWN] = "own", NULL};
static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT] = DRAPE_NUMBER("dt", "s", 1.0 / 60, DRAPE_ABOVE(0), 1e6, "nominal step"),
    [PARAM_SUBSTEPS] = DRAPE_INTEGER(
        "substeps", "1", 0, 0, 1e6,
        "substeps in a step; 0: as many as the stability limit at the start of the step requires"),
    [PARAM_FORM] =
        DRAPE_CHOICE("form", FORM_VELOCITY, form_choices,
                     "velocity: second order; position: x' = x + (x - x_before) + a h^2 as CS184 and Boson"),
    [PARAM_DAMPING] = DRAPE_NUMBER("damping", "%", 0, 0, 100,
                                   "velocity lost in each substep: more substeps damp more, as in CS184"),
    [PARAM_CONTACT] =
        DRAPE_CHOICE("contact", DRAPE_VERLET_CS184, contact_choices,
                     "how nodes are moved out of colliders; cs184: friction is the fraction of a correction "
                     "that is left out; boson: nodes stop on flat surfaces, friction changes forces"),
    [PARAM_SURFACE_OFFSET] = DRAPE_NUMBER("surface_offset", "m", 1e-4, 0, 1e9,
                                          "cs184: distance from a flat surface at which a node is placed"),
    [PARAM_FRICTION_RANGE] =
        DRAPE_NUMBER("friction_range", "m", 0.5, 0, 1e9,
                     "boson: distance from a surface up to which nodes have friction with it"),
    [PARAM_FRICTION_DRAG] =
        DRAPE_NUMBER("friction_drag", "N s/m", 0.5, 0, 1e9, "boson: drag of a node under friction"),
    [PARAM_SELF_BOXES] = DRAPE_CHOICE(
        "self_boxes", BOXES_ALL, boxes_choices,
        "boxes in which points near a point of cloth are searched; own: only its own box, as in CS184"),
    [PARAM_STRAIN_LIMIT] = DRAPE_NUMBER("strain_limit", "1", DRAPE_DERIVED("none"), 0, 1e6,
                                        "largest strain of a spring, kept by moving its nodes; 0.1 in CS184"),
    [PARAM_STRAIN_LIMIT_ITERATIONS] = DRAPE_INTEGER(
        "strain_limit_iterations", "1", 1, 1, 1e6,
        "maximum number of passes over all springs; one, as in CS184, does not reach the limit"),
    [PARAM_GUARD] = DRAPE_BOOLEAN("guard", true,
                                  "reject steps that create energy or collapse an element; false, as in "
                                  "CS184 and Boson: only those in which a node is faster than 1e6 m/s"),
};

#define STABILITY_ITERATIONS 30    /* finds omega of a sheet to 1 % */
#define SAFETY               0.8   /* fraction of the stability limit that a substep takes */
#define MAX_SPEED            1e6   /* [m/s] of a node; a step with a faster one has blown up */
#define MAX_SUBSTEPS         10000 /* of a step that are not given; one that needs more is rejected */

typedef struct verlet_state {
    drape_system *system;
    const drape_model *model;
    const drape_motion *motion;
    double values[PARAM_COUNT];
    double keep;        /* c */
    double *g, *g1;     /* nodes: negative forces */
    double *x0;         /* nodes: at the start of the substep */
    double *pins;       /* nodes: positions of moving pins at its end */
    double *inverse;    /* nodes: 1/mass [1/kg], three times each; 0 if pinned */
    double *v_ahead;    /* nodes: velocity form with forces that depend on v */
    double *dissipated; /* nodes; NULL if nothing dissipates */
    drape_verlet_force *force;
    drape_verlet_contact contact;
    drape_verlet_limit limit;
    drape_verlet_self self;
    drape_spectrum *spectrum;
    drape_work work;
} verlet_state;

/* One substep. */
typedef struct substep {
    double t0, t, h;
    double share; /* of the correction of self-contact: one over the substeps */
    double *x, *v;
    const double *internal;
    drape_step_info *info;
} substep;

/* ---- Creation ---- */

static drape_status create_arrays(drape_arena *arena, verlet_state *s)
{
    const drape_model *m = s->model;
    const size_t nodes = 3 * (size_t)m->node_count;
    double **const always[] = {&s->g, &s->g1, &s->x0, &s->pins, &s->inverse};
    for (size_t i = 0; i < sizeof always / sizeof *always; i++)
        *always[i] = drape_arena_take(arena, nodes, sizeof(double));
    if (m->has_own_dissipation) {
        s->v_ahead = drape_arena_take(arena, nodes, sizeof(double));
        s->dissipated = drape_arena_take(arena, nodes, sizeof(double));
    }
    for (int32_t f = 0; s->inverse && f < m->free_count; f++)
        for (size_t k = 0, i = (size_t)m->node_of_free[f]; k < 3; k++)
            s->inverse[3 * i + k] = 1 / m->mass[i];
    return drape_arena_status(arena);
}

/* The rules of contact put nodes on the surface of a body that is the same before and after a substep. */
static drape_status check_rigid(drape_arena *arena, const drape_model *m)
{
    for (int32_t c = 0; c < m->collider_count; c++)
        if (m->colliders[c].frames.frame_count > 0)
            return drape_fail_at(
                arena->ctx, DRAPE_E_ARGUMENT, "/integrator/method",
                "verlet has rules of contact for rigid bodies, and %s is of the type %s, which deforms; "
                "the other integrators follow it",
                m->colliders[c].name, m->colliders[c].ops->entry.name);
    return DRAPE_OK;
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    verlet_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (verlet_state){.system = system,
                        .model = drape_system_model(system),
                        .motion = drape_system_motion(system),
                        .keep = 1 - values[PARAM_DAMPING] / 100};
    memcpy(s->values, values, sizeof s->values);
    s->contact = (drape_verlet_contact){.model = s->model,
                                        .motion = s->motion,
                                        .rule = (int)values[PARAM_CONTACT],
                                        .offset = values[PARAM_SURFACE_OFFSET],
                                        .friction_range = values[PARAM_FRICTION_RANGE],
                                        .friction_drag = values[PARAM_FRICTION_DRAG]};
    drape_status status = check_rigid(arena, s->model);
    if (!status)
        status = create_arrays(arena, s);
    if (!status)
        status = drape_verlet_force_create(arena, s->system, &s->force);
    if (!status && !isnan(values[PARAM_STRAIN_LIMIT]))
        status = drape_verlet_limit_create(arena, s->model, values[PARAM_STRAIN_LIMIT],
                                           (int)values[PARAM_STRAIN_LIMIT_ITERATIONS], &s->limit);
    if (!status && s->model->contact.self)
        status = drape_verlet_self_create(arena, s->model, values[PARAM_SELF_BOXES] == BOXES_OWN, &s->self);
    if (!status)
        status = drape_spectrum_create(arena, s->system, STABILITY_ITERATIONS, &s->spectrum);
    return status;
}

/* ---- Forces ---- */

/* The work of friction with colliders that move is added over a share of the substep. */
static void evaluate(verlet_state *s, const substep *sub, double share, double t, const double *v, double *g)
{
    double start = drape_clock_seconds();
    drape_verlet_force_sum(
        s->force,
        &(drape_point){
            .x = sub->x, .v = v, .internal = sub->internal, .t = t, .span = {t, t}, .turning = true},
        g);
    s->work.residual_seconds += drape_clock_seconds() - start;
    s->work.residuals++;
    drape_system_work(s->system)[DRAPE_BY_COLLIDERS] +=
        share * sub->h * drape_verlet_friction(&s->contact, t, sub->x, v, g);
}

/* Adds the work of the dissipative forces at x, v and t over a share of the substep. */
static void audit_dissipation(verlet_state *s, const substep *sub, double share, double t, const double *v)
{
    if (s->dissipated)
        sub->info->dissipated += drape_system_dissipation(
            s->system,
            &(drape_point){
                .x = sub->x, .v = v, .internal = sub->internal, .t = t, .span = {t, t}, .turning = true},
            share * sub->h, s->dissipated);
}

/* ---- The stages of a substep ---- */

/* Along the directions that moving supports hold, nodes have the mean velocity of these over the substep. */
static void carry(const verlet_state *s, const substep *sub)
{
    if (s->model->supports_move)
        drape_supports_hold_velocity(s->motion, (const double[]){sub->t0, sub->t}, false, sub->v);
}

/* Moving pins get their mean velocity over the substep. */
static void start_pins(verlet_state *s, const substep *sub)
{
    const drape_motion *m = s->motion;
    carry(s, sub);
    if (m->moved_count == 0)
        return;
    drape_motion_place_pins(m, sub->t, s->pins);
    for (int32_t i = 0; i < m->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)m->moved_node[i] + k;
            sub->v[at] = (s->pins[at] - sub->x[at]) / sub->h;
        }
}

/* Adds the work of moving pins and supports against g over a share of the substep. */
static void audit_pins(verlet_state *s, const substep *sub, const double *g, double share)
{
    const drape_motion *m = s->motion;
    double *work = &drape_system_work(s->system)[DRAPE_BY_PINS];
    for (int32_t i = 0; i < m->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)m->moved_node[i] + k;
            *work += share * g[at] * sub->v[at] * sub->h;
        }
    *work += share * drape_system_support_work(s->system, NULL, sub->t0, sub->t);
}

static void damp(verlet_state *s, const substep *sub)
{
    const drape_model *m = s->model;
    double taken = 0;
    if (s->keep == 1)
        return;
    if (m->supports_move)
        drape_system_project(s->system, sub->v); /* what supports move is not damped */
    for (int32_t f = 0; f < m->free_count; f++) {
        double *v = sub->v + 3 * (size_t)m->node_of_free[f];
        taken += m->mass[m->node_of_free[f]] * vec3_dot(v, v);
        for (int k = 0; k < 3; k++)
            v[k] *= s->keep;
    }
    sub->info->dissipated += 0.5 * (1 - s->keep * s->keep) * taken;
}

/* v -= w g/m, x0 = x, x += h v of all coordinates; inverse is 0 where x is pinned. */
LANES_DISPATCH static void move_all(size_t n, double w, double h, const double *restrict inverse,
                                    const double *restrict g, double *restrict v, double *restrict x,
                                    double *restrict x0)
{
    for (size_t i = 0; i < n; i++) {
        v[i] -= w * inverse[i] * g[i];
        x0[i] = x[i];
        x[i] += inverse[i] > 0 ? h * v[i] : 0;
    }
}

/* Moving pins go to their positions at the end of the substep. */
static void move(const verlet_state *s, const substep *sub, double w)
{
    carry(s, sub);
    move_all(3 * (size_t)s->model->node_count, w, sub->h, s->inverse, s->g, sub->v, sub->x, s->x0);
    drape_motion_place_pins(s->motion, sub->t, sub->x);
}

/* v = (x - x0)/h of all coordinates that are not pinned. */
LANES_DISPATCH static void take_velocities(size_t n, double h, const double *restrict inverse,
                                           const double *restrict x, const double *restrict x0,
                                           double *restrict v)
{
    double per = 1 / h;
    for (size_t i = 0; i < n; i++)
        v[i] = inverse[i] > 0 ? (x[i] - x0[i]) * per : v[i];
}

/* Moves nodes by the rules of contact and of the strain limit, and updates their velocities. */
static void project(verlet_state *s, const substep *sub)
{
    const drape_model *m = s->model;
    if (!m->contact.self && m->collider_count == 0 && s->limit.count == 0)
        return;
    double start = drape_clock_seconds();
    if (m->contact.self)
        drape_verlet_self_push(&s->self, sub->share, sub->x);
    drape_system_work(s->system)[DRAPE_BY_COLLIDERS] +=
        drape_verlet_project(&s->contact, sub->t0, sub->t, sub->h, s->x0, sub->x);
    if (s->limit.count > 0)
        drape_verlet_limit_lengths(&s->limit, sub->x);
    if (m->supports_move || m->image_set_count > 0)
        drape_supports_hold(s->motion, sub->t0, s->x0, sub->t, sub->x);
    take_velocities(3 * (size_t)m->node_count, sub->h, s->inverse, sub->x, s->x0, sub->v);
    s->work.contact_seconds += drape_clock_seconds() - start;
}

/* v + h/2 a, with the other half already added by move(): the velocity at the end, to first order. */
static const double *velocity_ahead(const verlet_state *s, const substep *sub)
{
    const drape_model *m = s->model;
    if (!s->v_ahead)
        return sub->v;
    memcpy(s->v_ahead, sub->v, 3 * (size_t)m->node_count * sizeof *s->v_ahead);
    for (int32_t f = 0; f < m->free_count; f++)
        vec3_add_scaled(-0.5 * sub->h / m->mass[m->node_of_free[f]], s->g + 3 * (size_t)m->node_of_free[f],
                        s->v_ahead + 3 * (size_t)m->node_of_free[f]);
    return s->v_ahead;
}

/* Forces that depend on positions alone are those of the end of the previous substep. */
static void substep_velocity(verlet_state *s, const substep *sub, bool first)
{
    const drape_model *m = s->model;
    start_pins(s, sub);
    damp(s, sub);
    if (first || s->v_ahead || s->contact.rule == DRAPE_VERLET_BOSON) {
        evaluate(s, sub, 0.5, sub->t0, sub->v, s->g);
    } else {
        double *swap = s->g;
        s->g = s->g1;
        s->g1 = swap;
    }
    audit_dissipation(s, sub, 0.5, sub->t0, sub->v);
    audit_pins(s, sub, s->g, 0.5);
    move(s, sub, 0.5 * sub->h);
    project(s, sub);
    const double *ahead = velocity_ahead(s, sub);
    evaluate(s, sub, 0.5, sub->t, ahead, s->g1);
    audit_dissipation(s, sub, 0.5, sub->t, ahead);
    audit_pins(s, sub, s->g1, 0.5);
    for (int32_t f = 0; f < m->free_count; f++)
        vec3_add_scaled(-0.5 * sub->h / m->mass[m->node_of_free[f]], s->g1 + 3 * (size_t)m->node_of_free[f],
                        sub->v + 3 * (size_t)m->node_of_free[f]);
}

/* ---- Stability ---- */

static int64_t substeps_for(const verlet_state *s, double h, double limit)
{
    int64_t given = (int64_t)s->values[PARAM_SUBSTEPS];
    if (given > 0)
        return given;
    const double needed = ceil(h / (SAFETY * limit));
    return needed <= MAX_SUBSTEPS ? (int64_t)fmax(needed, 1) : MAX_SUBSTEPS + 1;
}

static void stability(void *state, const drape_state *at, double h, drape_stability *out)
{
    verlet_state *s = state;
    drape_spectrum_largest(s->spectrum, at, &out->omega, &out->damping);
    double w = out->omega, mu = out->damping, c = s->keep;
    /* the formula times its conjugate, which has no cancellation */
    double sum = mu + sqrt(mu * mu + 2 * (1 + c) * w * w);
    out->limit = sum > 0 ? 2 * (1 + c) / sum : INFINITY;
    out->substep = h / (double)substeps_for(s, h, out->limit);
    out->step = s->values[PARAM_SUBSTEPS] > 0 ? s->values[PARAM_SUBSTEPS] * out->limit : INFINITY;
}

/* ---- The step ---- */

/* The first node that is not finite, or else the fastest. */
static int32_t fastest_node(const drape_model *m, const drape_state *out)
{
    int32_t fastest = -1;
    double largest = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *v = out->v + 3 * (size_t)i;
        double square = vec3_dot(v, v);
        if (!isfinite(square) || !drape_all_finite(out->x + 3 * (size_t)i, 3))
            return i;
        if (square > largest) {
            largest = square;
            fastest = i;
        }
    }
    return fastest;
}

static bool blew_up(const drape_model *m, const drape_state *out, drape_step_info *info)
{
    int32_t node = fastest_node(m, out);
    double speed = vec3_norm(out->v + 3 * (size_t)node);
    if (speed <= MAX_SPEED && drape_all_finite(out->x + 3 * (size_t)node, 3))
        return false;
    info->reason = DRAPE_REASON_BLOW_UP;
    info->diagnostic = (drape_diagnostic){.what = "speed [m/s]",
                                          .term = "",
                                          .element = -1,
                                          .node = {node, -1, -1, -1},
                                          .cloth = drape_model_cloth_of(m, node),
                                          .value = speed,
                                          .limit = MAX_SPEED};
    return true;
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    verlet_state *s = state;
    size_t nodes = 3 * (size_t)s->model->node_count;
    drape_stability known = {.limit = INFINITY};
    if (s->values[PARAM_SUBSTEPS] == 0)
        stability(s, in, h, &known);
    const int64_t n = substeps_for(s, h, known.limit);
    info->residual = info->tolerance = NAN;
    info->lenient = s->values[PARAM_GUARD] == 0;
    if (s->values[PARAM_SUBSTEPS] == 0 && n > MAX_SUBSTEPS) {
        info->reason = DRAPE_REASON_MAX_SUBSTEPS;
        info->diagnostic.what = "substeps";
        info->diagnostic.value = MAX_SUBSTEPS + 1;
        info->diagnostic.limit = MAX_SUBSTEPS;
        return DRAPE_RETRY_REJECTED;
    }
    memcpy(out->x, in->x, nodes * sizeof *out->x);
    memcpy(out->v, in->v, nodes * sizeof *out->v);
    info->reason = DRAPE_REASON_CONVERGED;
    s->self.cancel = s->limit.cancel = s->contact.cancel = *drape_system_cancel_flag(s->system);
    for (int64_t k = 0; k < n; k++) {
        const substep sub = {.t0 = in->t + (double)k / (double)n * (out->t - in->t),
                             .t =
                                 k + 1 == n ? out->t : in->t + (double)(k + 1) / (double)n * (out->t - in->t),
                             .h = h / (double)n,
                             .share = 1 / (double)n,
                             .x = out->x,
                             .v = out->v,
                             .internal = in->internal,
                             .info = info};
        if (s->values[PARAM_FORM] == FORM_POSITION) {
            start_pins(s, &sub);
            evaluate(s, &sub, 1, sub.t0, sub.v, s->g);
            audit_dissipation(s, &sub, 1, sub.t0, sub.v);
            audit_pins(s, &sub, s->g, 1);
            damp(s, &sub);
            move(s, &sub, sub.h);
            project(s, &sub);
        } else
            substep_velocity(s, &sub, k == 0);
        if (drape_system_cancelled(s->system))
            return drape_system_status(s->system);
    }
    info->iterations = (int)n;
    return blew_up(s->model, out, info) ? DRAPE_RETRY_NONFINITE : DRAPE_OK;
}

/* A step depends on the state alone. */
static void restart(void *state, const drape_state *from)
{
    (void)state;
    (void)from;
}

static drape_work work(const void *state)
{
    return ((const verlet_state *)state)->work;
}

/* Lists of neighbours are left out: steps have the same bits whenever the lists were made. */
static void archive(void *state, drape_archive *a)
{
    drape_work_archive(&((verlet_state *)state)->work, a);
}

const drape_integrator_ops drape_integrator_verlet = {
    .entry = {.name = "verlet",
              .summary = "explicit Verlet substeps, with the contact rules and the strain limit of CS184 and "
                         "Boson; stable below 2/omega",
              .reference = "Verlet 1967; Provot 1995; CS184 clothsim; Hairer, Lubich & Wanner 2003",
              DRAPE_PARAMS(params)},
    .order = 2,
    .conservative = true,
    .leaves_losses = true,
    .create = create,
    .projects_contact = true,
    .in_space = true,
    .step = step,
    .restart = restart,
    .stability = stability,
    .work = work,
    .archive = archive,
};
