/* cusick: the drape coefficient of a measured fabric in the tester of Cusick 1965: its overhang, let go level, falls and
 * folds. There is no closed form: expected is what finer meshes converge to, 0.4464, 0.4784 and 0.4875 with 9, 13 and 17
 * circles of 80, 112 and 144 nodes; squares of the mesh size are in the ratio of 2.9, the steps in that of 3.5, so that
 * what is beyond is 0.008 to 0.012. The fabric's tension is 100 N/m, a fiftieth of a woven one's: flat triangles bend
 * across their edges only as far as they stretch (docs/validate.md). */
#include "lab/cusick.h"

#define LIMIT 0.497

static const double fabrics[] = {3}; /* places in the table */

static double expected(double unused)
{
    (void)unused;
    return LIMIT;
}

const drape_reference drape_reference_cusick = {
    .entry.name = "cusick",
    .entry.summary = "drape coefficient",
    CUSICK_CASES,
    .entry.reference = "Cusick 1965, ISO 9073-9, on a fabric of Feng et al. 2022; finer meshes",
    .parameters = fabrics,
    .case_count = 1,
    .expected = expected,
};
