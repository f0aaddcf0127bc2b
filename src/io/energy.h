/* energy.h: the energy log, folder/energy.csv: one row for each frame. */
#ifndef DRAPE_IO_ENERGY_H
#define DRAPE_IO_ENERGY_H

#include "io/file.h"

#define DRAPE_ENERGY_NAME "energy.csv" /* in the folder of a run */

/* One frame. Its positions may lie between two states; the energies are those of the first state at or
 * after it. */
typedef struct drape_energy_row {
    int64_t frame;
    double t, t_state; /* [s] of the frame; of the state */
    drape_energy energy;
} drape_energy_row;

/* As drape_csv_open. */
drape_status drape_energy_open(drape_context *ctx, drape_folder *folder, bool resumes, drape_file *file);

/* Adds a row; call it in the C locale. After a failure the file ends with the row before. Errors:
 * DRAPE_E_FILE. */
drape_status drape_energy_write(drape_file *file, const drape_energy_row *row);

#endif
