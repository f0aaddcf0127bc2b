/* pendulum_ida: the same by variable order and steps. dt is only when it is looked at. */
#include "lab/pendulum.h"

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'ida', 'rtol': 1e-6, 'max_order': 5", degrees, text, size);
}

const drape_reference drape_reference_pendulum_ida = {
    .entry.name = "pendulum_ida",
    PENDULUM_PERIOD,
    .model = "stretch.cst, bend.midedge; square; ida, order 5",
    .scene = scene,
};
