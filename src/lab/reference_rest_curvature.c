/* rest_curvature: a strip whose rest is an arc, clamped at one end, starts flat: its end comes to rest on the
 * arc. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

static const double curvatures[] = {1, 3.14159265358979323846};

static double expected(double curvature)
{
    return (1 - cos(curvature)) / curvature;
}

static int scene(double curvature, double load, char *text, size_t size)
{
    (void)load;
    char bend[100];
    snprintf(bend, sizeof bend, "{'type': 'bend.midedge', 'curvature': [%.17g, 0, 0]}", curvature);
    const strip s = {
        .columns = 81, .rows = 4, .width = 0.02, .thickness = 0.02, .bend = bend, .tolerance = 1e-12};
    return strip_scene(&s, text, size);
}

static drape_status measure(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = tip[1];
    return status;
}

const drape_reference drape_reference_rest_curvature = {
    .entry.name = "rest_curvature",
    .entry.summary = "rise of the end w/L",
    .unit = "1",
    .parameter = "curvature L",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "an arc",
    .tolerance = 0.005,
    .parameters = curvatures,
    .case_count = sizeof curvatures / sizeof *curvatures,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
