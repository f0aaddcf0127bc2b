/* tables.h: the tables of a run: steps.csv, a row for each attempted step, accepted or not, and energy.csv, a
 * row for each frame. Call these in the C locale; after a failure a table ends with the row before. */
#ifndef DRAPE_IO_TABLES_H
#define DRAPE_IO_TABLES_H

#include "io/csv.h"
#include "sim/events.h"

#define DRAPE_STEPS_NAME  "steps.csv"
#define DRAPE_ENERGY_NAME "energy.csv"

/* The names of the columns, as drape_csv_open takes them. */
extern const char drape_steps_columns[], drape_energy_columns[];

/* energy: of the state after the attempt. events: those of the sim, of which the row has the ones that are
 * reported after the attempt; NULL: there are none. Errors: DRAPE_E_FILE. */
drape_status drape_steps_write(drape_file *file, const drape_attempt *attempt, const drape_energy *energy,
                               const drape_event_set *events);

/* A frame at t [s], whose positions may lie between two states; the energies are those of the first state at
 * or after it, at t_state. Errors: DRAPE_E_FILE. */
drape_status drape_energy_write(drape_file *file, int64_t frame, double t, double t_state,
                                const drape_energy *energy);

#endif
