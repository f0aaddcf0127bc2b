/* oscillator_midpoint: the implicit midpoint rule keeps the amplitude, and is slow: (1 + i w/2)/(1 - i w/2), w = omega h,
 * turns by 2 atan(w/2). */
#include "lab/oscillator.h"

#include <math.h>

static const double angles[] = {0.1, 0.5, 2};

static double expected(double angle)
{
    return 2 * atan(angle / 2) / angle;
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return oscillator_scene("'method': 'midpoint'", angle, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    return oscillator_phase(run, run->parameter, value);
}

const drape_reference drape_reference_oscillator_midpoint = {
    .name = "oscillator_midpoint",
    .quantity = "angle of a step over omega h",
    .unit = "1",
    .parameter = "omega h",
    .model = "stretch.cst; square; midpoint",
    .source = "2 atan(omega h/2)",
    .tolerance = 1e-4,
    .parameters = angles,
    .case_count = sizeof angles / sizeof *angles,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
