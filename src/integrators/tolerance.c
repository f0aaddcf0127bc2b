/* tolerance.c: see tolerance.h. */
#include "integrators/tolerance.h"

#include "base/vec3.h"

void drape_derive_tolerances(const drape_model *model, double rtol, double *atol_x, double *atol_v)
{
    double gravity = vec3_norm(model->gravity), length = model->length;
    if (isnan(*atol_x))
        *atol_x = rtol * length;
    if (isnan(*atol_v))
        *atol_v = rtol * (gravity > 0 ? sqrt(gravity * length) : length);
}
