/* cusick.c: see cusick.h. */
#include "lab/cusick.h"

#include "lab/fabric.h"
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define PI     3.14159265358979323846
#define ROWS   13
#define SPOKES 112
#define TENSION                                                                                              \
    100.0 /* [N/m], a fiftieth of a woven one's: flat triangles bend across their edges only as far as they stretch */

int cusick_scene(double place, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'annulus', 'rows': %d, 'columns': %d, 'inner_radius': %g, "
        "'outer_radius': %g},\n 'material': {'fabric': '%s', 'young_modulus': %g, 'poisson_ratio': 0, "
        "'thickness': 1e-3},\n 'terms': ['stretch.cst', 'bend.midedge', {'type': 'drag.viscous', "
        "'coefficient': 1}], 'pins': [{'edge': 'top', 'clamp': true}]}],\n 'gravity': [0, -9.81, 0], "
        "'integrator': {'method': 'be', 'dt': 0.02, 'tolerance': 1e-6, 'globalization': 'work'}, 'duration': "
        "1}",
        ROWS, SPOKES, CUSICK_INNER, CUSICK_OUTER, fabric_at(place)->name, TENSION / 1e-3);
}

/* The area inside the shadow of the outer rim, by its corners. Folds that hang under others would be counted with their
 * sign; specimens of 30 cm do not do that. */
drape_status cusick_measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    const int32_t nodes = drape_model_node_count(run->model);
    const double *rim = drape_sim_positions(run->sim) + 3 * (size_t)(nodes - SPOKES);
    double twice = 0, inner = PI * CUSICK_INNER * CUSICK_INNER, outer = PI * CUSICK_OUTER * CUSICK_OUTER;
    for (int32_t i = 0; i < SPOKES; i++) {
        const double *a = rim + 3 * (size_t)i, *b = rim + 3 * (size_t)((i + 1) % SPOKES);
        twice += a[2] * b[0] - a[0] * b[2];
    }
    *value = (twice / 2 - inner) / (outer - inner);
    return status;
}
