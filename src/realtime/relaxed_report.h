/* relaxed_report.h: the cloth that bodies leave no room (relaxed.h), for messages, reports and the
 * summary. */
#ifndef DRAPE_REALTIME_RELAXED_REPORT_H
#define DRAPE_REALTIME_RELAXED_REPORT_H

#include "realtime/realtime.h"
#include "realtime/relaxed.h"

/* The relaxed cloth of a sim; NULL: there is no contact. */
drape_relaxed_set *drape_realtime_relaxed(const drape_sim *sim);

/* The total at a collider; -1: at pinned pieces of cloth. Never NULL; its `most` is 0 if nothing was relaxed
 * there. */
const drape_relaxed_total *drape_sim_relaxed_total(const drape_sim *sim, int32_t collider);
const char *drape_sim_relaxed_name(const drape_sim *sim, int32_t collider);

/* The number of nodes that are relaxed at a collider. */
int32_t drape_sim_relaxed_at(const drape_sim *sim, int32_t collider);

/* The number of relaxed nodes and the largest depth [m] among them. */
int32_t drape_sim_relaxed_now(const drape_sim *sim, double *deepest);

/* Logs where cloth was relaxed, or is held again, since the last call. */
void drape_sim_log_relaxed(drape_sim *sim);

#endif
