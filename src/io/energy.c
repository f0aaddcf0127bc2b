/*
 * energy.c: see energy.h. A row is written by one system call, so that a killed run leaves whole rows.
 *
 * The energies of interpolated positions would be wrong: stretching is so stiff that an interpolation error
 * too small to be seen can have as much energy as the motion itself, and interpolated positions have no
 * consistent velocities. So a row contains the energies of an accepted state, and the time of that state.
 */
#include "io/energy.h"

#include <inttypes.h>

#include "io/csv.h"

#define FILE_NAME DRAPE_ENERGY_NAME

static const char columns[] = "frame,t,t_state,kinetic,elastic,gravity,contact,dissipated,numerical,total\n";

drape_status drape_energy_open(drape_context *ctx, drape_folder *folder, bool resumes, drape_file *file)
{
    return drape_csv_open(ctx, folder, FILE_NAME, columns, resumes, file);
}

drape_status drape_energy_write(drape_file *file, const drape_energy_row *row)
{
    const drape_energy *e = &row->energy;
    const double numbers[] = {row->t,        row->t_state, e->kinetic,
                              e->elastic,    e->gravity,   e->contact,
                              e->dissipated, e->numerical, e->kinetic + e->elastic + e->gravity + e->contact};
    drape_file_print(file, "%" PRId64, row->frame);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_csv_put_number(file, numbers[i]);
    drape_file_put_text(file, "\n");
    return drape_file_keep(file);
}
