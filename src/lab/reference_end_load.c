/* end_load: a strip clamped level with a force at its end that stays vertical: how far the end sinks. */
#include "lab/rod.h"
#include "lab/strip.h"

#include <stdio.h>

static const double forces[] = {1, 2, 4};

static double expected(double force)
{
    double drop, reach;
    drape_rod_tip(0, force, &drop, &reach);
    return drop;
}

static int scene(double force, double load, char *text, size_t size)
{
    (void)load;
    char terms[200];
    snprintf(terms, sizeof terms, ", {'type': 'load.line', 'edge': 'right', 'force': [0, %.17g, 0]}",
             -force * STRIP_RIGIDITY);
    const strip s = {
        .columns = 81, .rows = 4, .width = 0.02, .thickness = 0.004, .terms = terms, .tolerance = 1e-12};
    return strip_scene(&s, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = -tip[1];
    return status;
}

const drape_reference drape_reference_end_load = {
    .entry.name = "end_load",
    .entry.summary = "sinking of the end w/L",
    .unit = "1",
    .parameter = "P L^2/B",
    .model = "stretch.cst, bend.midedge, load.line; irregular",
    .entry.reference =
        "theta'' + P cos theta = 0; Bisshopp & Drucker 1945, Large deflection of cantilever beams",
    .tolerance = 0.005,
    .parameters = forces,
    .case_count = sizeof forces / sizeof *forces,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
