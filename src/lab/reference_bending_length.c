/* bending_length: ASTM D1388 pushes a strip over an edge until the chord to its end falls to 41.5 degrees,
 * and takes the bending length as half of the overhang: there G = 8, within 0.04 %. The rod's own angle at G
 * = 8 is 41.487 degrees. */
#include "lab/rod.h"
#include "lab/strip.h"

#include <math.h>

#define DEGREES (180 / 3.14159265358979323846)

static const double weights[] = {8};

static double expected(double weight)
{
    double drop, reach;
    drape_rod_tip(weight, 0, &drop, &reach);
    return atan2(drop, reach) * DEGREES;
}

static int scene(double weight, double load, char *text, size_t size)
{
    (void)load;
    const strip s = {.columns = 81,
                     .rows = 4,
                     .width = 0.02,
                     .thickness = 0.004,
                     .gravity = {0, -strip_gravity(weight), 0},
                     .tolerance = 1e-12};
    return strip_scene(&s, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = atan2(-tip[1], tip[0]) * DEGREES;
    return status;
}

const drape_reference drape_reference_bending_length = {
    .entry.name = "bending_length",
    .entry.summary = "angle of the chord to the end",
    .unit = "degree",
    .parameter = "G = rho g L^3/B",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "ASTM D1388; Peirce 1930, The handle of cloth as a measurable quantity",
    .tolerance = 0.005,
    .parameters = weights,
    .case_count = 1,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
