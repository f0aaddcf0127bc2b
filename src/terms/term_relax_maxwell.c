/*
 * relax.maxwell: the generalised Maxwell solid. Of the stiffness of every strain measure of its cloth the
 * parts g_i relax, each with a time t_i: after a jump of the strain the force is f(t) = f(0) (1 - sum g_i +
 * sum g_i exp(-t/t_i)), a Prony series. So the stiffness of the material is that of a jump, the relaxed one
 * the part 1 - sum g_i of it. The law is that part; the library keeps the branches (model/relaxation.h).
 */
#include "terms/terms.h"

#include <math.h>

enum { BRANCHES = 4 };

#define FRACTION "part of every stiffness that relaxes with the time of the same number"
#define TIME     "time in which the force of that part falls to 1/e at constant strain"
#define FURTHER(fraction, time)                                                                              \
    DRAPE_NUMBER(fraction, "1", DRAPE_DERIVED("none"), DRAPE_ABOVE(0), 1, FRACTION),                         \
        DRAPE_NUMBER(time, "s", DRAPE_DERIVED("none"), 1e-9, 1e12, TIME)

static const drape_param params[2 * BRANCHES] = {
    DRAPE_NUMBER("fraction_1", "1", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1, FRACTION),
    DRAPE_NUMBER("time_1", "s", DRAPE_REQUIRED, 1e-9, 1e12, TIME),
    FURTHER("fraction_2", "time_2"),
    FURTHER("fraction_3", "time_3"),
    FURTHER("fraction_4", "time_4"),
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    (void)cloth;
    for (int i = 0; i < BRANCHES; i++) {
        const double fraction = values[2 * i], time = values[2 * i + 1];
        if (isnan(fraction) != isnan(time))
            return drape_term_refuse(builder, "\"%s\" is given without \"%s\"",
                                     params[2 * i + isnan(fraction)].name, params[2 * i + isnan(time)].name);
        if (!isnan(fraction))
            DRAPE_TRY(drape_term_add_branch(builder, fraction, time));
    }
    return DRAPE_OK;
}

static void law(const double *values, int32_t count, const double *k, const double *strain,
                const double *rate, double *force, double *dforce_dstrain, double *dforce_drate,
                double *energy)
{
    (void)rate, (void)dforce_drate;
    double lasting = 1; /* the part of the stiffness that does not relax */
    for (int i = 0; i < BRANCHES; i++)
        lasting -= isnan(values[2 * i]) ? 0 : values[2 * i];
    const double relaxing = 1 - fmax(0, lasting);
    for (int32_t i = 0; i < count; i++) {
        const double c = relaxing * k[i];
        force[i] -= c * strain[i];
        dforce_dstrain[i] -= c;
        energy[i] -= 0.5 * c * strain[i] * strain[i];
    }
}

const drape_term_ops drape_term_relax_maxwell = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "relax.maxwell",
         .summary =
             "stress relaxation and creep: parts of the stiffness of every strain measure of the cloth's "
             "other terms, each in series with a dashpot",
         .reference = "generalised Maxwell solid: Simo & Hughes 1998, Computational Inelasticity, 10.3; "
                      "Taylor, Pister & Goudreau 1970",
         DRAPE_PARAMS(params)},
    .element_name = "measure",
    .build = build,
    .law = law,
};
