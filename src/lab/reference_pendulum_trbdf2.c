/* pendulum_trbdf2: the same by trbdf2, whose error is a fraction of bdf2's. */
#include "lab/pendulum.h"

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'trbdf2', 'tolerance': 1e-9", degrees, text, size);
}

const drape_reference drape_reference_pendulum_trbdf2 = {
    .entry.name = "pendulum_trbdf2",
    PENDULUM_PERIOD,
    .model = "stretch.cst, bend.midedge; square; trbdf2",
    .scene = scene,
};
