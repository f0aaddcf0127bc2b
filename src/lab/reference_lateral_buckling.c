/* lateral_buckling: the weight under which a strip, clamped at one end with its width upright, turns aside.
 * It bends about its width with E I = B w and twists with G J = E h^3 w/(6 (1 + nu)) = 2 B w/(1 + nu): nu
 * counts. The sag in its own plane is (h/w)^2 of what it would be aside. */
#include "lab/rod.h"
#include "lab/strip.h"

#include <math.h>

static const double ratios[] = {0.35, 0};

/* beta'' + q^2 t^4/(4 E I G J) beta = 0 (Prandtl 1899, Michell 1899): q L^3 = 12.8538 sqrt(E I G J), here
 * over B w. */
static double expected(double nu)
{
    return 2 * sqrt(drape_rod_threshold(4, 20, 60)) * sqrt(2 / (1 + nu));
}

static int scene(double nu, double weight, char *text, size_t size)
{
    const strip s = {.columns = 121,
                     .rows = 5,
                     .width = 0.03,
                     .thickness = 0.001,
                     .poisson = nu,
                     .orientation = "vertical",
                     .gravity = {0, -strip_gravity(weight), 0},
                     .tolerance = 1e-10};
    return strip_scene(&s, text, size);
}

const drape_reference drape_reference_lateral_buckling = {
    .entry.name = "lateral_buckling",
    .entry.summary = "rho g L^3/B at which a strip on edge turns aside",
    .unit = "1",
    .parameter = "nu",
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "q L^3 = 12.8538 sqrt(E I G J); Prandtl 1899, Michell 1899; Romero et al. 2021",
    .tolerance = 0.05,
    .parameters = ratios,
    .case_count = sizeof ratios / sizeof *ratios,
    .expected = expected,
    .scene = scene,
    .measure = lab_unstable_modes,
    .low = 0.85,
    .high = 1.15,
};
