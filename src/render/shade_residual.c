/* shade_residual.c: the field residual in colours. */
#include "render/shading.h"

DRAPE_FIELD_SHADING(residual, "what is left of the equations of motion");
