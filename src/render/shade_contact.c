/* shade_contact.c: the field contact in colours. */
#include "render/shading.h"

DRAPE_FIELD_SHADING(contact);
