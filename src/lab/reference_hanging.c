/* hanging: a strip of a measured fabric hung along the warp from its upper edge: how much longer its weight makes it. The law
 * of stretch.cst is S = K (l^2 - 1)/2 by the stretch l, so the force per width is K l (l^2 - 1)/2 = rho g s at s from the free
 * end. Near the edge that is held the strip does not narrow, and is stiffer by 1/(1 - nu^2), 1.8 times at most, over some half
 * width, a hundredth of its length. */
#include "lab/fabric.h"

#include <gsl/gsl_integration.h>
#include <math.h>

typedef struct strip_of {
    double stiffness, weight; /* [N/m], [N/m2] */
} strip_of;

/* At s from the free end. */
static double strain(double s, void *user)
{
    const strip_of *strip = user;
    return fabric_strain(strip->stiffness, strip->weight * s);
}

static double expected(double place)
{
    drape_woven tension;
    drape_fabric_tension(fabric_at(place), &tension);
    strip_of strip = {tension.warp, fabric_at(place)->areal_density * FABRIC_GRAVITY};
    gsl_function f = {strain, &strip};
    double value = NAN, error;
    size_t count;
    gsl_integration_qng(&f, 0, 1, 0, 1e-9, &value, &error, &count);
    return value;
}

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    return fabric_hung(place, false, FABRIC_GRAVITY, 0, text, size);
}

const drape_reference drape_reference_hanging = {
    .entry.name = "hanging",
    .entry.summary = "lengthening of a strip of 1 m, hung along the warp",
    .unit = "m",
    FABRIC_CASES,
    .model = "stretch.cst, bend.midedge; irregular",
    .entry.reference = "K l (l^2 - 1)/2 = rho g s; the fabric's own",
    .tolerance = 0.01,
    .expected = expected,
    .scene = scene,
    .measure = fabric_measure_lengthening,
};
