/* engine_output.h: the files and the page of a report, and units for its figures. */
#ifndef DRAPE_LAB_ENGINE_OUTPUT_H
#define DRAPE_LAB_ENGINE_OUTPUT_H

#include "lab/engine.h"

/* Writes a text as a file of l->folder, atomically. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_write_text(lab *l, const char *name, const char *text, size_t size);

/* The same with JSON, whose reference it takes; NULL: out of memory. */
drape_status lab_write_json(lab *l, const char *name, json_t *object, size_t flags);

/* Reads a file of a folder, or of none (NULL) into an arena; *text ends with a 0 that *size does not count.
 * Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_read_text(drape_arena *arena, const char *folder, const char *name, char **text,
                           size_t *size);

/* The same as JSON, which the caller owns; NULL after a failure. Errors: also DRAPE_E_PARSE. */
drape_status lab_read_json(drape_arena *arena, const char *folder, const char *name, json_t **object);

/* Adds an object to a file, as a line. */
void lab_put_line(drape_file *file, const json_t *object);

/* Writes results.csv: a row for each result, a column for each number or text that any result has, tags
 * first. */
drape_status lab_write_csv(lab *l);

/* The unit of a scene's value at a JSON pointer, as "Pa"; "" if the value has none, or one that depends on
 * other values of the scene. */
const char *lab_unit(const char *pointer);

void lab_page_heading(lab *l, const char *text);

/* Adds a figure with its caption. */
void lab_page_figure(lab *l, const char *svg, size_t size, const char *caption);

/* A table of the page and, if `markdown` is not NULL, of that text. The text of a cell is escaped for both;
 * a tab in it begins another cell. */
typedef struct lab_table {
    lab *l;
    FILE *markdown;
} lab_table;

/* Begins a table with a row of heads; adds a row. The format separates the cells by tabs. */
void lab_table_begin(const lab_table *t, const char *title, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
void lab_table_row(const lab_table *t, const char *format, ...) __attribute__((format(printf, 2, 3)));
void lab_table_end(const lab_table *t);

/* report.html of the summary and the body. */
drape_status lab_write_page(lab *l, const char *title);

#endif
