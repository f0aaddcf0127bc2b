/* oscillator: backward Euler leaves 1/(1 + (omega h)^2) of the energy of an oscillation in each step. */
#include "lab/oscillator.h"

static double expected(double angle)
{
    return 1 / (1 + angle * angle);
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return oscillator_scene("'method': 'be'", angle, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = oscillator_amplitude(run, value);
    *value *= *value;
    return status;
}

const drape_reference drape_reference_oscillator = {
    .entry.name = "oscillator",
    .entry.summary = "share of energy left by a step",
    OSCILLATOR_CASES,
    .model = "stretch.cst; square; be",
    .entry.reference = "1/(1 + omega^2 h^2), of 1/(1 - i omega h)",
    .parameters = oscillator_angles,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
