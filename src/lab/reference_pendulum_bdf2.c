/* pendulum_bdf2: the same by bdf2, slow by (2 pi/400)^2/3 = 8e-5 of small swings. */
#include "lab/pendulum.h"

static const double angles[] = {30, 90, 150};

static int scene(double degrees, double load, char *text, size_t size)
{
    (void)load;
    return pendulum_scene("'method': 'bdf2', 'tolerance': 1e-9", degrees, text, size);
}

const drape_reference drape_reference_pendulum_bdf2 = {
    .name = "pendulum_bdf2",
    .quantity = "period over that of small swings",
    .unit = "1",
    .parameter = "degrees",
    .model = "stretch.cst, bend.midedge; square; bdf2",
    .source = "T/T0 = 2/pi K(sin(a/2))",
    .tolerance = 0.001,
    .parameters = angles,
    .case_count = sizeof angles / sizeof *angles,
    .expected = pendulum_period,
    .scene = scene,
    .measure = pendulum_measure,
};
