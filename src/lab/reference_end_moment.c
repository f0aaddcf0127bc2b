/* end_moment: a strip clamped level with a moment at its end becomes an arc of curvature M/B: how far the end
 * rises. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

static const double moments[] = {0.3, 1, 2, 3.1415926535897932,
                                 4.7123889803846899}; /* to three quarters of a circle */

static double expected(double moment)
{
    return (1 - cos(moment)) / moment;
}

static int scene(double moment, double load, char *text, size_t size)
{
    (void)load;
    char terms[200];
    snprintf(terms, sizeof terms, ", {'type': 'load.moment', 'edge': 'right', 'moment': %.17g}",
             moment * STRIP_RIGIDITY);
    const strip s = {
        .columns = 81, .rows = 4, .width = 0.02, .thickness = 0.01, .terms = terms, .tolerance = 1e-11};
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

const drape_reference drape_reference_end_moment = {
    .entry.name = "end_moment",
    .entry.summary = "rise of the end w/L",
    .unit = "1",
    .parameter = "M L/B",
    .model = "stretch.cst, bend.midedge, load.moment; irregular",
    .entry.reference = "an arc of curvature M/B",
    .tolerance = 0.005,
    .parameters = moments,
    .case_count = sizeof moments / sizeof *moments,
    .expected = expected,
    .scene = scene,
    .measure = measure,
};
