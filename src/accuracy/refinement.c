/* refinement.c: see refinement.h. */
#include "accuracy/refinement.h"

#include "base/elementary.h"
#include "base/vec3.h"

#include <math.h>

#define FIRST_STEP    0.1  /* of the time in which cloth swings by its size, sqrt(L/g) */
#define LEAST_PARTS   4    /* of the duration */
#define LEAST_STEP    1e-7 /* of the duration */
#define FIRST_RTOL    10.0 /* times the accuracy */
#define LARGEST_RTOL  0.1
#define FINE_RTOL     0.1 /* times the accuracy: of the second level with error control */
#define LEAST_RTOL    1e-9
#define SAME          1.3 /* distances that differ by less do not converge */
#define LONGER        1.1 /* times that two runs agree, which grow by less, do not grow */
#define MOST_STUCK    2
#define MOST_HALVINGS 8 /* that are compared with error control */

/* Shares of the distance between a level and the one before: of halved steps, which leave 1 at order 1 and
 * 1/3 at order 2, and of a tenth of a tolerance; at bodies, and without. An estimate is meant to be
 * too large rather than too small. */
static const double halved_share[2] = {1, 2}, tenth_share[2] = {0.25, 0.5};
/* Ratios of two distances that are taken at their word: of order 1/2, and at most what halving gains or, of
 * error control, the tolerance. */
#define LEAST_RATIO 1.41
#define TENTH_RATIO 10.0

void drape_refinement_init(drape_refinement *l, const drape_model *m, double size, double accuracy)
{
    const double g = vec3_norm(m->gravity), swing = sqrt(g > 0 ? size / g : 1);
    const bool hits = m->collider_count > 0;
    *l = (drape_refinement){.accuracy = accuracy,
                            .least_step = LEAST_STEP * m->duration,
                            .hits = hits,
                            .gain = hits ? 2 : 4,
                            .can_control = !m->has_branches && !m->has_kinetic,
                            .level = {.method = hits ? "newton_k" : "bdf2",
                                      .key = "dt",
                                      .value = fmin(FIRST_STEP * swing, m->duration / LEAST_PARTS),
                                      .share = halved_share[hits],
                                      .most = INFINITY},
                            .fixed_error = NAN,
                            .trust = 1,
                            .before = NAN};
}

double drape_refinement_error(const drape_refinement *l, double apart, bool whole)
{
    double share = l->level.share;
    if (whole && !isnan(l->before) && l->parted >= 1)
        share =
            1 / (fmin(fmax(l->before / apart, LEAST_RATIO), l->level.controlled ? TENTH_RATIO : l->gain) - 1);
    return share * (l->level.controlled ? 1 : l->trust) * apart;
}

double drape_refinement_hopeless(const drape_refinement *l)
{
    return (l->level.controlled ? 1 : l->gain) * l->accuracy / drape_refinement_error(l, 1, false);
}

/* Of halving the steps until they are as accurate. */
static double work_of_halvings(const drape_refinement *l, double error)
{
    double work = 2 * l->fixed_work;
    for (int i = 0; i < MOST_HALVINGS && error > l->accuracy; i++) {
        error /= l->gain;
        work *= 2;
    }
    return work;
}

bool drape_refinement_goes_on(drape_refinement *l, double apart)
{
    if (!(apart > l->fixed_error))
        return false;
    l->trust *= apart / l->fixed_error;
    l->fixed_error = apart;
    const double most = work_of_halvings(l, apart);
    const bool more = most > l->level.most;
    l->level.most = fmax(most, l->level.most);
    return more;
}

static bool halve(drape_refinement *l)
{
    l->level = l->fixed;
    l->level.value /= 2;
    return l->level.value > l->least_step;
}

static bool next_controlled(drape_refinement *l, const drape_level_result *r)
{
    if (r->given_up || r->failed) {
        l->spent = r->work;
        l->before = NAN;
        return halve(l);
    }
    /* the first of them that is compared is far from one that costs little */
    const double from = l->level.value;
    l->level.value = l->level.share == 1 ? FINE_RTOL * l->accuracy : from / 10;
    l->level.share = drape_pow(tenth_share[l->hits], drape_ln(from / l->level.value) / drape_ln(10));
    return l->stuck < MOST_STUCK && l->level.value > LEAST_RTOL;
}

/* Whether the last two distances are of whole runs. */
static bool whole_pair(const drape_refinement *l, const drape_level_result *r)
{
    return !isnan(l->before) && l->parted >= 1 && r->fraction >= 1;
}

/* Whether the present level agrees better with the one before than that did with its own: it is nearer, also
 * where both were cut because they parted, as in an impact; or it agrees for longer. */
static bool converges(const drape_refinement *l, const drape_level_result *r)
{
    if (isnan(r->apart) || isnan(l->before) || l->before > SAME * r->apart)
        return true;
    return l->parted < 1 && (r->fraction >= 1 || r->fraction > LONGER * l->parted);
}

bool drape_refinement_next(drape_refinement *l, const drape_level_result *r)
{
    const double error = drape_refinement_error(l, r->apart, r->fraction >= 1);
    if (r->fraction >= 1 && error <= l->accuracy)
        return false;
    l->failures = !r->failed ? 0 : l->failures > 0 && r->fraction > LONGER * l->failed ? 1 : l->failures + 1;
    l->failed = r->fraction;
    if (l->failures > MOST_STUCK)
        return false;
    l->stuck = converges(l, r) ? 0 : l->stuck + 1;
    if (l->level.controlled) {
        l->before = l->level.value < FINE_RTOL * l->accuracy ? r->apart : NAN;
        l->parted = r->fraction;
        return next_controlled(l, r);
    }
    l->fixed = l->level;
    l->fixed_error = error * (r->expected / r->apart);
    l->fixed_work = r->work / r->fraction;
    if (whole_pair(l, r))
        l->gain = fmin(fmax(l->before / r->apart, LEAST_RATIO), l->gain);
    l->before = r->apart;
    l->parted = r->fraction;
    if (!l->can_control || work_of_halvings(l, l->fixed_error) < 2 * l->spent || isnan(r->apart) ||
        (l->stuck == 0 && r->fraction >= 1 && error <= l->gain * l->accuracy))
        return l->stuck < MOST_STUCK && halve(l);
    l->before = NAN;
    l->level = (drape_level){.method = "rosenbrock",
                             .key = "rtol",
                             .value = fmin(FIRST_RTOL * l->accuracy, LARGEST_RTOL),
                             .controlled = true,
                             .share = 1,
                             .most = work_of_halvings(l, l->fixed_error)};
    return true;
}
