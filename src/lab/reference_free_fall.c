/* free_fall: backward Euler lets a sheet fall by g h^2 n (n + 1)/2 in n steps, exactly: the share (n + 1)/n
 * of what gravity does. Held to the digits that tolerance and rounding leave. */
#include "lab/strip.h"

#include <stdio.h>

#define GRAVITY 9.81
#define TIME    0.5

static const double steps[] = {10, 100};

static double expected(double n)
{
    return GRAVITY * TIME * TIME * (n + 1) / n / 2;
}

static int scene(double n, double load, char *text, size_t size)
{
    (void)load;
    return snprintf(text, size,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 4, 'rows': 4, 'width': "
                    "1, 'height': 1},\n "
                    "'material': {'young_modulus': 1e4, 'poisson_ratio': 0.3, 'thickness': 1e-3, "
                    "'areal_density': 0.1},\n "
                    "'terms': ['stretch.cst', 'bend.midedge']}],\n 'gravity': [0, %g, 0], 'integrator': "
                    "{'method': 'be', 'dt': "
                    "%.17g, 'tolerance': 1e-12}, 'duration': %g}",
                    -GRAVITY, TIME / n, TIME);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = -tip[1];
    return status;
}

const drape_reference drape_reference_free_fall = {
    .entry.name = "free_fall",
    .entry.summary = "way fallen in 0.5 s",
    .unit = "m",
    .parameter = "steps",
    .model = "stretch.cst, bend.midedge; irregular; be",
    .entry.reference = "sum of backward Euler's steps",
    .tolerance = 1e-9,
    .parameters = steps,
    .case_count = 2,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
