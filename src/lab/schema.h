/* schema.h: experiment.json and cases.jsonl of a stranger are checked, once, before anything of them is
 * used. */
#ifndef DRAPE_LAB_SCHEMA_H
#define DRAPE_LAB_SCHEMA_H

#include "lab/lab.h"

/* Checks the content of experiment.json; file: its path, for the message. From then on its members have
 * the types of lab.h, tags and names no control characters, same_as is an earlier case that has a result
 * of its own, and the cases of a series stand side by side. Errors: DRAPE_E_PARSE, DRAPE_E_MEMORY. */
drape_status lab_check_about(drape_context *ctx, const char *file, json_t *about);

/* The same for a line of cases.jsonl beside the cases of the experiment; fault: why line is NULL. */
drape_status lab_check_line(const lab *l, const char *file, int64_t number, json_t *line,
                            const json_error_t *fault);

#endif
