/* hanging: a strip of a measured fabric hung from its upper edge: how much longer its weight makes it. The law of
 * stretch.cst is S = K (l^2 - 1)/2 by the stretch l, so the force per width is K l (l^2 - 1)/2 = rho g s at s from the free
 * end. K = 1e4 N/m is 500 gf/cm at 5 %; the fabrics' own tension was not measured. */
#include "compile/fabrics.h"
#include "lab/rod.h"
#include "lab/strip.h"

#include <gsl/gsl_integration.h>
#include <math.h>
#include <stdio.h>

#define GRAVITY 9.81
#define TENSION 1e4 /* K [N/m] */

static const double fabrics[] = {1, 2, 3, 4, 5, 6}; /* places in the table */

static double excess(double stretch, void *force)
{
    return TENSION * stretch * (stretch * stretch - 1) / 2 - *(const double *)force;
}

/* The stretch less 1, at s from the free end. */
static double strain(double s, void *density)
{
    double force = *(const double *)density * GRAVITY * s;
    return drape_root(excess, &force, 1, 2) - 1;
}

static double expected(double place)
{
    double density = drape_fabrics[(int)place].areal_density, value = NAN, error;
    gsl_function f = {strain, &density};
    size_t count;
    gsl_integration_qng(&f, 0, 1, 0, 1e-9, &value, &error, &count);
    return value;
}

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    const drape_fabric *f = &drape_fabrics[(int)place];
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 5, 'rows': 41, 'width': 0.1, "
        "'height': 1, 'orientation': 'vertical'},\n 'material': {'fabric': '%s', 'young_modulus': %g, "
        "'poisson_ratio': 0, 'thickness': 1e-3},\n 'terms': ['stretch.cst', 'bend.midedge'], 'pins': "
        "[{'edge': "
        "'top'}]}],\n 'gravity': [0, %g, 0], 'integrator': {'method': 'static', 'tolerance': 1e-10}, "
        "'duration': 1}",
        f->name, TENSION / 1e-3, -GRAVITY);
}

/* Of the lowest nodes, which are those of the lower edge. */
static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    int count = 0;
    *value = 0;
    for (int32_t i = 0; i < drape_model_node_count(run->model); i++)
        if (rest[3 * (size_t)i + 1] < -1 + 1e-9) {
            *value += rest[3 * (size_t)i + 1] - x[3 * (size_t)i + 1];
            count++;
        }
    *value /= count;
    return status;
}

const drape_reference drape_reference_hanging = {
    .name = "hanging",
    .quantity = "lengthening of a hung strip of 1 m",
    .unit = "m",
    .parameter = "fabric, by its place",
    .model = "stretch.cst, bend.midedge; irregular",
    .source = "K l (l^2 - 1)/2 = rho g s; Feng et al. 2022",
    .tolerance = 0.005,
    .parameters = fabrics,
    .case_count = sizeof fabrics / sizeof *fabrics,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
