/* shade_residual.c: the field residual in colours. */
#include "render/shading.h"

DRAPE_FIELD_SHADING(residual);
