/* tolerance.c: see tolerance.h. */
#include "integrators/tolerance.h"

#include "base/elementary.h"
#include "base/vec3.h"

#include <float.h>

/* Of the time in which the scene moves by its size. What comes too near crosses the least gap of contact,
 * 1e-3 of a thickness, in longer steps at any speed that it can have, so steps as short as this, one
 * after the other, lead nowhere. */
#define LEAST_STEP 1e-10

void drape_derive_tolerances(const drape_model *model, double rtol, double *atol_x, double *atol_v)
{
    double gravity = vec3_norm(model->gravity), length = model->length;
    if (isnan(*atol_x))
        *atol_x = rtol * length;
    if (isnan(*atol_v))
        *atol_v = rtol * (gravity > 0 ? sqrt(gravity * length) : length);
}

double drape_step_factor(double error, double before, int power)
{
    const double integral = 0.7 / power, proportion = 0.4 / power;
    const double e = fmax(error, DBL_EPSILON), e0 = fmax(before, DRAPE_LEAST_ERROR);
    const double factor = DRAPE_STEP_SAFETY * drape_pow(e, -integral) * drape_pow(e0, proportion);
    return fmax(DRAPE_STEP_CUT, fmin(DRAPE_STEP_GROWTH, factor));
}

bool drape_steps_exhausted(double t, double most, bool counts, double *second, int64_t *steps)
{
    *steps = (floor(t) == *second ? *steps : 0) + counts;
    *second = floor(t);
    if ((double)*steps <= most)
        return false;
    *steps = 0;
    return true;
}

bool drape_step_moves(double h, double size, double speed, bool last, int64_t *tiny)
{
    *tiny = h < LEAST_STEP * size / speed && !last ? *tiny + 1 : 0;
    if (*tiny <= DRAPE_MAX_TINY_STEPS)
        return true;
    *tiny = 0;
    return false;
}
