/* shade_strain.c: the field strain in colours. */
#include "render/shading.h"

DRAPE_FIELD_SHADING(strain);
