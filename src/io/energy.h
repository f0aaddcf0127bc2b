/* energy.h: the energy log, folder/energy.csv: a row for every frame. */
#ifndef DRAPE_IO_ENERGY_H
#define DRAPE_IO_ENERGY_H

#include "io/file.h"

/* One frame. Its positions may lie between two states; energies are of a state, the first at or after it. */
typedef struct drape_energy_row {
    int64_t frame;
    double t, t_state; /* [s] of the frame, of the state */
    drape_energy energy;
} drape_energy_row;

/* As drape_csv_open. */
drape_status drape_energy_open(drape_context *ctx, const char *folder, off_t kept, drape_file *file);

/* Adds a row, in the C locale. On failure the file ends with the row before. Errors: DRAPE_E_FILE. */
drape_status drape_energy_write(drape_file *file, const drape_energy_row *row);

#endif
