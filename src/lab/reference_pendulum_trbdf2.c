/* pendulum_trbdf2: the same by trbdf2, whose error is a fraction of bdf2's. */
#include "lab/pendulum.h"

static const double angles[] = {30, 90, 150};

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'trbdf2', 'tolerance': 1e-9", degrees, text, size);
}

const drape_reference drape_reference_pendulum_trbdf2 = {
    .name = "pendulum_trbdf2",
    .quantity = "period over that of small swings",
    .unit = "1",
    .parameter = "degrees",
    .model = "stretch.cst, bend.midedge; square; trbdf2",
    .source = "T/T0 = 2/pi K(sin(a/2))",
    .tolerance = 0.001,
    .parameters = angles,
    .case_count = sizeof angles / sizeof *angles,
    .expected = pendulum_period,
    .scene = scene,
    .measure = pendulum_measure,
};
