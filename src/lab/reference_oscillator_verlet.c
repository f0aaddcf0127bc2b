/* oscillator_verlet: leapfrog keeps the amplitude below omega h = 2, and is fast: sin(angle/2) = omega h/2. */
#include "lab/oscillator.h"

#include <math.h>

static const double angles[OSCILLATOR_ANGLES] = {0.1, 0.5, 1};

static double expected(double angle)
{
    return 2 * asin(angle / 2) / angle;
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return oscillator_scene("'method': 'verlet', 'substeps': 1", angle, text, size);
}

const drape_reference drape_reference_oscillator_verlet = {
    .entry.name = "oscillator_verlet",
    OSCILLATOR_PHASE,
    .model = "stretch.cst; square; verlet",
    .entry.reference = "2 asin(omega h/2)",
    .parameters = angles,
    .expected = expected,
    .scene = scene,
};
