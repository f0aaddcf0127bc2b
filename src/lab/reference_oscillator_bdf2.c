/* oscillator_bdf2: on z' = i omega z the formula 3/2 z1 - 2 z0 + 1/2 z_ = i omega h z1 has the roots
 * (2 +- sqrt(1 + 2 i omega h))/(3 - 2 i omega h); the larger is what a step leaves of the amplitude once the other has
 * died: below 0.35^15 after the steps that are not measured. */
#include "lab/oscillator.h"

#include <complex.h>
#include <math.h>

#define FIRST 15
#define LAST  25

static double expected(double angle)
{
    const double complex z = I * angle;
    return cabs((2 + csqrt(1 + 2 * z)) / (3 - 2 * z));
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return oscillator_scene("'method': 'bdf2'", angle, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    return oscillator_amplitude_between(run, FIRST, LAST, value);
}

const drape_reference drape_reference_oscillator_bdf2 = {
    .entry.name = "oscillator_bdf2",
    OSCILLATOR_AMPLITUDE,
    .model = "stretch.cst; square; bdf2",
    .entry.reference = "roots of (3/2 - i omega h) r^2 - 2 r + 1/2; .990401 at omega h = .5",
    .parameters = oscillator_angles,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
