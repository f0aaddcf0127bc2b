/* run.h: one case: the scene with its settings, simulated and measured. */
#ifndef DRAPE_LAB_RUN_H
#define DRAPE_LAB_RUN_H

#include "drape/lab.h"
#include "lab/trace.h"

#include <jansson.h>
#include <stdatomic.h>

/* A case to simulate, and the measurements to make. */
typedef struct lab_request {
    const drape_lab_def *def;   /* scene, settings of all cases, cancel */
    const char *scene;          /* name of its file; NULL: the def's */
    const char *identity;       /* that the scene must have when the case is done (lab_identify) */
    const json_t *identified;   /* settings with which it has that identity; NULL: none */
    const json_t *settings;     /* {pointer: value} of the case; NULL: none */
    const lab_trace *reference; /* NULL or no frames: nothing to compare with */
    double reference_error;     /* [m] estimate of its error */
    const double *times;        /* (time_count) [s] at which steps end, and at which it is compared and
                                   recorded; NULL: at frames, which may lie within steps, and at the end */
    size_t time_count;
    const lab_probe *probe; /* NULL or no points: nowhere */
    lab_trace *record;      /* its frames and, last, its end; or its states at `times`. NULL: not
                                   recorded. Made here, in: */
    drape_arena *arena;     /* of the record */
    double seconds;         /* CPU: a run that takes more is stopped */
    double deadline;        /* [s] of the wall clock: a run that is not done by then is abandoned; 0: none */
    int repeats;            /* the least CPU time of so many counts */
    const atomic_bool *given_up; /* another thread failed; NULL: there is none */
} lab_request;

/* The scene with its settings, and its model. Errors: as of drape_scene_load and drape_scene_compile;
 * *scene is to be destroyed in any case. */
drape_status lab_load_scene(drape_context *ctx, const lab_request *request, drape_scene **scene);
drape_status lab_load(drape_context *ctx, const lab_request *request, drape_model **model);

/* The identity of a scene and of all files that it names, as digits: a hash of its text and of these
 * files, and of the compiled model where there are any. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_hash_scene(drape_context *ctx, const char *path, const drape_model *model, char digits[17]);

/* The same of the scene of a request as it is now, with the settings `identified`, which are those of one
 * case for all: a scene may lack what the cases set. Errors: those of loading. */
drape_status lab_identify(drape_context *ctx, const lab_request *request, char digits[17]);

/* Whether the scene still has the identity of the request. Errors: those of loading, DRAPE_E_ARGUMENT (it has
 * another one). */
drape_status lab_check_identity(drape_context *ctx, const lab_request *request);

/* Whether it compiles. */
drape_status lab_try(drape_context *ctx, const lab_request *request);

/* Runs it. *result: what was measured, to be freed by the caller; a simulation that stops is a result.
 * NULL: the deadline passed before it was done. Errors: those of loading, DRAPE_E_MEMORY, DRAPE_E_STOPPED
 * (cancelled). */
drape_status lab_run(drape_context *ctx, const lab_request *request, json_t **result);

#endif
