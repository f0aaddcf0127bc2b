/* shade_velocity.c: the field velocity in colours. */
#include "render/shading.h"

DRAPE_FIELD_SHADING(velocity);
