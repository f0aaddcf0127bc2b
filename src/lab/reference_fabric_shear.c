/* fabric_shear: a square of a measured fabric whose lower edge is moved along the upper one by gamma: its energy is
 * A (shear gamma^2/2 + C22 gamma^4/8), C22 of the direction across, so 2 E/(A gamma^2) is the shear stiffness and
 * C22 gamma^2/4, a quarter of 1e4 N/m times 1e-6 at most: 7e-5 of the softest shear beside it. */
#include "lab/fabric.h"
#include "lab/strip.h"

#include <stdio.h>

#define GAMMA 1e-3

static double expected(double place)
{
    drape_woven tension;
    drape_fabric_tension(fabric_at(place), &tension);
    return tension.shear;
}

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': "
        "1},\n 'material': {'fabric': '%s'},\n 'terms': ['stretch.cst'], 'pins': [{'edge': 'top'}, "
        "{'edge': 'bottom', 'track': [[0, [0, 0, 0]], [1, [%g, 0, 0]]]}]}],\n 'gravity': [0, 0, 0], "
        "'integrator': {'method': 'be', 'dt': 0.5}, 'duration': 1}",
        fabric_at(place)->name, GAMMA);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    *value = 2 * drape_sim_energy(run->sim).elastic / (GAMMA * GAMMA);
    return status;
}

const drape_reference drape_reference_fabric_shear = {
    .entry.name = "fabric_shear",
    .entry.summary = "shear stiffness of a square",
    .unit = "N/m",
    FABRIC_CASES,
    .model = "stretch.cst; square",
    .entry.reference = "A shear gamma^2/2; the fabric's own",
    .tolerance = 0.001,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
