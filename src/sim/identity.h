/* identity.h: see identity.c. */
#ifndef DRAPE_SIM_IDENTITY_H
#define DRAPE_SIM_IDENTITY_H

#include "model/model.h"

/* A hash of all numbers of a model; of a part, that of the whole model. */
uint64_t drape_model_identity(const drape_model *model);

#endif
