/* cantilever: a strip clamped level bends under its own weight: drop over reach of its end, for G = rho g
 * L^3/B. Without lateral contraction (nu = 0) strip and rod are the same. At small G the membrane is made
 * soft, so that forces are far above the rounding of its; at large G thin, so that its stretch stays below
 * 1e-4. */
#include "lab/rod.h"
#include "lab/strip.h"

static const double weights[] = {0.01, 0.1, 1, 10, 100, 1000};

static double expected(double weight)
{
    double drop, reach;
    drape_rod_tip(weight, 0, &drop, &reach);
    return drop / reach;
}

static int scene(double weight, double load, char *text, size_t size)
{
    (void)load;
    const strip s = {.columns = weight > 50 ? 201 : 81,
                     .rows = 4,
                     .width = 0.02,
                     .thickness = weight > 5 ? 0.004 : 0.02,
                     .gravity = {0, -strip_gravity(weight), 0},
                     .tolerance = weight * 1e-13}; /* a thousandth of the weight of a node, or less */
    return strip_scene(&s, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = -tip[1] / tip[0];
    return status;
}

const drape_reference drape_reference_cantilever = {
    .entry.name = "cantilever",
    .entry.summary = "drop over reach of the end",
    .unit = "1",
    .parameter = "G = rho g L^3/B",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "theta'' + G (1 - s) cos theta = 0; Romero et al. 2021, the cantilever test",
    .tolerance = 0.01,
    .parameters = weights,
    .case_count = sizeof weights / sizeof *weights,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
