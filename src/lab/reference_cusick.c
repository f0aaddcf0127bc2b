/* cusick: the drape coefficient of a measured fabric in the tester of Cusick 1965: its overhang, let go level, falls and
 * folds. There is no closed form: expected is what finer meshes converge to, 0.4464, 0.4784 and 0.4875 with 9, 13 and 17
 * circles of 80, 112 and 144 nodes; squares of the mesh size are in the ratio of 2.9, the steps in that of 3.5, so that
 * what is beyond is 0.008 to 0.012. The fabric's tension is 100 N/m, a fiftieth of a woven one's: flat triangles bend
 * across their edges only as far as they stretch (docs/validate.md). */
#include "lab/cusick.h"
#include "lab/fabric.h"
#include "lab/strip.h"

#define ROWS   13
#define SPOKES 112
#define LIMIT  0.497

static const double fabrics[] = {3}; /* places in the table */

static double expected(double unused)
{
    (void)unused;
    return LIMIT;
}

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    return cusick_scene(fabric_at(place), ROWS, SPOKES, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    *value = cusick_coefficient(run, SPOKES);
    return status;
}

const drape_reference drape_reference_cusick = {
    .name = "cusick",
    .quantity = "drape coefficient",
    .unit = "1",
    .parameter = "fabric, by its place",
    .model = "stretch.cst, bend.midedge; annulus; be",
    .source = "Cusick 1965, ISO 9073-9, on a fabric of Feng et al. 2022; finer meshes",
    .tolerance = 0.05,
    .parameters = fabrics,
    .case_count = 1,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
