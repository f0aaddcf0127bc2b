/* steps.h: the step log, folder/steps.csv: a row for every attempted step, accepted or not. */
#ifndef DRAPE_IO_STEPS_H
#define DRAPE_IO_STEPS_H

#include "io/file.h"

/* Takes the memory, and puts a file with the line of column names in the place of any that is there. Destroy
 * the file also after a failure. Errors: DRAPE_E_MEMORY, DRAPE_E_FILE. */
drape_status drape_steps_open(drape_context *ctx, const char *folder, drape_file *file);

/* Adds a row, in the C locale. energy: of the state kept after the attempt. On failure the file ends with the
 * row before. Errors: DRAPE_E_FILE. */
drape_status drape_steps_write(drape_file *file, const drape_attempt *attempt, const drape_energy *energy);

#endif
