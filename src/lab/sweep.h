/*
 * sweep.h: the cases of an experiment, run by several threads into a file of lines. A case that has a line is
 * not run again; a line that a kill cut short is dropped, and its case is run again.
 */
#ifndef DRAPE_LAB_SWEEP_H
#define DRAPE_LAB_SWEEP_H

#include "lab/lab.h"
#include "lab/run.h"

/* Takes the results of all cases*.jsonl of a folder into l->results; those that are there already stay.
 * *found counts the new ones. Errors: DRAPE_E_FILE, DRAPE_E_PARSE (a whole line that is not a result of
 * this experiment), DRAPE_E_MEMORY. */
drape_status lab_read_lines(lab *l, const char *folder, int64_t *found);

/* Adds an object as a line. */
void lab_put_line(drape_file *file, const json_t *object);

/* The name of the file of lines that this process writes. */
void lab_cases_name(const lab *l, char name[64]);

/* Begins a file of the folder with the lines of a shard's results, not yet under its name. The caller
 * destroys it in any case. */
drape_status lab_begin_lines(lab *l, const char *name, int shard, int shards, drape_file *file);

/* What a case asks for: its settings, and what all cases of the experiment, or it alone, are compared
 * with. */
lab_request lab_request_of(const lab *l, size_t index);

/* Runs the cases of this shard that have no result; each becomes a line as soon as it is done. Errors: those
 * of lab_run, DRAPE_E_FILE, DRAPE_E_STOPPED. */
drape_status lab_sweep(lab *l);

#endif
