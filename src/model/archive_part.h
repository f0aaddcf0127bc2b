/* archive_part.h: archives arrays of a model of which each rank has a part (base/ranks.h): the bytes are
 * those of the whole model, whatever the number of ranks, each of which writes its rows. Collective. */
#ifndef DRAPE_MODEL_ARCHIVE_PART_H
#define DRAPE_MODEL_ARCHIVE_PART_H

#include "base/archive.h"
#include "model/model.h"

/* nodes: (node_count x 3) */
void drape_archive_nodes(drape_archive *a, const drape_model *model, double *nodes);

/* The internal variables of a state (internal_count). */
void drape_archive_internal(drape_archive *a, const drape_model *model, double *internal);

#endif
