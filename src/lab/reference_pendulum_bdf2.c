/* pendulum_bdf2: the same by bdf2, slow by (2 pi/400)^2/3 = 8e-5 of small swings. */
#include "lab/pendulum.h"

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'bdf2', 'tolerance': 1e-9", degrees, text, size);
}

const drape_reference drape_reference_pendulum_bdf2 = {
    .entry.name = "pendulum_bdf2",
    PENDULUM_PERIOD,
    .model = "stretch.cst, bend.midedge; square; bdf2",
    .scene = scene,
};
