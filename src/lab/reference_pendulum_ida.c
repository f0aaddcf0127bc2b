/* pendulum_ida: the same by variable order and steps. dt is only when it is looked at. */
#include "lab/pendulum.h"

static const double angles[] = {30, 90, 150};

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'ida', 'rtol': 1e-6, 'max_order': 5", degrees, text, size);
}

const drape_reference drape_reference_pendulum_ida = {
    .name = "pendulum_ida",
    .quantity = "period over that of small swings",
    .unit = "1",
    .parameter = "degrees",
    .model = "stretch.cst, bend.midedge; square; ida, order 5",
    .source = "T/T0 = 2/pi K(sin(a/2))",
    .tolerance = 0.001,
    .parameters = angles,
    .case_count = sizeof angles / sizeof *angles,
    .expected = pendulum_period,
    .scene = scene,
    .measure = pendulum_measure,
};
