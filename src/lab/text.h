/* text.h: files and pages of a report. */
#ifndef DRAPE_LAB_TEXT_H
#define DRAPE_LAB_TEXT_H

#include "lab/lab.h"

/* Writes a text as a file of l->folder, whole or not at all. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_write_text(lab *l, const char *name, const char *text, size_t size);

/* Reads a file of a folder, or of none; *text is freed by the caller, with a 0 at its end. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status lab_read_text(drape_context *ctx, const char *folder, const char *name, char **text,
                           size_t *size);

/* results.csv: the columns that any result has, tags first. */
drape_status lab_write_csv(lab *l);

/* Runs gnuplot on a script, kept as name.gp in the folder, which writes pictures there. DRAPE_OK with
 * *drawn false, and a line in the words, where there is no gnuplot or it fails: figures and lines are there
 * all the same. */
drape_status lab_plot(lab *l, const char *name, const char *script, size_t size, bool *drawn);

/* Adds to the page: a heading, a picture of the folder with its caption, a table row. */
void lab_page_heading(lab *l, const char *text);
drape_status lab_page_picture(lab *l, const char *name, const char *caption);
void lab_page_text(lab *l, const char *text); /* escaped */

/* report.html of the words and the body. */
drape_status lab_write_page(lab *l, const char *title);

#endif
