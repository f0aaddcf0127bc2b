/* friction_slide: a sheet lies on a table, is given a push and slides until friction has stopped it, after
 * v0^2/(2 mu g). Below friction_velocity, 1e-3 of v0, friction is smoothed: that adds (1e-3)^2 or so of the way. The
 * barrier of the table was in equilibrium with the weight before. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define GRAVITY 9.81
#define SPEED   1.0

static const double coefficients[] = {0.1, 0.3, 0.8};

static double expected(double mu)
{
    return SPEED * SPEED / (2 * mu * GRAVITY);
}

static int scene(double mu, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(text, size,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 4, 'rows': 3, 'width': "
                    "0.3, 'height': 0.2,\n "
                    "'transform': {'translate': [0, 0.0095, 0]}},\n 'material': {'young_modulus': 1e5, "
                    "'thickness': 1e-3, "
                    "'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.midedge']}],\n "
                    "'gravity': [0, %g, 0], 'colliders': [{'type': 'plane', 'point': [0, 0, 0], 'normal': "
                    "[0, 1, 0], 'friction': "
                    "%.17g}],\n 'contact': {'distance': 0.01, 'friction_velocity': 1e-3},\n 'integrator': "
                    "{'method': 'trbdf2', 'dt': "
                    "0.002, 'tolerance': 1e-9}, 'duration': 10}",
                    -GRAVITY, mu);
}

static double mean(const drape_reference_run *run)
{
    const int32_t nodes = drape_model_node_count(run->model);
    double sum = 0;
    for (int32_t i = 0; i < nodes; i++)
        sum += drape_sim_positions(run->sim)[3 * (size_t)i];
    return sum / nodes;
}

/* At rest on the barrier: backward Euler's damping, by itself, takes too long. */
static drape_status push(drape_reference_run *run)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    double *x = calloc(2 * n, sizeof *x), *v = x + n;
    drape_status status = x ? lab_settle(run, x) : DRAPE_E_MEMORY;
    for (size_t i = 0; !status && i < n; i += 3)
        v[i] = SPEED;
    if (!status)
        status = drape_sim_set_state(run->sim, 0, x, v);
    free(x);
    return status;
}

/* Twice as long as it takes to stop. */
static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = push(run);
    const double before = mean(run);
    if (!status)
        status = drape_sim_advance(run->sim, 2 * SPEED / (run->parameter * GRAVITY));
    *value = mean(run) - before;
    return status;
}

const drape_reference drape_reference_friction_slide = {
    .entry.name = "friction_slide",
    .entry.summary = "way of a pushed sheet until it stands",
    .unit = "m",
    .parameter = "mu",
    .model = "stretch.cst, bend.midedge; irregular; plane; trbdf2",
    .entry.reference = "v0^2/(2 mu g)",
    .tolerance = 0.005,
    .parameters = coefficients,
    .case_count = sizeof coefficients / sizeof *coefficients,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
