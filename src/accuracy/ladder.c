/* ladder.c: see ladder.h. */
#include "accuracy/ladder.h"

#include "base/vec3.h"

#include <math.h>

#define FIRST_STEP    0.1  /* of the time in which cloth swings by its size, sqrt(L/g) */
#define LEAST_PARTS   4    /* of the duration */
#define LEAST_STEP    1e-7 /* of the duration */
#define FIRST_RTOL    10.0 /* times the accuracy */
#define LARGEST_RTOL  0.1
#define LEAST_RTOL    1e-9
#define SAME          1.3 /* distances that differ by less do not converge */
#define MOST_STUCK    2
#define MOST_HALVINGS 8 /* that are compared with error control */

/* Shares of the distance between a rung and the one before: of halved steps, which leave 1 at order 1 and 1/3
 * at order 2, and of a tenth of a tolerance; at bodies, and without. A run is told to be further off than it is
 * rather than nearer. */
static const double halved_share[2] = {1, 2}, tenth_share[2] = {0.25, 0.5};
/* Ratios of two distances that are taken at their word: of order 1/2, and at most what halving gains or, of
 * error control, the tolerance. */
#define LEAST_RATIO 1.41
#define TENTH_RATIO 10.0

/* What one halving gains. */
static double gain(const drape_ladder *l)
{
    return l->hits ? 2 : 4;
}

void drape_ladder_init(drape_ladder *l, const drape_model *m, double size, double accuracy)
{
    const double g = vec3_norm(m->gravity), swing = sqrt(g > 0 ? size / g : 1);
    const bool hits = m->collider_count > 0;
    *l = (drape_ladder){.accuracy = accuracy,
                        .least_step = LEAST_STEP * m->duration,
                        .hits = hits,
                        .can_control = !m->has_branches && !m->has_kinetic,
                        .rung = {.method = hits ? "newton_k" : "bdf2",
                                 .key = "dt",
                                 .value = fmin(FIRST_STEP * swing, m->duration / LEAST_PARTS),
                                 .share = halved_share[hits],
                                 .most = INFINITY},
                        .fixed_error = NAN,
                        .trust = 1,
                        .before = NAN};
}

double drape_ladder_error(const drape_ladder *l, double apart, bool whole)
{
    double share = l->rung.share;
    if (whole && !isnan(l->before))
        share =
            1 / (fmin(fmax(l->before / apart, LEAST_RATIO), l->rung.controlled ? TENTH_RATIO : gain(l)) - 1);
    return share * (l->rung.controlled ? 1 : l->trust) * apart;
}

double drape_ladder_hopeless(const drape_ladder *l)
{
    if (!l->can_control || l->rung.controlled)
        return INFINITY;
    return gain(l) * l->accuracy / drape_ladder_error(l, 1, false);
}

/* Of halving the steps until they are as accurate. */
static double work_of_halvings(const drape_ladder *l, double error)
{
    const double halvings = ceil(log(fmax(error / l->accuracy, 1)) / log(gain(l)));
    return l->fixed_work * pow(2, 1 + fmin(halvings, MOST_HALVINGS));
}

bool drape_ladder_goes_on(drape_ladder *l, double apart)
{
    if (!(apart > l->fixed_error))
        return false;
    l->trust *= apart / l->fixed_error;
    l->fixed_error = apart;
    const double most = work_of_halvings(l, apart);
    const bool more = most > l->rung.most;
    l->rung.most = fmax(most, l->rung.most);
    return more;
}

static bool halve(drape_ladder *l)
{
    l->rung = l->fixed;
    l->rung.value /= 2;
    return l->rung.value > l->least_step;
}

static bool next_controlled(drape_ladder *l, const drape_rung_result *r)
{
    if (r->given_up) {
        l->can_control = false;
        l->before = NAN;
        return halve(l);
    }
    l->rung.value /= 10;
    l->rung.share = tenth_share[l->hits];
    return l->stuck < MOST_STUCK && l->rung.value > LEAST_RTOL;
}

bool drape_ladder_next(drape_ladder *l, const drape_rung_result *r)
{
    const bool follows = !isnan(r->apart),
               converges = !follows || isnan(l->before) || l->before > SAME * r->apart;
    const double error = drape_ladder_error(l, r->apart, r->fraction >= 1);
    if (!r->given_up && r->fraction >= 1 && error <= l->accuracy)
        return false;
    l->stuck = converges ? 0 : l->stuck + 1;
    l->before = r->fraction < 1 || (l->rung.controlled && l->rung.share == 1) ? NAN : r->apart;
    if (l->rung.controlled)
        return next_controlled(l, r);
    l->fixed = l->rung;
    l->fixed_error = error;
    l->fixed_work = r->work / r->fraction;
    if (!l->can_control || !follows || (converges && error <= gain(l) * l->accuracy)) {
        return l->stuck < MOST_STUCK && halve(l);
    }
    l->before = NAN;
    l->rung = (drape_rung){.method = "rosenbrock",
                           .key = "rtol",
                           .value = fmin(FIRST_RTOL * l->accuracy, LARGEST_RTOL),
                           .controlled = true,
                           .share = 1, /* the other is of another method */
                           .most = work_of_halvings(l, error)};
    return true;
}
