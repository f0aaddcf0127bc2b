/* plate.c: see plate.h. The deflection is some 1e-4 thicknesses, so the membrane adds its square. */
#include "lab/plate.h"

#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define THICKNESS 0.1
#define PRESSURE  0.01 /* [Pa] */
#define PI        3.14159265358979323846

int plate_scene(const char *mesh, const char *terms, double poisson, bool clamp, char *text, size_t size)
{
    const double modulus = 12 * (1 - poisson * poisson) / (THICKNESS * THICKNESS * THICKNESS);
    const char *held = clamp ? ", 'clamp': true" : "";
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {%s, 'width': 1, 'height': 1},\n 'material': {'young_modulus': "
        "%.17g, "
        "'poisson_ratio': %.17g, 'thickness': %g, 'areal_density': 1},\n 'terms': [%s],\n 'pins': [{'edge': "
        "'left'%s}, {'edge': 'right'%s}, {'edge': 'top'%s}, {'edge': 'bottom'%s}]}],\n 'gravity': [0, %g, "
        "0], "
        "'integrator': {'method': 'static', 'tolerance': 1e-10}, 'duration': 1}",
        mesh, modulus, poisson, THICKNESS, terms, held, held, held, held, -PRESSURE);
}

drape_status plate_measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    *value = lab_deflection(run, 0.5, -0.5) / PRESSURE;
    return status;
}

double plate_navier(void)
{
    double sum = 0;
    for (int m = 1; m < 400; m += 2)
        for (int n = 1; n < 400; n += 2) {
            const double k = m * m + n * n, sign = (m + n) % 4 == 2 ? 1 : -1;
            sum += sign * 16 / (m * n * k * k * pow(PI, 6));
        }
    return sum;
}
