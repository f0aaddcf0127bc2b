/* plate_clamped: a square plate, its sides clamped: the deflection in its middle. Its error falls with the
 * square of the mesh size, from 1.2 % at 33 rows. */
#include "lab/plate.h"

static const double ratios[] = {0.3};

static double expected(double nu)
{
    (void)nu;
    return 0.00126532;
}

static int scene(double nu, double load, char *text, size_t size)
{
    (void)load;
    return plate_scene("'grid': 'irregular', 'columns': 57, 'rows': 57", "'stretch.cst', 'bend.midedge'", nu,
                       true, text, size);
}

const drape_reference drape_reference_plate_clamped = {
    .entry.name = "plate_clamped",
    .entry.summary = "w D/(q a^4) in the middle",
    .unit = "1",
    .parameter = "nu",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "Taylor & Govindjee 2004, Solution of clamped rectangular plate problems",
    .tolerance = 0.005,
    .parameters = ratios,
    .case_count = 1,
    .expected = expected,
    .scene = scene,
    .measure = plate_measure,
};
