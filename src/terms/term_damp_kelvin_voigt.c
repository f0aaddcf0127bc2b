/*
 * damp.kelvin_voigt: a dashpot parallel to the spring of every strain measure of its cloth: the generalized
 * force is beta k q', and so the force on the nodes beta k q' grad q(x). It vanishes exactly in rigid motion,
 * where q' = 0. Fixed-step methods take q' as a difference of q, IDA as grad q . v.
 */
#include "terms/terms.h"

#include <math.h>

enum { PARAM_BETA, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_BETA] =
        DRAPE_NUMBER("beta", "s", DRAPE_REQUIRED, 0, 1e6,
                     "retardation time: damping stiffness over elastic stiffness of every strain measure"),
};

static void law(const double *values, int32_t count, const double *k, const double *strain,
                const double *rate, double *force, double *dforce_dstrain, double *dforce_drate,
                double *energy)
{
    (void)strain, (void)dforce_dstrain, (void)energy;
    for (int32_t i = 0; i < count; i++) {
        double c = values[PARAM_BETA] * k[i];
        force[i] += c * rate[i];
        dforce_drate[i] += c;
    }
}

const drape_term_ops drape_term_damp_kelvin_voigt = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "damp.kelvin_voigt",
         .summary =
             "internal damping: force beta k q' grad q on every strain measure q of the cloth's other terms",
         .reference = "Kelvin-Voigt solid: spring and dashpot in parallel",
         DRAPE_PARAMS(params)},
    .element_name = "measure",
    .law = law,
    .dissipative = true,
    .from_fabric = true,
};
