/* reference.h: physics references: scenes whose outcome is known, and what Drape makes of them. */
#ifndef DRAPE_LAB_REFERENCE_H
#define DRAPE_LAB_REFERENCE_H

#include "base/arena.h"
#include "base/registry.h"
#include "io/file.h"
#include "sim/sim.h"

#include <jansson.h>

#define DRAPE_LAB_TEXT 4096 /* bytes of a scene's text, at most */

/* Whether to stop. Called after every step; it must not use the sim. */
typedef bool drape_validate_cancel(void *user);

typedef struct drape_reference drape_reference;
typedef struct lab_sheet lab_sheet;

/* A case of a reference, and the simulation in which it is measured. */
typedef struct drape_reference_run {
    const drape_reference *reference;
    int index;        /* of the case */
    double parameter; /* of the case */
    double load;      /* trial value of a threshold; 0 in other references */
    drape_context *ctx;
    drape_arena arena; /* freed after the measurement */
    drape_model *model;
    drape_sim *sim;
    drape_validate_cancel *cancel; /* NULL: never */
    void *user;                    /* of cancel */
} drape_reference_run;

/* How a case ended. */
typedef enum drape_outcome {
    DRAPE_OUTCOME_PASS,
    DRAPE_OUTCOME_FAIL,
    DRAPE_OUTCOME_DOCUMENTED, /* differs from the reference by the documented model error */
    DRAPE_OUTCOME_STOPPED     /* the simulation failed */
} drape_outcome;

/* A reference. Its cases differ in one parameter. */
struct drape_reference {
    drape_entry entry;        /* summary: the quantity; reference: the source of what is expected */
    const char *unit;         /* of the quantity */
    const char *parameter;    /* what the cases differ in; NULL: there is one case */
    const char *model;        /* the terms and the mesh */
    double tolerance;         /* relative; of the documented value where there is one */
    const double *parameters; /* (case_count), see DRAPE_CASES */
    int case_count;
    double (*expected)(double parameter); /* NULL: known is given */
    const double *known;                  /* the expected value of each case, or of all; see DRAPE_KNOWN */
    int known_count;                      /* case_count, or 1 */
    const double *documented; /* (case_count) what the model converges to instead; NULL: no model error */
    const lab_sheet *sheet;   /* the scenes of all cases; NULL: `scene` writes them (sheet.h) */
    /* Writes the text of the scene of a case and its load, in which ' stands for "; returns its length. */
    int (*scene)(const drape_reference_run *c, char text[DRAPE_LAB_TEXT]);
    double constants[4]; /* for `scene` or `measure`, where references differ in them */
    /* What is measured: the state at the end of the scene, or, by `measure`, which advances the sim
     * itself. */
    double (*value)(const drape_reference_run *run);
    drape_status (*measure)(drape_reference_run *run, double *value);
    /* For thresholds: the quantity is the load above which that is > 0, sought between these multiples of
     * the expected value. */
    double low, high;
};

extern const drape_reference *const drape_references[]; /* NULL-ended */
extern const drape_registry drape_reference_registry;

/* The parameters of the cases, in an initialiser of drape_reference. */
#define DRAPE_CASES(...)                                                                                     \
    .parameters = (const double[]){__VA_ARGS__},                                                             \
    .case_count = sizeof((const double[]){__VA_ARGS__}) / sizeof(double)

/* What is expected, where that is a table, or one value for all cases. */
#define DRAPE_KNOWN(...)                                                                                     \
    .known = (const double[]){__VA_ARGS__},                                                                  \
    .known_count = sizeof((const double[]){__VA_ARGS__}) / sizeof(double)

/* What the model converges to in each case. */
#define DRAPE_DOCUMENTED(...)                                                                                \
    .documented = (const double[])                                                                           \
    {                                                                                                        \
        __VA_ARGS__                                                                                          \
    }

/* Defines the reference of that name; meson.build puts it into the table. */
#define DRAPE_REFERENCE(id, ...) const drape_reference drape_reference_##id = {.entry.name = #id, __VA_ARGS__}

typedef struct drape_validation {
    double parameter, expected, documented, obtained;
    double error;   /* relative, of the value it is checked against */
    double seconds; /* of CPU */
    drape_outcome verdict;
    char message[512]; /* of a simulation that failed */
} drape_validation;

/* Runs one case. Errors: DRAPE_E_MEMORY, DRAPE_E_STOPPED (cancelled); all else is a verdict. */
drape_status drape_validate(drape_context *ctx, const drape_reference *reference, int index,
                            drape_validate_cancel *cancel, void *user, drape_validation *out);

/* Simulations that a case takes: the search of a threshold takes several. */
int drape_validate_runs(const drape_reference *reference);

/* What is expected of a case. */
double drape_reference_expected(const drape_reference *reference, int index);

/* Writes the scene of a case, with a load if it is a threshold, as JSON. Returns its length. A text that does
 * not fit is cut short, and is no JSON any more. */
int drape_reference_text(const drape_reference *reference, int index, double load, char text[DRAPE_LAB_TEXT]);

const char *drape_outcome_name(drape_outcome verdict);

/* ---- Cases as lines of JSON, and a folder of them that an interrupted run resumes from ---- */

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
