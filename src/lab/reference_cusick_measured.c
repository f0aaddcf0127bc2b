/* cusick_measured: the drape coefficient of fabrics that were both bent (KES) and draped (Matsudaira et al. 2015). */
#include "lab/cusick.h"
#include "lab/fabric.h"
#include "lab/strip.h"

#define ROWS   13
#define SPOKES 112

static const double fabrics[] = {14, 15, 16, 17};

static double expected(double place)
{
    return fabric_at(place)->drape;
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

const drape_reference drape_reference_cusick_measured = {
    .name = "cusick_measured",
    .quantity = "drape coefficient",
    .unit = "1",
    .parameter = "fabric, by its place",
    .model = "stretch.cst, bend.midedge; annulus; be",
    .source = "Matsudaira, Masuda, Wada & Yokura 2015",
    .tolerance = 0.1,
    .parameters = fabrics,
    .case_count = sizeof fabrics / sizeof *fabrics,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
