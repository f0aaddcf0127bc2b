/* oscillator: two nodes on an elastic sheet, its other side held: backward Euler leaves 1/(1 + (omega h)^2)
 * of the energy in each step. k = E h w/L = 1 N/m, half of 1 kg moves: omega^2 = 2. At strains of 1e-5 the
 * sheet is linear to 1e-5. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define SPEED 1e-5
#define STEPS 20

static const double angles[] = {0.1, 0.5, 2};

static double expected(double angle)
{
    return 1 / (1 + angle * angle);
}

static int scene(double angle, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': "
        "1},\n "
        "'material': {'young_modulus': 1, 'poisson_ratio': 0, 'thickness': 1, 'areal_density': 1, 'mass': "
        "'uniform'},\n 'terms': ['stretch.cst'], 'pins': [{'edge': 'top'}], 'velocity': [0, 0, %g]}],\n "
        "'gravity': [0, 0, 0], 'integrator': {'method': 'be', 'dt': %.17g, 'tolerance': 1e-15}, 'duration': "
        "%.17g}",
        -SPEED, angle / sqrt(2), STEPS * angle / sqrt(2));
}

static double energy(drape_lab_run *run)
{
    const drape_energy e = drape_sim_energy(run->sim);
    return e.kinetic + e.elastic;
}

static drape_status measure(drape_lab_run *run, double *value)
{
    const double before = energy(run);
    drape_status status = lab_advance(run);
    *value = pow(energy(run) / before, 1.0 / STEPS);
    return status;
}

const drape_reference drape_reference_oscillator = {
    .name = "oscillator",
    .quantity = "share of energy left by a step",
    .unit = "1",
    .parameter = "omega h",
    .model = "stretch.cst; square; be",
    .source = "|1/(1 - i omega h)|^2",
    .tolerance = 1e-4,
    .parameters = angles,
    .case_count = sizeof angles / sizeof *angles,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
