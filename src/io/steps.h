/* steps.h: the step log, folder/steps.csv: one row for each attempted step, accepted or not. */
#ifndef DRAPE_IO_STEPS_H
#define DRAPE_IO_STEPS_H

#include "io/file.h"
#include "sim/events.h"

#define DRAPE_STEPS_NAME "steps.csv" /* in the folder of a run */

/* As drape_csv_open. */
drape_status drape_steps_open(drape_context *ctx, drape_folder *folder, bool resumes, drape_file *file);

/* Adds a row; call it in the C locale. energy: of the state after the attempt. events: those of the sim, of
 * which the row has the ones that are reported after the attempt; NULL: there are none. After a failure the
 * file ends with the row before. Errors: DRAPE_E_FILE. */
drape_status drape_steps_write(drape_file *file, const drape_attempt *attempt, const drape_energy *energy,
                               const drape_event_set *events);

#endif
