/* oscillator_trbdf2: the stability function of TR-BDF2 on the imaginary axis: R = (a1 (1 + w)/(1 - w) - a0)/(1 - w) with
 * w = gamma z/2, gamma = 2 - sqrt(2), a1 = 1/(gamma (2 - gamma)), a0 = a1 - 1. */
#include "lab/oscillator.h"

#include <complex.h>
#include <math.h>

static double expected(double angle)
{
    const double gamma = 2 - sqrt(2), a1 = 1 / (gamma * (2 - gamma));
    const double complex w = I * angle * gamma / 2;
    return cabs((a1 * (1 + w) / (1 - w) - (a1 - 1)) / (1 - w));
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return oscillator_scene("'method': 'trbdf2'", angle, text, size);
}

const drape_reference drape_reference_oscillator_trbdf2 = {
    .entry.name = "oscillator_trbdf2",
    OSCILLATOR_AMPLITUDE,
    .model = "stretch.cst; square; trbdf2",
    .entry.reference = "stability function; Bank et al. 1985, Hosea & Shampine 1996",
    .parameters = oscillator_angles,
    .expected = expected,
    .scene = scene,
    .measure = oscillator_amplitude,
};
