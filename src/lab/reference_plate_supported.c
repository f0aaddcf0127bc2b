/* plate_supported: a square plate, its sides held, free to turn: the deflection in its middle. */
#include "lab/plate.h"

static const double ratios[] = {0.3, 0};

static double expected(double nu)
{
    (void)nu;
    return plate_navier();
}

static int scene(double nu, double load, char *text, size_t size)
{
    (void)load;
    return plate_scene("'grid': 'irregular', 'columns': 33, 'rows': 33", "'stretch.cst', 'bend.midedge'", nu,
                       false, text, size);
}

const drape_reference drape_reference_plate_supported = {
    .entry.name = "plate_supported",
    .entry.summary = "w D/(q a^4) in the middle",
    .unit = "1",
    .parameter = "nu",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "Navier's series; Timoshenko & Woinowsky-Krieger 1959, 30",
    .tolerance = 0.005,
    .parameters = ratios,
    .case_count = sizeof ratios / sizeof *ratios,
    .expected = expected,
    .scene = scene,
    .measure = plate_measure,
};
