/*
 * lab.h: experiments on a scene: work against accuracy, maps of stability, orders of convergence. A library
 * of its own, libdrape_lab, since its statistics link GSL (GPL) and libdrape does not.
 *
 * An experiment is a list of cases, each the scene with some values changed. The result of a case is a line
 * of JSON in the folder, so an interrupted run resumes where it stopped, and the shards of a sweep that ran
 * separately are merged: the report needs only the lines.
 *
 * Threads: a call uses `jobs` threads of its own, each with a context of its own. progress is called by one
 * at a time, not always by the same.
 */
#ifndef DRAPE_LAB_H
#define DRAPE_LAB_H

#include "drape.h"

DRAPE_C_BEGIN

/* A value of the scene, as of drape_scene_set: a JSON pointer and a JSON text. */
typedef struct drape_lab_setting {
    const char *pointer, *value; /* "/integrator/dt", "0.01" */
} drape_lab_setting;

/* Progress of a sweep. done: cases that need no more work, of total in this shard; total 0: the reference
 * solution is being made. seconds_left: NaN while it is unknown. */
typedef void drape_lab_progress(void *user, int64_t done, int64_t total, double seconds_left);

/* Whether to stop: the cases in progress are abandoned, the lines of those done are kept. Called by all
 * threads, at any time: it must be thread-safe. */
typedef bool drape_lab_cancel(void *user);

/* What to run. Initialise with drape_lab_def_init. Strings live during the call. */
typedef struct drape_lab_def {
    size_t struct_size;                /* set by drape_lab_def_init */
    const char *scene;                 /* a scene file */
    const char *folder;                /* for results; made if it does not exist */
    const drape_lab_setting *settings; /* of all cases */
    size_t setting_count;              /* of settings */
    const char *const *integrators;    /* names; none: the default of the experiment */
    size_t integrator_count;           /* of integrators */
    const char *const *axes;           /* stability: 2 or 3 of "/pointer=from:to:n" or "...:nlog" */
    size_t axis_count;                 /* of axes */
    int levels;                        /* converge: refinements, 3 to 12; default 6 */
    bool space;                        /* converge: also of the mesh */
    double strain_limit;               /* stability: an edge strained by more is unphysical; default 0.2 */
    double case_seconds; /* [s] CPU time of a case, which is then stopped as over budget; default 30 */
    int repeats;         /* tradeoff: of which the least CPU time counts; default 3 */
    int jobs;            /* threads, 1 to 256; default 1: cases that run side by side cost each other time */
    int shard, shards;   /* cases whose number is shard - 1 modulo shards; default 1 of 1 */
    drape_lab_progress *progress; /* NULL: none */
    drape_lab_cancel *cancel;     /* NULL: never */
    void *user;                   /* of both */
} drape_lab_def;

/* Fills *def with the defaults. */
DRAPE_API void drape_lab_def_init(drape_lab_def *def, size_t struct_size);

/* The outcome. */
typedef struct drape_lab_outcome {
    int64_t cases;    /* of the experiment */
    int64_t done;     /* of them with a line by now */
    int64_t resumed;  /* of those, found from before */
    int64_t failed;   /* of those, that did not complete */
    int64_t rejected; /* steps that were rejected in all of them */
    bool input;       /* a failure is due to the input, not to the output folder */
    char *text;       /* the summary of the report, lines; free with drape_lab_outcome_free */
} drape_lab_outcome;

/* Frees the text of an outcome; the struct is the caller's. */
DRAPE_API void drape_lab_outcome_free(drape_lab_outcome *outcome);

/* Runs "tradeoff", "stability" or "converge" into the folder: cases.jsonl, experiment.json, results.csv,
 * pictures and report.html; a shard, beside which others may write, only experiment.json and
 * cases-1-of-4.jsonl: the merge writes the rest. Earlier lines of the same experiment are kept as they are.
 * Errors: DRAPE_E_ARGUMENT (no such experiment, a wrong def, a setting that no case uses, a folder that holds
 * another experiment), those of loading the scene, DRAPE_E_FILE, DRAPE_E_SOLVER (no reference: the folder is
 * left as it was before), DRAPE_E_MEMORY, DRAPE_E_STOPPED (cancelled). */
DRAPE_API drape_status drape_lab_run(drape_context *ctx, const char *experiment, const drape_lab_def *def,
                                     drape_lab_outcome *outcome);

/* Brings the lines of several folders together in one, with the report over them. Errors: DRAPE_E_FILE,
 * DRAPE_E_PARSE (a line that is no result), DRAPE_E_ARGUMENT (folders of different experiments),
 * DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_lab_merge(drape_context *ctx, const char *const *folders, size_t count,
                                       const char *folder, drape_lab_outcome *outcome);

DRAPE_C_END

#endif
