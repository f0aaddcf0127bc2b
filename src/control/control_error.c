/*
 * error: makes any fixed-step integrator adaptive. The local error is estimated, as in BDF codes, from the
 * difference between the solution of the step and its prediction. The prediction is the polynomial of degree
 * p, the method's order, through the preceding states, continued to the end of the step. Positions and
 * velocities are predicted separately, because a method's velocities are not the exact derivatives of its
 * positions. With x^(p+1) the derivative, prediction and solution differ by x^(p+1) times the product of (t1
 * - t_j) over (p+1)!, and the method's local error is about h^(p+1)/(p+1)! x^(p+1). The estimate is therefore
 * the difference times h^(p+1) over that product. This is exact for backward Euler, 3/4 of the error of bdf2
 * at constant steps, and more than the error of midpoint.
 *
 * Errors are weighted by a length and a velocity, as IDA's are. The next step follows from this error and the
 * last one by a PI rule (Gustafsson 1991; Hairer & Wanner 1996, IV.2):
 *     h_next = h safety e^(-0.7/(p+1)) e_before^(0.4/(p+1)).
 */
#include "base/elementary.h"
#include "base/reason.h"
#include "control/halve.h"
#include "integrators/tolerance.h"

#include <math.h>

enum { PARAM_DT_MIN, PARAM_RTOL, PARAM_ATOL_X, PARAM_ATOL_V, PARAM_COUNT };
enum { SCRATCH_LAST_ERROR };

#define MAX_GROWTH  2.0  /* bdf2 is zero-stable below 1 + sqrt(2) */
#define FIRST_SHARE 10.0 /* see first_error */

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT_MIN] = DRAPE_DT_MIN_PARAM,
    [PARAM_RTOL] = DRAPE_RTOL_PARAM,
    [PARAM_ATOL_X] = DRAPE_ATOL_X_PARAM,
    [PARAM_ATOL_V] = DRAPE_ATOL_V_PARAM,
};

/* A prediction: the weights of the states in, past[0] and past[1], and the factor from the difference to the
 * local error. */
typedef struct prediction {
    double weight[3], factor;
    int points;
} prediction;

/* Computes Lagrange's weights for extrapolation to t1, from as many points as the order needs and the history
 * provides. */
static prediction predict(const drape_trial *trial)
{
    prediction p = {.points = 1, .factor = 1};
    double t[3] = {trial->in->t, 0, 0}, t1 = trial->in->t + trial->h;
    for (int k = 0; k < 2 && k < trial->order && trial->past[k]; k++)
        t[p.points++] = trial->past[k]->t;
    for (int j = 0; j < p.points; j++) {
        p.weight[j] = 1;
        p.factor *= trial->h / (t1 - t[j]);
        for (int k = 0; k < p.points; k++)
            if (k != j)
                p.weight[j] *= (t1 - t[k]) / (t[j] - t[k]);
    }
    return p;
}

/* Converts the difference between a solution and its prediction to a local error. */
static double difference(const prediction *p, double solution, double y0, double y1, double y2)
{
    return p->factor * (solution - (p->weight[0] * y0 + p->weight[1] * y1 + p->weight[2] * y2));
}

/* The first step has no history, so there is no estimate for velocities: their whole change g h is not an
 * error, and at tight tolerances would allow no step at all. For positions there is one: h^2 a/2, the
 * deviation from uniform motion. The step may therefore also be 1/FIRST_SHARE of that at which this deviation
 * equals atol_x, as in Hairer, Norsett & Wanner 1993, II.4: its square then is as small as the tolerance, and
 * so is the error h^2 v''/2 of velocities. */
static double first_error(double by_both, double by_positions)
{
    return by_both <= 1 ? by_both : fmin(by_both, FIRST_SHARE * sqrt(by_positions));
}

/* Returns the root mean square over the free DOFs of the weighted errors of positions and velocities.
 * *worst_node receives the node with the largest contribution; -1: none. */
static double local_error(const double *values, const drape_trial *trial, int32_t *worst_node)
{
    const drape_model *m = trial->model;
    const drape_state *a = trial->in, *b = trial->past[0] ? trial->past[0] : a,
                      *c = trial->past[1] ? trial->past[1] : a;
    const prediction p = predict(trial);
    double atol_x = values[PARAM_ATOL_X], atol_v = values[PARAM_ATOL_V], sum = 0, positions = 0;
    drape_derive_tolerances(m, values[PARAM_RTOL], &atol_x, &atol_v);
    double largest = -1;
    *worst_node = -1;
    for (int32_t f = 0; f < m->free_count; f++)
        for (size_t k = 0; k < 3; k++) {
            size_t i = 3 * (size_t)m->node_of_free[f] + k;
            double flight =
                p.points == 1 ? trial->h * a->v[i] : 0; /* in the first step at least the velocity is known */
            double ex = (difference(&p, trial->out->x[i], a->x[i], b->x[i], c->x[i]) - flight) / atol_x;
            double ev = difference(&p, trial->out->v[i], a->v[i], b->v[i], c->v[i]) / atol_v;
            sum += ex * ex + ev * ev;
            positions += ex * ex;
            if (!(ex * ex + ev * ev <= largest) && !isnan(largest)) { /* the first NaN is kept */
                largest = ex * ex + ev * ev;
                *worst_node = m->node_of_free[f];
            }
        }
    double count = 6.0 * fmax(1, m->free_count), error = sqrt(sum / count);
    return p.points == 1 && isfinite(error) ? first_error(error, sqrt(positions / count)) : error;
}

static drape_verdict judge(const double *values, drape_trial *trial)
{
    if (drape_trial_failed(trial))
        return drape_halve(values[PARAM_DT_MIN], trial);
    int32_t node;
    double error = local_error(values, trial, &node), last = trial->scratch[SCRATCH_LAST_ERROR];
    if (!(error <= 1)) { /* also rejects NaN */
        const double allowed = drape_pow(error, -1.0 / (trial->order + 1)),
                     factor = isnan(error) ? 0.5 : fmax(DRAPE_STEP_CUT, DRAPE_STEP_SAFETY * allowed);
        trial->info->reason = DRAPE_REASON_ERROR_TEST;
        trial->info->diagnostic =
            (drape_diagnostic){.what = "local error / tolerance",
                               .term = "",
                               .element = -1,
                               .node = {node, -1, -1, -1},
                               .cloth = node >= 0 ? drape_model_cloth_of(trial->model, node) : -1,
                               .value = error,
                               .limit = 1};
        drape_verdict verdict = drape_halve(values[PARAM_DT_MIN], trial);
        double proposed = fmax(values[PARAM_DT_MIN], factor * trial->h);
        /* otherwise the halved step, which changes the time, is used */
        if (verdict == DRAPE_RETRY && trial->in->t + proposed > trial->in->t)
            trial->h_next = proposed;
        return verdict;
    }
    const double factor = drape_step_factor(error, last > 0 ? last : error, trial->order + 1);
    trial->scratch[SCRATCH_LAST_ERROR] = fmax(error, DRAPE_LEAST_ERROR);
    trial->h_next = fmax(values[PARAM_DT_MIN], fmin(MAX_GROWTH, factor) * trial->h);
    return DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_error = {
    .entry = {.name = "error",
              .summary = "step size by the local error, estimated with a predictor; PI control",
              .reference = "Gustafsson 1991; Hairer & Wanner 1996, IV.2",
              DRAPE_PARAMS(params)},
    .own_steps = true,
    .history_depth = 2,
    .max_attempts = 100000,
    .judge = judge,
};
