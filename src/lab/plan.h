/*
 * plan.h: what a sweep will take, from a sample of its cases: CPU time, time on free cores, memory, disk.
 */
#ifndef DRAPE_LAB_PLAN_H
#define DRAPE_LAB_PLAN_H

#include "lab/lab.h"

/* The cases of this shard that are run for a plan of def->plan cases, spread evenly over all of them, in the
 * order in which they are to be run: at most def->plan, and the same ones in every call. cases: room for
 * l->count. Returns their number. */
size_t lab_plan_sample(const lab *l, size_t *cases);

/* Writes plan.json, and its sentences into the summary. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_write_plan(lab *l);

/* Whether a case is run by this shard: it is its own, and not the same as another one. */
bool lab_is_ours(const lab *l, size_t i);

#endif
