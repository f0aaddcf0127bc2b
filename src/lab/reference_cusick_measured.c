/* cusick_measured: the drape coefficient of fabrics that were both bent (KES) and draped (Matsudaira et al. 2015), against what
 * an elastic sheet of their weight and B gives on the mesh of `cusick`. It is no pass: docs/validate.md says what such a sheet
 * lacks, and what of theirs is not known here. */
#include "lab/cusick.h"
#include "lab/fabric.h"

/* Places in the table, and what the model gives instead: of runs of 1 s, 13 circles of 112 nodes, in which it does not move any
 * more (0.7666, 0.7664 and 0.7664 after 1, 1.25 and 1.5 s). */
static const double fabrics[] = {14, 15, 16, 17};
static const double elastic[] = {0.7666, 0.5409, 0.6822, 0.3854};

static double expected(double place)
{
    return fabric_at(place)->drape;
}

static double documented(double place)
{
    return elastic[(int)(place - fabrics[0])];
}

const drape_reference drape_reference_cusick_measured = {
    .entry.name = "cusick_measured",
    .entry.summary = "drape coefficient of a measured fabric",
    CUSICK_CASES,
    .entry.reference = "Matsudaira, Masuda, Wada & Yokura 2015",
    .parameters = fabrics,
    .case_count = sizeof fabrics / sizeof *fabrics,
    .expected = expected,
    .documented = documented,
};
