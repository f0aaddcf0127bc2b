/* catenary: a heavy strip of length 1.2 m between two ends 1 m apart: its sag. Hardly stiff against bending;
 * the right end is brought from 1.2 m. */
#include "lab/rod.h"
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define SPAN   1.0
#define LENGTH 1.2

static const double nothing[] = {0};

/* 2 a sinh(span/(2 a)) = length */
static double excess(double a, void *unused)
{
    (void)unused;
    return 2 * a * sinh(SPAN / (2 * a)) - LENGTH;
}

static double expected(double unused)
{
    (void)unused;
    const double a = drape_root(excess, NULL, 0.1, 10);
    return a * (cosh(SPAN / (2 * a)) - 1);
}

static int scene(double unused, double load, char *text, size_t size)
{
    (void)unused, (void)load;
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 61, 'rows': 3, 'width': %g, "
        "'height': "
        "0.04},\n 'material': {'young_modulus': 1e7, 'poisson_ratio': 0, 'thickness': 1e-3, 'areal_density': "
        "0.1},\n 'terms': ['stretch.cst', {'type': 'bend.midedge', 'warp': 1e-6, 'weft': 1e-6}],\n 'pins': "
        "[{'edge': 'left'}, {'edge': 'right', 'track': [[0, [0, 0, 0]], [1, [%g, 0, 0]]]}]}],\n 'gravity': "
        "[0, "
        "-9.81, 0], 'integrator': {'method': 'be', 'dt': 0.02, 'tolerance': 1e-5}, 'duration': 1.6}",
        LENGTH, SPAN - LENGTH);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    double *x = calloc(3 * nodes, sizeof *x);
    drape_status status = x ? lab_advance(run) : DRAPE_E_MEMORY;
    if (!status)
        status = lab_settle(run, x);
    *value = 0;
    for (size_t i = 0; !status && i < nodes; i++)
        *value = fmax(*value, -x[3 * i + 1]);
    free(x);
    return status;
}

const drape_reference drape_reference_catenary = {
    .entry.name = "catenary",
    .entry.summary = "sag of 1.2 m over a span of 1 m",
    .unit = "m",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "2 a sinh(s/(2 a)) = L, sag a (cosh(s/(2 a)) - 1)",
    .tolerance = 0.001,
    .parameters = nothing,
    .case_count = 1,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
