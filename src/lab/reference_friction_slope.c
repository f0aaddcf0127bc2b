/* friction_slope: the friction above which a sheet stays on a slope is its tangent. The slope is gravity's: the table is
 * level. A sheet that stays creeps by less than friction_velocity. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define GRAVITY 9.81
#define CREEP   1e-4 /* [m/s] friction_velocity */
#define DEGREE  (3.14159265358979323846 / 180)

static const double slopes[] = {10, 30};

static double expected(double degrees)
{
    return tan(degrees * DEGREE);
}

static int scene(double degrees, double mu, char *text, size_t size)
{
    return snprintf(text, size,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 4, 'rows': 3, 'width': "
                    "0.3, 'height': 0.2,\n "
                    "'transform': {'translate': [0, 0.0095, 0]}},\n 'material': {'young_modulus': 1e5, "
                    "'thickness': 1e-3, "
                    "'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.midedge']}],\n 'gravity': [%.17g, "
                    "%.17g, 0], 'colliders': "
                    "[{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': %.17g}],\n "
                    "'contact': {'distance': 0.01, "
                    "'friction_velocity': %g},\n 'integrator': {'method': 'be', 'dt': 0.01, 'tolerance': "
                    "1e-9}, 'duration': 1}",
                    GRAVITY * sin(degrees * DEGREE), -GRAVITY * cos(degrees * DEGREE), mu, CREEP);
}

/* 1 where it stays. 1e-3 less friction than it takes is a speed of 1e-3 g sin a after a second, 17 times CREEP or more. */
static drape_status measure(drape_reference_run *run, double *value)
{
    const int32_t nodes = drape_model_node_count(run->model);
    double speed = 0;
    drape_status status = lab_advance(run);
    for (int32_t i = 0; i < nodes; i++)
        speed += drape_sim_velocities(run->sim)[3 * (size_t)i] / nodes;
    *value = speed < CREEP;
    return status;
}

const drape_reference drape_reference_friction_slope = {
    .entry.name = "friction_slope",
    .entry.summary = "friction above which a sheet stays on a slope",
    .unit = "1",
    .parameter = "degrees",
    .model = "stretch.cst, bend.midedge; irregular; plane; be",
    .entry.reference = "mu = tan a; Coulomb 1785",
    .tolerance = 0.005,
    .parameters = slopes,
    .case_count = sizeof slopes / sizeof *slopes,
    .expected = expected,
    .scene = scene,
    .measure = measure,
    .low = 0.9,
    .high = 1.1,
};
