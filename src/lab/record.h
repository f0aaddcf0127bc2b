/* record.h: cases of `drape validate` as lines of JSON, and a folder of them that an interrupted run goes on from. */
#ifndef DRAPE_LAB_RECORD_H
#define DRAPE_LAB_RECORD_H

#include "io/file.h"
#include "lab/validate.h"

#include <jansson.h>

/* One case: what it is and what came of it. */
typedef struct lab_record {
    const drape_reference *reference;
    int index; /* of its parameters */
    bool done; /* v is filled */
    drape_validation v;
} lab_record;

/* All cases of all references, or of one, in the order of the table. NULL, and a message, where there is no memory. */
lab_record *lab_records_make(drape_context *ctx, const drape_reference *only, size_t *count);

/* What is told of a case that is done; NULL: no memory. */
json_t *lab_record_json(const lab_record *record);

/* Takes the lines of folder/cases.jsonl that are of these cases: of the same scene and this version of Drape; they are
 * judged anew. Others are left out. The file is then begun anew with what was taken, open for more; closed and
 * destroyed by the caller. *found counts. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_records_open(drape_context *ctx, const char *folder, lab_record *records, size_t count,
                              drape_file *file, size_t *found);

/* Adds the line of a case that is done. Errors: DRAPE_E_FILE. */
drape_status lab_record_keep(drape_file *file, const lab_record *record);

#endif
