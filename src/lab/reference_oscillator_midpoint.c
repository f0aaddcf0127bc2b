/* oscillator_midpoint: the implicit midpoint rule keeps the amplitude, and is slow: (1 + i w/2)/(1 - i w/2), w = omega h,
 * turns by 2 atan(w/2). */
#include "lab/oscillator.h"

#include <math.h>

static double expected(double angle)
{
    return 2 * atan(angle / 2) / angle;
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return oscillator_scene("'method': 'midpoint'", angle, text, size);
}

const drape_reference drape_reference_oscillator_midpoint = {
    .entry.name = "oscillator_midpoint",
    OSCILLATOR_PHASE,
    .model = "stretch.cst; square; midpoint",
    .entry.reference = "2 atan(omega h/2)",
    .parameters = oscillator_angles,
    .expected = expected,
    .scene = scene,
};
