/* csv.h: writes the fields of a CSV as in RFC 4180, except that lines end in \n alone, as Unix tools
 * expect. Each field is preceded by a comma, so the first field of a row is written by the caller. */
#ifndef DRAPE_IO_CSV_H
#define DRAPE_IO_CSV_H

#include "io/file.h"

void drape_csv_put_integer(drape_file *file, int64_t value);
/* With 17 digits, in the locale of the thread. */
void drape_csv_put_number(drape_file *file, double value);
/* In quotes if necessary; NULL is an empty field. */
void drape_csv_put_text(drape_file *file, const char *text);

/* The text within quotes. */
void drape_csv_put_quoted(drape_file *file, const char *text);

/* Takes the memory for the table folder/NAME and begins it with the line of column names. Destroy the file
 * even after a failure. Errors: DRAPE_E_MEMORY, DRAPE_E_FILE. */
drape_status drape_csv_open(drape_context *ctx, drape_folder *folder, const char *name, const char *columns,
                            drape_file *file);

#endif
