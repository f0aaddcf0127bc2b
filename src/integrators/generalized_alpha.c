/*
 * generalized_alpha: the methods of structural dynamics with fixed steps and damping that is chosen:
 * generalized-alpha (Chung & Hulbert 1993), HHT-alpha (Hilber, Hughes & Taylor 1977) and Newmark (1959), by
 * one set of formulas. With b, c for Newmark's beta and gamma, m, f for alpha_m and alpha_f:
 *     x1 = x0 + h v0 + h^2 ((1/2 - b) a0 + b a1),   v1 = v0 + h ((1 - c) a0 + c a1)
 *     M ((1 - m) a1 + m a0) + (1 - f) g(x1, v1, t1) + f g(x0, v0, t0) = 0
 * With d = x1 - x0 and mu = (1 - m)/((1 - f) b h^2):
 *     mu M (d - p) + g(x0 + d, v_b + w d) = 0,   w = c/(b h)
 *     v_b = (1 - c/b) v0 + h (1 - c/(2 b)) a0
 *     p = h v0 + h^2 (1/2 - b) a0 - (m a0 + f M^-1 g0)/((1 - f) mu)
 * Forces are weighted, not positions, so that contact holds at the end of the step, where its equation is
 * solved. Rates of measures are grad q . v.
 *
 *     family       m                   f              c            b
 *     rho_inf r    (2 r - 1)/(r + 1)   r/(r + 1)      1/2 - m + f  (1 - m + f)^2/4
 *     hht a        0                   -a             1/2 - a      (1 - a)^2/4
 *     newmark      0                   0              gamma        beta
 * r is the factor by which a step multiplies what is far too fast for it; 1 is the trapezoidal rule, which
 * damps nothing. The first two families are of order 2, Newmark's is so for gamma = 1/2 only.
 *
 * The acceleration a is kept between steps. It starts from M a = -g, and again wherever forces jump. It is
 * that of the time t + (m - f) h, not t (Erlicher, Bonaventura & Bursi 2002), so where h changes to h' it is
 * taken to t + (m - f) h' on the line through -M^-1 g at t: without that the order would be 1. A step from a
 * kink in the motion of pins is backward Euler, which these formulas give for m = f = 0, b = c = 1, a0 = 0:
 * the dashpots between a pin that jumps to another velocity and its neighbours would make a0 far too large.
 */
#include "integrators/implicit.h"

#include <math.h>
#include <string.h>

enum {
    PARAM_FAMILY = DRAPE_NEWTON_PARAM_COUNT,
    PARAM_RHO_INF,
    PARAM_ALPHA,
    PARAM_BETA,
    PARAM_GAMMA,
    PARAM_COUNT
};
enum { FAMILY_RHO_INF, FAMILY_HHT, FAMILY_NEWMARK };

static const char *const families[] = {
    [FAMILY_RHO_INF] = "rho_inf", [FAMILY_HHT] = "hht", [FAMILY_NEWMARK] = "newmark", NULL};
static const drape_param params[PARAM_COUNT] = {
    DRAPE_NEWTON_PARAMS,
    [PARAM_FAMILY] =
        DRAPE_CHOICE("family", FAMILY_RHO_INF, families,
                     "rho_inf: Chung & Hulbert, by rho_inf; hht: by alpha; newmark: by beta and gamma"),
    [PARAM_RHO_INF] =
        DRAPE_NUMBER("rho_inf", "1", 0.5, 0, 1,
                     "factor by which a step multiplies waves that it does not resolve; 1 damps "
                     "nothing, 0 the most"),
    [PARAM_ALPHA] =
        DRAPE_NUMBER("alpha", "1", -0.05, -1.0 / 3, 0, "of family hht; 0 damps nothing, -1/3 the most"),
    [PARAM_BETA] = DRAPE_NUMBER("beta", "1", 0.25, DRAPE_ABOVE(0), 1, "of family newmark; at least gamma/2"),
    [PARAM_GAMMA] =
        DRAPE_NUMBER("gamma", "1", 0.5, 0.5, 1, "of family newmark; above 1/2 it damps, and is of order 1"),
};

typedef struct coefficients {
    double m, f, b, c; /* alpha_m, alpha_f, beta, gamma */
} coefficients;

static const coefficients backward_euler = {.b = 1, .c = 1};

typedef struct alpha_state {
    drape_implicit common; /* first */
    coefficients usual;
    double *a, *a1;       /* nodes [m/s2]: of the last accepted state; at the end of the last attempt */
    double *v0, *g0, *a0; /* nodes: at the start of the step, with the velocities of pins; forces; a for h */
    double known, made;   /* [s] times of a and a1; NAN: unknown */
    double h, h1;         /* [s] the steps that led to them; 0: of backward Euler, at a kink */
} alpha_state;

static drape_status choose(drape_context *ctx, const double *values, coefficients *s)
{
    const double r = values[PARAM_RHO_INF], alpha = values[PARAM_ALPHA];
    switch ((int)values[PARAM_FAMILY]) {
    case FAMILY_RHO_INF:
        s->m = (2 * r - 1) / (r + 1);
        s->f = r / (r + 1);
        break;
    case FAMILY_HHT:
        s->m = 0;
        s->f = -alpha;
        break;
    default:
        s->b = values[PARAM_BETA];
        s->c = values[PARAM_GAMMA];
        if (2 * s->b < s->c)
            return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/integrator/beta",
                                 "%.15g is below gamma/2, %.15g: the steps would not be stable", s->b,
                                 s->c / 2);
        return DRAPE_OK;
    }
    s->c = 0.5 - s->m + s->f;
    s->b = (1 - s->m + s->f) * (1 - s->m + s->f) / 4;
    return DRAPE_OK;
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    alpha_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = choose(arena->ctx, values, &s->usual);
    if (!status)
        status = drape_implicit_init_newton(arena, system, values, &s->common);
    const size_t nodes = s->common.equation.nodes;
    s->a = drape_arena_take(arena, nodes, sizeof *s->a);
    s->a1 = drape_arena_take(arena, nodes, sizeof *s->a1);
    s->v0 = drape_arena_take(arena, nodes, sizeof *s->v0);
    s->g0 = drape_arena_take(arena, nodes, sizeof *s->g0);
    s->a0 = drape_arena_take(arena, nodes, sizeof *s->a0);
    s->known = s->made = NAN;
    return status ? status : drape_arena_status(arena);
}

/* Velocities of moved pins at both ends of the step: those of the parabola through their positions at its
 * start, middle and end. They are of order 2, and bounded where a track has a kink. */
static void move_pins(alpha_state *s, const drape_state *in, double t1, double h)
{
    drape_step_equation *e = &s->common.equation;
    const drape_motion *m = s->common.motion;
    memcpy(e->x, in->x, e->nodes * sizeof *e->x);
    drape_motion_place_pins(m, in->t + h / 2, e->x);
    drape_motion_place_pins(m, t1, e->x_base);
    for (int32_t i = 0; i < m->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)m->moved_node[i] + k;
            const double half = e->x[at] - in->x[at], whole = e->x_base[at] - in->x[at];
            s->v0[at] = (4 * half - whole) / h;
            e->v_base[at] = (3 * whole - 4 * half) / h;
        }
}

/* Takes over a1 if the last attempt was accepted, which computed it for the state that this step starts
 * from. */
static void settle(alpha_state *s, const drape_state *in)
{
    if (s->made == in->t) {
        double *swap = s->a;
        s->a = s->a1;
        s->a1 = swap;
        s->known = s->made;
        s->h = s->h1;
    }
    s->made = NAN;
}

/* g0, and a0 for a step of size h. Without a known one it is that of the forces, in each attempt anew: the
 * velocities of moved pins in them are means over parts of the step. */
static void evaluate_start(alpha_state *s, const drape_state *in, double h)
{
    const drape_step_equation *e = &s->common.equation;
    const bool known = s->known == in->t;
    drape_implicit_force_at_start(&s->common, in, s->v0, s->g0);
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        const double now = -s->g0[at] / e->model->mass[at / 3];
        s->a0[at] = known ? s->a[at] : now;
        if (known && s->usual.m != s->usual.f && s->h > 0 && s->h != h)
            s->a0[at] = now + h / s->h * (s->a[at] - now);
    }
}

static void set_equation(alpha_state *s, const drape_state *in, double h, const coefficients *k)
{
    drape_implicit *common = &s->common;
    drape_step_equation *e = &common->equation;
    const double share = (1 - k->m) / (k->b * h * h); /* (1 - f) mu */
    e->point.weight = k->c / (k->b * h);
    e->mass_weight = share / (1 - k->f);
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        const double v = in->v[at], a = s->a0[at], mass = e->model->mass[at / 3];
        e->v_base[at] = (1 - k->c / k->b) * v + h * (1 - k->c / (2 * k->b)) * a;
        e->inertia[i] = h * v + h * h * (0.5 - k->b) * a - (k->m * a + k->f * s->g0[at] / mass) / share;
        common->d[i] = h * v;
    }
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    alpha_state *s = state;
    drape_implicit *common = &s->common;
    drape_step_equation *e = &common->equation;
    drape_implicit_base(common, in, out->t, h);
    common->equation.point.instant = true;
    memset(s->v0, 0, e->nodes * sizeof *s->v0);
    move_pins(s, in, out->t, h);
    settle(s, in);
    const bool kink = drape_motion_at_kink(common->motion, in->t);
    const coefficients *k = kink ? &backward_euler : &s->usual;
    if (kink)
        memset(s->a0, 0, e->nodes * sizeof *s->a0);
    else
        evaluate_start(s, in, h);
    set_equation(s, in, h, k);
    drape_status status = drape_implicit_solve_from(common, info);
    if (status && !info->usable)
        return status;
    memcpy(out->x, e->x, e->nodes * sizeof *out->x);
    memcpy(out->v, e->v, e->nodes * sizeof *out->v);
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        const double flight = h * in->v[at] + h * h * (0.5 - k->b) * s->a0[at];
        s->a1[at] = (common->d[i] - flight) / (k->b * h * h);
    }
    s->made = out->t;
    s->h1 = kink ? 0 : h;
    drape_implicit_audit_stage(common, in->x, out->x, in->t, h, e->probe, info);
    return status;
}

static void restart(void *state, const drape_state *from)
{
    alpha_state *s = state;
    s->known = s->made = NAN;
    (void)from;
}

static void archive_acceleration(const alpha_state *s, double *t, double *h, double *a,
                                 drape_archive *archive)
{
    drape_archive_double(archive, t);
    drape_archive_double(archive, h);
    if (!isnan(*t))
        drape_archive_doubles(archive, a, s->common.equation.nodes);
}

static void archive(void *state, drape_archive *a)
{
    alpha_state *s = state;
    archive_acceleration(s, &s->known, &s->h, s->a, a);
    archive_acceleration(s, &s->made, &s->h1, s->a1, a);
    drape_implicit_archive(state, a);
}

const drape_integrator_ops drape_integrator_generalized_alpha = {
    .entry = {.name = "generalized_alpha",
              .summary =
                  "generalized-alpha, HHT-alpha or Newmark by Newton: fixed step, second order, damping "
                  "of unresolved waves as chosen",
              .reference = "Chung & Hulbert 1993; Hilber, Hughes & Taylor 1977; Newmark 1959",
              DRAPE_PARAMS(params)},
    .order = 2,
    .create = create,
    .step = step,
    .smooth_forces = true,
    .restart = restart,
    .archive = archive,
    DRAPE_IMPLICIT_OPS,
};
