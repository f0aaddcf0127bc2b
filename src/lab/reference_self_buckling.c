/* self_buckling: the weight under which an upright strip, clamped at its foot, buckles. Here it stands along
 * x and gravity is along -x: it stays straight, and the signs of the eigenvalues of its Hessian tell whether
 * it would stay so. */
#include "lab/rod.h"
#include "lab/strip.h"

static const double nothing[] = {0};

/* theta'' + G t theta = 0: Greenhill 1881. */
static double expected(double unused)
{
    (void)unused;
    return drape_rod_threshold(1, 5, 10);
}

static int scene(double unused, double weight, char *text, size_t size)
{
    (void)unused;
    const strip s = {.columns = 41,
                     .rows = 4,
                     .width = 0.04,
                     .thickness = 0.004,
                     .gravity = {-strip_gravity(weight), 0, 0},
                     .tolerance = 1e-11};
    return strip_scene(&s, text, size);
}

const drape_reference drape_reference_self_buckling = {
    .entry.name = "self_buckling",
    .entry.summary = "G = rho g L^3/B at which an upright strip buckles",
    .unit = "1",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "theta'' + G t theta = 0; Greenhill 1881",
    .tolerance = 0.02,
    .parameters = nothing,
    .case_count = 1,
    .expected = expected,
    .scene = scene,
    .measure = lab_unstable_modes,
    .low = 0.9,
    .high = 1.1,
};
