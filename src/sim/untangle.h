/* untangle.h: the untangling of the start that a scene asks for, and its report. */
#ifndef DRAPE_SIM_UNTANGLE_H
#define DRAPE_SIM_UNTANGLE_H

#include "sim/sim.h"

/* Untangles the start, once, if the scene asks for it and no step was made. Errors: as drape_sim_untangle;
 * DRAPE_E_SOLVER only if the scene wants a run to end that does not come apart. */
drape_status drape_sim_untangle_start(drape_sim *sim);

/* Takes apart what passes through the cloth, as far as so many sweeps do. Not reported. */
drape_status drape_sim_untangle_some(drape_sim *sim, int sweeps);

/* Takes what is known about it to a new sim of the same cloth. */
void drape_sim_copy_untangling(drape_sim *to, const drape_sim *from);

#endif
