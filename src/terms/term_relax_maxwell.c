/*
 * relax.maxwell: the generalised Maxwell solid. Of the stiffness of every strain measure of its cloth the
 * parts g_i relax, each with a time t_i: after a jump of the strain the force is f(t) = f(0) (1 - sum g_i +
 * sum g_i exp(-t/t_i)), a Prony series. So the stiffness of the material is that of a jump, the relaxed one
 * the part 1 - sum g_i of it. The law is that part; the library keeps the branches (model/relaxation.h).
 */
#include "terms/terms.h"

#include <math.h>

enum { BRANCHES = 4 };

#define FRACTION(name)                                                                                       \
    DRAPE_NUMBER(name, "1", DRAPE_DERIVED("none; at least the first is given"), DRAPE_ABOVE(0), 1,           \
                 "part of every stiffness that relaxes with the time of the same number")
#define TIME(name)                                                                                           \
    DRAPE_NUMBER(name, "s", DRAPE_DERIVED("none; at least the first is given"), 1e-9, 1e12,                  \
                 "time in which the force of that part falls to 1/e at constant strain")

static const drape_param params[2 * BRANCHES] = {
    FRACTION("fraction_1"), TIME("time_1"), FRACTION("fraction_2"), TIME("time_2"),
    FRACTION("fraction_3"), TIME("time_3"), FRACTION("fraction_4"), TIME("time_4")};

/* The part of the stiffness that does not relax. */
static double lasting(const double *values)
{
    double part = 1;
    for (int i = 0; i < BRANCHES; i++)
        part -= isnan(values[2 * i]) ? 0 : values[2 * i];
    return part;
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    (void)cloth;
    drape_status status = DRAPE_OK;
    for (int i = 0; i < 2; i++)
        if (isnan(values[i]))
            return drape_term_refuse(builder, "\"%s\" is missing: %s", params[i].name, params[i].help);
    for (int i = 0; !status && i < BRANCHES; i++) {
        const double fraction = values[2 * i], time = values[2 * i + 1];
        if (isnan(fraction) != isnan(time))
            return drape_term_refuse(builder, "\"%s\" is given without \"%s\"",
                                     params[2 * i + isnan(fraction)].name, params[2 * i + isnan(time)].name);
        if (!isnan(fraction))
            status = drape_term_add_branch(builder, fraction, time);
    }
    return status;
}

static void law(const double *values, int32_t count, const double *k, const double *strain,
                const double *rate, double *force, double *dforce_dstrain, double *dforce_drate,
                double *energy)
{
    (void)rate, (void)dforce_drate;
    const double relaxing = 1 - fmax(0, lasting(values));
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
