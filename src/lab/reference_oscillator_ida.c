/* oscillator_ida: what variable order and steps leave of ten and an eighth oscillations: the velocity over that at the
 * start, cos(2 pi 10.125), where errors of amplitude and of phase both show. Tolerances of 1e-8 a step, of what moves. */
#include "lab/oscillator.h"

#include <math.h>

#define PI 3.14159265358979323846

static const double turns[] = {1.125, 10.125};

static double expected(double count)
{
    return cos(2 * PI * count);
}

static int scene(double count, double load, char *text, size_t size)
{
    (void)count, (void)load;
    return oscillator_scene("'method': 'ida', 'rtol': 1e-8, 'max_order': 5, 'atol_x': 1e-13, 'atol_v': 1e-13",
                            1, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = drape_sim_advance(run->sim, 2 * PI * run->parameter / OSCILLATOR_OMEGA);
    *value = drape_sim_velocities(run->sim)[3 * 2 + 2] / -OSCILLATOR_SPEED;
    return status;
}

const drape_reference drape_reference_oscillator_ida = {
    .entry.name = "oscillator_ida",
    .entry.summary = "velocity over that at the start",
    .unit = "1",
    .parameter = "turns",
    .model = "stretch.cst; square; ida, order 5",
    .entry.reference = "cos(2 pi turns)",
    .tolerance = 1e-3,
    .parameters = turns,
    .case_count = sizeof turns / sizeof *turns,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
