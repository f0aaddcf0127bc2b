/* csv.h: writes the fields of a CSV as in RFC 4180, except that lines end in \n alone, as Unix tools expect;
 * each field is preceded by a comma, so the caller writes the first field of a row. And the tables of a run,
 * which are written in the C locale: steps.csv, a row for each attempted step, accepted or not, and
 * energy.csv, a row for each frame. After a failure a table ends with the row before. */
#ifndef DRAPE_IO_CSV_H
#define DRAPE_IO_CSV_H

#include "io/file.h"
#include "sim/event_set.h"

void drape_csv_put_integer(drape_file *file, int64_t value);
/* With 17 digits, in the locale of the thread. */
void drape_csv_put_number(drape_file *file, double value);
void drape_csv_put_numbers(drape_file *file, size_t count, const double *values);
/* In quotes if necessary; NULL is an empty field. */
void drape_csv_put_text(drape_file *file, const char *text);

/* The text within quotes. */
void drape_csv_put_quoted(drape_file *file, const char *text);

/* Takes the memory for the table folder/NAME and begins it with the line of column names. Destroy the file
 * even after a failure. Errors: DRAPE_E_MEMORY, DRAPE_E_FILE. */
drape_status drape_csv_open(drape_context *ctx, drape_folder *folder, const char *name, const char *columns,
                            drape_file *file);

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
                                const drape_energy *energy, drape_sim *sim);

#endif
