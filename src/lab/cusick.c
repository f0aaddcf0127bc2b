/* cusick.c: see cusick.h. */
#include "lab/cusick.h"

#include <math.h>

#define PI 3.14159265358979323846

/* The area inside the shadow of the outer rim, by its corners. Folds that hang under others would be counted with their
 * sign; specimens of 30 cm do not do that. */
double cusick_coefficient(const drape_reference_run *run, int32_t spokes)
{
    const int32_t nodes = drape_model_node_count(run->model);
    const double *rim = drape_sim_positions(run->sim) + 3 * (size_t)(nodes - spokes);
    double twice = 0, inner = PI * CUSICK_INNER * CUSICK_INNER, outer = PI * CUSICK_OUTER * CUSICK_OUTER;
    for (int32_t i = 0; i < spokes; i++) {
        const double *a = rim + 3 * (size_t)i, *b = rim + 3 * (size_t)((i + 1) % spokes);
        twice += a[2] * b[0] - a[0] * b[2];
    }
    return (twice / 2 - inner) / (outer - inner);
}
