/* validate.h: references of physics: what a scene gives against what is known. */
#ifndef DRAPE_LAB_VALIDATE_H
#define DRAPE_LAB_VALIDATE_H

#include "base/registry.h"
#include "sim/sim.h"

/* Whether to stop. Called after every step: it must only look. */
typedef bool drape_validate_cancel(void *user);

/* A scene while a reference is measured in it. */
typedef struct drape_reference_run {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
    double parameter;              /* of the case */
    drape_validate_cancel *cancel; /* whether to stop; NULL: never */
    void *user;                    /* of cancel */
} drape_reference_run;

/* Fills the model and the sim from a scene's text, in which ' stands for "; the other members are set before.
 * drape_reference_close in any case. */
drape_status drape_reference_open(drape_reference_run *run, const char *text);
void drape_reference_close(drape_reference_run *run);

/* How a case ended. */
typedef enum drape_outcome {
    DRAPE_OUTCOME_PASS,
    DRAPE_OUTCOME_FAIL,
    DRAPE_OUTCOME_DOCUMENTED, /* not the reference, but what this model is known to give instead */
    DRAPE_OUTCOME_STOPPED     /* the simulation did */
} drape_outcome;

/* A reference. Its cases differ in one parameter. */
typedef struct drape_reference {
    drape_entry entry;        /* summary: the quantity; reference: the source of what is expected */
    const char *unit;         /* of the quantity */
    const char *parameter;    /* what the cases differ in; NULL: nothing */
    const char *model;        /* the terms and the mesh */
    double tolerance;         /* relative; of the documented value where there is one */
    const double *parameters; /* (case_count) */
    int case_count;
    double (*expected)(double parameter);
    double (*documented)(
        double parameter); /* what the model converges to instead; NULL: it has no such error */
    /* The text of the scene; load: what is searched, else 0. As snprintf. */
    int (*scene)(double parameter, double load, char *text, size_t size);
    /* Advances the sim and measures. */
    drape_status (*measure)(drape_reference_run *run, double *value);
    /* Thresholds: the quantity is the load, between these shares of the expected one, above which measure is
     * > 0. */
    double low, high;
} drape_reference;
extern const drape_reference *const drape_references[]; /* NULL-ended */
extern const drape_registry drape_reference_registry;

typedef struct drape_validation {
    double parameter, expected, documented, obtained, error; /* error: relative, of the one it is held to */
    double seconds;                                          /* of CPU */
    drape_outcome verdict;
    char message[512]; /* of a simulation that stopped */
} drape_validation;

/* Runs one case. cancel: see drape_reference_run. Errors: DRAPE_E_MEMORY, DRAPE_E_STOPPED (cancel said so): all else is a
 * verdict. */
drape_status drape_validate(drape_context *ctx, const drape_reference *reference, int index,
                            drape_validate_cancel *cancel, void *user, drape_validation *out);

/* Simulations that a case takes: those of a search are several. */
int drape_validate_runs(const drape_reference *reference);

/* What expected and documented are, and how far what was obtained is from them. */
void drape_validate_judge(const drape_reference *reference, drape_validation *v);

const char *drape_outcome_name(drape_outcome verdict);

#define DRAPE_LAB_TEXT 4096 /* of a scene, at most */

#endif
