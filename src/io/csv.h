/* csv.h: fields of the rows of a CSV as of RFC 4180, but with lines that end in \n alone, as the tools of a
 * Unix expect. Each begins with its comma: the first field of a row is the caller's. */
#ifndef DRAPE_IO_CSV_H
#define DRAPE_IO_CSV_H

#include "io/file.h"

void drape_csv_put_integer(drape_file *file, int64_t value);
/* 17 digits, in the locale of the thread. */
void drape_csv_put_number(drape_file *file, double value);
/* Quoted where it must be; NULL is an empty field. */
void drape_csv_put_text(drape_file *file, const char *text);

/* Takes the memory for the table folder/NAME. kept < 0: puts a file with the line of column names in the
 * place of any that is there; else goes on behind the first `kept` bytes of the one that is there, after
 * drape_file_trim. Destroy the file also after a failure. Errors: DRAPE_E_MEMORY, DRAPE_E_FILE. */
drape_status drape_csv_open(drape_context *ctx, const char *folder, const char *name, const char *columns,
                            off_t kept, drape_file *file);

#endif
