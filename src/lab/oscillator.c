/* oscillator.c: see oscillator.h. */
#include "lab/oscillator.h"

#include <math.h>
#include <stdio.h>

#define AMPLITUDE_STEPS 20
#define PHASE_STEPS     50

const double oscillator_angles[OSCILLATOR_ANGLES] = {0.1, 0.5, 2};

int oscillator_scene(const char *integrator, double angle, char *text, size_t size)
{
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': "
        "1},\n "
        "'material': {'young_modulus': 1, 'poisson_ratio': 0, 'thickness': 1, 'areal_density': 1, 'mass': "
        "'uniform'},\n 'terms': ['stretch.cst'], 'pins': [{'edge': 'top'}], 'velocity': [0, 0, %g]}],\n "
        "'gravity': [0, 0, 0], 'integrator': {%s, 'dt': %.17g, 'tolerance': 1e-15},\n 'controller': {'type': "
        "'fixed'}, 'duration': 1000}",
        -OSCILLATOR_SPEED, integrator, angle / OSCILLATOR_OMEGA);
}

drape_status oscillator_advance(drape_reference_run *run, double angle, int steps)
{
    return drape_sim_advance(run->sim, drape_sim_time(run->sim) + steps * angle / OSCILLATOR_OMEGA);
}

double oscillator_energy(const drape_reference_run *run)
{
    const drape_energy e = drape_sim_energy(run->sim);
    return e.kinetic + e.elastic;
}

drape_status oscillator_amplitude_between(drape_reference_run *run, int from, int to, double *value)
{
    drape_status status = from ? oscillator_advance(run, run->parameter, from) : DRAPE_OK;
    const double before = oscillator_energy(run);
    if (!status)
        status = oscillator_advance(run, run->parameter, to - from);
    *value = pow(oscillator_energy(run) / before, 0.5 / (to - from));
    return status;
}

drape_status oscillator_amplitude(drape_reference_run *run, double *value)
{
    return oscillator_amplitude_between(run, 0, AMPLITUDE_STEPS, value);
}

/* How far a free node is from its rest. */
static double position(const drape_reference_run *run)
{
    const size_t at = 3 * 2 + 2;
    return drape_sim_positions(run->sim)[at] - drape_model_rest_positions(run->model)[at];
}

drape_status oscillator_phase(drape_reference_run *run, double *value)
{
    double x[3] = {0}, product = 0, square = 0;
    drape_status status = DRAPE_OK;
    for (int k = 0; !status && k < PHASE_STEPS; k++) {
        status = oscillator_advance(run, run->parameter, 1);
        x[0] = x[1], x[1] = x[2], x[2] = position(run);
        if (k < 2)
            continue;
        product += x[1] * (x[0] + x[2]);
        square += x[1] * x[1];
    }
    *value = acos(product / (2 * square)) / run->parameter;
    return status;
}
