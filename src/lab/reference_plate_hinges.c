/* plate_hinges: the supported plate of hinges on grids of right triangles. It does not converge to the plate:
 * its energy is not that of an isotropic one. The documented shares are those at 160 rows; they hold within 1
 * % from 40 on. */
#include "lab/plate.h"

static const double parallel[] = {0, 1};

static double expected(double unused)
{
    (void)unused;
    return plate_navier();
}

static double documented(double is_parallel)
{
    return plate_navier() * (is_parallel > 0 ? 0.555 : 0.744);
}

static int scene(double is_parallel, double load, char *text, size_t size)
{
    (void)load;
    return plate_scene(is_parallel > 0
                           ? "'grid': 'square', 'columns': 49, 'rows': 49, 'diagonals': 'parallel'"
                           : "'grid': 'square', 'columns': 49, 'rows': 49, 'diagonals': 'alternating'",
                       "'stretch.edge', 'bend.hinge'", 1.0 / 3, false, text, size);
}

const drape_reference drape_reference_plate_hinges = {
    .entry.name = "plate_hinges",
    .entry.summary = "w D/(q a^4) in the middle",
    .unit = "1",
    .parameter = "diagonals: 0 alternating, 1 parallel",
    .model = "stretch.edge, bend.hinge; square",
    .entry.reference = "Navier's series; the hinges' limit: docs/validate.md",
    .tolerance = 0.02,
    .parameters = parallel,
    .case_count = 2,
    .expected = expected,
    .documented = documented,
    .scene = scene,
    .measure = plate_measure,
};
