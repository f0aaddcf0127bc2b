/* fabric_tension: a tensile test along the weft: a strip of a measured fabric, without weight, pulled by a force per width
 * that lengthens it by 2 %: K l (l^2 - 1)/2 at l = 1.02. */
#include "lab/fabric.h"

#define STRETCH 1.02

static double expected(double unused)
{
    (void)unused;
    return STRETCH - 1;
}

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    drape_woven tension;
    drape_fabric_tension(fabric_at(place), &tension);
    return fabric_hung(place, true, 0, tension.weft * STRETCH * (STRETCH * STRETCH - 1) / 2, text, size);
}

const drape_reference drape_reference_fabric_tension = {
    .entry.name = "fabric_tension",
    .entry.summary = "lengthening of a strip of 1 m, pulled along the weft",
    .unit = "m",
    FABRIC_CASES,
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "K l (l^2 - 1)/2; the fabric's own",
    .tolerance = 0.01,
    .expected = expected,
    .scene = scene,
    .measure = fabric_measure_lengthening,
};
