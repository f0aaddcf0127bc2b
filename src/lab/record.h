/* record.h: cases of `drape validate` as lines of JSON, and a folder of them that an interrupted run resumes
 * from. */
#ifndef DRAPE_LAB_RECORD_H
#define DRAPE_LAB_RECORD_H

#include "io/file.h"
#include "lab/validate.h"

#include <jansson.h>

/* One case and its result. */
typedef struct lab_record {
    const drape_reference *reference;
    int index; /* of its parameters */
    bool done; /* v is filled */
    drape_validation v;
} lab_record;

/* All cases of all references, or of one, in the order of the table, to be freed by drape_free. NULL, with a
 * message, if out of memory. */
lab_record *lab_records_make(drape_context *ctx, const drape_reference *only, size_t *count);

/* The JSON that is reported of a completed case; NULL: out of memory. */
json_t *lab_record_json(const lab_record *record);

/* Takes the lines of folder/cases.jsonl that belong to these cases: of the same scene and this version of
 * Drape; they are judged again. The file is then written again with the lines taken, open for more; the
 * caller closes and destroys it, then closes the folder. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_records_open(drape_context *ctx, const char *path, lab_record *records, size_t count,
                              drape_folder **folder, drape_file *file);

/* Adds the line of a case that is done. Errors: DRAPE_E_FILE. */
drape_status lab_record_keep(drape_file *file, const lab_record *record);

#endif
