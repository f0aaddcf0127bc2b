/* fabric: ASTM D1388 on measured fabrics: a strip along the warp, of twice the bending length (B/(rho
 * g))^(1/3), pushed over an edge, has its chord at 41.5 degrees, 41.487 by the rod: what a preset says is
 * what the test of its source measures. */
#include "compile/fabrics.h"
#include "lab/rod.h"
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define GRAVITY 9.81
#define DEGREES (180 / 3.14159265358979323846)

static const double fabrics[] = {1, 2, 3, 4, 5, 6}; /* places in the table */

static double expected(double unused)
{
    (void)unused;
    double drop, reach;
    drape_rod_tip(8, 0, &drop, &reach);
    return atan2(drop, reach) * DEGREES;
}

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    const drape_fabric *f = &drape_fabrics[(int)place];
    const double length = 2 * cbrt(f->warp / (f->areal_density * GRAVITY));
    return snprintf(text, size,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 41, 'rows': 5, "
                    "'width': %.17g, 'height': "
                    "%.17g},\n 'material': {'fabric': '%s', 'young_modulus': %.17g, 'poisson_ratio': 0, "
                    "'thickness': 1e-3},\n "
                    "'terms': ['stretch.cst', 'bend.midedge'], 'pins': [{'edge': 'left', 'clamp': "
                    "true}]}],\n 'gravity': [0, "
                    "%g, 0], 'integrator': {'method': 'static', 'tolerance': %.3g}, 'duration': 1}",
                    length, length / 10, f->name, 12 * f->warp / (length * length * 1e-4) / 1e-3, -GRAVITY,
                    f->areal_density * GRAVITY * length * length / 10 / 205 * 1e-4);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = atan2(-tip[1], tip[0]) * DEGREES;
    return status;
}

const drape_reference drape_reference_fabric = {
    .name = "fabric",
    .quantity = "angle of the chord of a strip along the warp",
    .unit = "degree",
    .parameter = "fabric, by its place",
    .model = "stretch.cst, bend.midedge; irregular",
    .source = "ASTM D1388; Feng et al. 2022",
    .tolerance = 0.005,
    .parameters = fabrics,
    .case_count = sizeof fabrics / sizeof *fabrics,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
