/* local_error.c: see local_error.h. */
#include "integrators/local_error.h"

#include "base/elementary.h"
#include "base/reason.h"

#include <float.h>
#include <math.h>

/* With 0.9 rosenbrock was rejected 1.4 times as often in contact, for 1.26 times the error at the same CPU
 * time. */
#define SAFETY    0.8
#define MIN_ERROR 1e-2 /* below, the growth is limited anyway, and the ratio of two errors is noise */
/* Share of the time in which the scene moves by its size that the first step takes at an error of 1. A
 * step that is too long costs one attempt, one that is too short a few to grow by DRAPE_STEP_GROWTH. */
#define START_SHARE 0.1
/* Fraction: a step as long as this much of what is left before a stop ends there; the rest is rounding. */
#define LANDED (1 - DRAPE_SAME)

void drape_local_error_init(const drape_system *system, const double *values, int power, drape_local_error *c)
{
    const drape_model *m = drape_system_model(system);
    *c = (drape_local_error){.model = m,
                             .motion = drape_system_motion(system),
                             .power = power,
                             .atol_x = values[DRAPE_LOCAL_ERROR_ATOL_X],
                             .atol_v = values[DRAPE_LOCAL_ERROR_ATOL_V],
                             .size = NAN,
                             .speed = NAN,
                             .max_step = values[DRAPE_LOCAL_ERROR_MAX_STEP],
                             .max_steps = values[DRAPE_LOCAL_ERROR_MAX_STEPS],
                             .kept_growth = 1,
                             .second = NAN};
    drape_derive_tolerances(m, values[DRAPE_LOCAL_ERROR_RTOL], &c->atol_x, &c->atol_v);
    drape_derive_tolerances(m, 1, &c->size, &c->speed);
    if (isnan(c->max_step))
        c->max_step = m->free_count > 0 ? INFINITY : m->duration / DRAPE_STEPS_WITHOUT_UNKNOWNS;
    drape_local_error_restart(c);
}

void drape_local_error_restart(drape_local_error *c)
{
    c->past = c->made = (drape_step_record){.end = NAN};
    c->tried = NAN;
}

double drape_local_error_stop(const drape_local_error *c, const drape_state *in, double end)
{
    return drape_motion_next_kink(c->motion, in->t, end);
}

/* ---- The size of a step ---- */

/* Root mean square over the free DOFs, relative to the size of the scene and its speed, of the rate of the
 * state: how often per second it moves by its size. */
static double rate_of_motion(const drape_local_error *c, const drape_state *in, const double *g)
{
    const drape_model *m = c->model;
    double sum = 0;
    for (int32_t f = 0; f < m->free_count; f++)
        for (size_t k = 0; k < 3; k++) {
            const size_t i = 3 * (size_t)m->node_of_free[f] + k;
            const double v = in->v[i] / c->size, a = g ? g[i] / (m->mass[i / 3] * c->speed) : 0;
            sum += v * v + a * a;
        }
    return sqrt(sum / (6.0 * fmax(1, m->free_count)));
}

drape_status drape_local_error_begin(drape_local_error *c, const drape_state *in, const double *g,
                                     drape_local_attempt *a, drape_step_info *info)
{
    const double left = a->stop - in->t;
    /* The last attempt was accepted if the state that it computed is the one that this step starts from. */
    if (c->made.end == in->t)
        c->past = c->made;
    else if (c->past.end != in->t)
        c->past = (drape_step_record){.end = NAN};
    c->made.end = NAN;
    a->again = c->tried == in->t;
    c->tried = in->t;
    if (isnan(c->past.end)) {
        const double rate = fmax(rate_of_motion(c, in, g), c->speed / c->size),
                     relative = fmin(1, fmin(c->atol_x / c->size, c->atol_v / c->speed));
        c->past = (drape_step_record){.end = in->t,
                                      .proposed = START_SHARE / rate * drape_pow(relative, 1 / c->power)};
    }
    const double wanted = fmin(fmin(c->past.proposed, c->max_step), a->bound);
    a->h = wanted >= LANDED * left ? left : 2 * wanted > left ? left / 2 : wanted;
    a->cut = a->h < LANDED * fmin(c->past.proposed, c->max_step);
    a->t1 = a->h == left ? a->stop : in->t + a->h;
    info->h = a->h;
    if (drape_steps_exhausted(in->t, c->max_steps, a->t1 != a->end, &c->second, &c->steps)) {
        info->reason = DRAPE_REASON_MAX_STEPS;
        return DRAPE_E_STEP_TOO_SMALL;
    }
    info->reason = DRAPE_REASON_ROUND_OFF;
    return a->t1 > in->t && isfinite(a->h) ? DRAPE_OK : DRAPE_E_STEP_TOO_SMALL;
}

/* ---- The error test ---- */

double drape_local_error_norm(const drape_local_error *c, const double *ex, const double *ev, int32_t *worst)
{
    const drape_model *m = c->model;
    double sum = 0, largest = -1;
    int32_t node = -1;
    for (int32_t f = 0; f < m->free_count; f++) {
        double share = 0;
        for (size_t i = 3 * (size_t)f; i < 3 * (size_t)f + 3; i++) {
            const double x = ex[i] / c->atol_x, v = ev[i] / c->atol_v;
            share += x * x + v * v;
        }
        sum += share;
        if (!(share <= largest) && !isnan(largest)) { /* the first NaN is kept */
            largest = share;
            node = m->node_of_free[f];
        }
    }
    if (worst)
        *worst = node;
    return sqrt(sum / (6.0 * fmax(1, m->free_count)));
}

/* Without bounds: h e^(-1/q), less the safety. Far below MIN_ERROR it is as good as infinite. */
static double elementary(const drape_local_error *c, double h, double error)
{
    return SAFETY * h * drape_pow(fmax(error, DBL_EPSILON), -1 / c->power);
}

static double propose(const drape_local_error *c, const drape_local_attempt *a, double error)
{
    const drape_step_record *past = &c->past;
    const double e = fmax(error, MIN_ERROR), simple = elementary(c, a->h, error);
    /* the error of a much shorter step is rounding */
    if (a->cut && !a->again)
        return a->h > DRAPE_STEP_CUT * past->proposed ? fmin(simple, past->proposed) : past->proposed;
    double next = simple;
    if (past->h > 0)
        next =
            fmin(next, elementary(c, a->h, e) * (a->h / past->h) * drape_pow(past->error / e, 1 / c->power));
    next = fmin(fmax(next, DRAPE_STEP_CUT * a->h), (a->again ? 1 : DRAPE_STEP_GROWTH) * a->h);
    return next > a->h && next < c->kept_growth * a->h ? a->h : next;
}

drape_status drape_local_error_test(drape_local_error *c, const drape_local_attempt *a, const double *ex,
                                    const double *ev, drape_step_info *info)
{
    int32_t node;
    const double error = drape_local_error_norm(c, ex, ev, &node);
    if (!isfinite(error)) {
        info->reason = DRAPE_REASON_NONFINITE;
        return DRAPE_RETRY_NONFINITE;
    }
    if (error > 1) {
        info->reason = DRAPE_REASON_ERROR_TEST;
        info->diagnostic = (drape_diagnostic){.what = "local error / tolerance",
                                              .term = "",
                                              .element = -1,
                                              .node = {node, -1, -1, -1},
                                              .cloth = node >= 0 ? drape_model_cloth_of(c->model, node) : -1,
                                              .value = error,
                                              .limit = 1};
        info->retry = fmax(elementary(c, a->h, error), DRAPE_STEP_CUT * a->h);
        return DRAPE_RETRY_REJECTED;
    }
    if (!drape_step_moves(a->h, c->size, c->speed, a->t1 == a->stop, &c->tiny)) {
        info->reason = DRAPE_REASON_ERROR_TEST;
        return DRAPE_E_STEP_TOO_SMALL;
    }
    const bool whole = !a->cut || a->again;
    c->made = (drape_step_record){.end = a->t1,
                                  .h = whole ? a->h : c->past.h,
                                  .error = whole ? fmax(error, MIN_ERROR) : c->past.error,
                                  .proposed = propose(c, a, error)};
    info->reason = DRAPE_REASON_CONVERGED;
    return DRAPE_OK;
}

/* ---- Archive ---- */

static void archive_record(drape_step_record *r, drape_archive *a)
{
    drape_archive_double(a, &r->end);
    drape_archive_double(a, &r->h);
    drape_archive_double(a, &r->error);
    drape_archive_double(a, &r->proposed);
}

void drape_local_error_archive(drape_local_error *c, drape_archive *a)
{
    archive_record(&c->past, a);
    archive_record(&c->made, a);
    drape_archive_double(a, &c->tried);
    drape_archive_double(a, &c->second);
    drape_archive_int64(a, &c->steps);
    drape_archive_int64(a, &c->tiny);
    if (a->reading && !(c->steps >= 0 && c->steps <= INT32_MAX && c->tiny >= 0 && c->tiny <= INT32_MAX))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an impossible number of steps");
}
