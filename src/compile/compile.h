/* compile.h: scene + rows -> model. The only place that looks rows up while a model is built. */
#ifndef DRAPE_COMPILE_COMPILE_H
#define DRAPE_COMPILE_COMPILE_H

#include "model/model.h"

/* The parameters of a material, in this order. */
enum {
    DRAPE_MATERIAL_YOUNG_MODULUS,
    DRAPE_MATERIAL_POISSON_RATIO,
    DRAPE_MATERIAL_THICKNESS,
    DRAPE_MATERIAL_DENSITY,
    DRAPE_MATERIAL_AREAL_DENSITY,
    DRAPE_MATERIAL_TOTAL_MASS,
    DRAPE_MATERIAL_MASS,
    DRAPE_MATERIAL_PARAM_COUNT
};
extern const drape_param drape_material_params[DRAPE_MATERIAL_PARAM_COUNT];

/* Makes a model. Faults are reported at JSON pointers of the scene. Integrator and controller are copied, not
 * yet checked. */
drape_status drape_compile(drape_context *ctx, const drape_scene_def *def, drape_model **out);

#endif
