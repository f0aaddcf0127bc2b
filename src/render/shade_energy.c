/* shade_energy.c: the field energy in colours. */
#include "render/shading.h"

DRAPE_FIELD_SHADING(energy);
