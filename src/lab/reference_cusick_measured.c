/* cusick_measured: the drape coefficient of fabrics that were both bent (KES) and draped (Matsudaira et al. 2015), against what
 * an elastic sheet of their weight and B gives on the mesh of `cusick`. It is no pass: docs/validate.md says what such a sheet
 * lacks, and what of theirs is not known here. */
#include "lab/cusick.h"
#include "lab/fabric.h"
#include "lab/strip.h"

#define ROWS   13
#define SPOKES 112

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

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    return cusick_scene(fabric_at(place), ROWS, SPOKES, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    *value = cusick_coefficient(run, SPOKES);
    return status;
}

/* Folds that begin otherwise end otherwise: 0.05 covers what another order of the sums, or another processor, makes of it. */
const drape_reference drape_reference_cusick_measured = {
    .name = "cusick_measured",
    .quantity = "drape coefficient of a measured fabric",
    .unit = "1",
    .parameter = "fabric, by its place",
    .model = "stretch.cst, bend.midedge; annulus; be",
    .source = "Matsudaira, Masuda, Wada & Yokura 2015",
    .tolerance = 0.05,
    .parameters = fabrics,
    .case_count = sizeof fabrics / sizeof *fabrics,
    .expected = expected,
    .documented = documented,
    .scene = scene,
    .measure = measure,
};
