/* ladder.c: see ladder.h. */
#include "accuracy/ladder.h"

#include "base/vec3.h"

#include <math.h>

#define FIRST_STEP    0.1  /* of the time in which cloth swings by its size, sqrt(L/g) */
#define LEAST_PARTS   4    /* of the duration */
#define LEAST_STEP    1e-7 /* of the duration */
#define FIRST_RTOL    10.0 /* times the accuracy */
#define LEAST_RTOL    1e-9
#define CONTROL_SHARE 0.12 /* a tenth of the tolerance leaves about a tenth of the error */
#define SAME          1.3  /* distances that differ by less do not converge */
#define LEAST_RATIO   1.41 /* of distances, at order 1/2 and 2 */
#define MOST_RATIO    4.0
#define MOST_HALVINGS 8 /* that are compared with error control */

static double order_of(const drape_rung *rung)
{
    return rung->share < 1 ? 2 : 1;
}

void drape_ladder_init(drape_ladder *l, const drape_model *m, double size, double accuracy)
{
    const double g = vec3_norm(m->gravity), swing = sqrt(g > 0 ? size / g : 1);
    const bool hits = m->collider_count > 0;
    *l = (drape_ladder){.accuracy = accuracy,
                        .can_control = !m->has_branches && !m->has_kinetic,
                        .rung = {.method = hits ? "newton_k" : "bdf2",
                                 .key = "dt",
                                 .value = fmin(FIRST_STEP * swing, m->duration / LEAST_PARTS),
                                 .share = hits ? 1 : 0.5, /* 1/3 at order 2, and 1 at order 1 */
                                 .most = INFINITY},
                        .least_step = LEAST_STEP * m->duration,
                        .before = NAN,
                        .ratio = NAN};
}

double drape_ladder_error(const drape_ladder *l, double apart)
{
    double share = l->rung.share;
    if (!l->rung.controlled && !isnan(l->ratio)) /* Richardson */
        share = 1 / (fmin(fmax(l->ratio, LEAST_RATIO), MOST_RATIO) - 1);
    return share * apart;
}

double drape_ladder_hopeless(const drape_ladder *l)
{
    if (l->unpredictable || (!l->rung.controlled && !(l->can_control && !l->gave_up)))
        return INFINITY;
    return pow(2, order_of(&l->rung)) * l->accuracy / drape_ladder_error(l, 1);
}

static bool halve(drape_ladder *l)
{
    l->rung = l->fixed;
    l->rung.value /= 2;
    return l->rung.value > l->least_step;
}

bool drape_ladder_next(drape_ladder *l, const drape_rung_result *r)
{
    const double error = drape_ladder_error(l, r->apart);
    const bool follows = !isnan(r->apart), known = follows && !isnan(l->before);
    const bool converges = !known || l->before > SAME * r->apart;
    if (!r->given_up && r->fraction >= 1 && error <= l->accuracy)
        return false;
    l->ratio = known ? l->before / r->apart : NAN;
    l->before = follows ? r->apart : NAN;
    if (l->rung.controlled) {
        if (r->given_up) {
            l->gave_up = true;
            l->before = l->ratio = NAN;
            return halve(l);
        }
        l->unpredictable = !converges;
        if (!converges || l->rung.value < LEAST_RTOL)
            return false;
        l->rung.value /= 10;
        l->rung.share = CONTROL_SHARE;
        return true;
    }
    l->fixed = l->rung;
    const double halvings = follows ? log2(fmax(error / l->accuracy, 1)) / order_of(&l->rung) : 1;
    if (!l->can_control || l->gave_up || !follows || (converges && halvings <= 1)) {
        l->unpredictable = !converges && (l->gave_up || !l->can_control);
        return !l->unpredictable && halve(l);
    }
    l->rung = (drape_rung){.method = "rosenbrock",
                           .key = "rtol",
                           .value = fmin(FIRST_RTOL * l->accuracy, 0.1),
                           .controlled = true,
                           .share = 1, /* the other is of another method */
                           .most = r->work / r->fraction * pow(2, 1 + fmin(ceil(halvings), MOST_HALVINGS))};
    l->before = l->ratio = NAN;
    return true;
}
