/* pendulum: its period. The implicit midpoint rule is slow by (2 pi/400)^2/12 = 2e-5 of small swings. */
#include "lab/pendulum.h"

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'midpoint', 'tolerance': 1e-9", degrees, text, size);
}

const drape_reference drape_reference_pendulum = {
    .entry.name = "pendulum",
    PENDULUM_PERIOD,
    .model = "stretch.cst, bend.midedge; square; midpoint",
    .scene = scene,
};
